//! The arguments of `softras pose`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::CameraArgs;
use clap::Args;
use softras::glam::{DQuat, DVec3};
use softras_fit::Pose;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The picture should be without light, as `softras render --unlit` makes it, and
seen by the camera of `softras render --frame sphere`. Confidence is near 1
where one pose alone explains the picture, and 0 where several do.

Examples:
  softras render fish -o target.png --frame sphere --unlit --size 64 --azimuth 250
  softras pose --mesh fish --image target.png -o posed.obj
  softras pose --mesh posed.obj --image target.png -o better.obj --init
  softras pose --mesh fish --image target.png -o posed.obj --init 0,1,0,90";

/// Find the rotation and translation of a mesh from a picture of it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct PoseArgs {
    /// The mesh to pose: a file or a built-in mesh
    #[arg(long, value_name = "MESH")]
    pub mesh: PathBuf,
    /// The picture to fit the pose to
    #[arg(long, value_name = "IMAGE")]
    pub image: PathBuf,
    /// Write the mesh in its pose: .obj
    #[arg(short, long = "out", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Refine one pose: the mesh's own, or x,y,z,degrees[,x,y,z]
    #[arg(long, value_name = "POSE", value_parser = init, num_args = 0..=1, default_missing_value = "0,1,0,0",
          conflicts_with = "starts")]
    pub init: Option<Pose>,
    /// Number of poses to fit, the most likely of 512
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512), default_value_t = 24)]
    pub starts: u32,
    /// Number of steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), default_value_t = 150)]
    pub iterations: u32,
    /// Fit the rotation alone
    #[arg(long)]
    pub no_translation: bool,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE", help_heading = "Input and device")]
    pub device: Option<String>,
}

/// A rotation about an axis, and a translation.
fn init(text: &str) -> Result<Pose, String> {
    let numbers = text.split(',').map(parse::number).collect::<Result<Vec<f64>, String>>()?;
    let (axis, degrees, moved) = match numbers[..] {
        [x, y, z, degrees] => (DVec3::new(x, y, z), degrees, DVec3::ZERO),
        [x, y, z, degrees, a, b, c] => (DVec3::new(x, y, z), degrees, DVec3::new(a, b, c)),
        _ => return Err(format!("{} numbers: give x,y,z,degrees, and if it is moved x,y,z", numbers.len())),
    };
    let axis = axis.try_normalize().ok_or("the axis has no length")?;
    Ok(Pose { rotation: DQuat::from_axis_angle(axis, degrees.to_radians()), translation: moved })
}
