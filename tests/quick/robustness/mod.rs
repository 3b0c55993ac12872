//! Inputs at the edge of what there is: crowds of triangles, degenerate geometry, extreme numbers, and every error.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod crowds;
#[cfg(target_os = "linux")]
mod drivers;
mod edge_cases;
mod errors;
mod layers;
mod properties;
