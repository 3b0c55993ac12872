//! What `softras grad` takes.

use crate::commands::gradients::Mode;
use crate::commands::parse;
use crate::commands::render::args::{BackgroundMode, CameraArgs, LightArgs, LookArgs, ModeArgs, Support};
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
The loss is the mean over all pixels of dR² + dG² + dB² + dA² between the soft image and the target,
both over the background. The target's silhouette A is its alpha channel; without one, or where all
of it is opaque, A is 1 where the colour is not black. The target is not resized: the image has its
size, and the camera stands as `softras render` would place it for that size.

The four panels: the soft image; the target; the loss of every pixel; and the way downhill, the
negative gradient of the loss by the vertices as seen by the camera, over the dimmed image and the
target's outline. Orange arrows start at vertices that are seen, blue ones at occluded vertices. One
vertex of each kind is drawn in every cell of a grid, the one with the most to say; lengths are by
the square root of its magnitude.

Examples:
  softras mesh fish -o fish.obj
  softras render fish.obj -o target.png --azimuth 180
  softras grad fish.obj --target target.png -o grad.png
  softras grad fish.obj --target target.png -o grad.png --blur 30 --json";

/// Draw what a loss against a target image wants the vertices to do
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct GradArgs {
    /// The mesh, with its .mtl and textures beside it
    pub mesh: PathBuf,
    /// The picture that the mesh is to look like: .png
    #[arg(long = "target", value_name = "IMAGE.png")]
    pub target_image: PathBuf,
    /// The picture to write
    #[arg(short, long = "out", value_name = "FILE.png")]
    pub out: PathBuf,
    /// Let the mesh read materials and textures outside its own folder
    #[arg(long)]
    pub allow_outside: bool,
    /// The Vulkan device: its index or a part of its name; or `reference`, the brute-force f64 statement of the model
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Print one JSON object: device, loss and its parts, the gradient's norm, camera, settings
    #[arg(long)]
    pub json: bool,
    /// exact, or paper: eq. 4 alone, barycentrics held constant
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

/// How soft the image is: by default much softer than a picture, so that gradients reach far.
#[derive(Args, Debug)]
#[command(next_help_heading = "Softness")]
pub struct SoftArgs {
    /// Softness of edges, screen units² (1 = half the image's height)
    #[arg(long, value_parser = parse::positive, conflicts_with = "blur")]
    pub sigma: Option<f64>,
    /// Softness of edges by the pixels that a triangle's influence reaches beyond it [default: 1/16 of the height]
    #[arg(long, value_name = "PIXELS", value_parser = parse::positive)]
    pub blur: Option<f64>,
    /// Softness of the depth order, in units of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 0.05)]
    pub gamma: f64,
    /// The influence below which a triangle is left out
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// Behind both the image and a transparent target: r,g,b (linear light, 0 to 1) or #rrggbb
    #[arg(long, value_name = "COLOUR", value_parser = parse::rgb, default_value = "0,0,0")]
    pub background: parse::Rgb,
    /// Take the bytes of textures and of the target as they are, rather than as sRGB
    #[arg(long)]
    pub raw: bool,
}

impl SoftArgs {
    /// As `softras render` would be told, for an image of this size.
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
