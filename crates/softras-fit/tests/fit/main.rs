//! Fitting: losses, regularisers, optimisers, remeshing, voxels, poses and jointed figures.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod atlas;
mod carved;
#[path = "../../../../tests/common/pool.rs"]
mod common;
mod doubt;
mod forearm;
mod gradients;
mod hull;
mod lengths;
mod losses;
mod meshes;
mod optimizers;
mod photos;
mod pose;
mod remesh;
mod run;
mod subdivision;
mod surface;
mod voxels;
