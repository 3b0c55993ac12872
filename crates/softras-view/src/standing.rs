//! The vertical axis of a mesh, guessed from what it would stand on.
//!
//! Files do not say which axis is up. Most that are made for pictures mean y, many of CAD, printing and scanning mean z. A mesh
//! stands on an axis if its centre lies above the convex hull of its lowest points, those within [`FLAT`] of its height, and that
//! hull is not small.

use glam::{DVec2, DVec3};
use softras::Mesh;

/// Points within this share of the height above the lowest one are those that a mesh stands on.
const FLAT: f64 = 0.02;
/// The least area of the hull that a mesh stands on, as a share of the area of its box seen from above.
const LEAST_BASE: f64 = 0.1;
/// The least area of that hull for an axis other than y, and how many times the hull of the highest points it must be: a slab
/// that is as flat above as below says nothing.
const CLEAR_BASE: f64 = 0.25;
const CLEAR_DIFFERENCE: f64 = 2.0;
/// A mesh that is flatter than this share of its largest side hangs on a wall more often than it stands on its back: of 820
/// pieces of furniture (Debian's sweethome3d-furniture, where y is up) 47 have a flat back, 37 of them flatter than this.
const LEAST_HEIGHT: f64 = 0.6;
/// A plate is thinner than this share of its other sides, and its lower face has at least this share of the upper one's area, or the
/// other way round: it lies flat. Five pieces of the same furniture are such plates upright, such as a shutter and two railings.
const PLATE: f64 = 0.1;
const SAME_FACES: f64 = 0.8;

/// Whether z is up, and not y: the mesh has a base there and does not stand on y, or is a plate there. x is never taken: one of
/// forty public files that stand on x alone has x up.
pub fn z_is_up(mesh: &Mesh) -> bool {
    let points: Vec<DVec3> = mesh.triangles().iter().flatten().map(|&i| point(mesh, i)).collect();
    let (low, high) = points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let size = high - low;
    let [below, above] = [1.0, -1.0].map(|sign| base(&points, 2, sign, mesh));
    // A picture on one flat face has no thickness and hangs.
    let is_thin = size.z > 0.0 && size.z < PLATE * size.x.min(size.y);
    let is_plate = is_thin && below.min(above) >= SAME_FACES * below.max(above);
    let is_flat = size.z < LEAST_HEIGHT * size.max_element();
    let stands = !is_flat && below >= CLEAR_DIFFERENCE * above && base(&points, 1, 1.0, mesh) < LEAST_BASE;
    below >= CLEAR_BASE && (is_plate || stands)
}

fn point(mesh: &Mesh, index: u32) -> DVec3 {
    DVec3::from_array(mesh.positions()[index as usize].map(f64::from))
}

/// The area of the hull of the lowest points along an axis, or the highest with a negative sign, as a share of the area of the
/// box seen along it; 0 if the centre of the surface does not lie above it.
fn base(points: &[DVec3], axis: usize, sign: f64, mesh: &Mesh) -> f64 {
    let height = |p: &DVec3| sign * p[axis];
    let seen = |p: DVec3| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    let (low, high) =
        points.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    let limit = low + FLAT * (high - low);
    let hull = hull(points.iter().filter(|p| height(p) <= limit).map(|p| seen(*p)).collect());
    let ends =
        points.iter().map(|p| seen(*p)).fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let footprint = (ends.1 - ends.0).element_product();
    let center = seen(center(mesh));
    let sides = || (0..hull.len()).map(|i| (hull[i], hull[(i + 1) % hull.len()]));
    let is_above = sides().all(|(a, b)| (b - a).perp_dot(center - a) > 0.0);
    let area = sides().map(|(a, b)| a.perp_dot(b)).sum::<f64>() / 2.0;
    if is_above && footprint > 0.0 { area / footprint } else { 0.0 }
}

/// The mean of the surface; the origin without one.
fn center(mesh: &Mesh) -> DVec3 {
    let weighted = mesh.triangles().iter().map(|triangle| {
        let [a, b, c] = triangle.map(|i| point(mesh, i));
        let area = (b - a).cross(c - a).length();
        (area * (a + b + c) / 3.0, area)
    });
    let (sum, area) = weighted.fold((DVec3::ZERO, 0.0), |(s, t), (p, area)| (s + p, t + area));
    if area > 0.0 { sum / area } else { DVec3::ZERO }
}

/// The convex hull, counter-clockwise, without points on its sides; none of fewer than three points.
fn hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return Vec::new();
    }
    let half = |points: &mut dyn Iterator<Item = &DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(*p - a) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(*p);
        }
        chain.pop();
        chain
    };
    let (lower, upper) = (half(&mut points.iter()), half(&mut points.iter().rev()));
    [lower, upper].concat()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    /// A mesh whose vertices are moved.
    fn mapped(mesh: &Mesh, to: impl Fn([f32; 3]) -> [f32; 3]) -> Mesh {
        Mesh::new(mesh.positions().iter().map(|p| to(*p)).collect(), mesh.triangles().to_vec()).unwrap()
    }

    #[test]
    fn a_mesh_that_stands_on_z_alone_is_found_and_x_is_never_up() {
        // A bust: a ball that was cut off below.
        let bust = mapped(&shapes::icosphere(4).unwrap(), |p| [p[0], p[1].max(-0.8), p[2] * 0.9]);
        assert!(!z_is_up(&bust));
        assert!(z_is_up(&mapped(&bust, |[x, y, z]| [z, x, y])));
        assert!(!z_is_up(&mapped(&bust, |[x, y, z]| [y, z, x])));
        // As flat as what hangs on a wall.
        assert!(!z_is_up(&mapped(&bust, |[x, y, z]| [z, x, 0.3 * y])));
        // Upside down it has no base.
        assert!(!z_is_up(&mapped(&bust, |[x, y, z]| [x, z, -y])));
    }

    #[test]
    fn y_is_up_where_nothing_speaks_for_another_axis() {
        let shapes = [shapes::cube(), shapes::icosphere(3), shapes::torus(0.7, 0.3, 64, 32), shapes::fish()];
        for mesh in shapes {
            assert!(!z_is_up(&mesh.unwrap()));
        }
        // A plate lies flat, but for one without thickness.
        let plate = |size: [f32; 3]| z_is_up(&mapped(&shapes::cube().unwrap(), |p| [0, 1, 2].map(|k| p[k] * size[k])));
        assert!(plate([3.0, 2.0, 0.1]) && ![[3.0, 0.1, 2.0], [0.1, 3.0, 2.0], [3.0, 2.0, 0.0]].into_iter().any(plate));
        let flat = Mesh::new(vec![[0.0, 0.0, 0.0], [2.0, 0.5, 0.0], [1.0, 2.0, 0.0]], vec![[0, 1, 2]]).unwrap();
        assert!(!z_is_up(&flat));
        assert!(!z_is_up(&Mesh::new(Vec::new(), Vec::new()).unwrap()));
    }
}
