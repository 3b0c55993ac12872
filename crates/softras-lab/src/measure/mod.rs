//! Measures the time of frames, the floor of that time, and the error of frames, for `softras bench` and the benchmarks.
//!
//! The scene is that of published comparisons: a mesh at distance 2.732, elevation 30°, 30° of view, filling 70 % of the
//! image's height ([`subject`]). Times are medians of wall time as a user of [`Renderer`](softras::Renderer) waits for
//! it, upload and download included, beside the device's own times of the stages ([`time`]). The floor is the work that no
//! renderer of this model can avoid, divided by the measured peak rate of the device ([`floor`], [`peak_flops`]). Errors
//! are against the f64 reference ([`error`]).

pub mod error;
pub mod floor;
mod mode;
pub mod needles;
mod peak;
pub mod subject;
pub mod sweep;
pub mod time;

pub use mode::Mode;
pub use peak::peak_flops;
