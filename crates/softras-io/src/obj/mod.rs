//! Wavefront OBJ files with their MTL materials and textures, read and written.
//!
//! Every `v` statement of the file becomes a vertex of the mesh, in the same order, because meshes are fitted and compared
//! vertex by vertex. All objects and groups become one mesh.

mod appearance;
mod material;
mod parse;
mod statement;
mod texture;
mod triangles;
mod write;

pub use parse::{FAR_UVS, FARTHEST_UV};
pub use write::{files_of, png};
#[cfg(test)]
pub use {material::STATEMENTS as MATERIAL_STATEMENTS, parse::STATEMENTS};

use crate::{source::Source, text};
use softras::{Mesh, Result};
use triangles::Triangles;

/// Reads an OBJ file, its materials and its textures.
pub fn read(source: &mut Source, bytes: Vec<u8>) -> Result<Mesh> {
    let path = source.path;
    let text = text::whole(path, bytes)?;
    let mut obj = parse::parse(source, &text)?;
    drop(text);
    let mut triangles = triangles::triangulate(path, &obj, &mut source.notes)?;
    let (appearance, opacity) = appearance::appearance(source, &mut obj, &mut triangles)?;
    source.normals = triangles.normals;
    source.opacity = opacity;
    let positions = source.placed(&obj.positions, &triangles.vertices)?;
    let Triangles { vertices, faces, .. } = triangles;
    source.mesh(positions, vertices, appearance, |t| faces.get(t).map(|&face| obj.faces[face].line))
}
