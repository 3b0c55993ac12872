//! The polygons of an OBJ file as triangles.

use super::parse::Obj;
use crate::{notes::Notes, polygon};
use softras::{Error, Result};
use std::path::Path;

/// Triangles in the order of their faces.
#[derive(Default)]
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

impl Triangles {
    /// Makes room for all of them, so that a lack of memory is an error and not the end of the process.
    fn reserve(&mut self, obj: &Obj) -> std::result::Result<(), std::collections::TryReserveError> {
        // A face of n corners, three at least, makes n - 2 triangles.
        let count = obj.corners.len() - 2 * obj.faces.len();
        self.vertices.try_reserve_exact(count)?;
        self.uvs.try_reserve_exact(if obj.uv_corners.is_empty() { 0 } else { count })?;
        self.normals.try_reserve_exact(if obj.normal_corners.is_empty() { 0 } else { count })?;
        self.faces.try_reserve_exact(count)
    }
}

/// Cuts all faces into triangles.
///
/// # Errors
/// [`Error::File`] with the line of a face that cannot be cut.
pub(super) fn triangulate(path: &Path, obj: &Obj, notes: &mut Notes) -> Result<Triangles> {
    let mut triangles = Triangles::default();
    triangles.reserve(obj).map_err(|_| Error::OutOfMemory {
        what: path.display().to_string(),
        bytes: size_of_val(&obj.corners[..]) as u64,
        fix: "give a smaller mesh, or allow the process more memory".into(),
    })?;
    let mut not_simple = Vec::new();
    let mut start = 0;
    for (index, face) in obj.faces.iter().enumerate() {
        let corners = &obj.corners[start..start + face.arity];
        let uv_corners = obj.uv_corners.get(start..start + face.arity);
        let normals = obj.normal_corners.get(start..start + face.arity);
        let normal = |corner: u32| obj.normals.get(corner as usize).copied().unwrap_or_default();
        start += face.arity;
        let polygon: Vec<_> = corners.iter().map(|&v| obj.positions[v as usize]).collect();
        let cut = polygon::triangulate(&polygon).map_err(|what| Error::File {
            path: path.into(),
            line: Some(face.line),
            what,
            fix: "triangulate it in a modelling program".into(),
        })?;
        if !cut.is_simple {
            not_simple.push(face.line);
        }
        for triangle in cut.triangles {
            triangles.vertices.push(triangle.map(|c| corners[c]));
            triangles.uvs.extend(uv_corners.map(|uvs| triangle.map(|c| uvs[c])));
            triangles.normals.extend(normals.map(|normals| triangle.map(|c| normal(normals[c]))));
            triangles.faces.push(index);
        }
    }
    if let Some(line) = not_simple.first() {
        let count = not_simple.len();
        let note = format!("polygons that cross themselves or are flat are cut as well as they allow ({count} in all)");
        notes.add(Some(*line), note);
    }
    Ok(triangles)
}
