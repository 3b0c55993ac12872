//! The view in which a mesh fills the picture.

use crate::{
    bounds::Bounds,
    framing::{self, Viewpoint},
    options::{CameraOptions, HalfHeight},
};
use glam::DVec3;
use softras::{Mesh, Projection, Result};

/// The most of the picture that the box of the projected vertices fills, in the direction in which it fills more, and the least
/// where a blur needs room around it.
const FILL: f64 = 0.9;
const LEAST_FILL: f64 = 0.3;
/// The most turns of a turntable whose boxes are computed; between them a box hardly grows.
const MOST_TURNS: usize = 36;
/// Rounds in which the centre of the box is found. Each decides which vertices are the outermost, and few are enough.
const ROUNDS: usize = 8;
/// The least distance from the camera to the nearest vertex, in radii of the mesh.
const CLEARANCE: f64 = 0.05;

/// The share of the picture that a mesh fills so that its outline's blur fits too. The blur ends where D = sigmoid(-d²/σ) is τ, with
/// d in halves of the picture's height, and not earlier: many triangles that are each faint there are not faint together.
pub fn share(sigma: f64, tau: f64, aspect: f64) -> f64 {
    let reach = (sigma * (1.0 / tau - 1.0).ln()).max(0.0).sqrt();
    (1.0 - reach / aspect.min(1.0)).clamp(LEAST_FILL, FILL)
}

/// The view at the beginning of `turns`, in degrees, from which the mesh fills `share` of the picture and is in its middle, in
/// all of the turns. A camera's place that the options give is kept. If they give the point looked at, that is in the middle, and the
/// camera is as near as it can be.
///
/// # Errors
/// As [`softras::Camera::look_at`].
pub fn filling(
    options: &CameraOptions,
    mesh: &Mesh,
    bounds: Bounds,
    aspect: f64,
    turns: &[f64],
    share: f64,
) -> Result<Viewpoint> {
    let view = Viewpoint::new(options, bounds, aspect);
    let is_given = options.eye.is_some()
        || match options.orthographic {
            None => options.distance.is_some(),
            Some(half_height) => half_height != HalfHeight::Fit,
        };
    if is_given {
        return Ok(view);
    }
    let [right, up, forward] = view.camera()?.axes();
    let (axis, pivot) = (framing::vertical(options), view.target);
    let seen: Vec<DVec3> = turns
        .iter()
        .step_by(turns.len().div_ceil(MOST_TURNS).max(1))
        .flat_map(|turn| {
            // Turning the camera is turning the mesh the other way.
            let turned = framing::turned(axis, -turn);
            used_once(mesh).map(move |p| turned * (p - pivot))
        })
        .map(|p| DVec3::new(right.dot(p), up.dot(p), forward.dot(p)))
        .collect();
    let is_centred = options.target.is_none();
    let (projection, place) = match view.projection {
        Projection::Perspective { fov_y } => {
            let slope = share * (fov_y / 2.0).tan();
            (view.projection, perspective(&seen, [slope * aspect, slope], is_centred, CLEARANCE * bounds.radius))
        }
        _ => {
            let [[left, low], [right, high]] = box_of(&seen, is_centred);
            let half = ((right - left) / aspect).max(high - low) / 2.0 / share;
            let half_height = if half > 0.0 { half } else { bounds.radius };
            let center = DVec3::new((left + right) / 2.0, (low + high) / 2.0, -view.eye.distance(pivot));
            (Projection::Orthographic { half_height }, center)
        }
    };
    let eye = pivot + place.x * right + place.y * up + place.z * forward;
    let target = eye - place.z.min(-CLEARANCE * bounds.radius) * forward;
    let (near, far) = framing::depth_range(options, bounds, eye, target);
    Ok(Viewpoint { eye, target, projection, near, far, ..view })
}

/// The vertices that triangles use.
fn used_once(mesh: &Mesh) -> impl Iterator<Item = DVec3> {
    let mut is_used = vec![false; mesh.positions().len()];
    mesh.triangles().iter().flatten().for_each(|&i| is_used[i as usize] = true);
    mesh.positions().iter().zip(is_used).filter(|(_, used)| *used).map(|(p, _)| DVec3::from_array(p.map(f64::from)))
}

/// The least and greatest x and y; on both sides of the origin the same where the box has to be around it.
fn box_of(points: &[DVec3], is_centred: bool) -> [[f64; 2]; 2] {
    let start = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    let [low, high] = points
        .iter()
        .fold(start, |[low, high], p| [[low[0].min(p.x), low[1].min(p.y)], [high[0].max(p.x), high[1].max(p.y)]]);
    if points.is_empty() {
        return [[0.0; 2]; 2];
    }
    if is_centred {
        return [low, high];
    }
    let reach = [0, 1].map(|k| (-low[k]).max(high[k]).max(0.0));
    [reach.map(|r| -r), reach]
}

/// The camera's place, in axes (right, up, forward), from which all points lie within the slopes, as near as it can be. Each
/// slope bounds the two sides of a cone: x - c ≤ s (z - d) and c - x ≤ s (z - d) for the place c and the depth d.
fn perspective(points: &[DVec3], slopes: [f64; 2], is_centred: bool, clearance: f64) -> DVec3 {
    let greatest = |of: &dyn Fn(&DVec3) -> f64| points.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let nearest = -greatest(&|p| -p.z);
    if points.is_empty() {
        return DVec3::new(0.0, 0.0, -1.0);
    }
    let depth_of = |k: usize| {
        let slope = slopes[k];
        let (right, left) = (greatest(&|p| p[k] - slope * p.z), greatest(&|p| -p[k] - slope * p.z));
        if is_centred { -(right + left) / (2.0 * slope) } else { -right.max(left) / slope }
    };
    let depth = depth_of(0).min(depth_of(1)).min(nearest - clearance);
    let middle = |k: usize| if is_centred { middle(points, k, depth) } else { 0.0 };
    DVec3::new(middle(0), middle(1), depth)
}

/// The place along an axis from which the outermost points on both sides are equally far from the picture's middle.
fn middle(points: &[DVec3], k: usize, depth: f64) -> f64 {
    let mut center = 0.0;
    for _ in 0..ROUNDS {
        let slope = |p: &&DVec3| (p[k] - center) / (p.z - depth);
        let by_slope = |a: &&DVec3, b: &&DVec3| slope(a).total_cmp(&slope(b));
        let (Some(low), Some(high)) = (points.iter().min_by(by_slope), points.iter().max_by(by_slope)) else { break };
        let (to_low, to_high) = (low.z - depth, high.z - depth);
        // Solves (high - c) / to_high = (c - low) / to_low.
        let next = (high[k] * to_low + low[k] * to_high) / (to_low + to_high);
        if next == center {
            break;
        }
        center = next;
    }
    center
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use softras::shapes;

    /// The box of a mesh in a view, in halves of the picture: left, right, low, high.
    fn projected(mesh: &Mesh, view: &Viewpoint, aspect: f64) -> [f64; 4] {
        // Halves of a picture that is 2 pixels high.
        let camera = view.camera().unwrap();
        used_once(mesh).fold([1.0, -1.0, 1.0, -1.0], |[left, r, low, high], p| {
            let [column, row, _] = camera.project(p, (2, 2)).unwrap();
            let (x, y) = ((column - 1.0) / aspect, 1.0 - row);
            [left.min(x), r.max(x), low.min(y), high.max(y)]
        })
    }

    #[test]
    fn the_box_fills_nine_tenths_and_is_in_the_middle() {
        let moved = |mesh: Mesh| {
            let places =
                mesh.positions().iter().map(|p| [40.0 * p[0] + 900.0, 40.0 * p[1], 40.0 * p[2] - 7.0]).collect();
            Mesh::new(places, mesh.triangles().to_vec()).unwrap()
        };
        let usual = CameraOptions::default();
        let ways = [
            usual,
            CameraOptions { fov: 80.0, elevation: -35.0, ..usual },
            CameraOptions { orthographic: Some(HalfHeight::Fit), ..usual },
            CameraOptions { up: Some([0.0, 0.0, 1.0]), azimuth: 9.0, ..usual },
        ];
        for mesh in [shapes::fish().unwrap(), moved(shapes::torus(0.9, 0.1, 24, 12).unwrap())] {
            for (options, aspect) in ways.into_iter().flat_map(|way| [0.4, 1.0, 2.5].map(|aspect| (way, aspect))) {
                let bounds = Bounds::of(&mesh);
                let view = filling(&options, &mesh, bounds, aspect, &[0.0], FILL).unwrap();
                let [left, right, low, high] = projected(&mesh, &view, aspect);
                assert!(
                    (left + right).abs() < 1e-3 && (low + high).abs() < 1e-3,
                    "{options:?} {left} {right} {low} {high}"
                );
                assert!((right.max(high) - 0.9).abs() < 1e-3, "{options:?} {aspect} {right} {high}");
                assert!(view.near > 0.0 && view.far > view.near);
                // A point that is given stays in the middle, and all of the mesh in the picture.
                let given = CameraOptions { target: Some((bounds.center + 0.3 * bounds.radius).to_array()), ..options };
                let view = filling(&given, &mesh, bounds, aspect, &[0.0], FILL).unwrap();
                let most = projected(&mesh, &view, aspect).map(f64::abs).into_iter().fold(0.0, f64::max);
                assert!((most - 0.9).abs() < 1e-3, "{options:?} {aspect} {most}");
                let to = (DVec3::from(given.target.unwrap()) - view.eye).normalize();
                assert!(to.distance((view.target - view.eye).normalize()) < 1e-9);
            }
        }
    }

    #[test]
    fn a_mesh_stays_in_the_picture_in_all_turns() {
        let (mesh, options) = (shapes::fish().unwrap(), CameraOptions::default());
        let turns: Vec<f64> = (0..100).map(|i| 3.6 * f64::from(i)).collect();
        let first = filling(&options, &mesh, Bounds::of(&mesh), 1.5, &turns, FILL).unwrap();
        let reach = |turn: &f64| {
            let view = first.turned(&options, Bounds::of(&mesh), *turn);
            projected(&mesh, &view, 1.5).map(f64::abs).into_iter().fold(0.0, f64::max)
        };
        let most = turns.iter().map(reach).fold(0.0, f64::max);
        assert!((0.89..0.91).contains(&most), "{most}");
    }

    #[test]
    fn a_blur_has_room() {
        assert_eq!(share(1e-5, 1e-4, 1.0), FILL);
        assert!((share(1e-2, 1e-4, 2.0) - 0.697).abs() < 1e-3, "{}", share(1e-2, 1e-4, 2.0));
        assert!(share(1e-2, 1e-4, 0.5) < share(1e-2, 1e-4, 1.0) && share(10.0, 1e-4, 1.0) == LEAST_FILL);
        let (mesh, options) = (shapes::fish().unwrap(), CameraOptions::default());
        let view = filling(&options, &mesh, Bounds::of(&mesh), 1.0, &[0.0], share(1e-2, 1e-4, 1.0)).unwrap();
        let most = projected(&mesh, &view, 1.0).map(f64::abs).into_iter().fold(0.0, f64::max);
        assert!((most - share(1e-2, 1e-4, 1.0)).abs() < 1e-3, "{most}");
    }

    #[test]
    fn meshes_without_extent_have_a_view() {
        let point = Mesh::new(vec![[1.0, 2.0, 3.0]; 3], vec![[0, 1, 2]]).unwrap();
        for mesh in [point, Mesh::new(Vec::new(), Vec::new()).unwrap()] {
            let usual = CameraOptions::default();
            let flat = CameraOptions { orthographic: Some(HalfHeight::Fit), ..usual };
            for options in [usual, flat, CameraOptions { target: Some([0.0; 3]), ..usual }] {
                let view = filling(&options, &mesh, Bounds::of(&mesh), 1.0, &[0.0], FILL).unwrap();
                assert!(view.camera().is_ok() && view.near > 0.0 && view.far > view.near, "{options:?} {view:?}");
            }
        }
    }
}
