//! The arguments of `softras bench`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::{BackgroundMode, Support};
use clap::{Args, builder::PossibleValuesParser};
use softras_check::measure::{Mode, subject};
use std::path::PathBuf;

/// Measure this device: run time, pairs and error by size and mode
#[derive(Args, Debug)]
#[command(after_help = "\
Modes: color+silhouette, color, silhouette, depth, normal, hard, to-colors,
to-camera. Without a mesh, the fish and icospheres of 1280 and 20480 triangles
are measured. Timings vary between runs, so compare figures of the same run.
docs/command.md explains the columns.

Examples:
  softras bench --quick
  softras bench bunny.obj --size 256,512 --modes color+silhouette --json bunny.json
  softras bench --plots plots")]
pub struct BenchArgs {
    /// A mesh: .obj, .ply, .stl, .gltf, .glb, or a built-in one: torus
    pub mesh: Option<PathBuf>,
    /// Measure for seconds in place of minutes
    #[arg(long)]
    pub quick: bool,
    /// Sides of the square images [default: 64,256,512; with --quick 64]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub size: Vec<u32>,
    /// The modes to measure [default: all; two with --quick]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = PossibleValuesParser::new(Mode::ALL.map(Mode::name)),
          hide_possible_values = true)]
    pub modes: Vec<String>,
    /// Number of times that each frame is timed [default: 20; with --quick 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10000))]
    pub repeats: Option<u32>,
    /// Leave out the errors, which the f64 model takes seconds for
    #[arg(long)]
    pub no_errors: bool,
    /// Write the rows as one JSON list
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Also plot time, error and growth (.svg); takes some minutes more
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    #[command(flatten)]
    pub frame: FrameArgs,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE", help_heading = "Input and device")]
    pub device: Option<String>,
}

/// The frames that are measured.
#[derive(Args, Debug)]
#[command(next_help_heading = "Frame")]
pub struct FrameArgs {
    /// Number of views, around the mesh
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096), default_value_t = 1)]
    pub batch: u32,
    /// Softness of edges, (half image heights)²
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub sigma: f64,
    /// Depth softness, as a share of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub gamma: f64,
    /// Least influence of a triangle on a pixel
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// Meaning of tau: probability or guaranteed
    #[arg(long, value_enum, value_name = "MODE", default_value = "probability", hide_possible_values = true)]
    pub support: Support,
    /// composite, or weighted as in the paper
    #[arg(long, value_enum, value_name = "MODE", default_value = "weighted", hide_possible_values = true)]
    pub background_mode: BackgroundMode,
}

impl BenchArgs {
    /// The sides of the images.
    pub fn sizes(&self) -> Vec<u32> {
        match (&self.size[..], self.quick) {
            ([], true) => vec![64],
            ([], false) => vec![64, 256, 512],
            (sizes, _) => sizes.to_vec(),
        }
    }

    /// The modes to measure.
    pub fn measured_modes(&self) -> Vec<Mode> {
        match (&self.modes[..], self.quick) {
            ([], true) => vec![Mode::ColorSilhouette, Mode::Silhouette],
            ([], false) => Mode::ALL.to_vec(),
            (names, _) => {
                names.iter().filter_map(|name| Mode::ALL.into_iter().find(|mode| mode.name() == name)).collect()
            }
        }
    }

    /// The number of times that each frame is timed.
    pub fn repeats(&self) -> usize {
        self.repeats.unwrap_or(if self.quick { 5 } else { 20 }) as usize
    }

    /// The settings of a frame, except for its mode.
    pub fn settings(&self, size: u32) -> softras::Settings {
        softras::Settings {
            sigma: self.frame.sigma,
            gamma: self.frame.gamma,
            tau: self.frame.tau,
            support: self.frame.support.into(),
            background: self.frame.background_mode.into(),
            ..subject::settings(size)
        }
    }
}
