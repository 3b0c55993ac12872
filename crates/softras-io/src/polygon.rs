//! Triangulates polygons in their plane: convex ones as a fan, others by ear clipping.

use crate::source::is_point;
use glam::DVec3;

/// Cutting off ears takes time up to the square of the number of corners, so larger concave polygons are refused.
const MAX_CONCAVE: usize = 2048;

/// The remedy for a polygon that is not cut.
pub const FIX: &str = "triangulate it in a modelling program";

/// The note on polygons that are not simple.
pub const NOT_SIMPLE: &str = "polygons that cross themselves or have no area are not tiled exactly";

/// The note on polygons that cannot be placed.
pub const STRAYS: &str = "faces with corners that are no vertices of the file are left out";

/// A polygon's triangles.
pub struct Cut {
    /// Corner numbers; always two triangles fewer than corners.
    pub triangles: Vec<[usize; 3]>,
    /// False when the polygon crosses itself or has no area: its triangles then cannot tile it.
    pub is_simple: bool,
}

/// Cuts a polygon of three or more of some positions.
///
/// # Errors
/// A text that tells what is wrong, for a concave polygon of more than 2048 corners.
pub fn of(corners: &[u32], positions: &[[f64; 3]]) -> Result<Cut, String> {
    if corners.len() == 3 {
        return Ok(Cut { triangles: vec![[0, 1, 2]], is_simple: true });
    }
    if let Some(bad) = corners.iter().position(|&corner| !is_point(&positions[corner as usize])) {
        // All triangles have this corner, so that the polygon is left out as one.
        let n = corners.len();
        let triangles = (1..n - 1).map(|i| [bad, (bad + i) % n, (bad + i + 1) % n]).collect();
        return Ok(Cut { triangles, is_simple: true });
    }
    triangulate(&corners.iter().map(|&corner| positions[corner as usize]).collect::<Vec<_>>())
}

fn triangulate(corners: &[[f64; 3]]) -> Result<Cut, String> {
    let flat = project(corners);
    if is_convex(&flat) {
        return Ok(Cut { triangles: (2..corners.len()).map(|c| [0, c - 1, c]).collect(), is_simple: true });
    }
    if corners.len() > MAX_CONCAVE {
        return Err(format!("concave face of {} corners, more than {MAX_CONCAVE}", corners.len()));
    }
    Ok(clip_ears(&flat))
}

/// Projects along the largest axis of the polygon's (Newell's) normal so that the polygon turns left.
fn project(corners: &[[f64; 3]]) -> Vec<[f64; 2]> {
    // Relative to the first corner, because the products would cancel far from the origin.
    let corners: Vec<DVec3> = corners.iter().map(|&c| DVec3::from(c) - DVec3::from(corners[0])).collect();
    let next = corners.iter().cycle().skip(1);
    let normal: DVec3 = corners.iter().zip(next).map(|(a, &b)| a.cross(b)).sum();
    let axis = (0..3).fold(0, |best, k| if normal[k].abs() > normal[best].abs() { k } else { best });
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let side = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    corners.iter().map(|c| [side * c[x], c[y]]).collect()
}

/// Twice the signed area of the triangle a, b, c: above 0 for a left turn.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether there are only left turns, also as seen from the first corner (a pentagram turns left at every corner).
fn is_convex(polygon: &[[f64; 2]]) -> bool {
    let n = polygon.len();
    let left = |a: usize, b: usize, c: usize| turn(polygon[a % n], polygon[b % n], polygon[c % n]) >= 0.0;
    let area: f64 = (2..n).map(|i| turn(polygon[0], polygon[i - 1], polygon[i])).sum();
    area > 0.0 && (0..n).all(|i| left(i, i + 1, i + 2) && left(0, i, i + 1))
}

/// Cuts off ears, corners that stick out and whose triangle holds no other corner, until a triangle is left.
///
/// A corner that lies outside a triangle stays outside, and one that lies inside blocks it until it is cut off itself. So
/// each triangle's search for a blocker goes on where it stopped, and since a cut makes two new triangles, all searches
/// together pass over at most three times the square of the number of corners.
///
/// The crate earcut is not used because it drops corners on straight edges, where neighbours would come apart.
fn clip_ears(polygon: &[[f64; 2]]) -> Cut {
    let mut rest = Rest::new(polygon);
    let mut cut = Cut { triangles: Vec::with_capacity(polygon.len() - 2), is_simple: true };
    let mut at = 0;
    for left in (4..=polygon.len()).rev() {
        let mut tip = at;
        let ear = (0..left).find_map(|_| {
            let candidate = tip;
            tip = rest.next[tip];
            rest.is_ear(candidate).then_some(candidate)
        });
        // A simple polygon always has an ear. If there is none, the polygon crosses itself, and any corner is cut off.
        cut.is_simple &= ear.is_some();
        let tip = ear.unwrap_or(at);
        cut.triangles.push([rest.previous[tip], tip, rest.next[tip]]);
        // Continuing behind the ear makes fewer slivers.
        at = rest.next[rest.next[tip]];
        rest.remove(tip);
    }
    let first = (0..polygon.len()).find(|&corner| !rest.is_gone[corner]).unwrap_or_default();
    cut.triangles.push([first, rest.next[first], rest.next[rest.next[first]]]);
    cut
}

/// The corners that are not cut off yet, as a ring.
struct Rest<'a> {
    polygon: &'a [[f64; 2]],
    previous: Vec<usize>,
    next: Vec<usize>,
    is_gone: Vec<bool>,
    /// For each corner, all corners before this one are outside the triangle that it makes with its neighbours, or gone.
    outside_before: Vec<usize>,
}

impl<'a> Rest<'a> {
    fn new(polygon: &'a [[f64; 2]]) -> Self {
        let n = polygon.len();
        Self {
            polygon,
            previous: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            is_gone: vec![false; n],
            outside_before: vec![0; n],
        }
    }

    /// Whether a corner sticks out and its triangle holds no other corner.
    fn is_ear(&mut self, tip: usize) -> bool {
        let [a, b, c] = [self.previous[tip], tip, self.next[tip]].map(|i| self.polygon[i]);
        if turn(a, b, c) <= 0.0 {
            return false;
        }
        let inside = |p: [f64; 2]| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
        let blocks = |p: [f64; 2]| p != a && p != b && p != c && inside(p);
        let from = self.outside_before[tip];
        let blocker = (from..self.polygon.len()).find(|&i| !self.is_gone[i] && blocks(self.polygon[i]));
        self.outside_before[tip] = blocker.unwrap_or(self.polygon.len());
        blocker.is_none()
    }

    fn remove(&mut self, tip: usize) {
        let (previous, next) = (self.previous[tip], self.next[tip]);
        (self.next[previous], self.previous[next]) = (next, previous);
        self.is_gone[tip] = true;
        // Their triangles are new.
        (self.outside_before[previous], self.outside_before[next]) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f64; 3]], triangles: &[[usize; 3]]) -> f64 {
        let flat = project(corners);
        triangles.iter().map(|t| turn(flat[t[0]], flat[t[1]], flat[t[2]])).inspect(|a| assert!(*a >= 0.0)).sum::<f64>()
            / 2.0
    }

    fn cut(corners: &[[f64; 3]]) -> Cut {
        triangulate(corners).unwrap_or(Cut { triangles: Vec::new(), is_simple: false })
    }

    #[test]
    fn a_convex_quad_is_a_fan_from_its_first_corner() {
        let quad = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]];
        assert_eq!(cut(&quad).triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_concave_polygon_is_tiled_exactly_in_any_plane_and_winding() {
        let arrow = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];
        let lift: [fn([f64; 2]) -> [f64; 3]; 4] = [
            |[x, y]| [x, y, 7.0],
            |[x, y]| [x, 7.0, y],
            |[x, y]| [x + 2.0 * y, y, x - y],
            |[x, y]| [1e6 + x, 1e6 - y, 1e6],
        ];
        for lift in lift {
            let corners = arrow.map(lift);
            let cut = cut(&corners);
            assert!(cut.is_simple);
            assert_eq!(cut.triangles.len(), 3);
            let flat = project(&corners);
            let whole: f64 = (2..5).map(|i| turn(flat[0], flat[i - 1], flat[i])).sum::<f64>() / 2.0;
            assert!((area(&corners, &cut.triangles) - whole).abs() < 1e-9);
        }
    }

    #[test]
    fn a_comb_of_many_teeth_is_tiled_exactly() {
        let mut comb = vec![[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]];
        comb.extend((0..200).rev().map(|i| [f64::from(i) / 2.0, if i % 2 == 0 { 1.0 } else { 5.0 }, 0.0]));
        let cut = cut(&comb);
        assert!(cut.is_simple);
        let whole = {
            let flat = project(&comb);
            (2..flat.len()).map(|i| turn(flat[0], flat[i - 1], flat[i])).sum::<f64>() / 2.0
        };
        assert!((area(&comb, &cut.triangles) - whole).abs() < 1e-9);
    }

    /// A double spiral has few ears at a time, and most corners that stick out are blocked.
    #[test]
    fn spirals_of_thousands_of_corners_are_cut_in_no_time() {
        let arm = |grow: f64| (0..1024).map(move |i| (f64::from(i) * 0.2, grow + 0.01 * f64::from(i)));
        let turns = arm(1.0).chain(arm(1.005).rev().collect::<Vec<_>>());
        let spiral: Vec<_> = turns.map(|(angle, radius)| [radius * angle.cos(), radius * angle.sin(), 0.0]).collect();
        let begin = std::time::Instant::now();
        for _ in 0..20 {
            assert_eq!(cut(&spiral).triangles.len(), 2046);
        }
        assert!(begin.elapsed().as_secs_f64() < 10.0, "{:?}", begin.elapsed());
    }

    #[test]
    fn what_cannot_be_tiled_is_said() {
        let bow_tie = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let point = [[1.0, 2.0, 3.0]; 5];
        for polygon in [&bow_tie[..], &point[..]] {
            let cut = cut(polygon);
            assert!(!cut.is_simple);
            assert_eq!(cut.triangles.len(), polygon.len() - 2);
        }
        let mut huge = vec![[0.5, 0.0, 0.0]];
        huge.extend((0..3000).map(|i| [f64::from(i % 2), f64::from(i), 0.0]));
        assert!(triangulate(&huge).is_err());
    }
}
