//! A pixel against a triangle on the screen: inside or not, squared distance to the boundary, barycentrics.

use super::real::{Real, cross2, dot, lerp, sub};

/// A triangle whose doubled area is at most this times its longest edge squared has no inside.
const NO_AREA: f64 = 1e-10;

/// Where a pixel lies with respect to a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Location<R> {
    /// All barycentrics ≥ 0, so the border belongs to it; never for a triangle without area.
    pub inside: bool,
    /// d², squared distance to the nearest boundary point.
    pub distance2: R,
    /// b, barycentrics as they are; `None` for a triangle without area.
    pub barycentrics: Option<[R; 3]>,
    /// b̂: clamped to [0, 1] and divided by their sum, or those of the nearest boundary point if there is no area.
    pub clipped: [R; 3],
}

/// Edge k, opposite corner k, runs from corner k + 1 to corner k + 2.
fn edge<T: Copy>(corners: &[T; 3], k: usize) -> (T, T) {
    (corners[(k + 1) % 3], corners[(k + 2) % 3])
}

/// Twice the signed area, positive counter-clockwise with y up; `None` where it is too little to have an inside.
pub fn doubled_area<R: Real>(corners: &[[R; 2]; 3]) -> Option<R> {
    let area = cross2(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let longest = (0..3).map(|k| edge_length2(corners, k)).fold(0.0, f64::max);
    (area.value().abs() > NO_AREA * longest).then_some(area)
}

fn edge_length2<R: Real>(corners: &[[R; 2]; 3], k: usize) -> f64 {
    let (a, b) = edge(corners, k);
    let e = sub(b, a).map(Real::value);
    dot(e, e)
}

/// Squared distance from `pixel` to the segment a b, and the parameter t ∈ [0, 1] of its nearest point.
fn segment<R: Real>(a: [R; 2], b: [R; 2], pixel: [R; 2]) -> (R, R) {
    let along = sub(b, a);
    let length2 = dot(along, along);
    let t = if length2.value() > 0.0 { (dot(sub(pixel, a), along) / length2).clamp(0.0, 1.0) } else { R::zero() };
    let offset = sub(lerp(a, b, t), pixel);
    (dot(offset, offset), t)
}

/// Locates `pixel` (x, y on the screen).
pub fn locate<R: Real>(corners: &[[R; 2]; 3], pixel: [f64; 2]) -> Location<R> {
    let pixel = pixel.map(R::constant);
    let Some(area) = doubled_area(corners) else {
        return locate_on_longest_edge(corners, pixel);
    };
    let barycentrics = std::array::from_fn(|k| {
        let (a, b) = edge(corners, k);
        cross2(sub(a, pixel), sub(b, pixel)) / area
    });
    let clamped = barycentrics.map(|b| b.clamp(0.0, 1.0));
    let sum = clamped[0] + clamped[1] + clamped[2];
    let mut distance2 = segment(corners[1], corners[2], pixel).0;
    for k in 1..3 {
        let (a, b) = edge(corners, k);
        let other = segment(a, b, pixel).0;
        if other.value() < distance2.value() {
            distance2 = other;
        }
    }
    Location {
        inside: barycentrics.iter().all(|b| b.value() >= 0.0),
        distance2,
        barycentrics: Some(barycentrics),
        clipped: clamped.map(|b| b / sum),
    }
}

fn locate_on_longest_edge<R: Real>(corners: &[[R; 2]; 3], pixel: [R; 2]) -> Location<R> {
    let lengths: [f64; 3] = std::array::from_fn(|k| edge_length2(corners, k));
    // The first of equals: later edges must be longer.
    let longest = (1..3).fold(0, |best, k| if lengths[k] > lengths[best] { k } else { best });
    let (a, b) = edge(corners, longest);
    let (distance2, t) = segment(a, b, pixel);
    let mut clipped = [R::zero(); 3];
    if lengths[longest] > 0.0 {
        clipped[(longest + 1) % 3] = R::one() - t;
        clipped[(longest + 2) % 3] = t;
    } else {
        clipped[0] = R::one();
    }
    Location { inside: false, distance2, barycentrics: None, clipped }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

    #[test]
    fn inside_outside_and_corner() {
        let inside = locate(&RIGHT, [0.25, 0.5]);
        assert!(inside.inside);
        assert_eq!(inside.clipped, [0.25, 0.25, 0.5]);
        // The slanted edge is nearest: (1 - x - y)² / 2.
        assert!((inside.distance2 - 0.03125).abs() < 1e-15);
        let beyond_corner = locate(&RIGHT, [-3.0, -4.0]);
        assert!(!beyond_corner.inside);
        assert_eq!(beyond_corner.distance2, 25.0);
        assert_eq!(beyond_corner.clipped, [1.0, 0.0, 0.0]);
    }

    #[test]
    fn the_border_is_inside() {
        let border = locate(&RIGHT, [0.5, 0.0]);
        assert!(border.inside);
        assert_eq!(border.distance2, 0.0);
    }

    #[test]
    fn winding_changes_nothing_but_the_area() {
        let other = [RIGHT[0], RIGHT[2], RIGHT[1]];
        assert_eq!(doubled_area(&RIGHT), Some(1.0));
        assert_eq!(doubled_area(&other), Some(-1.0));
        let (a, b) = (locate(&RIGHT, [0.3, 0.9]), locate(&other, [0.3, 0.9]));
        assert!((a.distance2 - b.distance2).abs() < 1e-16);
        assert_eq!(a.clipped[1], b.clipped[2]);
    }

    #[test]
    fn a_line_has_no_inside_and_its_longest_edge_is_its_boundary() {
        let line = [[0.0, 0.0], [3.0, 0.0], [1.0, 0.0]];
        let on = locate(&line, [2.0, 0.0]);
        assert!(!on.inside && on.distance2 == 0.0 && on.barycentrics.is_none());
        // Edge 2 (corners 0 and 1) is the longest; corner 2 gets nothing.
        assert!((on.clipped[0] - 1.0 / 3.0).abs() < 1e-15 && on.clipped[2] == 0.0);
        assert_eq!(locate(&line, [4.0, 1.0]).distance2, 2.0);
    }

    #[test]
    fn a_point_has_a_distance() {
        let point = locate(&[[1.0, 1.0]; 3], [4.0, 5.0]);
        assert_eq!((point.distance2, point.clipped), (25.0, [1.0, 0.0, 0.0]));
    }
}
