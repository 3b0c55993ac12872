//! The numbers of a judged file, read by tobj, and its polygons as triangles.

use super::{
    polygon,
    scan::{Face, Scan},
};
use crate::{
    error::{Error, Result},
    scene::Mesh,
};
use std::{
    fmt::Write,
    io::{self, BufRead, Read},
    path::Path,
};

/// Positions in file order, one per `v`, and triangles.
#[derive(Default)]
pub(super) struct Geometry {
    pub positions: Vec<[f32; 3]>,
    /// One per position, or none at all.
    pub colors: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub triangles: Vec<[u32; 3]>,
    /// As `triangles`, into `uvs`; empty without any `vt`. Not to be read where the face has no UVs.
    pub uv_triangles: Vec<[u32; 3]>,
    /// For each triangle its face, an index into [`Scan::faces`].
    pub face_of_triangle: Vec<usize>,
}

/// Reads numbers and triangulates.
///
/// # Errors
/// [`Error::File`] with the line of a number that is none or not finite, or of a polygon too large to cut.
pub(super) fn read(path: &Path, scan: &Scan, notes: &mut Vec<String>) -> Result<Geometry> {
    let file_error = |line: usize, what: String, fix: &str| {
        Err(Error::File { path: path.into(), line: Some(line), what, fix: fix.into() })
    };
    let mesh = match parse(scan) {
        Ok(mesh) => mesh,
        Err((error, line)) => {
            let statement = scan.text.lines().nth(line).unwrap_or_default();
            let statement: String = statement.chars().take(80).collect();
            return file_error(scan.lines[line], format!("{error} in {statement:?}"), "give plain decimal numbers");
        }
    };
    let positions = triples(&mesh.positions);
    if let Some(i) = positions.iter().position(|p| !p.iter().all(|x| x.abs() <= Mesh::FARTHEST)) {
        let what = format!("vertex {:?} is not within ±{:e}", positions[i], Mesh::FARTHEST);
        return file_error(line_of(scan, "v ", i), what, "remove or repair it");
    }
    let uvs: Vec<[f32; 2]> = mesh.texcoords.chunks_exact(2).map(|uv| [uv[0], uv[1]]).collect();
    if let Some(i) = uvs.iter().position(|uv| !uv.iter().all(|x| x.abs() <= 1e4)) {
        let what = format!("texture coordinate {:?} is not within ±10000", uvs[i]);
        return file_error(line_of(scan, "vt ", i), what, "shift it by whole numbers: the image repeats");
    }
    let colors = triples(&mesh.vertex_color);
    let mut geometry = Geometry { positions, colors, uvs, ..Geometry::default() };
    match triangulate(&mut geometry, &mesh, scan, notes) {
        Ok(()) => Ok(geometry),
        Err((line, what)) => file_error(line, what, "triangulate it in a modelling program"),
    }
}

/// Cuts the faces into triangles; the error is the line of one that cannot be cut, and why.
fn triangulate(
    geometry: &mut Geometry,
    mesh: &tobj::Mesh,
    scan: &Scan,
    notes: &mut Vec<String>,
) -> std::result::Result<(), (usize, String)> {
    let mut not_simple = Vec::new();
    let mut start = prelude_length(scan);
    for (face, Face { line, .. }) in scan.faces.iter().enumerate() {
        // The first arity is the prelude's; there are none when all are 3.
        let arity = mesh.face_arities.get(face + 1).map_or(3, |&n| n as usize);
        let corners = &mesh.indices[start..start + arity];
        let uv_corners = mesh.texcoord_indices.get(start..start + arity);
        let polygon: Vec<_> = corners.iter().map(|&v| geometry.positions[v as usize].map(f64::from)).collect();
        let cut = polygon::triangulate(&polygon).map_err(|what| (*line, what))?;
        if !cut.is_simple {
            not_simple.push(line);
        }
        for triangle in cut.triangles {
            geometry.triangles.push(triangle.map(|c| corners[c]));
            geometry.uv_triangles.extend(uv_corners.map(|uvs| triangle.map(|c| uvs[c])));
            geometry.face_of_triangle.push(face);
        }
        start += arity;
    }
    if let Some(line) = not_simple.first() {
        let count = not_simple.len();
        notes.push(format!(
            "line {line}: polygons that cross themselves or are flat are cut as well as they allow ({count} in all)"
        ));
    }
    Ok(())
}

fn triples(values: &[f32]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect()
}

/// The file's line of the `index`-th statement that starts with `keyword`.
fn line_of(scan: &Scan, keyword: &str, index: usize) -> usize {
    let mut lines = scan.text.lines().zip(&scan.lines).filter(|(text, _)| text.starts_with(keyword));
    lines.nth(index).map_or(0, |(_, &line)| line)
}

fn prelude_length(scan: &Scan) -> usize {
    scan.totals.vertices.max(scan.totals.uvs)
}

/// tobj's mesh, or its error and the line of [`Scan::text`] where it stopped, from 0.
fn parse(scan: &Scan) -> std::result::Result<tobj::Mesh, (tobj::LoadError, usize)> {
    // tobj numbers vertices and UVs in the order in which faces name them and drops the rest. A first polygon that
    // names all of them in file order makes its numbers the file's.
    let mut prelude = String::from("l");
    for i in 1..=prelude_length(scan) {
        // Writing to a String cannot fail.
        let _ = match scan.totals.uvs {
            0 => write!(prelude, " {i}"),
            uvs => write!(prelude, " {}/{}", i.min(scan.totals.vertices), i.min(uvs)),
        };
    }
    prelude.push('\n');
    let mut reader = LineCounter { inner: prelude.as_bytes().chain(scan.text.as_bytes()), lines: 0 };
    let models = tobj::load_obj_buf(&mut reader, &tobj::LoadOptions::default(), |_| Err(tobj::LoadError::ReadError));
    // The line read last is where tobj stopped; the prelude is one more.
    let line = reader.lines.saturating_sub(2).min(scan.lines.len() - 1);
    let (models, _) = models.map_err(|error| (error, line))?;
    models.into_iter().next().map(|model| model.mesh).ok_or((tobj::LoadError::GenericFailure, line))
}

/// Counts the lines that tobj has consumed: its errors do not tell.
struct LineCounter<R> {
    inner: R,
    lines: usize,
}

impl<R: BufRead> Read for LineCounter<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.fill_buf()?.read(buffer)?;
        self.consume(n);
        Ok(n)
    }
}

impl<R: BufRead> BufRead for LineCounter<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        if let Ok(bytes) = self.inner.fill_buf() {
            self.lines += bytes[..amount].iter().filter(|&&byte| byte == b'\n').count();
        }
        self.inner.consume(amount);
    }
}
