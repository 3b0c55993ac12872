//! The arguments of `softras articulate`.

use crate::commands::parse;
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
A doll of ten bones is posed at random with its left arm behind its back, so that at most its hand is visible. It is
fitted to one picture of itself, starting from a pose in which the whole forearm is hidden. The report gives the error
of the hidden elbow. A hard renderer has no gradient for it; `visible only` is the same soft fit without the gradients
of triangles that a hard rasterization does not show.

Examples:
  softras articulate -o occluded.png
  softras articulate --trials 20 --json";

/// Fit the pose of a jointed figure to one picture in which an arm is hidden behind its back
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ArticulateArgs {
    /// Write a picture of the first trial: target, start, visible only and soft, from the camera and from behind
    #[arg(short, long = "out", value_name = "FILE.png", value_parser = parse::file_ending("png"))]
    pub out: Option<PathBuf>,
    /// Write the figure of the first trial in the pose of the soft fit
    #[arg(long, value_name = "POSED.obj")]
    pub obj: Option<PathBuf>,
    /// Number of poses to find
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), default_value_t = 1)]
    pub trials: u32,
    /// Seed of the poses
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Number of steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), default_value_t = 300)]
    pub iterations: u32,
    /// Side of the fitted picture in pixels
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=1024), default_value_t = 64)]
    pub size: u32,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
}
