//! `softras iou`: the intersection over union of the volumes of two meshes.

use super::mesh_file::ReadArgs;
use super::outputs::Outputs;
use super::{Failure, note, say};
use clap::Args;
use serde_json::json;
use softras_fit::{Voxels, cube_around, is_closed};
use softras_io::{Budget, Loaded};
use std::path::{Path, PathBuf};

/// Compare two solids: intersection over union of their volumes
#[derive(Args, Debug)]
#[command(after_help = "\
The grid is a cube around both meshes, which are not moved. An open sheet has no
inside: a note is printed for a mesh that is not closed.

Examples:
  softras iou fitted.obj fish
  softras iou fitted.obj truth.obj --resolution 128 --json")]
pub struct IouArgs {
    /// One mesh: a file or a built-in mesh
    pub a: PathBuf,
    /// The other
    pub b: PathBuf,
    /// Voxels along a side of the grid (32 in the paper)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=512), default_value_t = 32)]
    pub resolution: u32,
    /// Print one JSON object: iou, volumes, resolution, closed, parts_inside_out
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub read: ReadArgs,
}

pub fn run(args: &IouArgs) -> Result<(), Failure> {
    let budget = Budget::new(args.read.memory);
    let [a, b] = [load(args, &args.a, &budget)?, load(args, &args.b, &budget)?];
    let (b, a) = (args.read.placed(b, a.origin)?.mesh, a.mesh);
    let resolution = args.resolution as usize;
    let (low, side) = cube_around(&[&a, &b]);
    let voxels = [Voxels::new(&a, low, side, resolution)?, Voxels::new(&b, low, side, resolution)?];
    for (_, path) in voxels.iter().zip([&args.a, &args.b]).filter(|(voxels, _)| voxels.is_mixed()) {
        let what =
            "some parts are inside out: where they overlap others, both count as outside: turn their triangles over";
        note(&format!("{}: {what}", path.display()));
    }
    let iou = voxels[0].iou(&voxels[1]);
    if !args.json {
        return say(&format!("{iou:.6}"));
    }
    let closed = [is_closed(&a)?, is_closed(&b)?];
    let [volumes, mixed] =
        [json!(voxels.each_ref().map(Voxels::volume)), json!(voxels.each_ref().map(Voxels::is_mixed))];
    let report = json!({
        "iou": iou, "volumes": volumes, "resolution": resolution, "closed": closed, "parts_inside_out": mixed,
    });
    say(&report.to_string())
}

fn load(args: &IouArgs, path: &Path, budget: &Budget) -> Result<Loaded, Failure> {
    let loaded = args.read.read(path, false, &Outputs::default(), budget)?;
    if !is_closed(&loaded.mesh)? {
        note(&format!("{} is not closed: rays vote on what is inside", path.display()));
    }
    Ok(loaded)
}
