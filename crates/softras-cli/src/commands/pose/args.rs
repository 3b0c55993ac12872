//! What `softras pose` takes.

use crate::commands::render::args::CameraArgs;
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The mesh is compared as it is coloured, without light, so the picture should be of the same kind
(`softras render --unlit`); a picture without transparency is all silhouette where it is not black.
The camera is the one that `softras render` would use.

Confidence is 1 - (least loss) / (least loss of a pose more than 10 degrees away): near 1 where one
pose explains the picture and no other does, 0 for a mesh that looks alike from several sides.

Examples:
  softras render fish.obj -o target.png --unlit --size 64 --azimuth 250 --elevation -10
  softras pose --mesh fish.obj --image target.png -o posed.obj
  softras pose --benchmark --json
  softras pose --benchmark --trials 1 --landscape landscape.png";

/// Find the rotation and translation of a mesh from a picture of it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct PoseArgs {
    /// The mesh
    #[arg(long, value_name = "MESH.obj", required_unless_present = "benchmark")]
    pub mesh: Option<PathBuf>,
    /// The picture
    #[arg(long, value_name = "TARGET.png", required_unless_present = "benchmark")]
    pub image: Option<PathBuf>,
    /// Write the mesh in its pose
    #[arg(short, long = "out", value_name = "POSED.obj", conflicts_with = "benchmark")]
    pub out: Option<PathBuf>,
    /// Poses to begin at, spread over all rotations
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024), default_value_t = 32)]
    pub starts: u32,
    /// Steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), default_value_t = 150)]
    pub iterations: u32,
    /// Leave the mesh in its place: fit the rotation only
    #[arg(long)]
    pub no_translation: bool,
    /// Fit without the schedule and with a hard renderer's gradients too, from the same starts, and report their losses
    #[arg(long, conflicts_with = "benchmark")]
    pub baselines: bool,
    /// A picture of the loss over two angles about the pose, sharp beside blurred
    #[arg(long, value_name = "FILE.png")]
    pub landscape: Option<PathBuf>,
    /// The coloured cube of the SoftRas paper: seeded rotations to find, with plain and with whitened colours, from one
    /// start and from several
    #[arg(long, conflicts_with_all = ["mesh", "image"])]
    pub benchmark: bool,
    /// Rotations of the benchmark
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), default_value_t = 100)]
    pub trials: u32,
    /// Seed of the benchmark
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    #[command(flatten)]
    pub camera: CameraArgs,
}
