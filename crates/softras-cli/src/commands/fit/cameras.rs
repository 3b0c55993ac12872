//! The cameras of the images of a fit.

use super::targets::{direction, numbers, read_array};
use glam::{DMat3, DMat4, DVec3};
use softras::{Camera, Error, Projection, Result};
use softras_io::Budget;
use softras_view::Bounds;
use std::path::Path;

/// The share of half the image's height that a mesh's bounding sphere fills.
const FILL: f64 = 0.9;

fn fault<T>(path: &Path, what: String, fix: &str) -> Result<T> {
    Err(Error::File { path: path.into(), line: None, what, fix: fix.into() })
}

fn perspective(fov: f64) -> Projection {
    Projection::Perspective { fov_y: fov.to_radians() }
}

/// Cameras spread around a mesh.
pub fn around(bounds: Bounds, count: usize, fov: f64) -> Result<Vec<Camera>> {
    let distance = bounds.radius / (FILL * (fov.to_radians() / 2.0).tan()).atan().sin();
    let one = |i: usize| {
        let eye = bounds.center + distance * direction(i, count);
        Camera::look_at(eye, bounds.center, DVec3::Y, perspective(fov))
    };
    (0..count).map(one).collect()
}

/// Reads cameras from a numpy array: the angles of the official data, or matrices.
pub fn read(path: &Path, fov: f64, budget: &Budget) -> Result<Vec<Camera>> {
    let array = read_array(path, budget)?;
    let values = numbers(path, &array)?;
    let row = |at: usize, i: usize| values.at(at + i);
    match array.shape[..] {
        [n, 3] => (0..n).map(|c| official([0, 1, 2].map(|i| row(3 * c, i)), fov)).collect(),
        [n, 4, 4] => {
            let matrix = |c: usize| DMat4::from_cols_array(&std::array::from_fn(|i| row(16 * c, i))).transpose();
            (0..n).map(|c| Camera::from_matrix(matrix(c), perspective(fov))).collect()
        }
        ref shape => {
            fault(path, format!("has shape {shape:?}"), "use [N, 3] (distance, elevation, azimuth) or [N, 4, 4]")
        }
    }
}

/// A camera of the official renderer, whose images are mirrored.
fn official([distance, elevation, azimuth]: [f64; 3], fov: f64) -> Result<Camera> {
    let straight = Camera::from_angles(distance, elevation, azimuth, perspective(fov))?;
    let [right, up, forward] = *straight.view();
    let rows = [right.map(|x| -x), up, forward, [0.0, 0.0, 0.0, 1.0]];
    Camera::from_matrix(DMat4::from_cols_array_2d(&rows).transpose(), perspective(fov))
}

fn rows(camera: &Camera) -> ([DVec3; 3], DVec3) {
    let view = camera.view();
    let axes = [0, 1, 2].map(|i| DVec3::new(view[i][0], view[i][1], view[i][2]));
    let offset = DVec3::new(view[0][3], view[1][3], view[2][3]);
    (axes, offset)
}

/// The view depth of a point.
fn depth(camera: &Camera, point: DVec3) -> f64 {
    let (axes, offset) = rows(camera);
    axes[2].dot(point) + offset.z
}

/// The region that all cameras look at: the point nearest to their axes, and the radius around it that the narrowest view
/// shows.
pub fn seen(cameras: &[Camera], (height, width): (usize, usize)) -> Bounds {
    let (mut matrix, mut vector) = (DMat3::ZERO, DVec3::ZERO);
    for camera in cameras {
        let (axes, offset) = rows(camera);
        // Calibrated cameras have oblique axes: the middle of the picture lies along what the first two are perpendicular to.
        let eye = -(DMat3::from_cols(axes[0], axes[1], axes[2]).transpose().inverse() * offset);
        let axis = axes[0].cross(axes[1]).normalize_or(axes[2]);
        // Least squares of the distances to the axes. The small diagonal decides between points that are equally good: it
        // prefers the one nearer to the origin.
        let across = DMat3::IDENTITY - outer(axis);
        matrix += across + DMat3::from_diagonal(DVec3::splat(1e-9));
        vector += across * eye;
    }
    let center = if matrix.determinant().abs() > 1e-12 { matrix.inverse() * vector } else { DVec3::ZERO };
    let aspect = (width as f64 / height as f64).min(1.0);
    let half = |camera: &Camera| match *camera.projection() {
        Projection::Perspective { fov_y } => depth(camera, center) * (fov_y / 2.0).tan() * aspect,
        Projection::Orthographic { half_height } => half_height * aspect,
        _ => depth(camera, center),
    };
    let radius = cameras.iter().map(half).filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min);
    Bounds { center, radius: if radius.is_finite() { radius } else { 1.0 } }
}

/// The length of a pixel about the middle of these bounds, world units: the narrowest view shows them along the shorter side of its
/// picture.
pub fn pixel(bounds: Bounds, (height, width): (usize, usize)) -> f64 {
    2.0 * bounds.radius / height.min(width) as f64
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Near and far for all cameras, at 1.5 radii before and behind the centre of the bounds.
pub fn depths(cameras: &[Camera], bounds: Bounds) -> (f64, f64) {
    let centers: Vec<f64> = cameras.iter().map(|c| depth(c, bounds.center)).collect();
    let farthest = centers.iter().copied().fold(0.0, f64::max) + 1.5 * bounds.radius;
    let nearest = centers.iter().copied().fold(f64::INFINITY, f64::min) - 1.5 * bounds.radius;
    (nearest.max(0.02 * farthest), farthest)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_one_length_in_upright_and_in_wide_pictures() {
        let bounds = Bounds { center: DVec3::new(0.3, -0.2, 0.1), radius: 1.0 };
        let cameras = around(bounds, 8, 30.0).unwrap();
        // Half the height of the picture at the middle of the object.
        let half = depth(&cameras[0], bounds.center) * 15f64.to_radians().tan();
        for size in [(64, 64), (64, 48), (64, 96)] {
            let found = pixel(seen(&cameras, size), size);
            assert!((found - half / 32.0).abs() < 1e-6, "{size:?}: {found}, not {}", half / 32.0);
        }
    }
}
