//! `softras iou`: how much of two solids is common.

use super::{Failure, note, say};
use clap::Args;
use serde_json::json;
use softras::Mesh;
use softras::fit::voxel_iou;
use softras::internals::fit::{Voxels, cube_around, is_closed};
use softras::obj::LoadOptions;
use std::path::{Path, PathBuf};

/// The volume that two meshes have in common over the volume that either has, by solid voxels
#[derive(Args, Debug)]
#[command(after_help = "\
The grid is a cube around both meshes as they stand: they are not moved or scaled. A voxel is inside
where its centre is; six rays along the axes vote on that, so small holes do no harm. A mesh that is
not closed is told of; an open sheet has no inside.

Examples:
  softras iou fitted.obj truth.obj
  softras iou fitted.obj truth.obj --resolution 128 --json")]
pub struct IouArgs {
    /// One mesh
    pub a: PathBuf,
    /// The other
    pub b: PathBuf,
    /// Voxels along a side of the grid; the SoftRas paper has 32
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512), default_value_t = 32)]
    pub resolution: u32,
    /// Print one JSON object: iou, volumes (world units³), resolution, closed
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
pub fn run(args: &IouArgs) -> Result<(), Failure> {
    let [a, b] = [load(&args.a)?, load(&args.b)?];
    let resolution = args.resolution as usize;
    let iou = voxel_iou(&a, &b, resolution)?;
    if !args.json {
        return say(&format!("{iou:.6}"));
    }
    let (low, side) = cube_around(&[&a, &b]);
    let volume = |mesh: &Mesh| Voxels::new(mesh, low, side, resolution).map(|v| v.volume());
    let closed = [&a, &b].map(is_closed);
    let report =
        json!({ "iou": iou, "volumes": [volume(&a)?, volume(&b)?], "resolution": resolution, "closed": closed });
    say(&report.to_string())
}

fn load(path: &Path) -> Result<Mesh, Failure> {
    let mesh = softras::obj::load(path, &LoadOptions { srgb: false, allow_outside: false })?.mesh;
    if !is_closed(&mesh) {
        note(&format!("{} is not closed: its inside is where most rays say so", path.display()));
    }
    Ok(mesh)
}
