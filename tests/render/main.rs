//! Images: the kernels against the f64 reference, numbers computed by hand, and what must not change an image.
#![cfg(feature = "reference")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../common/mod.rs"]
mod common;
mod cropped;
mod forward;
mod helpers;
mod invariance;
mod pixels;
mod properties_images;
mod repeat_frames;
mod support;
