//! A device against the f64 reference, on small scenes that cover the model: what `softras check` prints.

mod compare;
mod scenes;

pub use compare::{Findings, GRADIENTS, IMAGE_TOLERANCE, IMAGES, compare};
pub use scenes::{CheckCase, cases};
