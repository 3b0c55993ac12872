//! Tests of OBJ, MTL and texture files: what is read, what is noted, what is refused with its line, and that a written mesh
//! is read back unchanged.

mod geometry;
mod materials;
mod refused;
mod written;

use crate::{LoadOptions, RAW, load, save};
use softras::{
    Error, Mesh,
    scene::{Appearance, Texture, Wrap},
};
use softras_io::Loaded;
use std::fs;
use tempfile::TempDir;

/// A folder with the given files; the OBJ file under test is `mesh.obj`.
fn folder<B: AsRef<[u8]>>(files: &[(&str, B)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

fn load_in(folder: &TempDir) -> softras::Result<Loaded> {
    load(folder.path().join("mesh.obj"), &RAW)
}

fn load_text(obj: impl AsRef<[u8]>) -> softras::Result<Loaded> {
    load_in(&folder(&[("mesh.obj", obj)]))
}

fn load_with_mtl(obj: &str, mtl: &str) -> softras::Result<Loaded> {
    load_in(&folder(&[("mesh.obj", obj), ("mesh.mtl", mtl)]))
}

/// The mesh of a text that is read without notes.
#[track_caller]
fn quiet(obj: impl AsRef<[u8]>) -> Mesh {
    let loaded = load_text(obj).unwrap();
    assert_eq!(loaded.notes, [""; 0]);
    loaded.mesh
}

#[track_caller]
fn assert_note(notes: &[String], parts: &[&str]) {
    assert!(notes.iter().any(|note| parts.iter().all(|part| note.contains(part))), "{parts:?} in none of {notes:#?}");
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

const TEXTURED: &str = "mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl t\nf 1/1 2/2 3/3\n";

fn one_pixel_png(color: [u8; 3]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb(color)).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}
