//! The surface where a sampled function is zero, as a closed mesh.

use crate::error::Result;
use crate::scene::Mesh;
use glam::DVec3;
use std::collections::HashMap;

/// Samples of a function over a cube, x running fastest. Its inside is where it is above 0.
#[derive(Clone, Debug)]
pub struct Samples {
    /// The position of the first sample, the cube's lowest corner.
    pub low: DVec3,
    /// The distance between samples.
    pub step: f64,
    /// Samples along a side.
    pub resolution: usize,
    /// `resolution³` values.
    pub values: Vec<f32>,
}

impl Samples {
    /// Samples that are all inside, over the cube of side `side` whose lowest corner is `low`.
    pub fn new(low: DVec3, side: f64, resolution: usize) -> Self {
        let values = vec![f32::MAX; resolution.pow(3)];
        Self { low, step: side / (resolution - 1) as f64, resolution, values }
    }

    /// The position of a sample.
    pub fn position(&self, i: usize) -> DVec3 {
        let n = self.resolution;
        self.low + self.step * DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64)
    }

    /// The mesh of the zero level, closed at the cube's sides, its triangles counter-clockwise seen from outside; `None` where
    /// no sample is inside.
    ///
    /// # Errors
    /// [`Error::Mesh`](crate::Error::Mesh) for a surface of more vertices than a mesh may have.
    pub fn mesh(mut self) -> Result<Option<Mesh>> {
        let n = self.resolution;
        let on_side = |i: usize| [i % n, i / n % n, i / n / n].iter().any(|&k| k == 0 || k == n - 1);
        let least = (1e-3 * self.step) as f32;
        for (_, value) in self.values.iter_mut().enumerate().filter(|(i, _)| on_side(*i)) {
            *value = value.min(-least);
        }
        let mut surface =
            Surface { grid: &self, positions: Vec::new(), vertex_of: HashMap::new(), triangles: Vec::new() };
        for cell in 0..self.values.len() {
            if [cell % n, cell / n % n, cell / n / n].iter().all(|&k| k + 1 < n) {
                surface.add_cell(cell);
            }
        }
        let Surface { positions, triangles, .. } = surface;
        if triangles.is_empty() { Ok(None) } else { Mesh::new(positions, triangles).map(Some) }
    }
}

/// Builds the zero level by marching tetrahedra (Doi and Koide 1991): six in each cell, all along the same diagonal, so
/// that neighbours share triangles. Unlike that of surface nets it is closed whatever the samples are.
struct Surface<'a> {
    grid: &'a Samples,
    positions: Vec<[f32; 3]>,
    /// The vertex between two samples, the inner one first.
    vertex_of: HashMap<[usize; 2], u32>,
    triangles: Vec<[u32; 3]>,
}

/// The order of axes along which a tetrahedron's edges lead from a cell's lowest corner to its highest; the first three orders
/// are even permutations.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

impl Surface<'_> {
    fn add_cell(&mut self, lowest: usize) {
        let n = self.grid.resolution;
        let along = [1, n, n * n];
        let inside = |sample: usize| self.grid.values[sample] > 0.0;
        let corners = (0..8).map(|k| lowest + (k & 1) + (k >> 1 & 1) * n + (k >> 2) * n * n);
        let count = corners.filter(|&corner| inside(corner)).count();
        if count == 0 || count == 8 {
            return;
        }
        for (path, [a, b, c]) in PATHS.into_iter().enumerate() {
            let first = lowest + along[a];
            let second = first + along[b];
            let [from, to] = if path < 3 { [first, second] } else { [second, first] };
            // In this order every tetrahedron is right-handed.
            self.add_tetrahedron([lowest, from, to, second + along[c]]);
        }
    }

    /// Adds the triangles that part the inner samples of a right-handed tetrahedron from the outer ones.
    fn add_tetrahedron(&mut self, corners: [usize; 4]) {
        // Even permutations of the corners: one for each corner that can come first, and one for each pair that can.
        const FIRST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]];
        const PAIR: [[usize; 4]; 6] =
            [[0, 1, 2, 3], [0, 2, 3, 1], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 2, 0], [2, 3, 0, 1]];
        let inside = corners.map(|corner| self.grid.values[corner] > 0.0);
        let is_first = |order: &&[usize; 4], wanted: bool| {
            inside[order[0]] == wanted && order[1..].iter().all(|&k| inside[k] != wanted)
        };
        if let Some(order) = FIRST.iter().find(|order| is_first(order, true)) {
            let [i, j, k, l] = order.map(|k| corners[k]);
            let triangle = [self.vertex(i, j), self.vertex(i, k), self.vertex(i, l)];
            self.triangles.push(triangle);
        } else if let Some(order) = FIRST.iter().find(|order| is_first(order, false)) {
            let [i, j, k, l] = order.map(|k| corners[k]);
            let triangle = [self.vertex(j, i), self.vertex(l, i), self.vertex(k, i)];
            self.triangles.push(triangle);
        } else if let Some(order) =
            PAIR.iter().find(|[i, j, k, l]| inside[*i] && inside[*j] && !inside[*k] && !inside[*l])
        {
            let [i, j, k, l] = order.map(|k| corners[k]);
            let [ik, il, jl, jk] = [self.vertex(i, k), self.vertex(i, l), self.vertex(j, l), self.vertex(j, k)];
            self.triangles.extend([[ik, il, jl], [ik, jl, jk]]);
        }
    }

    /// The vertex between an inner and an outer sample, where linear interpolation of f is 0.
    fn vertex(&mut self, inner: usize, outer: usize) -> u32 {
        let (grid, positions) = (self.grid, &mut self.positions);
        *self.vertex_of.entry([inner, outer]).or_insert_with(|| {
            let [a, b] = [inner, outer].map(|sample| f64::from(grid.values[sample]));
            // The clamp keeps the vertices of neighbouring edges apart.
            let part = (a / (a - b)).clamp(0.02, 0.98);
            positions.push(grid.position(inner).lerp(grid.position(outer), part).as_vec3().to_array());
            positions.len() as u32 - 1
        })
    }
}
