//! Specks of a mesh: parts that are smaller than pictures show.

use super::topology::Topology;
use glam::DVec3;
use softras::{Mesh, Result};

/// The mesh without its parts that are smaller than a length in every direction, and how many these are. The largest part stays.
pub fn without_specks(mesh: &Mesh, length: f64) -> Result<(Mesh, usize)> {
    let parts = Topology::of(mesh)?.parts();
    let sizes: Vec<f64> = parts.iter().map(|part| size(mesh, part)).collect();
    let least = sizes.iter().copied().fold(0.0, f64::max).min(length);
    let mut is_kept = vec![false; mesh.positions().len()];
    for (part, _) in parts.iter().zip(&sizes).filter(|(_, size)| **size >= least) {
        part.iter().for_each(|&vertex| is_kept[vertex] = true);
    }
    let specks = sizes.iter().filter(|size| **size < least).count();
    let kept = |triangle: &[u32; 3]| is_kept[triangle[0] as usize];
    let triangles: Vec<usize> =
        (0..).zip(mesh.triangles()).filter(|(_, t)| kept(t)).map(|(number, _)| number).collect();
    Ok((if specks > 0 { mesh.part(&triangles)? } else { mesh.clone() }, specks))
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
            let (left, found) = without_specks(&mesh, length).unwrap();
            assert_eq!((found, parts(&left)), (specks, (4 - specks, Some(0))), "{length}");
        }
        let (left, _) = without_specks(&mesh, 0.5).unwrap();
        assert_eq!(left.positions().len(), 2 * mesh.positions().len() / 4);
        assert!(left.positions().iter().all(|[x, ..]| (*x - 3.0).abs() <= 1.01 || (*x - 9.0).abs() <= 1.01));
    }
}
