//! Solids as voxels, and the intersection over union of two of them.
//!
//! A voxel is inside if its centre is. Six rays from the centre, both ways along each axis, vote on that: a ray votes
//! inside if the numbers of triangles that it leaves and enters through differ, which holds in overlaps of closed parts
//! too. More than three votes decide. In a closed mesh all six agree; a mesh with small holes still counts as a solid,
//! since most rays miss the holes; an open sheet has no inside.

use crate::bad;
use softras::{Error, Result, scene::Mesh};

/// The largest number of voxels along a side.
pub const MAX_RESOLUTION: usize = 512;
/// Offset of the rays from a voxel's centre, in voxels, so that they do not run along faces that lie on the grid.
const ASIDE: [f64; 3] = [1.237e-5, -2.618e-5, 3.141e-5];
/// The most voxels whose crossings are counted at a time, 16 MiB.
const MOST_COUNTED: usize = 1 << 22;
/// How much larger the grid is than the meshes, as a fraction of their size.
const MARGIN: f64 = 1e-3;

/// A cube of voxels, each inside or outside a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    resolution: usize,
    side: f64,
    inside: Vec<bool>,
    is_mixed: bool,
}

impl Voxels {
    /// The voxels of a mesh within the cube of side `side` whose lowest corner is `low`, in world units.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a resolution outside 1 to [`MAX_RESOLUTION`] or a side that is not above 0.
    pub fn new(mesh: &Mesh, low: [f64; 3], side: f64, resolution: usize) -> Result<Self> {
        validate(low, side, resolution)?;
        let mut votes = vec![0u8; resolution.pow(3)];
        let grid = Grid { low, step: side / resolution as f64, resolution };
        let (mut least, mut most) = (0, 0);
        for axis in 0..3 {
            grid.walk(mesh, axis, |at, before, total| {
                votes[at] += u8::from(before != 0) + u8::from(total - before != 0);
                if total == 0 {
                    (least, most) = (before.min(least), before.max(most));
                }
            });
        }
        let inside = votes.into_iter().map(|votes| votes > 3).collect();
        Ok(Self { resolution, side, inside, is_mixed: least < 0 && most > 0 })
    }

    /// Whether some parts of the mesh are inside out and others are not. Where two such parts overlap, they cancel and count as outside.
    pub fn is_mixed(&self) -> bool {
        self.is_mixed
    }

    /// The number of voxels inside of both over that of those inside of either; 1 where neither has an inside. Both are of one cube.
    pub fn iou(&self, other: &Self) -> f64 {
        let pairs = || self.inside.iter().zip(&other.inside);
        let (both, either) = (pairs().filter(|(a, b)| **a && **b).count(), pairs().filter(|(a, b)| **a || **b).count());
        if either == 0 { 1.0 } else { both as f64 / either as f64 }
    }

    /// Whether each voxel is inside, x running fastest, then y, then z.
    pub fn inside(&self) -> &[bool] {
        &self.inside
    }

    /// Volume of the inside in world units³.
    pub fn volume(&self) -> f64 {
        let voxel = (self.side / self.resolution as f64).powi(3);
        self.inside.iter().filter(|&&inside| inside).count() as f64 * voxel
    }
}

/// The volume of the intersection of two solids over that of their union, by counting the voxels of a cube around both
/// meshes with `resolution` voxels a side (1 to 512); 1 where neither mesh has an inside.
///
/// # Errors
/// [`softras::Error::Fit`] for a resolution outside 1 to 512.
pub fn voxel_iou(a: &Mesh, b: &Mesh, resolution: usize) -> Result<f64> {
    let (low, side) = cube_around(&[a, b]);
    Ok(Voxels::new(a, low, side, resolution)?.iou(&Voxels::new(b, low, side, resolution)?))
}

/// The share of a solid that its mesh encloses other than once: where parts of it overlap, and where it is inside out. It is
/// counted by the voxels of a cube around the mesh with `resolution` voxels a side (1 to 512), along lines on which the mesh is
/// closed.
///
/// # Errors
/// [`softras::Error::Fit`] for a resolution outside 1 to 512.
pub fn overlap(mesh: &Mesh, resolution: usize) -> Result<f64> {
    let (low, side) = cube_around(&[mesh]);
    validate(low, side, resolution)?;
    let grid = Grid { low, step: side / resolution as f64, resolution };
    let (mut inside, mut wrong) = (0usize, 0usize);
    grid.walk(mesh, 0, |_, before, total| {
        // A line into a solid crosses a triangle that faces against it, which counts -1.
        inside += usize::from(total == 0 && before != 0);
        wrong += usize::from(total == 0 && before != 0 && before != -1);
    });
    Ok(if inside == 0 { 0.0 } else { wrong as f64 / inside as f64 })
}

fn validate(low: [f64; 3], side: f64, resolution: usize) -> Result<()> {
    if !(1..=MAX_RESOLUTION).contains(&resolution) {
        return bad(format!("{resolution} voxels a side"), "use 1 to 512");
    }
    if !(side > 0.0 && side.is_finite() && low.iter().all(|x| x.is_finite())) {
        return bad(format!("a cube of side {side:?} from {low:?}"), "use a finite side above 0");
    }
    Ok(())
}

/// The voxels of a cube with `side` voxels a side that a surface touches, and those that it encloses: no way through untouched
/// voxels leads to them from the cube's border. Empty where there are not side³ voxels.
pub fn enclosed(touched: &[bool], side: usize) -> Vec<bool> {
    if side.checked_pow(3) != Some(touched.len()) {
        return Vec::new();
    }
    let strides = [1, side, side * side];
    let is_border = |at: usize| strides.iter().any(|stride| [0, side - 1].contains(&(at / stride % side)));
    let mut open: Vec<usize> = (0..touched.len()).filter(|&at| !touched[at] && is_border(at)).collect();
    let mut solid = vec![true; touched.len()];
    open.iter().for_each(|&at| solid[at] = false);
    while let Some(at) = open.pop() {
        for stride in strides {
            let place = at / stride % side;
            let steps = [(place > 0).then(|| at - stride), (place + 1 < side).then(|| at + stride)];
            for next in steps.into_iter().flatten() {
                if solid[next] && !touched[next] {
                    solid[next] = false;
                    open.push(next);
                }
            }
        }
    }
    solid
}

/// Whether the mesh bounds a solid: every edge is used by as many triangles in one direction as in the other.
///
/// # Errors
/// [`Error::OutOfMemory`].
pub fn is_closed(mesh: &Mesh) -> Result<bool> {
    let count = 3 * mesh.triangles().len();
    let mut edges: Vec<([u32; 2], i32)> = Vec::new();
    if edges.try_reserve_exact(count).is_err() {
        let bytes = (count * size_of::<([u32; 2], i32)>()) as u64;
        let fix = "give a smaller mesh, or allow the process more memory".into();
        return Err(Error::OutOfMemory { what: "a mesh's edges".into(), bytes, fix });
    }
    let turn = |(from, to): (u32, u32)| ([from.min(to), from.max(to)], if from < to { 1 } else { -1 });
    edges.extend(mesh.triangles().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)].map(turn)));
    edges.sort_unstable();
    let turns = |uses: &[([u32; 2], i32)]| uses.iter().map(|(_, turn)| turn).sum::<i32>();
    Ok(edges.chunk_by(|a, b| a.0 == b.0).all(|uses| turns(uses) == 0))
}

/// The lowest corner and the side of a cube slightly larger than the meshes' bounding box.
pub fn cube_around(meshes: &[&Mesh]) -> ([f64; 3], f64) {
    let boxes: Vec<_> = meshes.iter().filter_map(|m| m.bounds()).collect();
    let reach = |axis: usize| {
        let low = boxes.iter().map(|(low, _)| f64::from(low[axis])).fold(f64::INFINITY, f64::min);
        let high = boxes.iter().map(|(_, high)| f64::from(high[axis])).fold(f64::NEG_INFINITY, f64::max);
        if low <= high { (low, high) } else { (0.0, 0.0) }
    };
    let reaches = [0, 1, 2].map(reach);
    let side = reaches.iter().map(|(low, high)| high - low).fold(1e-30, f64::max) * (1.0 + MARGIN);
    (reaches.map(|(low, high)| (low + high - side) / 2.0), side)
}

struct Grid {
    low: [f64; 3],
    step: f64,
    resolution: usize,
}

impl Grid {
    /// A voxel's centre along an axis.
    fn center(&self, axis: usize, i: usize) -> f64 {
        self.low[axis] + (i as f64 + 0.5 + ASIDE[axis]) * self.step
    }

    /// Calls `each` for every voxel with the crossings along an axis, counted with their directions: those before its centre and
    /// those of the whole line. A few rows of columns are walked at a time.
    fn walk(&self, mesh: &Mesh, axis: usize, mut each: impl FnMut(usize, i32, i32)) {
        let rows = (MOST_COUNTED / self.resolution.pow(2)).max(1);
        for first in (0..self.resolution).step_by(rows) {
            self.walk_rows(mesh, axis, first..(first + rows).min(self.resolution), &mut each);
        }
    }

    fn walk_rows(
        &self,
        mesh: &Mesh,
        axis: usize,
        rows: std::ops::Range<usize>,
        each: &mut impl FnMut(usize, i32, i32),
    ) {
        let n = self.resolution;
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let centers: Vec<f64> = (0..n).map(|k| self.center(axis, k)).collect();
        // For each column of voxels, the directions of the triangles that its line crosses between a voxel's centre and the
        // one before it, added up: however many triangles there are, this takes no more memory. Those behind the last
        // centre count last.
        let mut changes = vec![0i32; rows.len() * n * (n + 1)];
        for triangle in mesh.triangles() {
            let corners = triangle.map(|i| mesh.positions()[i as usize].map(f64::from));
            let [us, vs] = [u, v].map(|axis| self.range(axis, corners.map(|c| c[axis])));
            for j in vs.start.max(rows.start)..vs.end.min(rows.end) {
                for i in us.clone() {
                    let at = [self.center(u, i), self.center(v, j)];
                    if let Some((position, sign)) = crossing(&corners, [axis, u, v], at) {
                        let behind = centers.partition_point(|center| position >= *center || position.is_nan());
                        changes[((j - rows.start) * n + i) * (n + 1) + behind] += sign;
                    }
                }
            }
        }
        let strides = [1, n, n * n];
        for (column, changes) in changes.chunks_exact(n + 1).enumerate() {
            let total: i32 = changes.iter().sum();
            let mut before = 0;
            for (k, change) in changes[..n].iter().enumerate() {
                before += change;
                let at = k * strides[axis] + column % n * strides[u] + (rows.start + column / n) * strides[v];
                each(at, before, total);
            }
        }
    }

    /// The range of voxels whose centres may lie between the corners along an axis.
    fn range(&self, axis: usize, corners: [f64; 3]) -> std::ops::Range<usize> {
        let index = |x: f64| ((x - self.low[axis]) / self.step - 0.5).clamp(-1.0, self.resolution as f64);
        let low = index(corners.iter().copied().fold(f64::INFINITY, f64::min)).floor().max(0.0) as usize;
        let high = index(corners.iter().copied().fold(f64::NEG_INFINITY, f64::max)).ceil() + 1.0;
        low..(high.max(0.0) as usize).min(self.resolution)
    }
}

/// Where the line along `axis` at `[u, v]` meets a triangle, and +1 or -1 by the side it comes from. A line on an edge
/// that two triangles share meets exactly one of them.
fn crossing(corners: &[[f64; 3]; 3], [axis, u, v]: [usize; 3], at: [f64; 2]) -> Option<(f64, i32)> {
    // The result for (a, b) is exactly minus that for (b, a), so triangles that share an edge agree on its side.
    let beside = |a: &[f64; 3], b: &[f64; 3]| {
        let turned = (a[u], a[v]) > (b[u], b[v]);
        let (a, b) = if turned { (b, a) } else { (a, b) };
        let side = (b[u] - a[u]) * (at[1] - a[v]) - (b[v] - a[v]) * (at[0] - a[u]);
        let side = if side == 0.0 { f64::MIN_POSITIVE } else { side };
        if turned { -side } else { side }
    };
    let [a, b, c] = corners;
    let sides = [beside(b, c), beside(c, a), beside(a, b)];
    let sign = if sides.iter().all(|s| *s > 0.0) {
        1
    } else if sides.iter().all(|s| *s < 0.0) {
        -1
    } else {
        return None;
    };
    let position = (sides[0] * a[axis] + sides[1] * b[axis] + sides[2] * c[axis]) / sides.iter().sum::<f64>();
    Some((position, sign))
}
