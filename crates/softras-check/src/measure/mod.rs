//! Measures the time and the error of frames, for `softras bench` and the benchmarks.
//!
//! The scene is that of published comparisons: a mesh at distance 2.732, elevation 30°, 30° of view, filling 70 % of the
//! image's height ([`subject`]). Times are medians of wall time as a user of [`Renderer`](softras::Renderer) waits for
//! it, upload and download included, beside the device's own times of the stages ([`time`]). Errors are
//! against the f64 reference ([`error`]).

pub mod error;
mod mode;
pub mod needles;
pub mod subject;
pub mod sweep;
pub mod time;

pub use mode::Mode;
