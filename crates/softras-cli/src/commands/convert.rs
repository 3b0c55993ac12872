//! `softras convert`: writes a mesh file in another format.

use super::mesh_file::ReadArgs;
use super::outputs::Outputs;
use super::{Failure, note, say};
use clap::Args;
use softras::Error;
use softras_io::{Budget, output};
use std::path::PathBuf;

/// Write a mesh file in another format
#[derive(Args, Debug)]
#[command(after_help = "\
Places, triangles, colours, UVs, textures, normals and opacity are kept. Notes tell
what is not read, and what the other format does not hold. With --strict they are errors.

Examples:
  softras convert scan.ply scan.glb
  softras convert scene.gltf scene.obj --strict")]
pub struct ConvertArgs {
    /// The mesh: .obj, .ply, .stl, .gltf or .glb
    pub mesh: PathBuf,
    /// The file to write: .obj with its materials and textures, .ply or .glb
    pub out: PathBuf,
    #[command(flatten)]
    pub read: ReadArgs,
}

pub fn run(args: &ConvertArgs) -> Result<(), Failure> {
    let outputs = Outputs::new([], [&args.out])?;
    let loaded = args.read.read_layers(&args.mesh, true, &outputs, &Budget::new(args.read.memory))?;
    let (files, lost) = loaded.encode(&args.out)?;
    if let Some(what) = lost.first().filter(|_| args.read.strict) {
        let fix = "write another format, or leave --strict out".into();
        return Err(Error::File { path: args.out.clone(), line: None, what: what.clone(), fix }.into());
    }
    lost.iter().for_each(|text| note(text));
    output::write_files(&files)?;
    let names: Vec<_> = files.iter().map(|(path, _)| path.display().to_string()).collect();
    say(&format!("{}: {} triangles", names.join(", "), loaded.mesh.triangles().len()))
}
