//! Single-view reconstruction, the headline of the paper: a network that sees one 64×64 picture and gives a mesh, trained
//! from pictures alone. The command `softras-reconstruct` makes data, trains, and shows what was learned.
//!
//! The network encodes a picture and moves the vertices of a sphere. In training every object comes in pairs of views: the
//! shape that the network sees in either is rendered in both, and the silhouettes (and colours) are compared. No shape is
//! ever shown.

mod args;
mod bits;
mod catalogue;
mod checkpoint;
mod colors;
mod command;
mod config;
mod data;
mod evaluate;
mod families;
mod fill;
mod furniture;
mod network;
mod official;
mod pairs;
mod palette;
mod picture;
mod scores;
mod sheet;
mod solid;
mod synthesis;
mod template;
mod train;
mod weights;

use clap::Parser;
use softras::scene::{ColorAggregation, Distance, SilhouetteAggregation};
use softras::{Camera, Error, Projection, Result, Settings};
use std::path::Path;
use std::process::ExitCode;

/// Pixels along a picture's side.
const SIZE: usize = 64;
/// Views of every object.
const VIEWS: usize = 24;
/// Voxels along the side of a solid.
const VOXELS: usize = 32;

fn main() -> ExitCode {
    match command::run(args::Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The camera of a view: 24 around the object, 30° above it, as in the official data. Those pictures are mirrored and
/// their azimuths are -15° k; a picture mirrored again is one of the mirrored object from +15° k.
fn camera(view: usize) -> Result<Camera> {
    camera_at(15.0 * view as f64)
}

/// The camera of an azimuth in degrees.
fn camera_at(azimuth: f64) -> Result<Camera> {
    Camera::from_angles(2.732, 30.0, azimuth, Projection::Perspective { fov_y: 30f64.to_radians() })
}

/// The settings for images with hard edges.
fn hard(settings: Settings) -> Settings {
    Settings {
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        distance: Distance::Hard,
        ..settings
    }
}

/// An error about a file's content.
fn file_error(path: &Path, what: impl Into<String>, fix: &str) -> Error {
    Error::File { path: path.into(), line: None, what: what.into(), fix: fix.into() }
}

/// An error about the numbers of a training or its data.
fn fit_error(what: impl Into<String>, fix: &str) -> Error {
    Error::Fit { what: what.into(), fix: fix.into() }
}

/// An error of reading or writing a file.
fn io_error(path: &Path, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Io { path: path.into(), source: std::io::Error::other(source) }
}
