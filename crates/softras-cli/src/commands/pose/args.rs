//! The arguments of `softras pose`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::CameraArgs;
use clap::Args;
use softras::glam::{DQuat, DVec3};
use softras_fit::Pose;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The mesh is rendered without light, so the picture should be unlit too (`softras render --unlit`).
The silhouette of a picture without transparency is every pixel that is not black. The camera is the
one that `softras render --frame sphere` would use.

Confidence is 1 - (least loss) / (least loss of a pose more than 10 degrees away): near 1 where only
one pose explains the picture, 0 for a mesh that looks the same from several sides, and unknown where
no start ended more than 10 degrees away. Poses with at most 1.5 times the least loss are counted as
equally good and listed.

The second line compares the picture with the mesh in this pose: the silhouettes' intersection over union, and
by how much of the picture's brightness the colours differ. A note says where they are too far apart for the
pose to be right: of a lit picture, or one that another camera sees.

The rotation is about the centre of the smallest sphere around the mesh, at which the camera looks by
default. That centre stays where it is when the mesh turns, so a posed mesh is rendered from the same
place; its translation moves it, and --look-at, --distance keep the camera where it was.

Examples:
  softras render fish.obj -o target.png --frame sphere --unlit --size 64 --azimuth 250 --elevation -10
  softras pose --mesh fish.obj --image target.png -o posed.obj
  softras pose --mesh posed.obj --image target.png -o better.obj --init
  softras pose --mesh fish.obj --image target.png -o posed.obj --init 0,1,0,90";

/// Find the rotation and translation of a mesh from a picture of it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct PoseArgs {
    /// The mesh file to pose
    #[arg(long, value_name = "MESH")]
    pub mesh: PathBuf,
    /// The picture to fit the pose to
    #[arg(long, value_name = "TARGET.png")]
    pub image: PathBuf,
    /// Write the mesh in its pose
    #[arg(short, long = "out", value_name = "POSED.obj")]
    pub out: Option<PathBuf>,
    /// Refine one pose in small steps, in place of searching: that which the mesh has (--init alone), or one that is given
    /// as rotation and translation: the axis, the angle in degrees and, if there is one, the way moved
    #[arg(long, value_name = "X,Y,Z,DEGREES[,X,Y,Z]", value_parser = init, num_args = 0..=1, default_missing_value = "0,1,0,0",
          conflicts_with = "starts")]
    pub init: Option<Pose>,
    /// Number of poses to fit: the most likely of 512 rotations that are compared with the picture first
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512), default_value_t = 24)]
    pub starts: u32,
    /// Number of steps: a fifth with all starts in images of at most 32 pixels a side, three tenths with the best half of them
    /// at 64, the others with the best of those at 128
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), default_value_t = 150)]
    pub iterations: u32,
    /// Fit the rotation only, without translation
    #[arg(long)]
    pub no_translation: bool,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    #[command(flatten)]
    pub read: ReadArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
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
