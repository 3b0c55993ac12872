//! Meshes from pictures: shape, colour, texture and pose, by the gradients of soft renderings.
//!
//! [`Fit`] is what `softras fit` does: from [`Views`](softras_io::Views) to a mesh, with a hull to begin with, its hollows, changes
//! of topology, and a texture. It runs to its end or steps one at a time, and ends with a mesh, its losses and its scores.
//! [`PoseSearch`] finds the rotation and translation of a rigid mesh from one picture.
//!
//! Both are made of parts that serve alone:
//! - [`ShapeFit`] is a mesh whose vertices and colours move by gradients: a template and [`ShapeOptions`], which say what moves (a
//!   [`Parametrization`]), what is minimised (an [`ImageLoss`] plus weighted [`Regularizer`]s) and how steps are taken (a
//!   [`Method`]). [`ShapeRun`] remembers its best mesh. [`ShapeFit::step_by`] takes a loss of your own.
//! - [`PoseFit`] follows gradients from given poses, many at once.
//! - [`visual_hull`] is the largest solid with given silhouettes, [`carved`] gives a mesh the holes and parts that it does not
//!   have, [`remeshed`] evens out triangles on the surface that they have, [`Subdivision`] divides them into smaller ones,
//!   [`with_atlas`] gives a mesh without UV coordinates a texture, [`soft_target`] softens a hard mask to the silhouette that a mesh
//!   of that outline renders to.
//! - [`mask_iou`] and [`voxel_iou`] measure how good a fit is.
//!
//! A step renders and differentiates on the device, and computes losses, regularizers and the optimiser on the host in f64. Sums run
//! in a fixed order, so the same input gives the same bits.
//!
//! ```
//! use softras::{Renderer, shapes};
//! use softras_fit::{Fit, ViewsOfMesh};
//! use std::ops::ControlFlow;
//!
//! # fn main() -> softras::Result<()> {
//! let mut renderer = Renderer::new()?;
//! // Views of a mesh; `Views::open` reads photographs.
//! let views = ViewsOfMesh { count: 8, size: (32, 32), ..ViewsOfMesh::default() };
//! let mut fit = Fit::of_mesh(shapes::torus(0.7, 0.3, 24, 12)?, &views, &mut renderer)?.color();
//! fit.options.iterations = Some(4);
//! let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(()))?;
//! assert!(fitted.scores.mean_mask_iou() > 0.8 && fitted.steps.len() == 4);
//! # Ok(())
//! # }
//! ```

mod cores;
mod fit;
mod mesh;
mod optimize;
mod photographs;
mod pose;
mod report;
mod solid;
mod work;

pub use cores::on_all_cores;
pub use fit::options::{FitOptions, Preset, Template};
pub use fit::paint::Painted;
pub use fit::scores::Scores;
pub use fit::{Fit, Fitted, Fitting, Taken};
pub use mesh::atlas::with_atlas;
pub use mesh::remesh::{evened, remeshed, remeshed_while};
pub use mesh::subdivision::Subdivision;
pub use mesh::topology::{Flap, Topology};
pub use optimize::image_loss::{
    ImageLoss, LossGradient, blur_factor, blurred, blurred_gradient, mask_iou, pooled, pooled_gradient,
};
pub use optimize::optimizer::{Method, Optimizer};
pub use optimize::regularizer::{Regularizer, laplacian_coordinates};
pub use optimize::run::ShapeRun;
pub use optimize::schedule::Schedule;
pub use optimize::shape::{Parametrization, ShapeFit, ShapeOptions, State, StepLosses};
pub use optimize::soft_target::{CLOSED, signed_distance, soft_target};
pub use photographs::cameras::Sphere;
pub use photographs::subject::{Lighting, Subject, ViewsOfMesh};
pub use photographs::unseen::Unseen;
pub use pose::{Pose, PoseFit, PoseOptions, PoseSearch, PoseTarget, rotations};
pub use report::film::Film;
pub use solid::carved::carved;
pub use solid::hull::visual_hull;
pub use solid::voxel::{MAX_RESOLUTION, Voxels, cube_around, enclosed, is_closed, overlap, voxel_iou};
pub use work::{Event, Progress, Stage, Told};

use glam::DVec3;
use softras::{Camera, Error, Mesh, Result, Settings};

/// A number for an error message, in few digits however large or small it is.
fn shown(x: f64) -> String {
    let plain = x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs());
    if plain { format!("{x}") } else { format!("{x:e}") }
}

fn bad<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}

/// The positions of a mesh's vertices.
fn points(mesh: &Mesh) -> Vec<DVec3> {
    doubles(mesh.positions())
}

/// Vectors in double precision.
fn doubles(values: &[[f32; 3]]) -> Vec<DVec3> {
    values.iter().map(|value| DVec3::from(value.map(f64::from))).collect()
}

/// Vectors in single precision.
fn singles(values: &[DVec3]) -> Vec<[f32; 3]> {
    values.iter().map(|value| value.as_vec3().to_array()).collect()
}

/// The settings for images of a height and a width, with `samples` samples along each side of a pixel.
fn sized(settings: &Settings, (height, width): (usize, usize), samples: usize) -> Settings {
    let side = |side: usize| u32::try_from(side.saturating_mul(samples)).unwrap_or(u32::MAX);
    Settings { width: side(width), height: side(height), ..settings.clone() }
}

/// The cameras for images with `samples` along each side of a pixel, as [`sized`] makes them.
fn finer(cameras: &[Camera], samples: usize) -> Result<Vec<Camera>> {
    cameras.iter().map(|camera| photographs::cameras::scaled(camera, [samples as f64; 2])).collect()
}
