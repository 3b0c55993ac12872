//! The solids of meshes on the grid of the evaluation.

use crate::VOXELS;
use crate::bits::Bits;
use softras::glam::DVec3;
use softras::{Mesh, Result};
use softras_fit::{Voxels, enclosed, is_closed};

const COUNT: usize = VOXELS * VOXELS * VOXELS;
/// The grid spans [-16/31, 16/31]: the official evaluation scales vertices by 31/32 into the unit cube.
const SIDE: f64 = VOXELS as f64 / (VOXELS as f64 - 1.0);

/// The voxels inside a mesh, in the order of the official data. A mesh that is not closed is filled from outside: a voxel is
/// inside if no path over voxels without surface leads from it to the border.
pub fn solid(mesh: &Mesh) -> Result<Bits> {
    let inside = if is_closed(mesh)? {
        Voxels::new(mesh, [-SIDE / 2.0; 3], SIDE, VOXELS)?.inside().to_vec()
    } else {
        filled(mesh)
    };
    Ok(Bits::new((0..COUNT).map(|i| inside[official(i)])))
}

/// The index, x fastest, of the voxel that the official data has at index `i`: those are indexed `[y][x][z]`, with x and z of
/// the mirrored object and z backwards.
fn official(i: usize) -> usize {
    let (y, x, z) = (i / (VOXELS * VOXELS), i / VOXELS % VOXELS, i % VOXELS);
    let (x, z) = (VOXELS - 1 - x, VOXELS - 1 - z);
    (z * VOXELS + y) * VOXELS + x
}

/// The voxels, x fastest, that are on the surface or not connected to the border.
fn filled(mesh: &Mesh) -> Vec<bool> {
    // One more voxel on every side, all of them outside.
    let wide = VOXELS + 2;
    let step = SIDE / VOXELS as f64;
    let mut surface = vec![false; wide.pow(3)];
    let index = |p: DVec3| {
        let [x, y, z] =
            (p / step + VOXELS as f64 / 2.0).floor().to_array().map(|x| (x + 1.0).clamp(0.0, wide as f64 - 1.0));
        (z as usize * wide + y as usize) * wide + x as usize
    };
    for triangle in mesh.triangles() {
        let [a, b, c] = triangle.map(|i| DVec3::from_array(mesh.positions()[i as usize].map(f64::from)));
        // Points less than half a voxel apart.
        let count = ((b - a).length().max((c - a).length()) * 2.0 / step).ceil().clamp(1.0, 4.0 * wide as f64) as usize;
        for i in 0..=count {
            for j in 0..=count - i {
                let [u, v] = [i, j].map(|k| k as f64 / count as f64);
                surface[index(a + (b - a) * u + (c - a) * v)] = true;
            }
        }
    }
    let solid = enclosed(&surface, wide);
    let inner = |i: usize| [i % VOXELS, i / VOXELS % VOXELS, i / (VOXELS * VOXELS)].map(|k| k + 1);
    (0..COUNT).map(inner).map(|[x, y, z]| solid[(z * wide + y) * wide + x]).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    /// The voxels of a cube of half size 0.3 with some of its triangles.
    fn count(triangles: impl Fn(&[[u32; 3]]) -> Vec<[u32; 3]>) -> usize {
        let cube = crate::solid::normalized(shapes::cube().unwrap(), 0.6).unwrap();
        let mesh = Mesh::new(cube.positions().to_vec(), triangles(cube.triangles())).unwrap();
        solid(&mesh).unwrap().bytes().map(usize::from).sum()
    }

    #[test]
    fn meshes_that_are_not_closed_are_filled_from_outside() {
        let whole = count(<[_]>::to_vec);
        assert_eq!(whole, 18usize.pow(3));
        // A triangle twice: the surface's own voxels count as inside.
        let doubled = count(|all| [all, &all[..1]].concat());
        assert!((whole..=20usize.pow(3)).contains(&doubled), "{doubled}");
        // Through a missing face the outside comes in.
        let open = count(|all| all[2..].to_vec());
        assert!(open < whole / 2, "{open}");
    }
}
