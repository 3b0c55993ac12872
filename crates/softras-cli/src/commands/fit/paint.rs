//! The texture that `--texture` makes of a mesh without one: an atlas on the mesh that was found, whose texels are fitted while
//! the shape stays.

use super::args::FitArgs;
use super::color_error::color_error;
use super::setup::Setup;
use super::targets::Views;
use super::texels::Texels;
use crate::commands::steps::{Loop, Steps};
use crate::commands::{Failure, note};
use serde_json::{Value, json};
use softras::scene::Appearance;
use softras::{Mesh, Renderer};
use softras_fit::{Schedule, Targets, with_atlas};

/// Steps of the texels.
const STEPS: usize = 100;
/// Their length, for colours from 0 to 1.
const RATE: Schedule = Schedule::Exponential { from: 0.1, to: 0.005 };
/// The length of a texel in pixels of the images, where the texture has room.
const TEXEL: f64 = 1.0;

/// A mesh with a fitted texture.
pub struct Painted {
    /// The mesh.
    pub mesh: Mesh,
    /// Whether Ctrl-C ended the fit of the texels.
    pub interrupted: bool,
    /// Texels along each side of the texture.
    side: u32,
    /// The length of a texel in pixels of the images.
    texel: f64,
    losses: Vec<f64>,
    /// The error of the colours with vertex colours, and with the texture.
    errors: [Option<f64>; 2],
}

impl Painted {
    /// What was made, as JSON.
    pub fn json(&self) -> Value {
        json!({
            "side": self.side, "texel_pixels": self.texel, "color_loss": self.losses,
            "color_error_by_vertices": self.errors[0], "color_error": self.errors[1],
        })
    }
}

/// A fit of texels in progress.
struct Painting<'a> {
    texels: Texels<'a>,
    /// The loss before each step.
    losses: Vec<f64>,
}

impl Steps for Painting<'_> {
    fn step(&mut self, at: usize, renderer: &mut Renderer) -> Result<String, Failure> {
        let loss = self.texels.step(RATE.at_step(at, STEPS), renderer)?;
        self.losses.push(loss);
        Ok(format!("loss of colours {loss:.5}"))
    }
}

/// Gives a mesh that was fitted a texture in its colours, and fits the texels to the targets under the lights of the fit.
pub fn painted(
    args: &FitArgs,
    setup: &Setup,
    views: &Views,
    targets: &Targets,
    mesh: &Mesh,
    renderer: &mut Renderer,
) -> Result<Painted, Failure> {
    let (start, texel) = with_atlas(mesh, TEXEL * setup.pixel, args.texture_size)?;
    let texel = texel / setup.pixel;
    let by_vertices = color_error(mesh, setup, views, renderer)?;
    let mut painting =
        Painting { texels: Texels::new(start, setup, targets, renderer)?, losses: Vec::with_capacity(STEPS) };
    let steps = if painting.texels.can_step() { STEPS } else { 0 };
    let taken = Loop::over(0..steps).with_bar("texture step").until_interrupted()?.run(&mut painting, renderer)?;
    let (mesh, losses, interrupted) = (painting.texels.mesh().clone(), painting.losses, taken < steps);
    let errors = [by_vertices, color_error(&mesh, setup, views, renderer)?];
    let painted = Painted { side: side(&mesh), texel, mesh, interrupted, losses, errors };
    note(&painted.sentence());
    Ok(painted)
}

impl Painted {
    fn sentence(&self) -> String {
        let Self { side, texel, errors, .. } = self;
        let longer = if *texel > TEXEL { ", as many as --texture-size allows" } else { "" };
        let error = |error: Option<f64>| error.map_or("unknown".into(), |error| format!("{error:.4}"));
        let [before, after] = errors.map(error);
        format!(
            "a texture of {side}×{side} texels, {texel:.2} pixels long{longer}, brings the error of the colours from {before} to \
             {after}"
        )
    }
}

/// Width and height of a mesh's first texture.
fn side(mesh: &Mesh) -> u32 {
    match mesh.appearance() {
        Appearance::Textured { textures, .. } => textures.first().map_or(0, |texture| texture.width()),
        _ => 0,
    }
}
