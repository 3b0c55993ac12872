//! Reads mesh files, and makes built-in meshes, for all commands.

use super::outputs::Outputs;
use super::{Failure, detail, note, parse};
use clap::Args;

use softras::scene::Appearance;
use softras::{Error, Mesh};
use softras_io::{Budget, LoadOptions, Loaded};
use std::path::Path;

/// How mesh files are read, and how much memory all files may take.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Input and device")]
pub struct ReadArgs {
    /// Also read materials and pictures outside the input file's folder
    #[arg(long)]
    pub allow_outside: bool,
    /// Refuse a mesh file that cannot be drawn completely
    #[arg(long)]
    pub strict: bool,
    /// The most memory for input files, and again for frames: 512M, 8G
    #[arg(long, value_name = "SIZE", value_parser = parse::bytes)]
    pub memory: Option<u64>,
}

impl ReadArgs {
    /// Reads a mesh within the budget and prints the notes on it, for a command that draws the mesh alone. None of the files read
    /// may be one that will be written. Textures are decoded from sRGB if so asked.
    pub fn read(self, path: &Path, srgb: bool, outputs: &Outputs, budget: &Budget) -> Result<Loaded, Failure> {
        let loaded = self.read_layers(path, srgb, outputs, budget)?;
        let known = loaded.notes.len();
        let loaded = softras_view::alone(loaded, self.strict)?;
        loaded.notes[known..].iter().for_each(|text| note(text));
        Ok(loaded)
    }

    /// A mesh relative to the origin of another one, in the coordinates of both files.
    pub fn placed(self, loaded: Loaded, origin: [f64; 3]) -> Result<Loaded, Failure> {
        let known = loaded.notes.len();
        let loaded = loaded.relative_to(origin)?;
        for text in &loaded.notes[known..] {
            if self.strict {
                let path = loaded.files.first().cloned().unwrap_or_else(|| "the built-in mesh".into());
                let fix = "move the meshes nearer to each other, or leave --strict out".into();
                return Err(Error::File { path, line: None, what: text.clone(), fix }.into());
            }
            note(text);
        }
        Ok(loaded)
    }

    /// Reads a mesh as [`read`](Self::read) does, for a command that draws [`Loaded::opacity`] and [`Loaded::single_sided`].
    pub fn read_layers(self, path: &Path, srgb: bool, outputs: &Outputs, budget: &Budget) -> Result<Loaded, Failure> {
        let options =
            LoadOptions { srgb, allow_outside: self.allow_outside, strict: self.strict, memory: budget.left() };
        let loaded = softras_io::load_named(path, &options)?;
        if options.memory.is_some() {
            budget.claim(path, "the mesh", held(&loaded.mesh))?;
        }
        outputs.spare(&loaded.files)?;
        loaded.notes.iter().for_each(|text| note(text));
        for file in &loaded.files {
            detail(&format!("read {}", file.display()));
        }
        if loaded.files.is_empty() {
            detail(&format!("{} is a built-in mesh", path.display()));
        }
        let mesh = &loaded.mesh;
        detail(&format!("{} vertices, {} triangles", mesh.positions().len(), mesh.triangles().len()));
        Ok(loaded)
    }
}

/// Bytes of a mesh in memory, without what is small beside the rest.
fn held(mesh: &Mesh) -> u64 {
    let texels = match mesh.appearance() {
        Appearance::Surface { texels, .. } => texels.len(),
        Appearance::Textured { textures, .. } => textures.iter().map(|texture| texture.texels().len()).sum(),
        Appearance::VertexColors(colors) => colors.len(),
        Appearance::Uniform(_) => 0,
    };
    12 * (mesh.positions().len() + mesh.triangles().len() + texels) as u64
}
