//! The arguments of `softras bench`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use clap::{Args, ValueEnum};
use softras_lab::measure;
use std::path::PathBuf;

/// Measure this device: run time, floor, pairs and error by size and mode
#[derive(Args, Debug)]
#[command(after_help = "\
The mesh is centred, scaled to 70 % of the image's height and seen from distance 2.732, elevation 30°.
Without a mesh, the built-in fish and icospheres of 1280 and 20480 triangles are measured.

median   milliseconds of wall time for a user of the library, upload and download included. forward: a
         frame that saves nothing for backward; backward: the gradient by vertex positions and colours;
         frame: a frame that saves what backward needs, and backward
of full  median / median of the same pass of color+silhouette
device   milliseconds of the stages by the device's own clock
floor    pairs needed x the least operations of a pair / the device's measured peak rate
pairs    (pixel, triangle) pairs. needed: those that the model keeps; evaluated: those computed (for
         backward, the pixels of all triangles' boxes, some of which it may skip)
disp.    dispatches, counted as they are recorded
error    the largest error of any value against the model in f64 at the same tau, without the few pixels
         that lie within 1e-4 of a discontinuity of the model; for backward, |device - f64| / |f64| of
         the gradient (left out where f64 would take minutes). --json has the error against the model
         without tau as well: max_error_untruncated. It is near 1 where tau decides what a pixel shows

Timings vary between runs, so compare figures of the same run.

Examples:
  softras bench --quick
  softras bench bunny.obj --size 256,512 --modes color+silhouette --json bunny.json
  softras bench --plots plots")]
pub struct BenchArgs {
    /// A mesh file: .obj, .ply, .stl, .gltf or .glb
    pub mesh: Option<PathBuf>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Sides of the square images, pixels [default: 64,256,512; with --quick 64]
    #[arg(long, value_name = "PIXELS", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub size: Vec<u32>,
    /// The modes to measure [default: all; with --quick color+silhouette and silhouette]
    #[arg(long, value_enum, value_delimiter = ',')]
    pub modes: Vec<Mode>,
    /// Number of views of a frame, around the mesh
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096), default_value_t = 1)]
    pub batch: u32,
    /// Softness of edges, screen units² (1 = half the image's height)
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub sigma: f64,
    /// Softness of the depth order, in units of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub gamma: f64,
    /// The influence on a pixel below which a triangle is ignored there
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// probability: tau bounds the error of the silhouette; guaranteed: tau bounds the error of every image
    #[arg(long, value_enum, default_value = "probability")]
    pub support: crate::commands::render::args::Support,
    /// weighted: the background is one more entry of the softmax, as in the paper; composite: colour fades with the
    /// silhouette
    #[arg(long, value_enum, default_value = "weighted")]
    pub background_mode: crate::commands::render::args::BackgroundMode,
    /// Number of times that each frame is timed [default: 20; with --quick 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10000))]
    pub repeats: Option<u32>,
    /// Measure for seconds in place of minutes: one mesh, one size, two modes, few repeats
    #[arg(long)]
    pub quick: bool,
    /// Leave out the errors, for which the f64 model takes seconds on large images or meshes
    #[arg(long)]
    pub no_errors: bool,
    /// Write the rows as one JSON list
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write pictures (.svg) into this folder: run time against error, growth, stages. This takes some minutes more
    #[arg(long, value_name = "DIR")]
    pub plots: Option<PathBuf>,
    /// The Vulkan device: its index or a part of its name, as `softras devices` lists them [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
}

/// [`measure::Mode`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// Colour alone
    Color,
    /// Silhouette alone
    Silhouette,
    /// Colour and silhouette
    #[value(name = "color+silhouette")]
    ColorSilhouette,
    /// Depth alone
    Depth,
    /// Normals alone
    Normal,
    /// A plain z-buffer's colour and silhouette
    Hard,
    /// Colour and silhouette, the gradient to vertex colours alone
    ToColors,
    /// Colour and silhouette, the gradient to the camera alone
    ToCamera,
}

impl From<Mode> for measure::Mode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Color => Self::Color,
            Mode::Silhouette => Self::Silhouette,
            Mode::ColorSilhouette => Self::ColorSilhouette,
            Mode::Depth => Self::Depth,
            Mode::Normal => Self::Normal,
            Mode::Hard => Self::Hard,
            Mode::ToColors => Self::ToColors,
            Mode::ToCamera => Self::ToCamera,
        }
    }
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
    pub fn measured_modes(&self) -> Vec<measure::Mode> {
        match (&self.modes[..], self.quick) {
            ([], true) => vec![measure::Mode::ColorSilhouette, measure::Mode::Silhouette],
            ([], false) => measure::Mode::ALL.to_vec(),
            (modes, _) => modes.iter().map(|&mode| mode.into()).collect(),
        }
    }

    /// The number of times that each frame is timed.
    pub fn repeats(&self) -> usize {
        self.repeats.unwrap_or(if self.quick { 5 } else { 20 }) as usize
    }

    /// The settings of a frame, except for its mode.
    pub fn settings(&self, size: u32) -> softras::Settings {
        softras::Settings {
            sigma: self.sigma,
            gamma: self.gamma,
            tau: self.tau,
            support: self.support.into(),
            background: self.background_mode.into(),
            ..measure::subject::settings(size)
        }
    }
}
