//! The nearest point of a surface, by a tree of boxes around its triangles. It is our own: parry3d-f64's is as fast on 25,000
//! triangles and twice as fast on 400,000, but takes 18 crates, a second glam among them, and 45 s of compile time.

use glam::DVec3;

/// The most triangles of a box that is not divided.
const LEAF: usize = 4;

/// A surface's triangles in a tree of boxes, with the colours and the wanted edge lengths of the surface's vertices.
pub struct Nearest {
    /// In the order of the boxes.
    triangles: Vec<Triangle>,
    boxes: Vec<Node>,
    colors: Vec<DVec3>,
    sizes: Vec<f64>,
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [u32; 3],
    positions: [DVec3; 3],
}

/// A box around the triangles of a range; each of its two children has half of the range.
struct Node {
    low: DVec3,
    high: DVec3,
    begin: usize,
    end: usize,
    /// The second child; the first one is the next box. `None` for a leaf.
    second: Option<usize>,
}

impl Node {
    fn distance_squared(&self, point: DVec3) -> f64 {
        point.clamp(self.low, self.high).distance_squared(point)
    }
}

/// A point of a surface, with the colour and the wanted edge length there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    pub point: DVec3,
    /// `None` for a surface without vertex colours.
    pub color: Option<DVec3>,
    /// The length that edges are to have.
    pub size: f64,
}

impl Nearest {
    /// `colors` is empty for a surface without vertex colours.
    pub fn new(
        positions: &[DVec3],
        triangles: impl Iterator<Item = [u32; 3]>,
        colors: Vec<DVec3>,
        sizes: Vec<f64>,
    ) -> Self {
        let place = |corners: [u32; 3]| Triangle { corners, positions: corners.map(|v| positions[v as usize]) };
        let triangles: Vec<Triangle> = triangles.map(place).collect();
        let count = triangles.len();
        let mut nearest = Self { triangles, boxes: Vec::new(), colors, sizes };
        nearest.add(0, count);
        nearest
    }

    /// Adds the box of a range of triangles, and those within it. Halving the range bounds the depth of the tree.
    fn add(&mut self, begin: usize, end: usize) {
        let range = &mut self.triangles[begin..end];
        let corners = range.iter().flat_map(|triangle| triangle.positions);
        let (low, high) = corners
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| (low.min(corner), high.max(corner)));
        let at = self.boxes.len();
        self.boxes.push(Node { low, high, begin, end, second: None });
        if end - begin <= LEAF {
            return;
        }
        let size = (high - low).to_array();
        let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
        let middle = (end - begin) / 2;
        let along = |triangle: &Triangle| triangle.positions.iter().map(|p| p[axis]).sum::<f64>();
        range.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)));
        self.add(begin, begin + middle);
        self.boxes[at].second = Some(self.boxes.len());
        self.add(begin + middle, end);
    }

    /// The nearest point within a distance, on triangles that face about the same way as `normal`, or on any if `normal` is 0.
    pub fn find(&self, point: DVec3, normal: DVec3, within: f64) -> Option<SurfacePoint> {
        let (mut best, mut least) = (None, within * within);
        let mut next = vec![0];
        while let Some(at) = next.pop() {
            let node = &self.boxes[at];
            if node.distance_squared(point) > least {
                continue;
            }
            if let Some(second) = node.second {
                // The nearer one is looked at first.
                let mut children = [at + 1, second];
                let far = |child: &usize| self.boxes[*child].distance_squared(point);
                children.sort_by(|a, b| far(b).total_cmp(&far(a)));
                next.extend(children);
                continue;
            }
            for triangle in &self.triangles[node.begin..node.end] {
                let [a, b, c] = triangle.positions;
                if normal != DVec3::ZERO && (b - a).cross(c - a).dot(normal) <= 0.0 {
                    continue;
                }
                let shares = shares_nearest(point, [a, b, c]);
                let distance = mixed(shares, [a, b, c]).distance_squared(point);
                if distance <= least {
                    (best, least) = (Some((triangle, shares)), distance);
                }
            }
        }
        best.map(|(triangle, shares)| self.at(triangle, shares))
    }

    /// The point of a triangle with these barycentric coordinates.
    fn at(&self, triangle: &Triangle, shares: [f64; 3]) -> SurfacePoint {
        let corners = triangle.corners.map(|v| v as usize);
        let color = (!self.colors.is_empty()).then(|| mixed(shares, corners.map(|v| self.colors[v])));
        let size = corners.iter().zip(shares).map(|(v, share)| share * self.sizes[*v]).sum();
        SurfacePoint { point: mixed(shares, triangle.positions), color, size }
    }
}

fn mixed(shares: [f64; 3], corners: [DVec3; 3]) -> DVec3 {
    shares[0] * corners[0] + shares[1] * corners[1] + shares[2] * corners[2]
}

/// The barycentric coordinates of the point of a triangle that is nearest to a point.
fn shares_nearest(point: DVec3, corners: [DVec3; 3]) -> [f64; 3] {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    if area > 0.0 {
        // Barycentric coordinates of the point's projection to the plane.
        let from = point - a;
        let (v, w) = (from.cross(ac).dot(normal) / area, ab.cross(from).dot(normal) / area);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return [1.0 - v - w, v, w];
        }
    }
    let on_edge = |from: usize, to: usize| {
        let along = corners[to] - corners[from];
        let part = (point - corners[from]).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        let part = part.clamp(0.0, 1.0);
        let mut shares = [0.0; 3];
        (shares[from], shares[to]) = (1.0 - part, part);
        shares
    };
    let far = |shares: &[f64; 3]| mixed(*shares, corners).distance_squared(point);
    let edges = [on_edge(0, 1), on_edge(1, 2), on_edge(2, 0)];
    edges.into_iter().fold(edges[0], |best, shares| if far(&shares) < far(&best) { shares } else { best })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::points;
    use softras::{Mesh, shapes};

    /// Colours are positions, and sizes are x.
    fn nearest(mesh: &Mesh) -> Nearest {
        let positions = points(mesh);
        let sizes = positions.iter().map(|p| p.x).collect();
        Nearest::new(&positions, mesh.triangles().iter().copied(), positions.clone(), sizes)
    }

    /// The distance to the nearest of points all over every triangle.
    fn tried(mesh: &Mesh, point: DVec3) -> f64 {
        const N: usize = 60;
        let corners = points(mesh);
        let parts = (0..=N).flat_map(|i| (0..=N - i).map(move |j| (i as f64 / N as f64, j as f64 / N as f64)));
        let triangles: Vec<[DVec3; 3]> = mesh.triangles().iter().map(|t| t.map(|v| corners[v as usize])).collect();
        let points = parts.flat_map(|(v, w)| triangles.iter().map(move |[a, b, c]| *a + v * (*b - *a) + w * (*c - *a)));
        points.map(|there| there.distance(point)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_nearest_point_is_that_of_all_triangles() {
        let mesh = shapes::torus(0.7, 0.3, 9, 7).unwrap();
        let nearest = nearest(&mesh);
        for i in 0..40 {
            // Points all over a box around the torus.
            let part = |by: f64| 2.6 * (f64::from(i) * by).fract() - 1.3;
            let point = DVec3::new(part(0.618_034), part(0.754_878), 0.6 * part(0.569_84));
            let found = nearest.find(point, DVec3::ZERO, f64::INFINITY).unwrap();
            let (distance, expected) = (found.point.distance(point), tried(&mesh, point));
            assert!(distance <= expected + 1e-12 && distance > expected - 0.01, "{point}: {distance}, {expected}");
            assert!(nearest.find(point, DVec3::ZERO, 0.99 * distance).is_none());
            assert!(nearest.find(found.point, DVec3::ZERO, 1e-9).is_some(), "the point is on the surface");
            // Colours and lengths are interpolated: here they are the position.
            assert!(found.color.unwrap().distance(found.point) < 1e-12);
            assert!((found.size - found.point.x).abs() < 1e-12);
        }
    }

    #[test]
    fn the_other_side_of_a_sheet_is_left_out() {
        let corners = |z: f32| [[-1.0, -1.0, z], [1.0, -1.0, z], [0.0, 1.0, z]];
        let positions = [corners(0.0), corners(-0.1)].concat();
        let sheets = nearest(&Mesh::new(positions, vec![[0, 1, 2], [3, 5, 4]]).unwrap());
        let below = DVec3::new(0.0, 0.0, -0.08);
        let found = |nearest: &Nearest, point: DVec3, normal: DVec3| nearest.find(point, normal, 2.0).map(|f| f.point);
        assert_eq!(found(&sheets, below, DVec3::Z), Some(DVec3::ZERO));
        assert!(found(&sheets, below, DVec3::ZERO).unwrap().distance(DVec3::new(0.0, 0.0, -0.1)) < 1e-6);
        // A needle without area, and nothing at all.
        let needle = nearest(&Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], vec![[0, 1, 2]]).unwrap());
        assert_eq!(found(&needle, DVec3::new(0.5, 1.0, 0.0), DVec3::ZERO), Some(0.5 * DVec3::X));
        let nothing = nearest(&Mesh::new(Vec::new(), Vec::new()).unwrap());
        assert_eq!(nothing.find(DVec3::ZERO, DVec3::ZERO, 1.0), None);
    }
}
