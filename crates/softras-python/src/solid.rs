//! Voxels as the official code counts them: those that the surface touches, and those that cannot be reached from outside.

use crate::arrays::floats;
use crate::exceptions::bad_input;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// A grid of voxels of side 1, voxel (i, j, k) from (i, j, k) to (i + 1, j + 1, k + 1).
struct Grid {
    size: usize,
    touched: Vec<bool>,
}

impl Grid {
    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.size + j) * self.size + k
    }

    fn touch(&mut self, at: [f64; 3]) {
        let inside = |x: &f64| *x >= 0.0 && *x < self.size as f64;
        if at.iter().all(inside) {
            let index = self.index(at.map(|x| x as usize));
            self.touched[index] = true;
        }
    }

    /// Touches the voxels around the points where lines along an axis through the grid's corners meet a triangle.
    fn cross(&mut self, triangle: &[[f64; 3]; 3], axis: usize) {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        let [a, b, c] = triangle;
        let ([bu, bv], [cu, cv]) = ([b[u] - a[u], b[v] - a[v]], [c[u] - a[u], c[v] - a[v]]);
        let area = bu * cv - cu * bv;
        if area == 0.0 {
            return;
        }
        let lines = |axis: usize| {
            let all = triangle.map(|corner| corner[axis]);
            let low = all.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
            let high = all.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor().min(self.size as f64);
            low as i64..=high as i64
        };
        let (along_u, along_v) = (lines(u), lines(v));
        for i in along_u {
            for j in along_v.clone() {
                let [pu, pv] = [i as f64 - a[u], j as f64 - a[v]];
                let (s, t) = ((pu * cv - pv * cu) / area, (pv * bu - pu * bv) / area);
                if s < 0.0 || t < 0.0 || s + t > 1.0 {
                    continue;
                }
                let depth = (a[axis] + s * (b[axis] - a[axis]) + t * (c[axis] - a[axis])).floor();
                for [du, dv] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                    let mut at = [depth; 3];
                    (at[u], at[v]) = (i as f64 - du, j as f64 - dv);
                    self.touch(at);
                }
            }
        }
    }
}

/// The solid of triangles [F, 3, 3] in units of voxels.
#[pyfunction]
pub fn solid_voxels<'py>(faces: &Bound<'py, PyAny>, size: usize) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let py = faces.py();
    let array = floats(faces, "faces", "place")?;
    if !matches!(array.shape(), [_, 3, 3]) || !(1..=softras_fit::MAX_RESOLUTION).contains(&size) {
        let what = format!("faces of shape {:?} in {size} voxels a side", array.shape());
        return Err(bad_input(what, "give [F, 3, 3] and 1 to 512 voxels"));
    }
    if array.as_slice()?.iter().any(|x| !x.is_finite()) {
        return Err(bad_input("faces with a corner that is no finite point", "give finite numbers"));
    }
    let corners: Vec<[f64; 3]> = array.as_slice()?.as_chunks::<3>().0.iter().map(|p| p.map(f64::from)).collect();
    let solid = py.detach(|| {
        let mut grid = Grid { size, touched: vec![false; size.pow(3)] };
        for triangle in corners.as_chunks::<3>().0 {
            (0..3).for_each(|axis| grid.cross(triangle, axis));
            triangle.iter().for_each(|corner| grid.touch(corner.map(f64::floor)));
        }
        softras_fit::enclosed(&grid.touched, size)
    });
    PyArray1::from_vec(py, solid).reshape([size; 3])
}
