//! The official renderer's equations in f64 and small scenes for them.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub mod equations;
pub mod scenes;
