//! Fits a mesh's shape and colours to target images, in f64.

pub mod colors;
mod compare;
mod options;
mod parametrization;
mod turn;

pub(crate) use compare::{known, masked, reached};
pub use options::ShapeOptions;
pub use parametrization::Parametrization;

use super::image_loss::ImageLoss;
use super::optimizer::{Method, Optimizer};
use crate::mesh::remesh::remeshed;
use crate::mesh::subdivision::Subdivision;
use crate::mesh::topology::Topology;
use crate::{bad, doubles, finer, points, singles, sized};
use compare::{ImageLosses, compare};
use glam::DVec3;
use parametrization::Parameters;
use softras::{
    Camera, CameraGradient, Error, Frame, GradientRequest, ImageGradient, MeshGradients, Renderer, Result,
    scene::{Lights, Mesh, Scene, Settings},
};
use softras_io::Views;
use std::ops::{Range, RangeInclusive};
pub(crate) use turn::steps_of_a_turn;
use turn::views_of_step;

/// The losses of a step, before it moved anything.
#[derive(Clone, Debug, PartialEq)]
pub struct StepLosses {
    /// The weighted sum of all losses and penalties.
    pub loss: f64,
    /// The silhouettes' loss, unweighted; 0 without silhouettes.
    pub silhouette: f64,
    /// The colours' loss, unweighted; 0 without colours.
    pub color: f64,
    /// The depths' loss, unweighted; 0 without depths.
    pub depth: f64,
    /// The normals' loss, unweighted; 0 without normals.
    pub normal: f64,
    /// The regularizers' penalties, unweighted, in the options' order.
    pub regularizers: Vec<f64>,
}

/// A shape fit in progress, computed in f64 around a renderer.
#[derive(Clone, Debug)]
pub struct ShapeFit {
    pub(crate) options: ShapeOptions,
    topology: Topology,
    scene: Scene,
    parameters: Parameters,
    values: Vec<f64>,
    /// The positions that the values give.
    positions: Vec<DVec3>,
    optimizer: Optimizer,
    color_values: Vec<f64>,
    color_optimizer: Optimizer,
    /// As many views as the renderer has been found to hold at once.
    views_at_once: usize,
}

/// The losses of a step and the gradients of their weighted sum, of all views or of some.
#[derive(Default)]
struct Descent {
    losses: ImageLosses,
    by_positions: Vec<DVec3>,
    by_colors: Vec<f64>,
    by_cameras: Vec<CameraGradient>,
}

impl Descent {
    /// Adds the losses and gradients of some views times their share of all views, since every loss is a mean over views.
    fn add(&mut self, part: &Self, share: f64) {
        self.losses.add(&part.losses, share);
        self.by_positions.resize(part.by_positions.len(), DVec3::ZERO);
        self.by_positions.iter_mut().zip(&part.by_positions).for_each(|(sum, g)| *sum += share * *g);
        self.by_colors.resize(part.by_colors.len(), 0.0);
        self.by_colors.iter_mut().zip(&part.by_colors).for_each(|(sum, g)| *sum += share * *g);
        let scaled = |by: &CameraGradient| CameraGradient { twist: by.twist.map(|x| share * x), ..*by };
        self.by_cameras.extend(part.by_cameras.iter().map(scaled));
    }
}

impl ShapeFit {
    /// Starts from a template mesh under the lights of the targets. [`Parametrization::Logit`] begins with a template that
    /// reaches to ±1 at half its size, as the official demo does with its sphere.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a template that the parametrization cannot represent, or 0 samples.
    pub fn new(template: Mesh, lights: Lights, options: ShapeOptions) -> Result<Self> {
        if options.samples == 0 {
            return bad("a fit with 0 samples", "use at least 1");
        }
        if [options.depth.0, options.normal.0].contains(&ImageLoss::NegativeIou) {
            return bad("an IoU of depths or normals", "compare them by L1 or L2");
        }
        let topology = Topology::of(&template)?;
        let template = if options.parametrization == Parametrization::Logit { halved(template)? } else { template };
        let (parameters, values) = Parameters::new(options.parametrization, &topology, &points(&template))?;
        let color_values = if options.fit_colors { colors::values(template.appearance()) } else { Vec::new() };
        Ok(Self {
            topology,
            scene: Scene::new(template).with_lights(lights),
            positions: parameters.positions(&values)?,
            parameters,
            optimizer: Optimizer::new(options.method, values.len()),
            values,
            color_optimizer: Optimizer::new(Method::ADAM, color_values.len()),
            color_values,
            options,
            views_at_once: usize::MAX,
        })
    }

    /// The mesh as it is now.
    pub fn mesh(&self) -> &Mesh {
        &self.scene.meshes[0]
    }

    /// The method of the fit.
    pub fn options(&self) -> &ShapeOptions {
        &self.options
    }

    /// Renders the targets' views, or those of them that [`ShapeOptions::views_per_step`] gives this step, compares them, and
    /// moves vertices with step size `rate` and colours with `color_rate`.
    ///
    /// The fit sets size, outputs and `save` of the settings itself. Where the device or
    /// [`RendererOptions::memory`](softras::RendererOptions::memory) cannot hold all views at once, they are rendered in parts.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for targets that do not fit together; otherwise as [`Renderer::render`] and
    /// [`Renderer::backward`].
    pub fn step(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        targets: &Views,
        rate: f64,
        color_rate: f64,
    ) -> Result<StepLosses> {
        let all = self.all_descents(renderer, settings, targets, self.wanted())?;
        self.finish_step(all, rate, color_rate)
    }

    /// Takes a step as [`ShapeFit::step`] does, and returns the gradient by the camera of each view.
    pub(crate) fn step_with_cameras(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        targets: &Views,
        (rate, color_rate): (f64, f64),
    ) -> Result<Vec<CameraGradient>> {
        let wanted = GradientRequest { camera: true, ..self.wanted() };
        let mut all = self.all_descents(renderer, settings, targets, wanted)?;
        let by_cameras = std::mem::take(&mut all.by_cameras);
        self.finish_step(all, rate, color_rate)?;
        Ok(by_cameras)
    }

    /// The losses and gradients of the views of a step.
    fn all_descents(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        targets: &Views,
        wanted: GradientRequest,
    ) -> Result<Descent> {
        let size = targets.size()?;
        let mut settings = sized(settings, size, self.options.samples);
        settings.outputs.color = targets.color.is_some();
        // Depths are compared together with the silhouette, see `compare`.
        settings.outputs.silhouette = targets.silhouette.is_some() || targets.depth.is_some();
        settings.outputs.depth = targets.depth.is_some();
        settings.outputs.normal = targets.normal.is_some();
        settings.save = true;
        let views = views_of_step(self.steps_taken(), self.options.views_per_step, targets.cameras.len());
        let mut at_once = self.views_at_once;
        let mut all = Descent::default();
        let make = |range: Range<usize>| self.descent(renderer, &settings, &targets.some(&views[range]), &wanted);
        softras::parts::in_parts(views.len(), &mut at_once, make, |range, part| {
            all.add(&part, range.len() as f64 / views.len() as f64);
            Ok::<(), Error>(())
        })?;
        self.views_at_once = at_once;
        Ok(all)
    }

    /// Moves vertices and colours.
    fn finish_step(&mut self, all: Descent, rate: f64, color_rate: f64) -> Result<StepLosses> {
        let Descent { losses, by_positions, by_colors, .. } = all;
        let regularizers = self.move_by(by_positions, &by_colors, rate, color_rate)?;
        let penalties: f64 = self.options.regularizers.iter().zip(&regularizers).map(|((_, w), r)| w * r).sum();
        let ImageLosses { silhouette, color, depth, normal } = losses;
        Ok(StepLosses {
            loss: losses.weighted(&self.options) + penalties,
            silhouette,
            color,
            depth,
            normal,
            regularizers,
        })
    }

    /// The number of steps that the optimisers have taken.
    fn steps_taken(&self) -> usize {
        usize::try_from(self.optimizer.steps().max(self.color_optimizer.steps())).unwrap_or_default()
    }

    /// Renders some views, and compares and differentiates them.
    fn descent(
        &self,
        renderer: &mut Renderer,
        settings: &Settings,
        targets: &Views,
        wanted: &GradientRequest,
    ) -> Result<Descent> {
        let cameras = finer(&targets.cameras, self.options.samples)?;
        let frame = renderer.render(&self.scene, &cameras, settings)?;
        let (losses, upstream) = compare(&frame, targets, &self.options)?;
        let gradients = renderer.backward(&frame, &upstream, wanted)?;
        let (by_positions, by_colors) = self.gradients(&gradients.meshes[0]);
        Ok(Descent { losses, by_positions, by_colors, by_cameras: gradients.cameras })
    }

    /// The inputs by which [`Renderer::backward`] has to differentiate.
    fn wanted(&self) -> GradientRequest {
        let wanted = GradientRequest { positions: self.options.fit_positions, ..GradientRequest::NOTHING };
        if self.options.fit_colors { colors::wanted(self.mesh().appearance(), wanted) } else { wanted }
    }

    /// The gradients by positions and colours, each empty where the fit does not move them.
    fn gradients(&self, mesh: &MeshGradients) -> (Vec<DVec3>, Vec<f64>) {
        let fit_colors = self.options.fit_colors;
        (
            doubles(&mesh.positions),
            if fit_colors { colors::gradient(self.mesh().appearance(), mesh) } else { Vec::new() },
        )
    }

    /// Renders some cameras' views, and takes a step by a loss of the caller's, who gives its value and its gradient by the images.
    /// Settings say the size and which images there are. Returns the value.
    ///
    /// # Errors
    /// Those of `loss`; otherwise as [`ShapeFit::step`].
    pub fn step_by(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        cameras: &[Camera],
        loss: impl FnOnce(&Frame) -> Result<(f64, ImageGradient)>,
        (rate, color_rate): (f64, f64),
    ) -> Result<f64> {
        let frame = renderer.render_saved(&self.scene, cameras, settings)?;
        let (value, upstream) = loss(&frame)?;
        let gradients = renderer.backward(&frame, &upstream, &self.wanted())?;
        let (by_positions, by_colors) = self.gradients(&gradients.meshes[0]);
        self.move_by(by_positions, &by_colors, rate, color_rate)?;
        Ok(value)
    }

    /// Adds the regularizers' gradients to those of the loss, and moves vertices and colours. Returns the regularizers' penalties,
    /// unweighted.
    fn move_by(&mut self, positions: Vec<DVec3>, colors: &[f64], rate: f64, color_rate: f64) -> Result<Vec<f64>> {
        let penalties = self.move_vertices(positions, rate)?;
        if self.options.fit_colors {
            self.move_colors(colors, color_rate)?;
        }
        Ok(penalties)
    }

    /// Adds the regularizers' gradients, moves the vertices, and returns the unweighted penalties.
    fn move_vertices(&mut self, mut gradient: Vec<DVec3>, rate: f64) -> Result<Vec<f64>> {
        if !self.options.fit_positions {
            return Ok(vec![0.0; self.options.regularizers.len()]);
        }
        let mut penalties = Vec::with_capacity(self.options.regularizers.len());
        for (regularizer, weight) in &self.options.regularizers {
            penalties.push(regularizer.add(&self.topology, &self.positions, *weight, &mut gradient)?);
        }
        let gradient = self.parameters.pull(&self.values, gradient)?;
        self.optimizer.step(&mut self.values, &gradient, rate);
        self.place()?;
        Ok(penalties)
    }

    /// Updates the positions from the parameters.
    fn place(&mut self) -> Result<()> {
        self.positions = self.parameters.positions(&self.values)?;
        self.scene.meshes[0].set_positions(singles(&self.positions))
    }

    fn move_colors(&mut self, gradient: &[f64], rate: f64) -> Result<()> {
        self.color_optimizer.step(&mut self.color_values, gradient, rate);
        self.color_values.iter_mut().for_each(|x| *x = x.clamp(0.0, 1.0));
        self.scene.meshes[0] = colors::recolored(self.mesh(), &self.color_values)?;
        Ok(())
    }

    /// The state that the fit can be resumed from: all parameters and the optimisers' running means.
    pub fn state(&self) -> State {
        State {
            values: self.values.clone(),
            optimizer: self.optimizer.state(),
            color_values: self.color_values.clone(),
            color_optimizer: self.color_optimizer.state(),
        }
    }

    /// Continues from a saved state.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] when the state belongs to another mesh or other options, or is not finite.
    pub fn restore(&mut self, state: State) -> Result<()> {
        let is_finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
        let mut optimizers = (self.optimizer.clone(), self.color_optimizer.clone());
        let fits = state.values.len() == self.values.len()
            && state.color_values.len() == self.color_values.len()
            && is_finite(&state.values)
            && is_finite(&state.color_values)
            && optimizers.0.restore(&state.optimizer)
            && optimizers.1.restore(&state.color_optimizer);
        if !fits {
            return bad(
                "a saved state of another fit, or with invalid numbers",
                "resume with the template and the options it was begun with",
            );
        }
        (self.optimizer, self.color_optimizer) = optimizers;
        (self.values, self.color_values) = (state.values, state.color_values);
        self.place()?;
        if self.options.fit_colors {
            self.scene.meshes[0] = colors::recolored(self.mesh(), &self.color_values)?;
        }
        Ok(())
    }

    /// This fit on the mesh with every triangle divided into four, with a new optimiser.
    ///
    /// # Errors
    /// Those of [`Subdivision::of`].
    pub fn subdivided(&self, subdivision: Subdivision) -> Result<Self> {
        self.on(subdivision.with(self.mesh(), &self.topology)?)
    }

    /// This fit on the mesh remeshed to edges whose lengths lie in a range of world units, with a new optimiser; see
    /// [`remeshed`].
    ///
    /// # Errors
    /// Those of [`remeshed`].
    pub fn remeshed(&self, edges: RangeInclusive<f64>) -> Result<Self> {
        self.on(remeshed(self.mesh(), edges)?)
    }

    fn on(&self, mesh: Mesh) -> Result<Self> {
        Self::new(mesh, self.scene.lights.clone(), self.options.clone())
    }
}

/// The mesh at half its size if it reaches to ±1, as [`shapes::icosphere`](softras::shapes::icosphere) does, where the logit has
/// no value; larger ones are left for the parametrization to refuse.
fn halved(mut mesh: Mesh) -> Result<Mesh> {
    let reach = mesh.positions().as_flattened().iter().fold(0.0f32, |most, x| most.max(x.abs()));
    if (1.0 - ROUNDING..=1.0 + ROUNDING).contains(&reach) {
        mesh.set_positions(mesh.positions().iter().map(|p| p.map(|x| 0.5 * x)).collect())?;
    }
    Ok(mesh)
}

/// How far from 1 the coordinates of a unit sphere may be.
const ROUNDING: f32 = 1e-6;

/// The state that a fit is resumed from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// The shape's parameters.
    pub values: Vec<f64>,
    /// Number of steps taken, mean of the gradient, mean of its square.
    pub optimizer: (i32, Vec<f64>, Vec<f64>),
    /// The colours.
    pub color_values: Vec<f64>,
    /// The colours' optimiser, in the same form.
    pub color_optimizer: (i32, Vec<f64>, Vec<f64>),
}
