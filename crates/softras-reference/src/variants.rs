//! Renderings that only tests and measurements use: without truncation, and at inputs given in f64.

use super::frame::{self, Search};
use super::{Parameters, ReferenceFrame, Truncation, validate};
use softras::{
    Error, Result,
    scene::{Camera, Scene, Settings},
};

/// The image of [`render`](super::render) with [`Truncation::None`] to within 1e-16 a triangle, without the pairs whose
/// part of their pixel is proved to be below that: 512² pixels of 6000 triangles take seconds. Distances other than
/// [`softras::scene::Distance::Euclidean`] are not culled.
///
/// # Errors
/// As [`render`](super::render).
pub fn render_untruncated(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<ReferenceFrame> {
    validate(scene, cameras, settings)?;
    let parameters = Parameters::new(scene, cameras, settings);
    Ok(frame::frame(scene, cameras, settings, Truncation::None, Search::Culled, &parameters))
}

/// [`render_culled`](super::render_culled) with every input replaced by the values of `parameters`, in f64: for finite
/// differences.
///
/// # Errors
/// As [`render`](super::render), and [`Error::Scene`] when the parameters are those of another scene.
pub fn render_at(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    parameters: &Parameters,
) -> Result<ReferenceFrame> {
    validate(scene, cameras, settings)?;
    if !parameters.fits(scene, cameras, settings) {
        return Err(Error::Scene {
            what: format!("{} parameters of another scene", parameters.values().len()),
            fix: "make them with Parameters::new for these meshes, cameras and lights".into(),
        });
    }
    Ok(frame::frame(scene, cameras, settings, Truncation::Tau, Search::Culled, parameters))
}
