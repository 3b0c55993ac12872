//! A pixel against a triangle on the screen: inside or not, squared distance to the boundary, barycentrics.

use super::real::{Real, cross2, dot, lerp, sub};
use softras::scene::SurfacePoint;

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
    /// b̂, the barycentrics that the triangle is sampled at ([`SurfacePoint`]). Without an area they are those of the
    /// nearest boundary point.
    pub sampled: [R; 3],
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

/// Squared distance from `pixel` to the nearest point of edge k, and that point's barycentrics.
fn nearest_on_edge<R: Real>(corners: &[[R; 2]; 3], k: usize, pixel: [R; 2]) -> (R, [R; 3]) {
    let (a, b) = edge(corners, k);
    let along = sub(b, a);
    let length2 = dot(along, along);
    let t = if length2.value() > 0.0 { (dot(sub(pixel, a), along) / length2).clamp(0.0, 1.0) } else { R::zero() };
    let offset = sub(lerp(a, b, t), pixel);
    let mut barycentrics = [R::zero(); 3];
    barycentrics[(k + 1) % 3] = R::one() - t;
    barycentrics[(k + 2) % 3] = t;
    (dot(offset, offset), barycentrics)
}

/// Locates `pixel` (x, y on the screen).
pub fn locate<R: Real>(corners: &[[R; 2]; 3], pixel: [f64; 2], surface_point: SurfacePoint) -> Location<R> {
    let pixel = pixel.map(R::constant);
    let Some(area) = doubled_area(corners) else {
        let (distance2, sampled) = nearest_on_edge(corners, longest_edge(corners), pixel);
        return Location { inside: false, distance2, barycentrics: None, sampled };
    };
    let barycentrics: [R; 3] = std::array::from_fn(|k| {
        let (a, b) = edge(corners, k);
        cross2(sub(a, pixel), sub(b, pixel)) / area
    });
    let inside = barycentrics.iter().all(|b| b.value() >= 0.0);
    let (distance2, nearest) = (1..3).fold(nearest_on_edge(corners, 0, pixel), |best, k| {
        let other = nearest_on_edge(corners, k, pixel);
        if other.0.value() < best.0.value() { other } else { best }
    });
    let sampled = match surface_point {
        SurfacePoint::Nearest if inside => barycentrics,
        SurfacePoint::Nearest => nearest,
        SurfacePoint::Clip => {
            let clamped = barycentrics.map(|b| b.clamp(0.0, 1.0));
            let sum = clamped[0] + clamped[1] + clamped[2];
            clamped.map(|b| b / sum)
        }
    };
    Location { inside, distance2, barycentrics: Some(barycentrics), sampled }
}

/// The longest edge, the first of equals. A triangle without extent has edge 2, which begins at corner 0.
fn longest_edge<R: Real>(corners: &[[R; 2]; 3]) -> usize {
    let lengths: [f64; 3] = std::array::from_fn(|k| edge_length2(corners, k));
    let longest = (1..3).fold(0, |best, k| if lengths[k] > lengths[best] { k } else { best });
    if lengths[longest] > 0.0 { longest } else { 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

    #[test]
    fn inside_outside_and_corner() {
        let inside = locate(&RIGHT, [0.25, 0.5], SurfacePoint::Clip);
        assert!(inside.inside);
        assert_eq!(inside.sampled, [0.25, 0.25, 0.5]);
        // The slanted edge is nearest: (1 - x - y)² / 2.
        assert!((inside.distance2 - 0.03125).abs() < 1e-15);
        let beyond_corner = locate(&RIGHT, [-3.0, -4.0], SurfacePoint::Clip);
        assert!(!beyond_corner.inside);
        assert_eq!(beyond_corner.distance2, 25.0);
        assert_eq!(beyond_corner.sampled, [1.0, 0.0, 0.0]);
    }

    #[test]
    fn a_needle_is_sampled_beside_the_pixel() {
        let needle = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.001]];
        let pixel = [0.9, -0.01];
        let nearest = locate(&needle, pixel, SurfacePoint::Nearest).sampled;
        assert!((nearest[1] - 0.9).abs() < 1e-15 && nearest[2] == 0.0, "{nearest:?}");
        // The clipped point lies half of the needle's length away.
        assert!(locate(&needle, pixel, SurfacePoint::Clip).sampled[0] > 0.5);
    }

    #[test]
    fn the_border_is_inside() {
        let border = locate(&RIGHT, [0.5, 0.0], SurfacePoint::Clip);
        assert!(border.inside);
        assert_eq!(border.distance2, 0.0);
    }
}
