//! A fit of the texels of a mesh with one texture, whose shape stays.

use super::setup::Setup;
use crate::{
    ImageLoss, Method, Optimizer, finer,
    optimize::shape::{colors, reached},
    pooled, pooled_gradient, sized,
};
use softras::{
    Error, GradientRequest, Image, ImageGradient, Lights, Mesh, Renderer, Result, Scene, Settings, parts,
    scene::Outputs,
};
use softras_io::Views;
use std::ops::Range;

/// Samples along each side of a pixel: the pictures show means over pixels, and a texel between single samples has no gradient.
const SAMPLES: usize = 2;
/// The least silhouette, of the picture and of the mesh, of a pixel whose colour is compared: the colour of a pixel at the outline
/// is mixed with the background, and texels that only such pixels show would become dark.
const COVERED: f32 = 0.99;

/// A fit in progress.
pub struct Texels<'a> {
    scene: Scene,
    targets: &'a Views,
    /// The weight of each pixel of the targets.
    weights: Image,
    settings: Settings,
    values: Vec<f64>,
    optimizer: Optimizer,
    at_once: usize,
}

impl<'a> Texels<'a> {
    /// Begins with the texels of a mesh under the lights of a fit.
    pub fn new(
        mesh: Mesh,
        setup: &Setup,
        lights: &Lights,
        targets: &'a Views,
        renderer: &mut Renderer,
    ) -> Result<Self> {
        let outputs = Outputs { color: true, ..Outputs::NOTHING };
        let settings = setup.settings(setup.iterations);
        let settings = Settings { outputs, ..sized(&settings, targets.size()?, SAMPLES) };
        let values = colors::values(mesh.appearance());
        let scene = Scene::new(mesh).with_lights(lights.clone());
        let weights = weights(&scene, targets, &settings, renderer)?;
        // One step length for all, so that a texel which is hardly seen moves little.
        let method = Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-12 };
        let optimizer = Optimizer::new(method, values.len());
        Ok(Self { scene, targets, weights, settings, values, optimizer, at_once: targets.cameras.len() })
    }

    /// The mesh with the texels as they are.
    pub fn mesh(&self) -> &Mesh {
        &self.scene.meshes[0]
    }

    /// Whether there is a pixel to compare.
    pub fn can_step(&self) -> bool {
        self.targets.color.is_some() && self.weights.data.iter().any(|weight| *weight > 0.0)
    }

    /// Takes a step and returns the loss before it: the weighted mean absolute difference of the colours.
    pub fn step(&mut self, rate: f64, renderer: &mut Renderer) -> Result<f64> {
        let (mut loss, mut gradient, mut at_once) = (0.0, vec![0.0; self.values.len()], self.at_once);
        let make = |views: Range<usize>| self.descent(views, renderer);
        parts::in_parts(self.targets.cameras.len(), &mut at_once, make, |_, (part, by_texels)| {
            loss += part;
            let by_texels = by_texels.iter().flat_map(|t| t.as_flattened());
            gradient.iter_mut().zip(by_texels).for_each(|(sum, x)| *sum += f64::from(*x));
            Ok::<(), Error>(())
        })?;
        self.at_once = at_once;
        self.optimizer.step(&mut self.values, &gradient, rate);
        self.values.iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
        self.scene.meshes[0] = colors::recolored(self.mesh(), &self.values)?;
        Ok(loss)
    }

    /// The share of some views in the loss and in its gradient by the texels.
    fn descent(&self, views: Range<usize>, renderer: &mut Renderer) -> Result<(f64, Vec<Vec<[f32; 3]>>)> {
        let Some(color) = &self.targets.color else { return Ok((0.0, Vec::new())) };
        let (color, weights) = (color.views(views.clone()), self.weights.views(views.clone()));
        let sum = |weights: &Image| weights.data.iter().map(|weight| f64::from(*weight)).sum::<f64>();
        let share = sum(&weights) / sum(&self.weights);
        if share == 0.0 {
            return Ok((0.0, Vec::new()));
        }
        let cameras = finer(&self.targets.cameras[views], SAMPLES)?;
        let frame = renderer.render_saved(&self.scene, &cameras, &self.settings)?;
        let shown = frame.color()?;
        let coarse = pooled(shown, SAMPLES)?;
        let loss = ImageLoss::L1.evaluate(&coarse, &reached(&color, &coarse), Some(&weights))?;
        let upstream = pooled_gradient(shown, &loss.gradient, SAMPLES, share)?;
        let wanted = GradientRequest { texels: true, ..GradientRequest::NOTHING };
        let mut gradients = renderer.backward(&frame, &ImageGradient::color(upstream), &wanted)?;
        Ok((share * loss.value, std::mem::take(&mut gradients.meshes[0].texture_texels)))
    }
}

/// 1 for each pixel that the object covers wholly in the picture and in the rendering of the mesh, else 0.
fn weights(scene: &Scene, targets: &Views, settings: &Settings, renderer: &mut Renderer) -> Result<Image> {
    let outputs = Outputs::SILHOUETTE;
    let settings = Settings { outputs, ..settings.clone() };
    let (height, width) = targets.size()?;
    let mut weights = Image { batch: targets.cameras.len(), height, width, channels: 1, data: Vec::new() };
    let cameras = finer(&targets.cameras, SAMPLES)?;
    parts::in_batches(renderer, scene, &cameras, &settings, |views, frame| {
        let covered = pooled(frame.silhouette()?, SAMPLES)?.data.into_iter().map(|x| x >= COVERED);
        let given = targets.silhouette.as_ref().map(|silhouette| silhouette.views(views));
        let inside = |i: usize| given.as_ref().is_none_or(|given| given.data[i] >= COVERED);
        weights.data.extend(covered.enumerate().map(|(i, covered)| f32::from(u8::from(covered && inside(i)))));
        Ok(())
    })?;
    Ok(weights)
}
