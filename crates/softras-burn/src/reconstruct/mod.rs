//! Single-view reconstruction, the headline of the paper: a network that sees one 64×64 picture and gives a mesh, trained
//! from pictures alone.
//!
//! The network encodes a picture and moves the vertices of a sphere. In training every object comes in pairs of views: the
//! shape that the network sees in either is rendered in both, and the silhouettes (and colours) are compared. No shape is
//! ever shown. [`data`] makes and reads sets of pictures, [`network`] is the network, [`train`] trains it, and [`evaluate`]
//! compares it with what needs no network.

mod catalogue;
pub mod checkpoint;
pub mod colors;
pub mod command;
pub mod config;
pub mod curves;
pub mod data;
pub mod evaluate;
pub mod families;
mod fill;
pub mod furniture;
pub mod model;
pub mod network;
pub mod official;
mod pairs;
mod palette;
pub mod picture;
mod scores;
pub mod sheet;
mod solid;
pub mod synthesis;
pub mod team;
pub mod template;
pub mod train;
pub mod voxels;
pub mod weights;

use softras::{Camera, Error, Projection, Result};
use std::path::Path;

/// Pixels along a picture's side.
pub const SIZE: usize = 64;
/// Views of every object.
pub const VIEWS: usize = 24;
/// Voxels along the side of a solid.
pub const VOXELS: usize = 32;

/// The camera of a view: 24 around the object, 30° above it, as in the official data. Those pictures are mirrored and
/// their azimuths are -15° k; a picture mirrored again is one of the mirrored object from +15° k.
///
/// # Errors
/// None for any view: the numbers are valid.
pub fn camera(view: usize) -> Result<Camera> {
    Camera::from_angles(2.732, 30.0, 15.0 * view as f64, Projection::Perspective { fov_y: 30f64.to_radians() })
}

/// What is wrong with a file's content, and how to fix it.
pub(crate) fn file_fault(path: &Path, what: impl Into<String>, fix: &str) -> Error {
    Error::File { path: path.into(), line: None, what: what.into(), fix: fix.into() }
}

/// An error about a file's content.
pub(crate) fn file_error<T>(path: &Path, what: impl Into<String>, fix: &str) -> Result<T> {
    Err(file_fault(path, what, fix))
}

/// An error about the numbers of a training or its data.
pub(crate) fn fit_error<T>(what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::Fit { what: what.into(), fix: fix.into() })
}
