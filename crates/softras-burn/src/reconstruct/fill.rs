//! Solids on the grid of the evaluation, packed a bit a voxel, and how far two of them overlap.

use super::VOXELS;
use softras::glam::DVec3;
use softras::{Mesh, Result};
use softras_fit::{Voxels, enclosed, is_closed};

const COUNT: usize = VOXELS * VOXELS * VOXELS;
/// The grid spans [-16/31, 16/31]: the official evaluation scales vertices by 31/32 into the unit cube.
const SIDE: f64 = VOXELS as f64 / (VOXELS as f64 - 1.0);

/// Voxels of the cube around the origin that objects lie in, in the order of the official data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grid(Vec<u64>);

impl Grid {
    /// From one value for each voxel, in the order of the official data; `None` for another number of them.
    pub fn from_values(values: impl ExactSizeIterator<Item = bool>) -> Option<Self> {
        let mut words = vec![0; COUNT / 64];
        if values.len() != COUNT {
            return None;
        }
        values.enumerate().filter(|(_, inside)| *inside).for_each(|(i, _)| words[i / 64] |= 1 << (i % 64));
        Some(Self(words))
    }

    /// The solid of a mesh. One that is not closed is filled from outside: a voxel is inside if no path over voxels without
    /// surface leads from it to the border.
    ///
    /// # Errors
    /// [`softras::Error::OutOfMemory`].
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let inside = if is_closed(mesh)? {
            Voxels::new(mesh, [-SIDE / 2.0; 3], SIDE, VOXELS)?.inside().to_vec()
        } else {
            filled(mesh)
        };
        let at = |i: usize| inside[official(i)];
        let mut words = vec![0; COUNT / 64];
        (0..COUNT).filter(|&i| at(i)).for_each(|i| words[i / 64] |= 1 << (i % 64));
        Ok(Self(words))
    }

    /// A byte for each voxel, 0 or 1.
    pub fn bytes(&self) -> Vec<u8> {
        (0..COUNT).map(|i| (self.0[i / 64] >> (i % 64) & 1) as u8).collect()
    }

    /// The intersection over union; 1 where both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let (mut both, mut either) = (0, 0);
        for (a, b) in self.0.iter().zip(&other.0) {
            both += (a & b).count_ones();
            either += (a | b).count_ones();
        }
        if either == 0 { 1.0 } else { f64::from(both) / f64::from(either) }
    }

    /// The voxels that at least a share of the grids has; of several shares the one whose solid overlaps the grids best.
    pub fn mean(grids: &[&Self]) -> Self {
        let counts: Vec<usize> =
            (0..COUNT).map(|i| grids.iter().filter(|grid| grid.0[i / 64] >> (i % 64) & 1 == 1).count()).collect();
        let at = |share: usize| {
            let mut words = vec![0; COUNT / 64];
            let over = |count: usize| 10 * count >= share * grids.len().max(1);
            counts
                .iter()
                .enumerate()
                .filter(|(_, count)| over(**count))
                .for_each(|(i, _)| words[i / 64] |= 1 << (i % 64));
            Self(words)
        };
        let score = |grid: &Self| grids.iter().map(|other| grid.iou(other)).sum::<f64>();
        let mut best = at(5);
        for candidate in (1..=9).map(at) {
            if score(&candidate) > score(&best) {
                best = candidate;
            }
        }
        best
    }
}

/// The index, x fastest, of the voxel that the official data has at index `i`: those are indexed [y][x][z], with x and z of
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

    /// A cube of half size 0.3 whose first `missing` triangles are left out.
    fn cube(missing: usize) -> Mesh {
        let whole = super::super::solid::normalized(shapes::cube().unwrap(), 0.6).unwrap();
        Mesh::new(whole.positions().to_vec(), whole.triangles()[missing..].to_vec()).unwrap()
    }

    #[test]
    fn overlaps_and_means() {
        let whole = Grid::new(&cube(0)).unwrap();
        let count = whole.bytes().iter().filter(|x| **x == 1).count();
        assert_eq!(count, 18usize.pow(3));
        assert_eq!(whole.iou(&whole), 1.0);
        let empty = Grid::from_values(vec![false; COUNT].into_iter()).unwrap();
        assert_eq!((whole.iou(&empty), empty.iou(&empty)), (0.0, 1.0));
        assert_eq!(Grid::mean(&[&whole, &whole, &empty]), whole);
        let again = Grid::from_values(whole.bytes().into_iter().map(|x| x == 1)).unwrap();
        assert_eq!(again, whole);
        assert!(Grid::from_values(vec![true; 5].into_iter()).is_none());
    }

    #[test]
    fn meshes_that_are_not_closed_are_filled_from_outside() {
        // The surface's own voxels count as inside.
        let lid = cube(0);
        let doubled = [lid.triangles(), &lid.triangles()[..1]].concat();
        let not_closed = Mesh::new(lid.positions().to_vec(), doubled).unwrap();
        assert!(!is_closed(&not_closed).unwrap());
        let count = Grid::new(&not_closed).unwrap().bytes().iter().filter(|x| **x == 1).count();
        assert!((18usize.pow(3)..=20usize.pow(3)).contains(&count), "{count}");
        // Through a missing face the outside comes in.
        let open = Grid::new(&cube(2)).unwrap().bytes().iter().filter(|x| **x == 1).count();
        assert!(open < 18usize.pow(3) / 2, "{open}");
    }
}
