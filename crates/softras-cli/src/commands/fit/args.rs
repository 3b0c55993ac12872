//! What `softras fit` takes.

use crate::commands::parse;
use crate::commands::render::args::Faces;
use clap::{Args, ValueEnum};
use softras::fit::ImageLoss;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  softras fit --views views.npy --cameras cameras.npy -o shape.obj --json log.json
  softras fit --views photos -o shape.obj --color --gif fit.gif --plot loss.png
  softras fit --from spot.obj --views 24 --size 128 --color -o fitted.obj
  softras fit --from spot.obj --template grey_spot.obj --texture -o textured.obj

Views and cameras:
  IMAGES.npy   [N, 4, H, W] or [N, H, W, 4] (RGBA; alpha is the silhouette), [N, H, W] (silhouettes); bytes or
               floats from 0 to 1
  CAMERAS.npy  [N, 3]: distance, elevation, azimuth in degrees, looking at the origin: the official data, whose images
               are mirrored; [N, 4, 4]: world to view, z forward
  FOLDER       PNG files and cameras.json: a list of objects with \"file\" and either \"eye\" (and \"target\", \"up\")
               or \"distance\", \"elevation\", \"azimuth\"; \"fov\" is the vertical angle of view in degrees. A PNG
               without transparency is all silhouette where it is not black.
  --from MESH  renders the views itself, all around the mesh, and reports the 3D IoU with it

Ctrl-C ends the fit and writes what there is; --checkpoint FILE with --resume goes on from there.";

/// Fit a mesh to images: its shape, and its colours with --color
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct FitArgs {
    /// The mesh to begin with: `sphere`, or an .obj file
    #[arg(long, value_name = "sphere|MESH.obj", default_value = "sphere")]
    pub template: String,
    /// Halvings of the sphere's edges: 3 makes 642 vertices
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=7), default_value_t = 3)]
    pub subdivisions: u32,
    /// Images: a .npy file or a folder; with --from the number of views [default: 24]
    #[arg(long, value_name = "IMAGES.npy|FOLDER|N", required_unless_present = "from")]
    pub views: Option<String>,
    /// Where the images were taken from: .npy or .json [default: cameras.json in the folder]
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    pub cameras: Option<PathBuf>,
    /// Vertical angle of view of the cameras that do not say it, degrees
    #[arg(long, value_name = "DEGREES", value_parser = parse::angle_of_view, default_value_t = 30.0)]
    pub fov: f64,
    /// Make the target images from this mesh
    #[arg(long, value_name = "MESH.obj")]
    pub from: Option<PathBuf>,
    /// Pixels of the images that --from makes
    #[arg(long, value_name = "SIZE", value_parser = parse::size, default_value = "128")]
    pub size: (u32, u32),
    /// Use every N-th view only
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), default_value_t = 1)]
    pub view_stride: u32,
    /// The mesh to write
    #[arg(short, long = "out", value_name = "OUT.obj")]
    pub out: PathBuf,
    /// Fit the colours too: the template's texels where it has a texture, else a colour for each vertex
    #[arg(long)]
    pub color: bool,
    /// Fit the template's texture alone: its vertices stay where they are
    #[arg(long, conflicts_with = "subdivide_at")]
    pub texture: bool,
    /// Read the pictures that cameras.json names from outside its folder too
    #[arg(long)]
    pub allow_outside: bool,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub files: FileArgs,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
}

impl FitArgs {
    /// Whether colours are fitted.
    pub fn colored(&self) -> bool {
        self.color || self.texture
    }
}

/// A set of defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// Smoothed parameters, sigma shrinking, no step that tears the surface
    Smooth,
    /// The official demo: displacements in logit space, Adam at 0.01, sigma 1e-4; the template at half its size
    Official,
}

/// How far silhouettes are from their targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Loss {
    /// 1 - IoU, each view's: for masks
    Iou,
    /// The mean difference
    L1,
    /// The mean square difference: for targets with smooth outlines, with --samples 2 or more
    L2,
}

impl Loss {
    /// The loss itself.
    pub fn image_loss(self) -> ImageLoss {
        match self {
            Self::Iou => ImageLoss::NegativeIou,
            Self::L1 => ImageLoss::L1,
            Self::L2 => ImageLoss::L2,
        }
    }
}

/// How it is fitted.
#[derive(Args, Debug)]
#[command(next_help_heading = "Method")]
pub struct MethodArgs {
    /// Where the defaults come from
    #[arg(long, value_enum, default_value = "smooth")]
    pub preset: Preset,
    /// Steps
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000), default_value_t = 500)]
    pub iterations: u32,
    /// Length of a step, from the first to the last: 0.01 or 0.02..0.002
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub rate: Option<(f64, f64)>,
    /// Length of a step of the colours
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub color_rate: Option<(f64, f64)>,
    /// Softness of edges, screen units²: 1e-4 or 1e-4..1e-5
    #[arg(long, value_name = "SIGMA", value_parser = range)]
    pub sigma: Option<(f64, f64)>,
    /// Softness of the depth order, in units of far - near, for colours
    #[arg(long, value_name = "GAMMA", value_parser = range)]
    pub gamma: Option<(f64, f64)>,
    /// What compares silhouettes with their targets
    #[arg(long, value_enum, default_value = "iou")]
    pub loss: Loss,
    /// Take the silhouettes as masks: pixels above a half count as 1, the others as 0
    #[arg(long, conflicts_with = "samples")]
    pub masks: bool,
    /// Which triangles are drawn: the front ones of a closed surface have the same silhouette, less enlarged by softness
    #[arg(long, value_enum, default_value = "both")]
    pub faces: Faces,
    /// Pixels rendered for each of the target's along each side
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: Option<u32>,
    /// How much steps are smoothed over the surface: (I + λ L)⁻¹ [default: 5; the official preset has none]
    #[arg(long, value_name = "LAMBDA", value_parser = parse::positive)]
    pub smoothing: Option<f64>,
    /// Weight of the Laplacian regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub laplacian: Option<f64>,
    /// Weight of the flatten regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub flatten: Option<f64>,
    /// Weight of the normal consistency regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub normals: Option<f64>,
    /// Weight of the colours' loss against the silhouettes'
    #[arg(long, value_name = "WEIGHT", value_parser = weight, default_value_t = 3.0)]
    pub color_weight: f64,
    /// Take the steps on the host in double precision, where otherwise the device takes them as a whole
    #[arg(long)]
    pub host: bool,
    /// Cut every triangle into four before these steps (several by commas)
    #[arg(long, value_name = "STEP", value_delimiter = ',')]
    pub subdivide_at: Vec<u32>,
    /// Make even triangles of the mesh before these steps (several by commas)
    #[arg(long, value_name = "STEP", value_delimiter = ',', conflicts_with = "texture")]
    pub remesh_at: Vec<u32>,
    /// How long the edges of --remesh-at are, in pixels of the images: 1.5 or, from the first step to the last, 2..1
    #[arg(long, value_name = "PIXELS", value_parser = range, default_value = "1.5", requires = "remesh_at")]
    pub edge: (f64, f64),
    /// Fit again without the schedule, without softness (sigma 1e-7), without regularisers and (with --color) without
    /// colours, and report these too
    #[arg(long)]
    pub baselines: bool,
}

/// What else is written.
#[derive(Args, Debug)]
#[command(next_help_heading = "Files")]
pub struct FileArgs {
    /// A log of every step as JSON: losses, seconds, IoU of every view
    #[arg(long, value_name = "LOG.json")]
    pub json: Option<PathBuf>,
    /// A picture of the loss by step
    #[arg(long, value_name = "FILE.png")]
    pub plot: Option<PathBuf>,
    /// The fit as an animation, target beside it
    #[arg(long, value_name = "FILE.gif")]
    pub gif: Option<PathBuf>,
    /// Everything that it takes to go on, written at the end and every 100 steps
    #[arg(long, value_name = "FILE.npz")]
    pub checkpoint: Option<PathBuf>,
    /// Go on from the checkpoint, if it is there
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
}

/// `0.01`, or `0.02..0.002`.
fn range(text: &str) -> Result<(f64, f64), String> {
    match text.split_once("..") {
        Some((from, to)) => Ok((parse::positive(from)?, parse::positive(to)?)),
        None => parse::positive(text).map(|x| (x, x)),
    }
}

/// A finite number, at least 0.
fn weight(text: &str) -> Result<f64, String> {
    parse::number(text).and_then(|x| if x >= 0.0 { Ok(x) } else { Err(format!("{x} is below 0")) })
}
