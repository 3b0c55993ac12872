//! The surface of a hull, and regions of it.

use crate::{Topology, mesh::regions::regions, photographs::seen::areas, points};
use glam::DVec3;
use softras::{Mesh, Result};

/// This quantile of the vertices' errors counts as the largest.
const LARGEST: f64 = 0.97;
/// How often the outline of a region is evened out.
const OUTLINE_PASSES: usize = 4;
/// The least length of a region's mean unit normal: a region that is more bent is no lid.
const LEAST_FLATNESS: f64 = 0.75;
/// The least area of a region, as a share of the mesh's.
const LEAST_SHARE: f64 = 0.015;
/// Directions from the centre of a region in which its outline is moved.
const SIDES: usize = 8;

/// A mesh with its topology and areas.
pub struct Surface<'a> {
    mesh: &'a Mesh,
    topology: Topology,
    positions: Vec<DVec3>,
    /// For each vertex, a third of its triangles' area vectors.
    areas: Vec<DVec3>,
}

/// Vertices that may lie over a hollow.
#[derive(Clone)]
pub struct Region {
    pub is_in: Vec<bool>,
    center: DVec3,
    /// The unit normal.
    normal: DVec3,
    /// The distance from the centre to the other side of the mesh.
    depth: f64,
}

impl Region {
    /// Unit vectors from the centre to the sides.
    pub fn sides(&self) -> [DVec3; SIDES] {
        let (x, y) = self.normal.any_orthonormal_pair();
        let angle = |i: usize| std::f64::consts::TAU * i as f64 / SIDES as f64;
        std::array::from_fn(|i| angle(i).cos() * x + angle(i).sin() * y)
    }

    /// Whether a point is nearer to this side than to the others, seen from the centre.
    fn is_at(&self, point: DVec3, side: &DVec3) -> bool {
        let from = (point - self.center).reject_from_normalized(self.normal);
        from.dot(*side) >= (std::f64::consts::PI / SIDES as f64).cos() * from.length()
    }
}

impl<'a> Surface<'a> {
    pub fn new(mesh: &'a Mesh) -> Result<Self> {
        Ok(Self { mesh, topology: Topology::of(mesh)?, positions: points(mesh), areas: areas(mesh) })
    }

    /// The mean with the neighbours, twice.
    pub fn smoothed(&self, mut values: Vec<f64>) -> Vec<f64> {
        for _ in 0..2 {
            let mean = |v: usize| {
                let around = self.topology.neighbors(v);
                (values[v] + around.iter().map(|n| values[*n as usize]).sum::<f64>()) / (1 + around.len()) as f64
            };
            values = (0..values.len()).map(mean).collect();
        }
        values
    }

    /// The connected regions where the errors are above a share of the largest, with what they enclose.
    pub fn regions(&self, errors: &[f64], level: f64) -> Vec<Region> {
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let largest = sorted.get((LARGEST * sorted.len() as f64) as usize).copied().unwrap_or(0.0);
        let is_wrong: Vec<bool> = errors.iter().map(|error| *error > level * largest).collect();
        let parts = self.parts(|v| is_wrong[v]);
        parts.iter().filter_map(|part| self.region(part)).collect()
    }

    /// The connected sets of vertices of a kind.
    fn parts(&self, is_in: impl Fn(usize) -> bool) -> Vec<Vec<usize>> {
        let beside = |v, around: &mut Vec<usize>| around.extend(self.topology.neighbors(v).iter().map(|n| *n as usize));
        regions(self.positions.len(), is_in, beside)
    }

    /// The region of a part, unless it is too small or too bent, or nothing is opposite of it.
    fn region(&self, part: &[usize]) -> Option<Region> {
        let mut is_in = vec![false; self.positions.len()];
        part.iter().for_each(|&v| is_in[v] = true);
        // The part encloses every connected set of the other vertices but the largest.
        let mut beside = self.parts(|v| !is_in[v]);
        beside.sort_by_key(Vec::len);
        beside.pop();
        beside.concat().into_iter().for_each(|v| is_in[v] = true);
        // A ragged outline would become ragged walls.
        let mut share: Vec<f64> = is_in.iter().map(|&is_in| f64::from(u8::from(is_in))).collect();
        for _ in 0..OUTLINE_PASSES {
            share = self.smoothed(share);
        }
        is_in = share.into_iter().map(|share| share > 0.5).collect();
        let inner = || (0..is_in.len()).filter(|&v| is_in[v]);
        let area: f64 = inner().map(|v| self.areas[v].length()).sum();
        let normal: DVec3 = inner().map(|v| self.areas[v]).sum();
        if area < LEAST_SHARE * self.area() || normal.length() < LEAST_FLATNESS * area {
            return None;
        }
        let normal = normal.normalize();
        let center = inner().map(|v| self.positions[v] * self.areas[v].length()).sum::<DVec3>() / area;
        let depth = self.depth(center, normal)?;
        Some(Region { is_in, center, normal, depth })
    }

    fn area(&self) -> f64 {
        self.areas.iter().map(|area| area.length()).sum()
    }

    /// The region with the ring of vertices around it, or without its own outermost ring; at one of its sides alone, if one is
    /// given.
    pub fn ringed(&self, region: &Region, grows: bool, side: Option<&DVec3>) -> Region {
        let changes = |v: usize| {
            side.is_none_or(|side| region.is_at(self.positions[v], side))
                && self.topology.neighbors(v).iter().any(|n| region.is_in[*n as usize] == grows)
        };
        let is_in = (0..region.is_in.len()).map(|v| region.is_in[v] ^ (region.is_in[v] != grows && changes(v)));
        Region { is_in: is_in.collect(), ..*region }
    }

    /// The distance from a point of the surface, against its normal, to the opposite side of the mesh.
    fn depth(&self, from: DVec3, normal: DVec3) -> Option<f64> {
        let hit = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| self.positions[v as usize]);
            let area = (b - a).cross(c - a);
            // Where a ray against the normal leaves the solid.
            let toward = -normal.dot(area);
            let along = (a - from).dot(area) / toward;
            let at = from - along * normal;
            let inside = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| (*q - *p).cross(at - *p).dot(area) >= 0.0);
            (toward > 0.0 && along > 0.0 && inside).then_some(along)
        };
        self.mesh.triangles().iter().filter_map(hit).min_by(f64::total_cmp)
    }

    /// The mesh with a region pushed inwards, by a share of the way to the other side.
    pub fn pushed(&self, region: &Region, share: f64) -> Result<Mesh> {
        let push =
            |(v, p): (usize, &DVec3)| if region.is_in[v] { *p - share * region.depth * region.normal } else { *p };
        let positions = self.positions.iter().enumerate().map(push).map(|p| p.as_vec3().to_array()).collect();
        Mesh::new(positions, self.mesh.triangles().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softras::shapes;

    const HEIGHT: f64 = 1.4;

    /// A box, and which of its vertices lie within its upper side, away from its edges.
    fn block() -> Result<(Mesh, Vec<bool>)> {
        let sphere = shapes::icosphere(4)?;
        let side = (0.5 * HEIGHT) as f32;
        let positions = sphere.positions().iter().map(|p| p.map(|x| (1.3 * x).clamp(-side, side))).collect();
        let block = Mesh::new(positions, sphere.triangles().to_vec())?;
        let on_lid = |p: &[f32; 3]| p[1] == side && p[0].abs() < 0.5 && p[2].abs() < 0.5;
        let is_in = block.positions().iter().map(on_lid).collect();
        Ok((block, is_in))
    }

    #[test]
    fn a_lid_is_found_and_pushed_to_the_other_side() -> Result<()> {
        let (block, is_in) = block()?;
        let surface = Surface::new(&block)?;
        // The middle of a lid, which looks right, belongs to it.
        let middle = |p: &[f32; 3]| p[0].abs() < 0.1 && p[2].abs() < 0.1;
        let looks_wrong = is_in.iter().zip(block.positions()).map(|(&is_in, p)| is_in && !middle(p));
        let errors: Vec<f64> = looks_wrong.map(|wrong| if wrong { 1.0 } else { 0.1 }).collect();
        let regions = surface.regions(&errors, 0.5);
        assert_eq!(regions.len(), 1);
        let region = &regions[0];
        // Its corners are rounded.
        let is_off = region.is_in.iter().zip(&is_in).filter(|(a, b)| a != b).count();
        let all = is_in.iter().filter(|is_in| **is_in).count();
        assert!(is_off < all / 5, "{is_off} of {all}");
        assert!(region.normal.distance(DVec3::Y) < 1e-3, "{}", region.normal);
        assert!((region.depth - HEIGHT).abs() < 1e-6, "{}", region.depth);
        let pushed = surface.pushed(region, 0.25)?;
        for ((from, to), is_in) in block.positions().iter().zip(pushed.positions()).zip(&region.is_in) {
            let sunk = if *is_in { 0.25 * HEIGHT } else { 0.0 };
            assert!((f64::from(from[1] - to[1]) - sunk).abs() < 1e-6 && (from[0] - to[0]).abs() < 1e-6);
        }
        let all = surface.ringed(region, true, None);
        let count = |region: &Region| region.is_in.iter().filter(|is_in| **is_in).count();
        assert!(count(&all) > count(region) && count(&surface.ringed(region, false, None)) < count(region));
        // The sides together grow as the whole does, each by vertices of its own direction.
        let mut by_sides = region.is_in.clone();
        for side in &region.sides() {
            let grown = surface.ringed(region, true, Some(side));
            for (v, (to, is_in)) in by_sides.iter_mut().zip(&grown.is_in).enumerate() {
                let from = surface.positions[v] - region.center;
                assert!(*is_in == region.is_in[v] || from.dot(*side) > 0.0);
                *to |= *is_in;
            }
            assert!(count(&grown) > count(region) && count(&grown) < count(&all));
        }
        assert_eq!(by_sides, all.is_in);
        Ok(())
    }

    #[test]
    fn what_is_no_lid_is_left_alone() -> Result<()> {
        let (block, is_in) = block()?;
        let surface = Surface::new(&block)?;
        // All around, a single vertex, and nothing.
        let one = is_in.iter().position(|is_in| *is_in);
        for errors in [vec![1.0; is_in.len()], (0..is_in.len()).map(|v| f64::from(Some(v) == one)).collect()] {
            assert!(surface.regions(&errors, 0.5).is_empty());
        }
        assert!(surface.regions(&vec![0.0; is_in.len()], 0.5).is_empty());
        Ok(())
    }
}
