//! The f64 reference: the image model computed on the host, without Vulkan and without code shared with the kernels.
//!
//! [`render`] visits all (pixel, triangle) pairs, [`render_culled`] only those of the triangles binned to a pixel's
//! tile. The code is generic over the number type `real::Real`; run over numbers that record their operations, the same
//! code that renders gives the gradient. Its stages are `setup` (transform, light, cut, project) → `geometry`
//! (distance, barycentrics) → `fragment` → `aggregate`.
//!
//! ```
//! use softras::{Camera, Projection, Scene, Settings, shapes};
//! use softras_reference::{GradientMode, Upstream, gradient, render_culled};
//!
//! # fn main() -> softras::Result<()> {
//! let scene = Scene::new(shapes::cube()?);
//! let camera = [Camera::from_angles(3.0, 30.0, 40.0, Projection::Perspective { fov_y: 0.8 })?];
//! let settings = Settings { width: 16, height: 16, ..Settings::default() };
//! let frame = render_culled(&scene, &camera, &settings)?;
//! let upstream = Upstream { d_silhouette: Some(frame.silhouette), ..Upstream::default() };
//! let gradients = gradient(&scene, &camera, &settings, &upstream, GradientMode::Exact)?;
//! assert!(gradients.positions(0).iter().any(|g| *g != 0.0));
//! # Ok(())
//! # }
//! ```

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
mod strongest;
mod tape;
mod texture;

pub use count::{Pairs, pairs};
pub use parameters::{Parameters, ReferenceGradients};
pub use strongest::strongest;

#[doc(no_inline)]
pub use softras::GradientMode;

use frame::Search;
use softras::{
    Error, Result,
    scene::{Camera, Scene, Settings},
};

/// Which (pixel, triangle) pairs the reference leaves out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truncation {
    /// The pairs that the kernels drop: pixels outside the triangle's support, see [`softras::scene::Support`].
    Tau,
    /// No pair: the untruncated model.
    None,
}

/// The reference's images, row 0 at the top; an image that [`softras::scene::Outputs`] does not ask for is empty.
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
    /// `[batch, height, width]`: how far the pixel is from the nearest discontinuity of the model, at most 1. Where it
    /// is within the rounding of a kernel, the kernel may compute the other side of the jump. It is the least over the
    /// pixel's pairs of
    /// |d²/r² - 1| outside a triangle (r the culling radius), |z/far - 1|, with hard modes the distance to the border
    /// in pixels and the relative gap of the two nearest depths, with surface textures the distance of R·b̂ to a
    /// border of cells.
    pub margin: Vec<f64>,
}

/// The upstream gradient ∂L/∂image of a batch; `None` for an image that the loss does not use.
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

/// Renders by visiting every (pixel, triangle) pair.
///
/// # Errors
/// [`Error::Scene`], [`Error::Camera`], [`Error::Light`] or [`Error::Settings`] for what is out of range.
pub fn render(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    truncation: Truncation,
) -> Result<ReferenceFrame> {
    render_with(scene, cameras, settings, truncation, Search::BruteForce, None)
}

/// Renders what [`render`] does with [`Truncation::Tau`], but visits for each pixel only the triangles binned to its
/// tile: 256² pixels of 6000 triangles take well under a second.
///
/// # Errors
/// As [`render`].
pub fn render_culled(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<ReferenceFrame> {
    render_with(scene, cameras, settings, Truncation::Tau, Search::Culled, None)
}

/// The image of [`render`] with [`Truncation::None`] to within 1e-16 a triangle, without the pairs whose part of their
/// pixel is proved to be below that: 512² pixels of 6000 triangles take seconds. Distances other than
/// [`softras::scene::Distance::Euclidean`] are not culled.
///
/// # Errors
/// As [`render`].
pub fn render_untruncated(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<ReferenceFrame> {
    render_with(scene, cameras, settings, Truncation::None, Search::Culled, None)
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
    render_with(scene, cameras, settings, Truncation::Tau, Search::Culled, Some(parameters))
}

fn render_with(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    truncation: Truncation,
    search: Search,
    parameters: Option<&Parameters>,
) -> Result<ReferenceFrame> {
    validate(scene, cameras, settings)?;
    let own = Parameters::new(scene, cameras, settings);
    let parameters = parameters.unwrap_or(&own);
    if !parameters.fits(&own) {
        return Err(Error::Scene {
            what: format!("{} parameters of another scene", parameters.values().len()),
            fix: "make them with Parameters::new for these meshes, cameras and lights".into(),
        });
    }
    Ok(frame::frame(scene, cameras, settings, truncation, search, parameters))
}

/// The gradient of L = Σ upstream · image by every input, with the set of pairs held fixed ([`Truncation::Tau`]).
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
    validate(scene, cameras, settings)?;
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

fn validate(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<()> {
    scene.validate(cameras)?;
    settings.validate()
}
