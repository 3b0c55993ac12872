//! Gradients of images: the kernels against the f64 reference, one hazard at a time, and the same bits every time.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod agreement;
mod features;
mod hazards;
mod living;
mod opacity;
mod per_vertex;
pub mod repeat;
mod room;
