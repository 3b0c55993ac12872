//! The nearest point of a surface, by a tree of boxes around its triangles.

use glam::DVec3;

/// The most triangles of a box that is not divided.
const LEAF: usize = 4;

/// A surface's triangles in a tree of boxes.
pub(super) struct Nearest {
    /// In the order of the boxes.
    triangles: Vec<[DVec3; 3]>,
    boxes: Vec<Node>,
}

/// A box around the triangles of a range, which its two children share between them.
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

impl Nearest {
    pub fn new(triangles: Vec<[DVec3; 3]>) -> Self {
        let count = triangles.len();
        let mut nearest = Self { triangles, boxes: Vec::new() };
        nearest.add(0, count);
        nearest
    }

    /// Adds the box of a range of triangles, and those within it. Halving the range bounds the depth of the tree.
    fn add(&mut self, begin: usize, end: usize) {
        let range = &mut self.triangles[begin..end];
        let (low, high) = range
            .iter()
            .flatten()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| (low.min(*corner), high.max(*corner)));
        let at = self.boxes.len();
        self.boxes.push(Node { low, high, begin, end, second: None });
        if end - begin <= LEAF {
            return;
        }
        let size = (high - low).to_array();
        let axis = (0..3).fold(0, |longest, axis| if size[axis] > size[longest] { axis } else { longest });
        let middle = (end - begin) / 2;
        let along = |[a, b, c]: &[DVec3; 3]| a[axis] + b[axis] + c[axis];
        range.select_nth_unstable_by(middle, |a, b| along(a).total_cmp(&along(b)));
        self.add(begin, begin + middle);
        self.boxes[at].second = Some(self.boxes.len());
        self.add(begin + middle, end);
    }

    /// The nearest point within a distance, of the triangles that face about the same way as `normal`, or of all where it is 0.
    pub fn point(&self, point: DVec3, normal: DVec3, within: f64) -> Option<DVec3> {
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
                let [a, b, c] = *triangle;
                let found = on_triangle(point, triangle);
                let distance = found.distance_squared(point);
                if distance <= least && (normal == DVec3::ZERO || (b - a).cross(c - a).dot(normal) > 0.0) {
                    (best, least) = (Some(found), distance);
                }
            }
        }
        best
    }
}

/// The point of a triangle that is nearest to a point.
fn on_triangle(point: DVec3, &[a, b, c]: &[DVec3; 3]) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let area = normal.length_squared();
    if area > 0.0 {
        // Barycentric coordinates of the point's projection to the plane.
        let from = point - a;
        let (v, w) = (from.cross(ac).dot(normal) / area, ab.cross(from).dot(normal) / area);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return a + v * ab + w * ac;
        }
    }
    let on_edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let part = (point - p).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        p + part.clamp(0.0, 1.0) * along
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    edges.into_iter().min_by(|p, q| p.distance_squared(point).total_cmp(&q.distance_squared(point))).unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    /// The nearest point by trying points all over every triangle.
    fn tried(triangles: &[[DVec3; 3]], point: DVec3) -> f64 {
        const N: usize = 60;
        let parts = (0..=N).flat_map(|i| (0..=N - i).map(move |j| (i as f64 / N as f64, j as f64 / N as f64)));
        let places = parts.flat_map(|(v, w)| triangles.iter().map(move |[a, b, c]| *a + v * (*b - *a) + w * (*c - *a)));
        places.map(|place| place.distance(point)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_nearest_point_is_that_of_all_triangles() {
        let mesh = shapes::torus(0.7, 0.3, 9, 7).unwrap();
        let corner = |v: u32| DVec3::from(mesh.positions()[v as usize].map(f64::from));
        let triangles: Vec<[DVec3; 3]> = mesh.triangles().iter().map(|t| t.map(corner)).collect();
        let nearest = Nearest::new(triangles.clone());
        for i in 0..40 {
            // Points all over a box around the torus.
            let part = |by: f64| 2.6 * (f64::from(i) * by).fract() - 1.3;
            let point = DVec3::new(part(0.618_034), part(0.754_878), 0.6 * part(0.569_84));
            let found = nearest.point(point, DVec3::ZERO, f64::INFINITY).unwrap();
            let (distance, expected) = (found.distance(point), tried(&triangles, point));
            assert!(distance <= expected + 1e-12 && distance > expected - 0.01, "{point}: {distance}, {expected}");
            assert!(nearest.point(point, DVec3::ZERO, 0.99 * distance).is_none());
            assert!(nearest.point(found, DVec3::ZERO, 1e-9).is_some(), "the point is on the surface");
        }
    }

    #[test]
    fn the_other_side_of_a_sheet_is_left_out() {
        let sheet = |z: f64, turned: bool| {
            let [a, b, c] = [DVec3::new(-1.0, -1.0, z), DVec3::new(1.0, -1.0, z), DVec3::new(0.0, 1.0, z)];
            if turned { [a, c, b] } else { [a, b, c] }
        };
        let nearest = Nearest::new(vec![sheet(0.0, false), sheet(-0.1, true)]);
        let below = DVec3::new(0.0, 0.0, -0.08);
        assert_eq!(nearest.point(below, DVec3::Z, 1.0), Some(DVec3::ZERO));
        assert_eq!(nearest.point(below, DVec3::ZERO, 1.0), Some(DVec3::new(0.0, 0.0, -0.1)));
        // A needle without area, and nothing at all.
        let needle = Nearest::new(vec![[DVec3::ZERO, DVec3::X, DVec3::X]]);
        assert_eq!(needle.point(DVec3::new(0.5, 1.0, 0.0), DVec3::ZERO, 2.0), Some(0.5 * DVec3::X));
        assert_eq!(Nearest::new(Vec::new()).point(DVec3::ZERO, DVec3::ZERO, 1.0), None);
    }
}
