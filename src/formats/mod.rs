//! One entry for mesh files of every format: Wavefront OBJ, and with the feature `formats` PLY, STL and glTF.

#[cfg(feature = "formats")]
mod gltf;
#[cfg(feature = "formats")]
mod ply;
#[cfg(feature = "formats")]
mod stl;
#[cfg(feature = "formats")]
mod weld;

#[cfg(feature = "formats")]
use crate::files::input;
use crate::{
    error::{Error, Result},
    obj::{self, LoadOptions, Loaded},
};
use std::{fs, io::Read, path::Path};

/// A format of mesh files.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Obj,
    Ply,
    Stl,
    Gltf,
}

/// Reads a mesh file: .obj, and with the feature `formats` .ply, .stl, .gltf and .glb.
///
/// The format is that of the file's content where that tells (PLY, binary glTF), else that of its ending.
/// [`obj::load`] says what is read of OBJ files. Of the others these are read:
/// - PLY: vertices in their order, polygons, normals, vertex colours or colours of faces, UVs by vertex or by corner with the image
///   that a `comment TextureFile NAME` names. Colours in bytes are decoded as textures are.
/// - STL: triangles; vertices at one position become one.
/// - glTF: all triangles of the scene, placed by their nodes, with normals, base colours and their textures, or vertex colours.
///   Vertices at one position become one; v runs up, as in OBJ files.
///
/// Limits and the folder that textures must lie in are as for OBJ files.
///
/// # Errors
/// [`Error::Io`] when the file cannot be read; [`Error::File`] for other formats, for malformed files, and under
/// [`LoadOptions::strict`] for every note.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let refuse = |what: String, fix: &str| Err(Error::File { path: path.into(), line: None, what, fix: fix.into() });
    match format(path)? {
        Some(Format::Obj) => obj::load(path, options),
        #[cfg(feature = "formats")]
        Some(format) => load_bytes(format, path, options),
        #[cfg(not(feature = "formats"))]
        Some(_) => refuse(
            "not an OBJ file".into(),
            "build softras with the feature `formats`, which reads .ply, .stl, .gltf and .glb",
        ),
        None => {
            let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned());
            let what =
                ending.map_or("no ending tells its format".into(), |ending| format!("no mesh format: .{ending}"));
            refuse(what, "softras reads .obj, .ply, .stl, .gltf and .glb")
        }
    }
}

/// The format of a file by its first bytes or, where they do not tell, by its ending.
fn format(path: &Path) -> Result<Option<Format>> {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let by_ending = match ending.as_deref() {
        Some("obj") => Some(Format::Obj),
        Some("ply") => Some(Format::Ply),
        Some("stl") => Some(Format::Stl),
        Some("gltf" | "glb") => Some(Format::Gltf),
        _ => None,
    };
    let io = |source| Error::Io { path: path.into(), source };
    // Opening something else, as a pipe, may wait forever; the readers refuse it.
    if !fs::metadata(path).map_err(io)?.is_file() {
        return Ok(by_ending.or(Some(Format::Obj)));
    }
    let mut head = Vec::new();
    fs::File::open(path).and_then(|file| file.take(4).read_to_end(&mut head)).map_err(io)?;
    Ok(match head[..] {
        [b'p', b'l', b'y', b'\r' | b'\n'] => Some(Format::Ply),
        [b'g', b'l', b'T', b'F'] => Some(Format::Gltf),
        _ => by_ending,
    })
}

#[cfg(feature = "formats")]
fn load_bytes(format: Format, path: &Path, options: &LoadOptions) -> Result<Loaded> {
    let mut source = obj::Source::new(path, options);
    let bytes = source.read_bytes(path)?;
    input::refuse_empty(path, bytes.len() as u64)?;
    let mesh = match format {
        Format::Ply => ply::read(&mut source, bytes),
        Format::Stl => stl::read(&mut source, bytes),
        Format::Gltf | Format::Obj => gltf::read(&mut source, &bytes),
    };
    // What is wrong with a mesh that a file holds is wrong with the file.
    let mesh = mesh.map_err(|error| match error {
        Error::Mesh { what, place, fix } => {
            Error::File { path: path.into(), line: None, what: format!("{what} at {place}"), fix }
        }
        other => other,
    })?;
    if mesh.triangles().is_empty() {
        return Err(fault(
            path,
            format!("no faces ({} vertices)", mesh.positions().len()),
            "give a mesh with triangles",
        ));
    }
    source.loaded(mesh)
}

/// An error of a file without lines.
#[cfg(feature = "formats")]
fn fault(path: &Path, what: impl Into<String>, fix: &str) -> Error {
    // What a parser quotes of a file may be as long as the file.
    let what: String = what.into().chars().take(300).collect();
    Error::File { path: path.into(), line: None, what, fix: fix.into() }
}
