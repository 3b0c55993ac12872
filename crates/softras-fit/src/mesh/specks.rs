//! Specks of a hull: parts of a few samples, which no picture shows alone.

use super::topology::Topology;
use glam::DVec3;
use softras::{Mesh, Result};

/// Parts that are smaller than this number of the edges that a mesh is to have are specks: a few triangles would remain of each, which
/// the steps of a fit draw together to a point.
pub const SPECK_EDGES: f64 = 2.0;

/// The mesh without its specks, given the length that its edges are to have, and how many these are. The largest part stays.
pub fn without_specks(mesh: Mesh, edge: f64) -> Result<(Mesh, usize)> {
    let parts = Topology::of(&mesh)?.parts();
    let sizes: Vec<f64> = parts.iter().map(|part| size(&mesh, part)).collect();
    let least = sizes.iter().copied().fold(0.0, f64::max).min(SPECK_EDGES * edge);
    let specks = sizes.iter().filter(|size| **size < least).count();
    if specks == 0 {
        return Ok((mesh, 0));
    }
    let mut is_kept = vec![true; mesh.positions().len()];
    for (part, _) in parts.iter().zip(&sizes).filter(|(_, size)| **size < least) {
        part.iter().for_each(|&vertex| is_kept[vertex] = false);
    }
    let triangles = mesh.triangles();
    let kept: Vec<usize> = (0..triangles.len()).filter(|&t| is_kept[triangles[t][0] as usize]).collect();
    Ok((mesh.part(&kept)?, specks))
}

/// The longest side of the box around some vertices.
fn size(mesh: &Mesh, vertices: &[usize]) -> f64 {
    let positions = || vertices.iter().map(|&vertex| DVec3::from(mesh.positions()[vertex].map(f64::from)));
    let low = positions().fold(DVec3::INFINITY, DVec3::min);
    let high = positions().fold(DVec3::NEG_INFINITY, DVec3::max);
    (high - low).max_element()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes::icosphere;

    /// Spheres of these radii, side by side.
    fn spheres(radii: &[f32]) -> Mesh {
        let ball = icosphere(1).unwrap();
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (i, radius) in (0..).zip(radii) {
            let first = positions.len() as u32;
            triangles.extend(ball.triangles().iter().map(|t| t.map(|v| first + v)));
            positions.extend(
                ball.positions().iter().map(|&[x, y, z]| [radius * x + 3.0 * i as f32, radius * y, radius * z]),
            );
        }
        Mesh::new(positions, triangles).unwrap()
    }

    #[test]
    fn parts_below_a_length_go() {
        let parts = |mesh: &Mesh| Topology::of(mesh).unwrap().parts_and_genus();
        let mesh = spheres(&[0.1, 1.0, 0.2, 0.6]);
        for (length, specks) in [(0.1, 0), (0.3, 1), (0.5, 2), (1.5, 3), (9.0, 3)] {
            let (left, found) = without_specks(mesh.clone(), length / SPECK_EDGES).unwrap();
            assert_eq!((found, parts(&left)), (specks, (4 - specks, Some(0))), "{length}");
        }
    }
}
