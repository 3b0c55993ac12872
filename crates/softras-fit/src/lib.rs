//! Fitting: a mesh's shape, colours and pose from images, by following the gradients of soft renderings.
//!
//! - [`Fit`] deforms, and optionally recolours, a template mesh until its renderings match [`Targets`]. [`ShapeFit`] is what it
//!   begins with: a template and [`ShapeOptions`], which say what moves (a [`Parametrization`]), what is minimised (an
//!   [`ImageLoss`] plus weighted [`Regularizer`]s) and how steps are taken (a [`Method`]).
//! - A step renders and differentiates on the device, and computes losses, regularizers and the optimiser on the host in f64.
//!   For a loss of your own, render [`ShapeFit::scene`], differentiate by the loss's gradient with
//!   [`Renderer::backward`](softras::Renderer::backward), and call [`ShapeFit::advance`].
//! - [`PoseSearch`] finds the rotation and translation of a rigid mesh from one image; [`PoseFit`] follows gradients from given
//!   poses, many at once.
//! - [`Targets::visual_hull`] is the largest solid with given silhouettes, to begin with. [`Targets::carved`] gives the mesh of a
//!   fit the holes and parts that it does not have. [`remeshed`] evens out triangles that a
//!   fit has stretched, on the surface that they have, [`Subdivision`] divides them into smaller ones, [`with_atlas`] gives a mesh without UV coordinates a texture to be fitted,
//!   [`soft_target`] softens a hard mask to the silhouette that a mesh of that outline renders to,
//!   [`mask_iou`] and [`voxel_iou`] measure how good a fit is.
//!
//! Sums run in a fixed order, so the same input gives the same bits.
//!
//! A cube's silhouettes from six sides turn a sphere into that cube; `examples/fit.rs` is the same with a written mesh:
//!
//! ```
//! use softras_fit::{Fit, Schedule, ShapeFit, ShapeOptions, Targets, mask_iou};
//! use softras::{Camera, Lights, Projection, Renderer, Scene, Settings, shapes};
//!
//! # fn main() -> softras::Result<()> {
//! let mut renderer = Renderer::new()?;
//! // The targets, which would be photographs' masks: a cube from six sides.
//! let goal = Scene::new(shapes::cube()?);
//! let projection = Projection::Perspective { fov_y: 0.6 };
//! let cameras: Vec<Camera> =
//!     (0..6).map(|i| Camera::from_angles(4.0, 25.0, 60.0 * f64::from(i), projection)).collect::<softras::Result<_>>()?;
//! let settings = Settings { width: 48, height: 48, ..Settings::default() }.with_depths_of(&goal, &cameras, 0.5);
//! let silhouette = renderer.render(&goal, &cameras, &settings)?.silhouette().cloned();
//! let targets = Targets { cameras: cameras.clone(), silhouette, ..Targets::default() };
//!
//! // The fit: a sphere, moved by the method of the command `softras fit`.
//! let shape = ShapeFit::new(shapes::icosphere(3)?, Lights::unlit(), ShapeOptions::smooth())?;
//! let mut fit = Fit::new(shape, &targets);
//! let mut losses = Vec::new();
//! let (steps, rate) = (80, Schedule::Exponential { from: 0.04, to: 0.007 });
//! let sigma = Schedule::Exponential { from: 3e-4, to: 3e-5 };
//! for step in 0..steps {
//!     let settings = Settings { sigma: sigma.at_step(step, steps), ..settings.clone() };
//!     losses.push(fit.step(&mut renderer, &settings, rate.at_step(step, steps), 0.0)?.loss);
//! }
//! assert!(losses[steps - 1] < 0.3 * losses[0]);
//!
//! let (best, _) = fit.best().expect("steps were taken");
//! let seen = renderer.render(&Scene::new(best.clone()), &cameras, &settings)?;
//! let (Some(seen), Some(wanted)) = (seen.silhouette(), &targets.silhouette) else { unreachable!() };
//! assert!(mask_iou(seen, wanted)?.iter().all(|iou| *iou > 0.88));
//! # Ok(())
//! # }
//! ```

mod atlas;
mod begin;
mod cameras;
mod carved;
mod checkpoint;
mod color_error;
mod dig;
mod film;
mod fit;
mod hull;
mod image_loss;
mod optimizer;
mod options;
mod paint;
mod pose;
mod recut;
mod regularizer;
mod remesh;
mod run;
mod schedule;
mod scores;
mod setup;
mod shape;
mod smoothing;
mod soft_target;
mod subdivision;
mod subject;
mod texels;
mod topology;
mod unseen;
mod voxel;

pub use atlas::with_atlas;
pub use carved::carved;
pub use film::Film;
pub use fit::{Fit, Fitted, Fitting, Progress, Taken};
pub use hull::visual_hull;
pub use image_loss::{
    ImageLoss, Valued, add_blurred_gradient, add_pooled_gradient, blur_factor, blurred, mask_iou, pooled,
};
pub use optimizer::{Method, Optimizer};
pub use options::{FitOptions, Preset, Template};
pub use paint::Painted;
pub use pose::{Differentiation, Pose, PoseFit, PoseOptions, PoseSearch, PoseTarget, rotations};
pub use regularizer::{Regularizer, laplacian_coordinates};
pub use remesh::{evened, remeshed};
pub use run::ShapeRun;
pub use schedule::Schedule;
pub use scores::Scores;
pub use shape::{Parametrization, ShapeFit, ShapeOptions, State, Step};
pub use smoothing::Smoothing;
pub use soft_target::{CLOSED, signed_distance, soft_target};
pub use subdivision::Subdivision;
pub use subject::{Lighting, Sphere, Subject, ViewsOfMesh};
pub use topology::{Flap, Topology};
pub use unseen::Unseen;
pub use voxel::{MAX_RESOLUTION, Voxels, cube_around, is_closed, overlap, voxel_iou};

use softras::{Error, Result};

/// A number for an error message, in few digits however large or small it is.
fn shown(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

fn bad<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}
