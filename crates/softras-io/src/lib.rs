//! Files of softras: meshes in OBJ, PLY, STL and glTF, pictures, and views, which are pictures with cameras.
//!
//! [`load`] reads a mesh with its colours and textures, [`save`] writes one. [`load_with`] also lists what a file has that
//! softras does not draw: [`Loaded::notes`]. A reader takes only regular files, counts their memory before it is allocated, and
//! never reads outside of the mesh's folder unless it is told to. A writer leaves the old file or the new one, never half of one.
//!
//! ```
//! # fn main() -> softras::Result<()> {
//! # let folder = tempfile::tempdir().expect("a folder");
//! # let path = folder.path().join("fish.obj");
//! softras_io::save(&softras::shapes::fish()?, &path)?;
//! let mesh = softras_io::load(&path)?;
//! assert_eq!(mesh.triangles(), softras::shapes::fish()?.triangles());
//! # Ok(())
//! # }
//! ```

mod budget;
mod coincident;
mod color;
mod fate;
mod find;
#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
mod formats;
mod gif;
mod gltf;
pub mod input;
mod named;
mod notes;
pub mod npy;
pub mod npz;
mod obj;
pub mod output;
mod paint;
mod picture;
mod picture_file;
mod ply;
mod polygon;
mod source;
mod stl;
pub mod text;
mod texture;
mod textures;
mod views;
mod weld;
mod written;

pub use budget::Budget;
pub use color::Curve;
pub use gif::write_gif;
pub use named::{built_in, load_named};
pub use picture::{Floats, Picture, PictureFormat};
pub use picture_file::PictureFile;
pub use source::{LoadOptions, Loaded, far_origin};
pub use views::{Map, Photograph, Views, ViewsOptions, read_picture};

use softras::{Error, Mesh, Result};
use source::Source;
use std::{
    io::{self, Read},
    path::{Path, PathBuf},
};
use written::Written;

/// Reads a mesh file: [`load_with`] without options, at its place in the file. Notes are lost.
///
/// # Errors
/// Those of [`load_with`].
pub fn load(path: impl AsRef<Path>) -> Result<Mesh> {
    Ok(load_with(path, &LoadOptions::default())?.at_place()?.mesh)
}

/// Reads a mesh file: .obj, .ply, .stl, .gltf and .glb.
///
/// The format is that of the file's content where that tells (PLY, binary glTF), else that of its ending.
/// - OBJ: every `v` statement becomes a vertex, in the same order, because meshes are fitted and compared vertex by vertex. All
///   objects and groups become one mesh, polygons are cut into triangles. The appearance is, first of these that applies:
///   [`Textured`] when a face has a `map_Kd` and UVs (other faces get a 1×1 image of their `Kd`), [`VertexColors`] from `v x y z r
///   g b`, [`Surface`] with one cell per triangle from several `Kd`, else [`Uniform`]. A face without a material is white. The
///   alpha of a `map_Kd` image, or a `map_d`, is that of the [`Texture`](softras::scene::Texture).
/// - PLY: vertices in their order. Colours are decoded as textures are.
/// - STL and glTF: vertices at one position become one; v runs up, as in OBJ files.
///
/// docs/formats.md lists what is drawn. A note tells of each part that is left out: faces of fewer than three corners, malformed
/// materials, textures that are no image, over 16384 pixels a side, over 2²⁷ pixels in all, or over 2²⁵ and 16 for each byte of their
/// files. A material file or texture that is missing or lies outside the mesh's folder is looked for by its name in the folder.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::File`] for other formats, and with the line for what leaves no mesh to
/// trust: a file that is cut off, no faces at all; under [`LoadOptions::strict`] for every note.
///
/// [`Textured`]: softras::scene::Appearance::Textured
/// [`VertexColors`]: softras::scene::Appearance::VertexColors
/// [`Surface`]: softras::scene::Appearance::Surface
/// [`Uniform`]: softras::scene::Appearance::Uniform
pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded> {
    let path = path.as_ref();
    let Some(format) = format(path)? else {
        let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned());
        let what = ending.map_or("no ending tells its format".into(), |ending| format!("no mesh format: .{ending}"));
        return Err(fault(path, what, "softras reads .obj, .ply, .stl, .gltf and .glb"));
    };
    let mut source = Source::new(path, options);
    let bytes = source.read_bytes(path)?;
    input::refuse_empty(path, bytes.len() as u64)?;
    let mesh = match format {
        Format::Obj => obj::read(&mut source, bytes),
        Format::Ply => ply::read(&mut source, &bytes),
        Format::Stl => stl::read(&mut source, bytes),
        Format::Gltf => gltf::read(&mut source, &bytes),
    };
    // An error of the mesh becomes one of the file that holds it.
    let mesh = mesh.map_err(|error| match error {
        Error::Mesh { what, place, fix } => fault(path, format!("{what} at {place}"), fix),
        other => other,
    })?;
    if mesh.triangles().is_empty() {
        let (line, reasons) = source.notes.reasons(3);
        let points = mesh.positions().len();
        if points == 0 && reasons.is_empty() {
            return Err(fault_at(path, line, "no faces and no vertices", "give a file with triangles"));
        }
        let reasons = if reasons.is_empty() { "its points are not drawn".into() } else { reasons };
        let what = format!("no faces ({points} vertices): {reasons}");
        let fix = "give a mesh with triangles (MeshLab makes them of points: Screened Poisson)";
        return Err(fault_at(path, line, what, fix));
    }
    source.loaded(mesh)
}

/// Writes a mesh as .obj, .ply or .glb: [`save_with`] with textures in sRGB.
///
/// # Errors
/// Those of [`save_with`].
pub fn save(mesh: &Mesh, path: impl AsRef<Path>) -> Result<Vec<PathBuf>> {
    save_with(mesh, path, &SaveOptions::default())
}

/// Options for writing a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaveOptions {
    /// Encode textures, and colours in bytes, from linear numbers to sRGB, in 8 bits a channel, as picture files have them. If false,
    /// numbers are written as they are, in 8 bits where that is exact, else in 16; read them with [`LoadOptions::srgb`] false, too.
    pub srgb: bool,
    /// Where the mesh's origin lies in the file's coordinates, as [`Loaded::origin`]. Unless it is 0, OBJ and PLY files get positions in
    /// 64 bits, and a glTF file has it as the translation of its node.
    pub origin: [f64; 3],
}

impl Default for SaveOptions {
    fn default() -> Self {
        Self { srgb: true, origin: [0.0; 3] }
    }
}

/// Writes a mesh in the format of the path's ending. Positions and UVs keep all their digits.
/// - .obj: vertices in their order, vertex colours in the `v` lines with all their digits, as sRGB, other colours in `NAME.mtl`, textures in
///   `NAME_texture.png` (or `NAME_texture_0.png`, `NAME_texture_1.png`, ..).
/// - .ply: binary; vertices in their order, colours in bytes, textures as of .obj, which repeat.
/// - .glb: everything in one file; a vertex is repeated for each of its UVs and normals, and with colours by face for each of its faces.
///
/// Normals of vertices are written in all of them.
///
/// Each file appears whole or not at all; the mesh file comes last, when those that it names are complete. Returns the files
/// written, the mesh file last.
///
/// # Errors
/// [`Error::File`] for other endings; [`Error::Io`]; [`Error::Mesh`] for what the format cannot hold: surface textures of more than
/// one cell, and without `srgb` texels outside [0, 1].
pub fn save_with(mesh: &Mesh, path: impl AsRef<Path>, options: &SaveOptions) -> Result<Vec<PathBuf>> {
    let (files, _) = encoded(Written::new(mesh, options)?, path.as_ref())?;
    output::write_files(&files)?;
    Ok(files.into_iter().map(|(path, _)| path).collect())
}

/// Files with their content, the one that names the others last, and notes on what their format does not hold.
pub type Encoded = (Vec<(PathBuf, Vec<u8>)>, Vec<String>);

impl Loaded {
    /// The files of all that was read in the format of the path's ending, for [`output::write_files`]: the mesh at its place, with the
    /// normals of its corners, the opacity of its triangles and whether light shades it.
    ///
    /// # Errors
    /// Those of [`save_with`].
    pub fn encode(&self, path: impl AsRef<Path>) -> Result<Encoded> {
        encoded(Written::of(self)?, path.as_ref())
    }
}

fn encoded(mut mesh: Written, path: &Path) -> Result<Encoded> {
    let is_binary = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"));
    let files = match by_ending(path) {
        Some(Format::Obj) => obj::files_of(&mut mesh, path)?,
        Some(Format::Ply) => ply::files_of(&mut mesh, path)?,
        Some(Format::Gltf) if is_binary => vec![(path.to_path_buf(), gltf::glb(&mut mesh)?)],
        _ => {
            let what = "not a name of a mesh file to write";
            return Err(fault(path, what, "give a name that ends in .obj, .ply or .glb"));
        }
    };
    Ok((files, mesh.notes))
}

/// A format of mesh files.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Obj,
    Ply,
    Stl,
    Gltf,
}

/// The format of a file by its first bytes or, where they do not tell, by its ending.
fn format(path: &Path) -> Result<Option<Format>> {
    let mut head = Vec::new();
    let read = input::open(path)?.take(7).read_to_end(&mut head);
    read.map_err(|source| Error::Io { path: path.into(), source })?;
    match text::unmarked(&head) {
        [b'p', b'l', b'y', space, ..] if space.is_ascii_whitespace() => Ok(Some(Format::Ply)),
        [b'g', b'l', b'T', b'F', ..] => Ok(Some(Format::Gltf)),
        [0x1f, 0x8b, ..] | [b'P', b'K', 3, 4, ..] => refuse(path, "a packed file (ZIP or gzip)", "unpack it first"),
        _ => Ok(by_ending(path)),
    }
}

fn by_ending(path: &Path) -> Option<Format> {
    let ending = path.extension()?.to_string_lossy().to_ascii_lowercase();
    match ending.as_str() {
        "obj" => Some(Format::Obj),
        "ply" => Some(Format::Ply),
        "stl" => Some(Format::Stl),
        "gltf" | "glb" => Some(Format::Gltf),
        _ => None,
    }
}

/// A fault in a part of a file, and its remedy.
type Wrong<F = &'static str> = (String, F);

/// Puts the place of a fault in front of its text.
fn within<F>(place: impl std::fmt::Display) -> impl FnOnce(Wrong<F>) -> Wrong<F> {
    move |(what, fix)| (format!("{place}: {what}"), fix)
}

/// An error that tells what is wrong with a file, and what to do.
fn fault(path: &Path, what: impl Into<String>, fix: impl Into<String>) -> Error {
    fault_at(path, None, what, fix)
}

/// [`fault`] with the line of the file.
fn fault_at(path: &Path, line: impl Into<Option<usize>>, what: impl Into<String>, fix: impl Into<String>) -> Error {
    // A parser may quote as much as the whole file.
    let what = what.into().chars().take(300).collect();
    Error::File { path: path.into(), line: line.into(), what, fix: fix.into() }
}

/// [`fault`] as a result.
fn refuse<T>(path: &Path, what: impl Into<String>, fix: impl Into<String>) -> Result<T> {
    Err(fault(path, what, fix))
}

/// A position of a mesh in the coordinates of a file where the mesh's origin lies elsewhere.
fn placed(position: [f32; 3], origin: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| f64::from(position[k]) + origin[k])
}

/// Why a surface with several colours on a triangle is not written.
fn several_cells(resolution: u32, format: &str) -> Error {
    Error::Mesh {
        what: format!("surface texture of resolution {resolution}"),
        place: "appearance".into(),
        fix: format!("{format} files hold one colour per face: use resolution 1, vertex colours or an image"),
    }
}

/// An I/O error of a file, from an error of an encoder.
fn failed(path: &Path, error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Io { path: path.into(), source: io::Error::other(error) }
}
