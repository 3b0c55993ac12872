//! Reads mesh files for all commands.

use super::outputs::Outputs;
use super::{Failure, detail, note};
use clap::Args;
use softras::obj::{LoadOptions, Loaded};
use std::path::Path;

/// How mesh files are read.
#[derive(Args, Clone, Copy, Debug)]
pub struct ReadArgs {
    /// Read materials, textures and pictures outside the folder of the file that names them, too
    #[arg(long)]
    pub allow_outside: bool,
    /// Refuse a mesh file of which something cannot be drawn, in place of printing a note
    #[arg(long)]
    pub strict: bool,
}

impl ReadArgs {
    /// Reads a mesh and prints the notes on it. None of the files read may be one that will be written. Textures are
    /// decoded from sRGB if so asked.
    pub fn read(self, path: &Path, srgb: bool, outputs: &Outputs) -> Result<Loaded, Failure> {
        let options = LoadOptions { srgb, allow_outside: self.allow_outside, strict: self.strict };
        let loaded = softras::load(path, &options)?;
        outputs.spare(&loaded.files)?;
        loaded.notes.iter().for_each(|text| note(text));
        for file in &loaded.files {
            detail(&format!("read {}", file.display()));
        }
        let mesh = &loaded.mesh;
        detail(&format!("{} vertices, {} triangles", mesh.positions().len(), mesh.triangles().len()));
        Ok(loaded)
    }
}
