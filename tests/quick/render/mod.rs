//! Images: the kernels against the f64 reference, and independence of batches, room and earlier frames.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cropped;
mod forward;
mod fragments;
mod invariance;
mod needles;
mod properties_images;
mod repeat_frames;
mod support;
