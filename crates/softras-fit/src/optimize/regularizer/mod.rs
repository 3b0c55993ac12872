//! Regularizers: penalties on vertex positions that keep a fitted mesh smooth, each with its analytic gradient.

mod flatten;
mod normals;

use crate::bad;
use crate::mesh::topology::Topology;
use glam::DVec3;
use softras::Result;

/// A penalty on the positions p of a mesh's vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regularizer {
    /// Σ |p_i - mean of its neighbours|² over vertices, as in the official code.
    Laplacian,
    /// Σ (1 + cos θ)² over edges, θ the angle between the two triangles there, π where they lie flat. As in the
    /// official code, with its small constants and over the first two edges of every face only.
    Flatten,
    /// Σ (1 - n·m) over edges and pairs of triangles there, n and m their unit normals, turned such that both are on one side of an
    /// unfolded pair.
    NormalConsistency,
}

impl Regularizer {
    /// The penalty; `weight` times its gradient is added to `gradient`.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] when positions or gradient are not one for each of the topology's vertices.
    pub fn add(self, topology: &Topology, positions: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> Result<f64> {
        let counts = [positions.len(), gradient.len()];
        if counts != [topology.vertices(); 2] {
            let what = format!("{counts:?} positions and gradients for {} vertices", topology.vertices());
            return bad(what, "give one for each vertex");
        }
        Ok(match self {
            Self::Laplacian => laplacian(topology, positions, weight, gradient),
            Self::Flatten => flatten::add(topology, positions, weight, gradient),
            Self::NormalConsistency => normals::add(topology, positions, weight, gradient),
        })
    }
}

/// The difference between each vertex's position and the mean of its neighbours, 0 for a vertex without neighbours.
pub fn laplacian_coordinates(topology: &Topology, positions: &[DVec3]) -> Vec<DVec3> {
    let one = |(i, &p): (usize, &DVec3)| {
        let neighbors = topology.neighbors(i);
        let sum: DVec3 = neighbors.iter().map(|&j| positions[j as usize]).sum();
        if neighbors.is_empty() { DVec3::ZERO } else { p - sum / neighbors.len() as f64 }
    };
    positions.iter().enumerate().map(one).collect()
}

fn laplacian(topology: &Topology, positions: &[DVec3], weight: f64, gradient: &mut [DVec3]) -> f64 {
    let offsets = laplacian_coordinates(topology, positions);
    for (i, offset) in offsets.iter().enumerate() {
        let neighbors = topology.neighbors(i);
        let slope = 2.0 * weight * *offset;
        gradient[i] += slope;
        let share = slope / neighbors.len().max(1) as f64;
        neighbors.iter().for_each(|&j| gradient[j as usize] -= share);
    }
    offsets.iter().map(|o| o.length_squared()).sum()
}
