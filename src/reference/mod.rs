//! The f64 judge: what the image model says, without Vulkan and sharing no code with the kernels.
//!
//! Brute force over all (pixel, triangle) pairs, or the same pairs binned. All of it is written once over
//! `real::Real`, so the gradient differentiates the very code that makes the images:
//! `setup` (transform, light, cut, project) → `geometry` (distance, barycentrics) → `fragment` → `aggregate`.

mod aggregate;
mod candidates;
mod count;
mod fragment;
mod frame;
mod geometry;
mod gradient;
mod light;
mod margin;
mod parameters;
mod project;
mod real;
mod setup;
mod tape;
#[cfg(test)]
mod tests;
mod texture;

pub use count::{Pairs, pairs};
pub use parameters::{Parameters, ReferenceGradients};

use crate::error::{Error, Result};
use crate::scene::{Camera, Scene, Settings};
use frame::Search;

/// Which pairs the judge leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truncation {
    /// Pairs outside their triangle with D < τ, or those that [`crate::scene::Support`] says, as the kernels do.
    Tau,
    /// None: the untruncated model.
    None,
}

/// What a gradient flows through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GradientMode {
    /// Everything: the derivative of the image as it is.
    #[default]
    Exact,
    /// Eq. 4 alone: the clipped barycentrics b̂ are constants of the pixel, so that colour, depth and normal depend on
    /// the vertices through D, z and the corners' own values. Under [`crate::scene::Parity::Official`] this is the
    /// official gradient: fragments outside [near, far] get none from the silhouette that counts them, and the
    /// silhouette's is damped where 1 - D < 1e-6.
    Paper,
}

/// The judge's images, row 0 at the top; empty where [`crate::scene::Outputs`] does not ask.
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    /// Number of views.
    pub batch: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// `[batch, height, width, 3]`.
    pub color: Vec<f64>,
    /// `[batch, height, width]`.
    pub silhouette: Vec<f64>,
    /// `[batch, height, width]`.
    pub depth: Vec<f64>,
    /// `[batch, height, width, 3]`.
    pub normal: Vec<f64>,
    /// `[batch, height, width]`: how far the pixel's nearest pair is from a jump of the model, at most 1; kernels may
    /// fall on the other side where this is within their rounding. The least over the pixel's pairs of
    /// |d²/r² - 1| outside a triangle (r the culling radius), |z/far - 1|, with hard modes the distance to the border
    /// in pixels and the relative gap of the two nearest depths, with surface textures the distance of R·b̂ to a
    /// border of cells.
    pub margin: Vec<f64>,
}

/// ∂L/∂image of a batch, for those images that the loss looks at.
#[derive(Clone, Debug, Default)]
pub struct Upstream {
    /// `[batch, height, width, 3]`.
    pub d_color: Option<Vec<f64>>,
    /// `[batch, height, width]`.
    pub d_silhouette: Option<Vec<f64>>,
    /// `[batch, height, width]`.
    pub d_depth: Option<Vec<f64>>,
    /// `[batch, height, width, 3]`.
    pub d_normal: Option<Vec<f64>>,
}

/// Renders by brute force.
///
/// # Errors
/// As [`Scene::judge`] and [`Settings::judge`].
pub fn render(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    truncation: Truncation,
) -> Result<ReferenceFrame> {
    judge(scene, cameras, settings)?;
    let parameters = Parameters::new(scene, cameras, settings);
    Ok(frame::frame(scene, cameras, settings, truncation, Search::BruteForce, &parameters))
}

/// The image of [`render`] with [`Truncation::Tau`], from triangles binned by tile: 256² pixels of 6000 triangles take
/// well under a second.
///
/// # Errors
/// As [`render`].
pub fn render_culled(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<ReferenceFrame> {
    judge(scene, cameras, settings)?;
    render_at(scene, cameras, settings, &Parameters::new(scene, cameras, settings))
}

/// The image of [`render`] with [`Truncation::None`] to within 1e-16 a triangle, without the pairs whose part of their
/// pixel is provably below that: 512² pixels of 6000 triangles take seconds. Distances other than
/// [`crate::scene::Distance::Euclidean`] are not culled.
///
/// # Errors
/// As [`render`].
pub fn render_untruncated(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<ReferenceFrame> {
    judge(scene, cameras, settings)?;
    let parameters = Parameters::new(scene, cameras, settings);
    Ok(frame::frame(scene, cameras, settings, Truncation::None, Search::Culled, &parameters))
}

/// [`render_culled`] with every input replaced by the values of `parameters`, in f64: for finite differences.
///
/// # Errors
/// As [`render`], and [`Error::Scene`] when the parameters are those of another scene.
pub fn render_at(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    parameters: &Parameters,
) -> Result<ReferenceFrame> {
    judge(scene, cameras, settings)?;
    if !parameters.fits(scene, cameras, settings) {
        return Err(Error::Scene {
            what: format!("{} parameters of another scene", parameters.values().len()),
            fix: "make them with Parameters::new for these meshes, cameras and lights".into(),
        });
    }
    Ok(frame::frame(scene, cameras, settings, Truncation::Tau, Search::Culled, parameters))
}

/// The gradient of L = Σ upstream · image with respect to every input, at a fixed set of pairs ([`Truncation::Tau`]).
///
/// # Errors
/// As [`render`], and [`Error::Backward`] when an upstream image does not have the frame's size.
pub fn gradient(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    upstream: &Upstream,
    mode: GradientMode,
) -> Result<ReferenceGradients> {
    judge(scene, cameras, settings)?;
    let pixels = cameras.len() * settings.height as usize * settings.width as usize;
    let images = [
        ("d_color", &upstream.d_color, 3),
        ("d_silhouette", &upstream.d_silhouette, 1),
        ("d_depth", &upstream.d_depth, 1),
        ("d_normal", &upstream.d_normal, 3),
    ];
    for (name, image, channels) in images {
        if let Some(image) = image
            && image.len() != pixels * channels
        {
            return Err(Error::Backward {
                what: format!("{name} has {} values, the frame {}", image.len(), pixels * channels),
                fix: "give batch × height × width × channels values".into(),
            });
        }
    }
    let parameters = Parameters::new(scene, cameras, settings);
    Ok(gradient::gradient(scene, cameras, settings, upstream, mode, &parameters))
}

fn judge(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<()> {
    scene.judge(cameras)?;
    settings.judge()
}
