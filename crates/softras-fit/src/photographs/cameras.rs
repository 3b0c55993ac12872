//! The cameras of the images of a fit.

use crate::{bad, points};
use glam::{DMat3, DVec3};
use softras::{Camera, Image, Mesh, Projection, Result};
use softras_io::Views;

/// The share of half the image's height that a mesh's bounding sphere fills.
const FILL: f64 = 0.9;

/// A sphere around an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// The centre.
    pub center: DVec3,
    /// World units.
    pub radius: f64,
}

impl Sphere {
    /// The sphere around the vertices that triangles use whose centre is that of their box; of radius 1 for a mesh without extent.
    pub(crate) fn around(mesh: &Mesh) -> Self {
        let Some((low, high)) = mesh.bounds() else { return Self { center: DVec3::ZERO, radius: 1.0 } };
        let [low, high] = [low, high].map(|corner| DVec3::from(corner.map(f64::from)));
        let center = (low + high) / 2.0;
        let radius = reach(mesh, center);
        Self { center, radius: if radius > 0.0 { radius } else { 1.0 } }
    }
}

/// The largest distance from a point to a vertex that a triangle uses.
pub fn reach(mesh: &Mesh, from: DVec3) -> f64 {
    let points = points(mesh);
    mesh.triangles().iter().flatten().map(|&i| points[i as usize].distance(from)).fold(0.0, f64::max)
}

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

/// The camera for images x times as wide and y times as high. Only [`Projection::Pinhole`] is measured in pixels and changes.
pub fn scaled(camera: &Camera, [x, y]: [f64; 2]) -> Result<Camera> {
    let Projection::Pinhole { fx, fy, cx, cy } = *camera.projection() else { return Ok(*camera) };
    Camera::from_affine(camera.matrix(), Projection::Pinhole { fx: x * fx, fy: y * fy, cx: x * cx, cy: y * cy })
}

/// The point nearest to the rays through the middles of all pictures.
fn middle(cameras: &[Camera], (height, width): (usize, usize)) -> DVec3 {
    let (mut matrix, mut vector) = (DMat3::ZERO, DVec3::ZERO);
    for camera in cameras {
        let to_world = camera.matrix().inverse();
        let eye = to_world.transform_point3(DVec3::ZERO);
        let ray = match *camera.projection() {
            Projection::Pinhole { fx, fy, cx, cy } => {
                DVec3::new((0.5 * width as f64 - cx) / fx, (cy - 0.5 * height as f64) / fy, 1.0)
            }
            _ => DVec3::Z,
        };
        let axis = to_world.transform_vector3(ray).normalize_or(DVec3::Z);
        // Least squares of the distances to the axes. The small diagonal decides between points that are equally good: it
        // prefers the one nearer to the origin.
        let across = DMat3::IDENTITY - outer(axis);
        matrix += across + DMat3::from_diagonal(DVec3::splat(1e-9));
        vector += across * eye;
    }
    if matrix.determinant().abs() > 1e-12 { matrix.inverse() * vector } else { DVec3::ZERO }
}

/// Half the shorter side of what a view shows at a point's depth, world units; not above 0 behind the camera.
fn half(camera: &Camera, point: DVec3, (height, width): (usize, usize)) -> f64 {
    let aspect = (width as f64 / height as f64).min(1.0);
    let depth = camera.to_view(point).z;
    match *camera.projection() {
        Projection::Perspective { fov_y } => depth * (fov_y / 2.0).tan() * aspect,
        Projection::Orthographic { half_height } => half_height * aspect,
        Projection::Pinhole { fx, fy, .. } => 0.5 * depth * height.min(width) as f64 / fx.max(fy),
        _ => depth,
    }
}

/// The region that the cameras look at: the point nearest to the rays through the middles of their pictures, and the radius around
/// it that the narrowest view shows, or the largest radius of a mask if that is more. Views whose mask is empty or cut by the border
/// count only if all are.
///
/// # Errors
/// [`softras::Error::Fit`] where more than half of the cameras look away from that point.
pub fn seen(views: &Views) -> Result<Sphere> {
    let (cameras, size) = (&views.cameras, views.size()?);
    let center = middle(cameras, size);
    let away = cameras.iter().filter(|camera| camera.to_view(center).z <= 0.0).count();
    if 2 * away > cameras.len() {
        return bad(
            format!("{away} of {} cameras look away from the others' target", cameras.len()),
            "give matrices from world to view with x to the right, y up and z into the picture; OpenCV's have y down, OpenGL's z out of it",
        );
    }
    let masks: Vec<Option<f64>> =
        (0..cameras.len()).map(|view| whole_mask(views.silhouette.as_ref()?, view, &cameras[view], center)).collect();
    let halves = cameras.iter().map(|camera| half(camera, center, size));
    let told: Vec<(f64, f64)> =
        halves.clone().zip(&masks).filter_map(|(half, mask)| Some((half, (*mask)? * half))).collect();
    let narrowest = |halves: &mut dyn Iterator<Item = f64>| halves.filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min);
    let radius = if told.is_empty() {
        narrowest(&mut halves.into_iter())
    } else {
        told.iter().map(|(_, mask)| *mask).fold(narrowest(&mut told.iter().map(|(half, _)| *half)), f64::max)
    };
    Ok(Sphere { center, radius: if radius.is_finite() { radius } else { 1.0 } })
}

/// How far a mask reaches from where a point is seen, in units of half the picture's shorter side; `None` for one that is empty or
/// that the border cuts.
fn whole_mask(silhouettes: &Image, view: usize, camera: &Camera, center: DVec3) -> Option<f64> {
    let (height, width) = (silhouettes.height, silhouettes.width);
    let [column, row, _] = camera.project(center, (width as u32, height as u32))?;
    let inside = |(i, x): (usize, &f32)| (*x > 0.5).then_some((i % width, i / width));
    let mut farthest = None;
    for (x, y) in silhouettes.view(view).iter().enumerate().filter_map(inside) {
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return None;
        }
        let distance = (x as f64 + 0.5 - column).hypot(y as f64 + 0.5 - row);
        farthest = Some(f64::max(distance, farthest.unwrap_or(0.0)));
    }
    Some(2.0 * farthest? / height.min(width) as f64)
}

/// The length of a view's pixel at a point, world units.
pub fn pixel_of(camera: &Camera, point: DVec3, size: (usize, usize)) -> f64 {
    2.0 * half(camera, point, size) / size.0.min(size.1) as f64
}

/// The length of a pixel at a point, world units: that of the median view.
pub fn pixel(cameras: &[Camera], center: DVec3, size: (usize, usize)) -> f64 {
    let mut pixels: Vec<f64> = cameras.iter().map(|c| pixel_of(c, center, size)).filter(|r| *r > 0.0).collect();
    pixels.sort_by(f64::total_cmp);
    pixels.get(pixels.len() / 2).copied().unwrap_or(2.0 / size.0.min(size.1) as f64)
}

/// v vᵀ.
pub fn outer(v: DVec3) -> DMat3 {
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
        for size in [(64, 64), (64, 96)] {
            let found = pixel(&cameras, bounds.center, size);
            assert!((found - half / 32.0).abs() < 1e-6, "{size:?}: {found}, not {}", half / 32.0);
        }
    }
}
