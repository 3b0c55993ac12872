//! Random scenes with difficult geometry and settings, and checks of what must hold of every one of them, for
//! `softras stress` and the tests.
//!
//! [`batch`] draws scenes from a seed: triangles without area, thin, doubled, coincident, interpenetrating, huge, with
//! corners on pixel centres, on the camera's plane and behind it; every setting over its whole range and beyond.
//! [`Stress::run`] renders and differentiates each twice. Either it is refused with a typed error, or every value is finite
//! and in its range, both runs have the same bits, and inside the region of [`Promise`] images and gradients agree with
//! the f64 reference within the tolerance.

mod bits;
mod draw;
mod form;
mod outcome;
mod promise;
mod range;
mod run;
mod shrink;
mod soup;

pub use crate::random::Random;
pub use bits::fingerprint;
pub use draw::{Case, Kind, Promise, at, batch, form};
pub use form::FORMS;
pub use outcome::{Finding, Outcome};
pub use promise::image_error;
pub use run::Stress;
