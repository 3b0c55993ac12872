//! Shape, colour and pose from images: what the gradients are for.
//!
//! - [`image_loss`]: how far images are from their targets, value and gradient.
//! - [`soft_target`]: masks made as soft as what is held against them.
//! - [`regularizer`]: what keeps a mesh a surface, on its [`topology`].
//! - [`optimizer`], [`smoothing`], [`schedule`]: how parameters follow their gradients.
//! - [`remesh`]: even triangles where a fit has stretched them.
//! - [`shape`]: all of it together, a mesh deformed until its images are the targets.
//! - [`device`]: the same with every step as a whole on the device, in single precision.
//! - [`pose`]: where a rigid mesh is, from one image; [`articulated`]: how a jointed figure stands.
//! - [`voxel`]: how much of two solids is common.
//!
//! Everything but [`device`] runs on the host in f64, in a fixed order, so that the same input gives the same bits; images
//! are rendered and differentiated through [`crate::Renderer`].

pub mod articulated;
pub mod device;
pub mod image_loss;
pub mod optimizer;
pub mod pose;
pub mod regularizer;
pub mod remesh;
pub mod schedule;
pub mod shape;
pub mod smoothing;
pub mod soft_target;
pub mod topology;
pub mod voxel;

use crate::error::{Error, Result};

fn bad<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}
