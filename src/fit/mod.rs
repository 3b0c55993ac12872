//! Fitting: a mesh's shape, colours and pose from images, by following the gradients of soft renderings.
//!
//! - [`ShapeFit`] deforms, and optionally recolours, a template mesh until its renderings match [`Targets`]. What it moves
//!   is a [`Parametrization`], what it minimises an [`ImageLoss`] plus weighted [`Regularizer`]s, and how it steps a
//!   [`Method`]. Every step is computed on the host in f64 around [`Renderer::render`](crate::Renderer::render) and
//!   [`Renderer::backward`](crate::Renderer::backward).
//! - [`DeviceFit`] runs the same method in single precision on the device, one submission a step and without a wait.
//!   [`HostFit`] computes the same bits on the host and lets you insert a loss of your own.
//! - [`PoseFit`] finds the rotation and translation of a rigid mesh from one image, many starting poses at once.
//! - [`remeshed`] evens out triangles that a fit has stretched, [`soft_target`] softens a hard mask to the silhouette that
//!   a mesh of that outline renders to, [`mask_iou`] and [`voxel_iou`] measure how good a fit is.
//!
//! Sums run in a fixed order, so the same input gives the same bits.

pub(crate) mod device;
pub(crate) mod image_loss;
mod optimizer;
pub(crate) mod pose;
pub(crate) mod regularizer;
mod remesh;
mod schedule;
mod shape;
pub(crate) mod smoothing;
pub(crate) mod soft_target;
pub(crate) mod topology;
pub(crate) mod voxel;

pub use device::{DeviceFit, HostFit};
pub use image_loss::{ImageLoss, Valued, mask_iou};
pub use optimizer::{Method, Optimizer};
pub use pose::{Differentiation, Pose, PoseFit, PoseOptions, PoseTarget, rotations};
pub use regularizer::Regularizer;
pub use remesh::remeshed;
pub use schedule::Schedule;
pub use shape::{Parametrization, ShapeFit, ShapeOptions, State, Step, Targets};
pub use soft_target::soft_target;
pub use voxel::voxel_iou;

use crate::error::{Error, Result};

fn bad<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}
