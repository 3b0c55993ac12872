//! Reads STL files, binary and text. The crate stl_io reads the triangles; which of the two formats a file has is decided
//! here, because many binary files begin with the word `solid` as those of text do.

use crate::{fault, source::Source, weld::Weld};
use softras::{Error, Result, scene::Mesh};
use std::{io::Cursor, path::Path};
use stl_io::create_stl_reader;

/// The bytes before the first triangle of a binary file, and those of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

pub(super) fn read(source: &mut Source, mut bytes: Vec<u8>) -> Result<Mesh> {
    let path = source.path;
    let count = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let expected = count.map(|count| HEADER as u64 + TRIANGLE as u64 * count as u64);
    let length = bytes.len() as u64;
    let mut triangles = Triangles { weld: Weld::new(), all: Vec::new() };
    if is_text(&bytes) && expected != Some(length) {
        // Several solids may follow one another.
        let text = String::from_utf8_lossy(&bytes).to_ascii_lowercase();
        drop(bytes);
        for solid in text.split("endsolid").filter(|solid| solid.contains("facet")) {
            let facets = solid.find("facet").map_or("", |at| &solid[at..]);
            triangles.add(path, format!("solid \n{facets}\nendsolid\n").into_bytes())?;
        }
        return triangles.mesh();
    }
    match (count, expected) {
        (Some(count), Some(expected)) if length < expected => {
            let holds = (length - HEADER as u64) / TRIANGLE as u64;
            let what = format!("cut off: it claims {count} triangles and holds {holds}");
            Err(fault(path, what, "copy or export the file again"))
        }
        (Some(_), Some(expected)) => {
            if length > expected {
                source.notes.add(None, format!("{} bytes after the last triangle are not read", length - expected));
            }
            // Not `solid`, which would make it a text for the crate.
            bytes[..5].fill(0);
            triangles.add(path, bytes)?;
            triangles.mesh()
        }
        _ => Err(fault(path, "neither a text nor a binary STL file", "export it again, as binary STL")),
    }
}

/// Whether a file is one of text: it begins with `solid` and has a facet, or has ended, soon thereafter.
fn is_text(bytes: &[u8]) -> bool {
    let start = &bytes[..bytes.len().min(2048)];
    let text = String::from_utf8_lossy(start).to_ascii_lowercase();
    let text = text.trim_start();
    text.starts_with("solid") && (text.contains("facet") || text.contains("endsolid"))
}

struct Triangles {
    weld: Weld<()>,
    all: Vec<[u32; 3]>,
}

impl Triangles {
    /// Adds those of a file.
    fn add(&mut self, path: &Path, bytes: Vec<u8>) -> Result<()> {
        let wrong = |error: std::io::Error| fault(path, format!("malformed STL: {error}"), "export the file again");
        let mut cursor = Cursor::new(bytes);
        for triangle in create_stl_reader(&mut cursor).map_err(wrong)? {
            let corners = triangle.map_err(wrong)?.vertices;
            // Fewer than u32 can count: each takes 12 bytes or more of a file of at most 4 GiB.
            self.all.push(corners.map(|corner| self.weld.vertex([corner[0], corner[1], corner[2]], ()).0));
        }
        Ok(())
    }

    fn mesh(self) -> Result<Mesh, Error> {
        Mesh::new(self.weld.positions, self.all)
    }
}
