//! `softras iou`: the intersection over union of the volumes of two meshes.

use super::mesh_file::ReadArgs;
use super::outputs::Outputs;
use super::{Failure, note, say};
use clap::Args;
use serde_json::json;
use softras::Mesh;
use softras_fit::voxel_iou;
use softras_fit::{Voxels, cube_around, is_closed};
use softras_io::Budget;
use std::path::{Path, PathBuf};

/// Compare two solids: the volume of their intersection over that of their union, in voxels
#[derive(Args, Debug)]
#[command(after_help = "\
The grid is a cube around both meshes; neither is moved or scaled. A voxel belongs to a mesh if its
centre lies inside. Six rays along the axes vote on that, so small holes do no harm. A note is printed
for a mesh that is not closed; an open sheet has no inside.

Examples:
  softras iou fitted.obj truth.obj
  softras iou fitted.obj truth.obj --resolution 128 --json")]
pub struct IouArgs {
    /// One mesh
    pub a: PathBuf,
    /// The other
    pub b: PathBuf,
    /// Voxels along a side of the grid (32 in the SoftRas paper)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512), default_value_t = 32)]
    pub resolution: u32,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Print one JSON object: iou, volumes (world units³), resolution, closed
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &IouArgs) -> Result<(), Failure> {
    let budget = Budget::new(args.read.memory.memory);
    let [a, b] = [load(args, &args.a, &budget)?, load(args, &args.b, &budget)?];
    let resolution = args.resolution as usize;
    let iou = voxel_iou(&a, &b, resolution)?;
    if !args.json {
        return say(&format!("{iou:.6}"));
    }
    let (low, side) = cube_around(&[&a, &b]);
    let volume = |mesh: &Mesh| Voxels::new(mesh, low, side, resolution).map(|v| v.volume());
    let closed = [is_closed(&a)?, is_closed(&b)?];
    let report =
        json!({ "iou": iou, "volumes": [volume(&a)?, volume(&b)?], "resolution": resolution, "closed": closed });
    say(&report.to_string())
}

fn load(args: &IouArgs, path: &Path, budget: &Budget) -> Result<Mesh, Failure> {
    let mesh = args.read.read(path, false, &Outputs::default(), budget)?.mesh;
    if !is_closed(&mesh)? {
        note(&format!("{} is not closed: its inside is where most rays say so", path.display()));
    }
    Ok(mesh)
}
