//! `softras mesh`: writes one of the built-in meshes.

use super::outputs::Outputs;
use super::{Failure, say};
use clap::Args;
use clap::builder::PossibleValuesParser;
use softras::scene::Appearance;
use softras_io::SaveOptions;
use std::path::PathBuf;

/// Write a built-in mesh as a file
#[derive(Args, Debug)]
#[command(after_help = "\
Other commands take the name itself: softras render fish -o fish.png

Examples:
  softras mesh torus -o torus.obj
  softras mesh fish --detail 4 -o fine.obj && softras render fine.obj -o fine.png")]
pub struct MeshArgs {
    /// The mesh to write
    #[arg(value_parser = PossibleValuesParser::new(softras::shapes::NAMES))]
    pub name: String,
    /// N times as many triangles along and around, for fish and torus
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub detail: u32,
    /// The file to write: .obj with its materials and textures, .ply or .glb
    #[arg(short, long = "out", value_name = "FILE")]
    pub out: PathBuf,
}

pub fn run(args: &MeshArgs) -> Result<(), Failure> {
    Outputs::new([], [&args.out])?;
    let mesh = softras::shapes::finer(&args.name, args.detail)?;
    // Vertex colours are linear light; the fish's texels are those of its PNG.
    let srgb = matches!(mesh.appearance(), Appearance::VertexColors(_));
    let files = softras_io::save_with(&mesh, &args.out, &SaveOptions { srgb, ..SaveOptions::default() })?;
    let names: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    say(&format!("{}: {vertices} vertices, {triangles} triangles", names.join(", ")))
}
