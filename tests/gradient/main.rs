//! Gradients of images: the kernels against the f64 reference, one hazard at a time, and the same bits every time.
#![cfg(feature = "reference")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod agreement;
#[path = "../common/mod.rs"]
mod common;
mod hazards;
mod helpers;
mod living;
mod opacity;
mod per_vertex;
mod repeat;
mod room;
