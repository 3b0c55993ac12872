//! Images: the kernels against the f64 reference, numbers computed by hand, and what must not change an image.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cropped;
mod forward;
mod helpers;
mod invariance;
mod needles;
mod pixels;
mod properties_images;
mod repeat_frames;
mod support;
