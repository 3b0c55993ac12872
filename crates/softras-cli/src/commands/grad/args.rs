//! The arguments of `softras grad`.

use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::{CameraArgs, LightArgs, ModeArgs, mode};
use clap::{Args, ValueEnum};
use softras::{GradientMode, Settings};
use softras_io::Curve;
use softras_view::Look;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The four panels are the soft image, the target, the loss of every pixel, and
the negative gradient by the vertices. Orange arrows start at visible
vertices, blue ones at hidden vertices. The camera is that of
`softras render --frame sphere`.

Examples:
  softras render fish -o target.png --frame sphere --azimuth 180
  softras grad fish --target target.png -o grad.png
  softras grad fish --target target.png -o grad.png --blur 30 --json";

/// Compare with a target image and draw the gradient at the vertices
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct GradArgs {
    /// The mesh: .obj, .ply, .stl, .gltf, .glb, or a built-in one: fish
    pub mesh: PathBuf,
    /// The target picture
    #[arg(long = "target", value_name = "IMAGE")]
    pub target_image: PathBuf,
    /// The picture to write: .png
    #[arg(short, long = "out", value_name = "FILE", value_parser = parse::file_ending("png"))]
    pub out: PathBuf,
    /// exact, or paper: eq. 4, with barycentrics held constant
    #[arg(long, value_enum, value_name = "MODE", default_value = "exact", hide_possible_values = true)]
    pub gradient: Mode,
    /// Print one JSON object: device, losses, gradient norm, camera, settings
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub soft: SoftArgs,
    #[command(flatten)]
    pub camera: CameraArgs,
    #[command(flatten)]
    pub light: LightArgs,
    #[command(flatten)]
    pub modes: ModeArgs,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Vulkan device: its index or a part of its name; or reference (f64)
    #[arg(long, value_name = "DEVICE", help_heading = "Input and device")]
    pub device: Option<String>,
}

mode!(Mode => GradientMode { Exact => Exact, Paper => Paper });

/// The softness of the image. By default it is much softer than a picture, so that gradients reach far.
#[derive(Args, Debug)]
#[command(next_help_heading = "Softness")]
pub struct SoftArgs {
    /// Softness of edges, (half image heights)²
    #[arg(long, value_parser = parse::positive, conflicts_with = "blur")]
    pub sigma: Option<f64>,
    /// Softness of edges, in pixels [default: 1/16 of the height]
    #[arg(long, value_name = "PIXELS", value_parser = parse::positive)]
    pub blur: Option<f64>,
    /// Softness of the depth order, in units of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 0.05)]
    pub gamma: f64,
    /// Least influence of a triangle on a pixel
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// Background: #rrggbb, a CSS name, or linear r,g,b
    #[arg(long, value_name = "COLOUR", value_parser = parse::rgb, default_value = "0,0,0")]
    pub background: parse::Rgb,
    /// Read textures and the target without the sRGB curve
    #[arg(long)]
    pub raw: bool,
}

impl SoftArgs {
    /// The curve by which bytes are decoded.
    pub fn curve(&self) -> Curve {
        if self.raw { Curve::Raw } else { Curve::Srgb }
    }

    /// The look of an image of this size, by a variant of the model.
    pub fn look(&self, size: (u32, u32), modes: &ModeArgs) -> Look {
        let blur = self.blur.unwrap_or(f64::from(size.1) / 16.0);
        Look {
            size,
            sigma: self.sigma,
            blur: self.sigma.is_none().then_some(blur),
            background: Some(self.background.numbers(self.curve())),
            curve: self.curve(),
            model: Settings { gamma: self.gamma, tau: self.tau, ..modes.settings() },
        }
    }
}
