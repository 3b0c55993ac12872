//! The polygons of an OBJ file as triangles.

use super::parse::Obj;
use crate::{fault_at, input, notes::Notes, polygon};
use softras::Result;
use std::path::Path;

/// Triangles in the order of their faces.
pub(super) struct Triangles {
    /// Indices into [`Obj::positions`].
    pub vertices: Vec<[u32; 3]>,
    /// Indices into [`Obj::uvs`], 0 where the face has no UVs; empty when the file has no `vt`.
    pub uvs: Vec<[u32; 3]>,
    /// The normals of the corners, 0 where there is none; empty when the file has no `vn`.
    pub normals: Vec<[[f32; 3]; 3]>,
    /// For each triangle its face, an index into [`Obj::faces`].
    pub faces: Vec<usize>,
}

/// Cuts all faces into triangles.
///
/// # Errors
/// [`softras::Error::File`] with the line of a face that cannot be cut; [`softras::Error::OutOfMemory`].
pub(super) fn triangulate(path: &Path, obj: &Obj, notes: &mut Notes) -> Result<Triangles> {
    // A face of n corners, three at least, makes n - 2 triangles.
    let count = obj.corners.len() - 2 * obj.faces.len();
    let mut triangles = Triangles {
        vertices: input::vector(path, count)?,
        uvs: input::vector(path, if obj.uv_corners.is_empty() { 0 } else { count })?,
        normals: input::vector(path, if obj.normal_corners.is_empty() { 0 } else { count })?,
        faces: input::vector(path, count)?,
    };
    let mut start = 0;
    for (index, face) in obj.faces.iter().enumerate() {
        let corners = &obj.corners[start..start + face.arity];
        let uv_corners = obj.uv_corners.get(start..start + face.arity);
        let normals = obj.normal_corners.get(start..start + face.arity);
        let normal = |corner: u32| obj.normals.get(corner as usize).copied().unwrap_or_default();
        start += face.arity;
        let cut = polygon::of(corners, &obj.positions).map_err(|what| fault_at(path, face.line, what, polygon::FIX))?;
        if !cut.is_simple {
            notes.count(face.line, polygon::NOT_SIMPLE);
        }
        for triangle in cut.triangles {
            triangles.vertices.push(triangle.map(|c| corners[c]));
            triangles.uvs.extend(uv_corners.map(|uvs| triangle.map(|c| uvs[c])));
            triangles.normals.extend(normals.map(|normals| triangle.map(|c| normal(normals[c]))));
            triangles.faces.push(index);
        }
    }
    Ok(triangles)
}
