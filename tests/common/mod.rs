//! Common parts of the tests: renderers, random scenes, comparisons, and the tables of modes and of tolerances.
#![allow(dead_code, unused_imports, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod compare;
pub mod gradient;
pub mod modes;
pub mod pool;
pub mod scenes;
pub mod tolerance;

pub use pool::*;
pub use softras_check::random;
