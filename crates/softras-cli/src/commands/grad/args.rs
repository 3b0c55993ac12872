//! The arguments of `softras grad`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::{BackgroundMode, CameraArgs, LightArgs, LookArgs, ModeArgs, Support};
use clap::{Args, ValueEnum};
use softras::GradientMode;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The loss is the mean over all pixels of dR² + dG² + dB² + dA² between the soft image and the target,
both over the background. The target's silhouette A is its alpha channel; without one, or where all
of it is opaque, A is 1 where the colour is not black. The image has the size of the target, and the
camera is the one that `softras render --frame sphere` would use for that size.

The four panels are the soft image, the target, the loss of every pixel, and the negative gradient
of the loss by the vertices, projected to the screen, over the dimmed image and the target's outline.
Orange arrows start at visible vertices, blue ones at occluded vertices. Every cell of a grid shows
one vertex of each kind, the one with the largest gradient; an arrow's length is proportional to the
square root of the gradient's magnitude.

Examples:
  softras mesh fish -o fish.obj
  softras render fish.obj -o target.png --frame sphere --azimuth 180
  softras grad fish.obj --target target.png -o grad.png
  softras grad fish.obj --target target.png -o grad.png --blur 30 --json";

/// Draw the gradient of a loss against a target image by the vertices
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct GradArgs {
    /// The mesh: .obj (its .mtl and textures beside it), .ply, .stl, .gltf or .glb
    pub mesh: PathBuf,
    /// The target picture: .png
    #[arg(long = "target", value_name = "IMAGE.png")]
    pub target_image: PathBuf,
    /// The picture to write
    #[arg(short, long = "out", value_name = "FILE.png", value_parser = parse::file_ending("png"))]
    pub out: PathBuf,
    #[command(flatten)]
    pub read: ReadArgs,
    /// The Vulkan device: its index or a part of its name; or `reference`, the brute-force f64 reference
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Print one JSON object: device, loss and its parts, the gradient's norm, camera, settings
    #[arg(long)]
    pub json: bool,
    /// exact, or paper: the gradient of the paper's eq. 4, with barycentrics held constant
    #[arg(long, value_enum, default_value = "exact")]
    pub gradient: Mode,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub soft: SoftArgs,
    #[command(flatten)]
    pub light: LightArgs,
    #[command(flatten)]
    pub modes: ModeArgs,
}

/// [`GradientMode`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// The exact derivative of the image
    Exact,
    /// The gradient of the paper's eq. 4 and of the official code, with barycentrics held constant
    Paper,
}

impl From<Mode> for GradientMode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Exact => Self::Exact,
            Mode::Paper => Self::Paper,
        }
    }
}

/// The softness of the image. By default it is much softer than a picture, so that gradients reach far.
#[derive(Args, Debug)]
#[command(next_help_heading = "Softness")]
pub struct SoftArgs {
    /// Softness of edges, screen units² (1 = half the image's height)
    #[arg(long, value_parser = parse::positive, conflicts_with = "blur")]
    pub sigma: Option<f64>,
    /// Softness of edges, as the distance in pixels that a triangle's influence reaches beyond its edges [default: 1/16 of the height]
    #[arg(long, value_name = "PIXELS", value_parser = parse::positive)]
    pub blur: Option<f64>,
    /// Softness of the depth order, in units of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 0.05)]
    pub gamma: f64,
    /// The influence on a pixel below which a triangle is ignored there
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// The background of the image and of a transparent target: r,g,b (linear light, 0 to 1), #rrggbb or a
    /// name of CSS 2, as white
    #[arg(long, value_name = "COLOUR", value_parser = parse::rgb, default_value = "0,0,0")]
    pub background: parse::Rgb,
    /// Read the bytes of textures and of the target without the sRGB curve
    #[arg(long)]
    pub raw: bool,
}

impl SoftArgs {
    /// The same as arguments of `softras render`, for an image of this size.
    pub fn look(&self, (width, height): (u32, u32)) -> LookArgs {
        let blur = self.blur.unwrap_or(f64::from(height) / 16.0);
        LookArgs {
            size: (width, height),
            samples: Some(1),
            sigma: self.sigma,
            blur: self.sigma.is_none().then_some(blur),
            gamma: self.gamma,
            epsilon: 1e-3,
            tau: self.tau,
            support: Support::Probability,
            background: Some(self.background),
            background_mode: BackgroundMode::Composite,
            raw: self.raw,
        }
    }
}
