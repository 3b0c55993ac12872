//! The scene, camera and settings of measurements.

use softras::scene::Appearance;
use softras::{Camera, Mesh, Projection, Result, Scene, Settings};

/// Distance of the camera from the origin.
pub const DISTANCE: f64 = 2.732;
/// Elevation of the camera above the horizon, degrees.
pub const ELEVATION: f64 = 30.0;
/// Vertical angle of view, degrees.
pub const FOV: f64 = 30.0;
/// The share of the image's height that the mesh fills.
pub const FILL: f64 = 0.7;

/// The mesh, centred and scaled to [`FILL`] the image, with vertex colours that vary over it.
///
/// # Errors
/// [`softras::Error::Mesh`] for a mesh that overflows when scaled.
pub fn framed(mesh: &Mesh) -> Result<Mesh> {
    let (low, high) = mesh.bounds().unwrap_or(([0.0; 3], [1.0; 3]));
    let middle = [0, 1, 2].map(|k| (f64::from(low[k]) + f64::from(high[k])) / 2.0);
    let size = f64::from(high[1]) - f64::from(low[1]);
    let size = if size > 0.0 { size } else { 1.0 };
    let scale = FILL * 2.0 * DISTANCE * (FOV / 2.0).to_radians().tan() / size;
    let place = |p: &[f32; 3]| [0, 1, 2].map(|k| ((f64::from(p[k]) - middle[k]) * scale) as f32);
    let positions: Vec<[f32; 3]> = mesh.positions().iter().map(place).collect();
    let colors = positions.iter().map(|p| p.map(|x| (x + 0.5).clamp(0.0, 1.0))).collect();
    Mesh::new(positions, mesh.triangles().to_vec())?.with_appearance(Appearance::VertexColors(colors))
}

/// An unlit scene of the [`framed`] mesh.
///
/// # Errors
/// As [`framed`].
pub fn scene(mesh: &Mesh) -> Result<Scene> {
    framed(mesh).map(Scene::new)
}

/// The camera at an azimuth in degrees.
///
/// # Errors
/// None for a finite azimuth.
pub fn camera(azimuth: f64) -> Result<Camera> {
    Camera::from_angles(DISTANCE, ELEVATION, azimuth, Projection::Perspective { fov_y: FOV.to_radians() })
}

/// Cameras spaced evenly around the vertical axis.
///
/// # Errors
/// None.
pub fn cameras(count: u32) -> Result<Vec<Camera>> {
    (0..count).map(|i| camera(360.0 * f64::from(i) / f64::from(count))).collect()
}

/// The default settings, but with σ = γ = 1e-4, for a square image.
pub fn settings(size: u32) -> Settings {
    Settings { width: size, height: size, sigma: 1e-4, gamma: 1e-4, ..Settings::default() }
}
