//! Surface cells of textured meshes, as the official code samples them.

use crate::exceptions::bad_input;
use crate::mesh::Mesh;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use softras::scene::{Appearance, Texture};

/// The barycentric coordinates of the centre of one of R² cells, number R y + x. Where x + y < R it is the upright triangle of
/// column x and row y; the other numbers are those of the inverted triangles between them.
fn centre(cell: usize, resolution: usize) -> [f32; 3] {
    let (y, x) = (cell / resolution, cell % resolution);
    let is_lower = x + y < resolution;
    let along = |i: usize| {
        let place = if is_lower { i as f64 + 1.0 / 3.0 } else { (resolution - 1 - i) as f64 + 2.0 / 3.0 };
        place / resolution as f64
    };
    let [a, b] = [along(x), along(y)];
    [a as f32, b as f32, (1.0 - a - b) as f32]
}

/// A texture by bilinear interpolation, corner texels at 0 and 1.
fn sample(texture: &Texture, [u, v]: [f32; 2]) -> [f32; 3] {
    let (width, height) = (texture.width() as usize, texture.height() as usize);
    let (x, y) = (u * (width - 1) as f32, (1.0 - v) * (height - 1) as f32);
    let (left, top) = ((x.max(0.0) as usize).min(width - 1), (y.max(0.0) as usize).min(height - 1));
    let (right, below) = ((left + 1).min(width - 1), (top + 1).min(height - 1));
    let (across, down) = ((x - left as f32).clamp(0.0, 1.0), (y - top as f32).clamp(0.0, 1.0));
    let at = |row: usize, column: usize| texture.texels()[row * width + column];
    let [a, b, c, d] = [at(top, left), at(top, right), at(below, left), at(below, right)];
    std::array::from_fn(|k| {
        let (upper, lower) = (a[k] + (b[k] - a[k]) * across, c[k] + (d[k] - c[k]) * across);
        upper + (lower - upper) * down
    })
}

/// The colours [F, R², 3] of a textured mesh in the middle of each cell. UVs above 1 repeat; those below 0 do not, as in the
/// official code.
#[pyfunction]
pub fn surface_cells<'py>(py: Python<'py>, mesh: &Mesh, resolution: usize) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle } = mesh.mesh.appearance() else {
        return Err(bad_input("the mesh has no textures", "give one that has"));
    };
    let count = uv_triangles.len();
    let cells: Vec<f32> = py.detach(|| {
        let centres: Vec<[f32; 3]> = (0..resolution.pow(2)).map(|cell| centre(cell, resolution)).collect();
        let mut cells = Vec::with_capacity(count * centres.len() * 3);
        for (t, corners) in uv_triangles.iter().enumerate() {
            let texture = &textures[texture_of_triangle.get(t).map_or(0, |&i| i as usize)];
            let [a, b, c] = corners.map(|i| uvs[i as usize].map(|x| if x > 1.0 { x % 1.0 } else { x }));
            for w in &centres {
                let uv = [0, 1].map(|k| w[0] * a[k] + w[1] * b[k] + w[2] * c[k]);
                cells.extend(sample(texture, uv));
            }
        }
        cells
    });
    PyArray1::from_vec(py, cells).reshape([count, resolution.pow(2), 3])
}
