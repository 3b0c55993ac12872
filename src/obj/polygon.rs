//! Triangulates polygons in their plane: convex ones as a fan, others by ear clipping.

use glam::DVec3;

/// Ear clipping takes time up to the cube of the number of corners, so larger concave polygons are refused.
const MAX_CONCAVE: usize = 2048;

/// A polygon's triangles.
pub(crate) struct Cut {
    /// Corner numbers; always two triangles fewer than corners.
    pub triangles: Vec<[usize; 3]>,
    /// False when the polygon crosses itself or has no area: its triangles then cannot tile it.
    pub is_simple: bool,
}

/// Cuts a polygon of three or more corners.
///
/// # Errors
/// What is wrong, for a concave polygon of more than 2048 corners.
pub(crate) fn triangulate(corners: &[[f64; 3]]) -> Result<Cut, String> {
    let fan = || (2..corners.len()).map(|c| [0, c - 1, c]).collect();
    if corners.len() == 3 {
        return Ok(Cut { triangles: fan(), is_simple: true });
    }
    let flat = project(corners);
    if is_convex(&flat) {
        return Ok(Cut { triangles: fan(), is_simple: true });
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

fn clip_ears(polygon: &[[f64; 2]]) -> Cut {
    let mut rest: Vec<usize> = (0..polygon.len()).collect();
    let mut cut = Cut { triangles: Vec::with_capacity(polygon.len() - 2), is_simple: true };
    let mut at = 0;
    while rest.len() > 3 {
        let n = rest.len();
        let ear = (0..n).map(|k| (at + k) % n).find(|&tip| is_ear(polygon, &rest, tip));
        // A simple polygon always has an ear. If there is none, the polygon crosses itself, and any corner is cut off.
        cut.is_simple &= ear.is_some();
        let tip = ear.unwrap_or(at % n);
        cut.triangles.push([rest[(tip + n - 1) % n], rest[tip], rest[(tip + 1) % n]]);
        rest.remove(tip);
        // Continuing behind the ear makes fewer slivers.
        at = tip + 1;
    }
    cut.triangles.push([rest[0], rest[1], rest[2]]);
    cut
}

/// Whether the corner `tip` of the rest sticks out and its triangle holds no other corner.
fn is_ear(polygon: &[[f64; 2]], rest: &[usize], tip: usize) -> bool {
    let n = rest.len();
    let [a, b, c] = [tip + n - 1, tip, tip + 1].map(|i| polygon[rest[i % n]]);
    let inside = |p: [f64; 2]| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    turn(a, b, c) > 0.0 && !rest.iter().map(|&i| polygon[i]).any(|p| p != a && p != b && p != c && inside(p))
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
