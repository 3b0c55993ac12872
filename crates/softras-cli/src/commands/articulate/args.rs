//! What `softras articulate` takes.

use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
A doll of ten bones is posed at random with its left arm behind its back, so that no more than the hand is seen, and
fitted to one picture of itself from a pose in which the whole forearm is hidden. Its elbow is the joint that is
reported. A hard renderer has no gradient for it; `visible only` is the same soft fit with the gradients of all
triangles that a hard rasterization does not show left out.

Examples:
  softras articulate -o occluded.png
  softras articulate --trials 20 --json";

/// Fit the pose of a jointed figure to one picture, an arm of it hidden behind its back
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ArticulateArgs {
    /// A picture of the first trial: target, start, visible only, soft; from the camera, and from behind
    #[arg(short, long = "out", value_name = "FILE.png")]
    pub out: Option<PathBuf>,
    /// Write the figure of the first trial as the soft fit left it
    #[arg(long, value_name = "POSED.obj")]
    pub obj: Option<PathBuf>,
    /// Poses to find
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), default_value_t = 1)]
    pub trials: u32,
    /// Seed of the poses
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), default_value_t = 300)]
    pub iterations: u32,
    /// Side of the picture that is fitted, pixels
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(16..=1024), default_value_t = 64)]
    pub size: u32,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
}
