//! The official renderer's equations in f64, small scenes for them, and comparisons.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod compare;
pub mod equations;
pub mod scenes;
