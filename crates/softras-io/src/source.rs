//! A mesh file that is being read, and what reading one gives.

use crate::{input, notes::Notes, textures::Room};
use softras::{Error, Mesh, Result};
use std::path::{Path, PathBuf};

/// Options for reading a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Decode textures from sRGB to linear. Off, a texel is its value / 255, as in the official renderer.
    pub srgb: bool,
    /// Allow materials and textures outside the mesh's folder. Off, a mesh from elsewhere cannot make softras read
    /// other files.
    pub allow_outside: bool,
    /// Refuse a file of which something is not kept, instead of telling it in [`Loaded::notes`].
    pub strict: bool,
    /// The most bytes of memory that the mesh with its materials and textures may take, counted before they are read; `None`:
    /// what the sizes of the files allow.
    pub memory: Option<u64>,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { srgb: true, allow_outside: false, strict: false, memory: None }
    }
}

/// A mesh, and notes on what was not kept of its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The mesh.
    pub mesh: Mesh,
    /// The normals of each triangle's corners as the file gives them, of any length, 0 where it gives none; empty for files
    /// without. The mesh has one vertex for each of the file's, which may have several normals: [`Mesh::with_normals`] takes
    /// them once its vertices are split, as `softras render` does.
    pub normals: Vec<[[f32; 3]; 3]>,
    /// The opacity of each triangle's material: `d` or 1 less `Tr` of an MTL file, the alpha of a glTF file's base colour; empty
    /// where all are 1. The model has no glass: `softras render` blends these triangles over the others, everything else draws
    /// them opaque. The alpha of textures is in the mesh.
    pub opacity: Vec<f32>,
    /// What the file contains and the mesh does not, each with its line.
    pub notes: Vec<String>,
    /// All files that were read: the mesh file first, then its materials and textures.
    pub files: Vec<PathBuf>,
}

/// A mesh file that is being read, with what is known of it besides its content.
pub struct Source<'a> {
    /// The mesh file.
    pub path: &'a Path,
    pub options: &'a LoadOptions,
    pub notes: Notes,
    /// As in [`Loaded`].
    pub files: Vec<PathBuf>,
    pub normals: Vec<[[f32; 3]; 3]>,
    pub opacity: Vec<f32>,
    /// Bytes of memory that the files still to be read may take.
    left: u64,
    /// Bytes of the mesh and material files that were read.
    read: u64,
}

/// Larger files are refused: their lines and vertices would not fit 32-bit numbers.
const MAX_BYTES: u64 = 1 << 32;

/// Bytes of memory that a byte of a mesh or material file takes, at most.
const MEMORY_PER_BYTE: u64 = 24;
/// The least bytes of a file for each triangle whose normals are kept: fewer only where vertices are drawn many times.
const BYTES_PER_NORMALS: u64 = 6;

impl<'a> Source<'a> {
    pub fn new(path: &'a Path, options: &'a LoadOptions) -> Self {
        let left = options.memory.unwrap_or(u64::MAX);
        Self {
            path,
            options,
            notes: Notes::new(path),
            files: vec![path.into()],
            normals: Vec::new(),
            opacity: Vec::new(),
            left,
            read: 0,
        }
    }

    /// Reads a file whole, of a size whose content the memory left can hold.
    ///
    /// # Errors
    /// As [`input::open`]; [`Error::File`](softras::Error::File) for a larger file.
    pub fn read_bytes(&mut self, path: &Path) -> Result<Vec<u8>> {
        let bytes = input::open(path)?.metadata().map_or(0, |metadata| metadata.len());
        let needed = bytes.saturating_mul(MEMORY_PER_BYTE);
        if needed > self.left {
            let [needed, left] = [needed, self.left].map(|bytes| bytes.div_ceil(1 << 20));
            let what = format!("takes up to {needed} MiB of memory, and {left} MiB are left");
            let fix = "allow more memory (--memory in the command), or give smaller files".into();
            return Err(Error::File { path: path.into(), line: None, what, fix });
        }
        self.left -= needed;
        self.read += bytes;
        input::read(path, MAX_BYTES)
    }

    /// Keeps the normals of each triangle's corners, given those of the vertices.
    pub fn keep_normals(&mut self, of_vertex: &[[f32; 3]], triangles: &[[u32; 3]]) {
        if of_vertex.is_empty() {
            return;
        }
        if triangles.len() as u64 > self.read / BYTES_PER_NORMALS {
            self.notes.add(None, "normals are not used: the file draws its vertices too many times");
            return;
        }
        let normal = |corner: u32| of_vertex.get(corner as usize).copied().unwrap_or_default();
        self.normals = triangles.iter().map(|triangle| triangle.map(normal)).collect();
    }

    /// How many texels the mesh's first image may have.
    pub fn room(&self) -> Room {
        Room::within(self.left)
    }

    /// # Errors
    /// [`Error::File`](softras::Error::File) for the first note, if the options are strict.
    pub fn loaded(self, mesh: Mesh) -> Result<Loaded> {
        let notes = self.notes.finish(self.options.strict)?;
        Ok(Loaded { mesh, normals: self.normals, opacity: self.opacity, notes, files: self.files })
    }
}
