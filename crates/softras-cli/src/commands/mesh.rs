//! `softras mesh`: writes one of the built-in meshes.

use super::outputs::Outputs;
use super::{Failure, say};
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::PathBuf;

/// Write a built-in mesh as a Wavefront OBJ file
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  softras mesh torus -o torus.obj
  softras mesh torus -o torus.obj && softras render torus.obj -o torus.png")]
pub struct MeshArgs {
    /// The mesh to write
    #[arg(value_parser = PossibleValuesParser::new(softras::internals::shapes::NAMES))]
    pub name: String,
    /// The file to write; materials and textures go beside it
    #[arg(short, long = "out", value_name = "FILE.obj")]
    pub out: PathBuf,
}

/// Runs the command.
pub fn run(args: &MeshArgs) -> Result<(), Failure> {
    Outputs::new([], [&args.out])?;
    let mesh = softras::internals::shapes::by_name(&args.name)?;
    let files = softras::obj::write_obj(&mesh, &args.out)?;
    let names: Vec<_> = files.iter().map(|f| f.display().to_string()).collect();
    let (vertices, triangles) = (mesh.positions().len(), mesh.triangles().len());
    say(&format!("{}: {vertices} vertices, {triangles} triangles", names.join(", ")))
}
