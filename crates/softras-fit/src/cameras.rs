//! The cameras of the images of a fit.

use crate::subject::Sphere;
use glam::{DMat3, DVec3};
use softras::{Camera, Projection, Result};

/// The share of half the image's height that a mesh's bounding sphere fills.
const FILL: f64 = 0.9;

fn perspective(fov: f64) -> Projection {
    Projection::Perspective { fov_y: fov.to_radians() }
}

/// Cameras spread around a mesh.
pub fn around(bounds: Sphere, count: usize, fov: f64) -> Result<Vec<Camera>> {
    let distance = bounds.radius / (FILL * (fov.to_radians() / 2.0).tan()).atan().sin();
    let one = |i: usize| {
        let eye = bounds.center + distance * direction(i, count);
        Camera::look_at(eye, bounds.center, DVec3::Y, perspective(fov))
    };
    (0..count).map(one).collect()
}

/// The region that all cameras look at: the point nearest to their axes, and the radius around it that the narrowest view
/// shows.
pub fn seen(cameras: &[Camera], (height, width): (usize, usize)) -> Sphere {
    let (mut matrix, mut vector) = (DMat3::ZERO, DVec3::ZERO);
    for camera in cameras {
        let axes = camera.axes();
        // Calibrated cameras have oblique axes: the middle of the picture lies along what the first two are perpendicular to.
        let eye = camera.matrix().inverse().transform_point3(DVec3::ZERO);
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
        Projection::Perspective { fov_y } => camera.to_view(center).z * (fov_y / 2.0).tan() * aspect,
        Projection::Orthographic { half_height } => half_height * aspect,
        _ => camera.to_view(center).z,
    };
    let radius = cameras.iter().map(half).filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min);
    Sphere { center, radius: if radius.is_finite() { radius } else { 1.0 } }
}

/// The length of a pixel about the middle of these bounds, world units: the narrowest view shows them along the shorter side of its
/// picture.
pub fn pixel(bounds: Sphere, (height, width): (usize, usize)) -> f64 {
    2.0 * bounds.radius / height.min(width) as f64
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Near and far for all cameras, at 1.5 radii before and behind the centre of the bounds.
pub fn depths(cameras: &[Camera], bounds: Sphere) -> (f64, f64) {
    let centers: Vec<f64> = cameras.iter().map(|c| c.to_view(bounds.center).z).collect();
    let farthest = centers.iter().copied().fold(0.0, f64::max) + 1.5 * bounds.radius;
    let nearest = centers.iter().copied().fold(f64::INFINITY, f64::min) - 1.5 * bounds.radius;
    (nearest.max(0.02 * farthest), farthest)
}

/// Direction `i` of `count`, on a spiral over the unit sphere from low to high.
fn direction(i: usize, count: usize) -> DVec3 {
    // The spiral leaves out the poles, where (0, 1, 0) is not a valid up vector.
    let y = 0.92 * ((2 * i + 1) as f64 / count as f64 - 1.0);
    let turn = i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * turn.cos(), y, radius * turn.sin())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_one_length_in_upright_and_in_wide_pictures() {
        let bounds = Sphere { center: DVec3::new(0.3, -0.2, 0.1), radius: 1.0 };
        let cameras = around(bounds, 8, 30.0).unwrap();
        // Half the height of the picture at the middle of the object.
        let half = cameras[0].to_view(bounds.center).z * 15f64.to_radians().tan();
        for size in [(64, 64), (64, 48), (64, 96)] {
            let found = pixel(seen(&cameras, size), size);
            assert!((found - half / 32.0).abs() < 1e-6, "{size:?}: {found}, not {}", half / 32.0);
        }
    }
}
