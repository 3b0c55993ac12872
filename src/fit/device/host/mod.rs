//! The device's fit computed on the host around [`Renderer::render`] and [`Renderer::backward`]: the same operations in
//! the same order in single precision, so the same bits. The caller can insert a loss of its own between the two.

mod images;
mod regularizers;
mod steps;

pub use regularizers::{edge_scale, edge_share};

use super::arithmetic::{Vec3, value_of};
use super::plan::FitPlan;
use super::tables::Tables;
use crate::error::Result;
use crate::fit::bad;
use crate::fit::shape::{ShapeFit, State, Step, Targets};
use crate::gradients::{Gradients, ImageGradient, Wanted};
use crate::image::Image;
use crate::renderer::{Frame, Renderer};
use crate::scene::{Camera, Mesh, Settings};

/// The state of a fit in the form of the device's buffers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitState {
    pub positions: Vec<Vec3>,
    /// Displacements in logit space, then the centre; empty for other parametrizations.
    pub parameters: Vec<Vec3>,
    /// Running means of each row's gradient and of its square.
    pub moments: Vec<[Vec3; 2]>,
    pub colors: Vec<Vec3>,
    pub color_moments: Vec<[Vec3; 2]>,
    pub steps: i32,
    pub color_steps: i32,
}

/// A shape fitted step by step on the host with the bits of a [`Fit`](crate::fit::Fit) on the device.
///
/// [`HostFit::step`] computes a whole step. For a loss of your own, call [`HostFit::render`], compute the loss and its
/// gradient by the images, and call [`Renderer::backward`] and [`HostFit::advance`].
#[derive(Clone, Debug)]
pub struct HostFit {
    fit: ShapeFit,
    cameras: Vec<Camera>,
    pub(super) plan: FitPlan,
    pub(super) tables: Tables,
    state: FitState,
}

impl HostFit {
    /// Continues a shape fit in single precision. `weights`, `[views, height, width, 1]` of the targets' size, weighs
    /// pixels.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets or weights that do not fit together, and what
    /// [`Fit::host_reason`](crate::fit::Fit::host_reason) would tell.
    pub fn new(fit: ShapeFit, targets: &Targets, weights: Option<&Image>) -> Result<Self> {
        let (plan, tables) = FitPlan::new(&fit, targets, weights)?;
        let state = FitState::of(&fit, &plan, &tables)?;
        let mut made = Self { fit, cameras: targets.cameras.clone(), plan, tables, state };
        made.show()?;
        Ok(made)
    }

    /// The mesh as it is now.
    pub fn mesh(&self) -> &Mesh {
        self.fit.mesh()
    }

    /// Renders the present mesh from the targets' cameras, saved for backward.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn render(&self, renderer: &mut Renderer, settings: &Settings) -> Result<Frame> {
        renderer.render(self.fit.scene(), &self.cameras, &self.plan.settings(settings))
    }

    /// What [`Renderer::backward`] has to differentiate by for [`HostFit::advance`].
    pub fn wanted(&self) -> Wanted {
        Wanted { positions: true, colors: self.plan.fit_colors, ..Wanted::NOTHING }
    }

    /// The losses of a frame, the regularizers' values included, and the gradient of the weighted image losses by the
    /// images.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for a frame with other images or sizes than the targets.
    pub fn compare(&self, frame: &Frame) -> Result<(Step, ImageGradient)> {
        let rendered = images::texels(&self.plan, frame)?;
        let pyramid = images::pyramid(&self.plan, &rendered);
        let sums = images::sums(&self.plan, &self.tables, &rendered, &pyramid);
        let upstream = images::upstream(&self.plan, &self.tables, &rendered, &pyramid, &sums);
        let penalties = regularizers::Penalties::of(&self.plan, &self.tables, &self.state.positions);
        Ok((self.found(&sums, &penalties), images::gradient(&self.plan, upstream)))
    }

    /// Moves vertices and colours against their gradients, to which the regularizers' are added.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for gradients of another mesh; [`crate::Error::Mesh`] when a step makes a vertex infinite
    /// or a NaN.
    pub fn advance(&mut self, gradients: &Gradients, rate: f64, color_rate: f64) -> Result<()> {
        let vertices = self.plan.vertices as usize;
        let by = gradients.meshes.first();
        let Some(by) = by.filter(|m| m.positions.len() == vertices) else {
            return bad("gradients of another mesh", "differentiate a frame of this fit by what it wants");
        };
        let penalties = regularizers::Penalties::of(&self.plan, &self.tables, &self.state.positions);
        let gradient = penalties.gathered(&self.plan, &self.tables, &by.positions);
        steps::advance(&self.plan, &self.tables, &mut self.state, gradient, rate);
        if self.plan.fit_colors {
            steps::advance_colors(&mut self.state, &by.colors, color_rate);
        }
        self.show()
    }

    /// A whole step: renders, compares, differentiates, advances.
    ///
    /// # Errors
    /// As its parts.
    pub fn step(&mut self, renderer: &mut Renderer, settings: &Settings, rate: f64, color_rate: f64) -> Result<Step> {
        let frame = self.render(renderer, settings)?;
        let (found, upstream) = self.compare(&frame)?;
        let gradients = renderer.backward(&frame, &upstream, &self.wanted())?;
        self.advance(&gradients, rate, color_rate)?;
        Ok(found)
    }

    /// The losses and penalties of a step, summed in the device's order.
    fn found(&self, sums: &[[f32; 4]], penalties: &regularizers::Penalties) -> Step {
        let plan = &self.plan;
        let views = plan.views as usize;
        let [silhouette, color] = super::arithmetic::strided_sum(sums.len(), |i| {
            let (s, scales) = (sums[i], plan.levels[i / views].scales);
            [
                value_of(plan.silhouette.code, [s[0], s[1]], scales[0]),
                value_of(plan.color.code, [s[2], s[3]], scales[1]),
            ]
        });
        let values = penalties.values(plan);
        let mut total = plan.silhouette.weight * silhouette;
        total += plan.color.weight * color;
        let weights = [plan.laplacian_weight, plan.flatten_weight, plan.edge_weight, plan.normal_weight];
        weights.iter().zip(values).for_each(|(w, v)| total += w * v);
        step_of(plan, [total, silhouette, color], values)
    }

    fn show(&mut self) -> Result<()> {
        self.fit.show(self.state.positions.clone(), &self.state.colors)
    }

    /// The fit as it is now, to be saved or continued in f64.
    ///
    /// # Errors
    /// [`crate::Error::Mesh`] when a step has made a vertex infinite or a NaN.
    pub fn into_shape(mut self) -> Result<ShapeFit> {
        self.state.put_back(&self.plan, &mut self.fit)?;
        Ok(self.fit)
    }
}

/// A step's losses, with the penalties in the order of the options' regularizers.
pub fn step_of(plan: &FitPlan, [loss, silhouette, color]: [f32; 3], penalties: [f32; 4]) -> Step {
    Step {
        loss: loss.into(),
        silhouette: silhouette.into(),
        color: color.into(),
        // The device compares neither.
        depth: 0.0,
        normal: 0.0,
        regularizers: plan.penalties.iter().map(|&index| penalties[index].into()).collect(),
    }
}

impl FitState {
    /// The state of a fit, rounded to single precision.
    pub fn of(fit: &ShapeFit, plan: &FitPlan, tables: &Tables) -> Result<Self> {
        let saved = fit.state();
        let rows = |values: &[f64]| -> Vec<Vec3> {
            values.chunks_exact(3).map(|v| [v[0] as f32, v[1] as f32, v[2] as f32]).collect()
        };
        let pairs = |(_, first, second): &(i32, Vec<f64>, Vec<f64>)| -> Vec<[Vec3; 2]> {
            let mut second = rows(second);
            second.resize(first.len() / 3, [0.0; 3]);
            rows(first).into_iter().zip(second).map(|(a, b)| [a, b]).collect()
        };
        let mut state = Self {
            positions: fit.mesh().positions().to_vec(),
            moments: pairs(&saved.optimizer),
            colors: rows(&saved.color_values),
            color_moments: pairs(&saved.color_optimizer),
            steps: saved.optimizer.0,
            color_steps: saved.color_optimizer.0,
            parameters: Vec::new(),
        };
        if plan.logit {
            state.parameters = rows(&saved.values);
            state.positions = steps::logit_positions(tables, &state.parameters);
        }
        Ok(state)
    }

    /// Sets a fit to this state.
    pub fn put_back(&self, plan: &FitPlan, fit: &mut ShapeFit) -> Result<()> {
        fit.show(self.positions.clone(), &self.colors)?;
        fit.restore(self.saved(plan, fit)?)?;
        // Restoring computed the positions in double precision; these are the device's.
        fit.show(self.positions.clone(), &self.colors)
    }

    /// The state in the form that [`ShapeFit`] restores.
    fn saved(&self, plan: &FitPlan, fit: &ShapeFit) -> Result<State> {
        let flat = |rows: &[Vec3]| rows.as_flattened().iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
        let moment = |moments: &[[Vec3; 2]], k: usize| flat(&moments.iter().map(|m| m[k]).collect::<Vec<_>>());
        let sgd = matches!(plan.method, crate::fit::optimizer::Method::Sgd { .. });
        let second = if sgd { Vec::new() } else { moment(&self.moments, 1) };
        Ok(State {
            values: if plan.logit { flat(&self.parameters) } else { fit.values_at(&self.positions)? },
            optimizer: (self.steps, moment(&self.moments, 0), second),
            color_values: flat(&self.colors),
            color_optimizer: (self.color_steps, moment(&self.color_moments, 0), moment(&self.color_moments, 1)),
        })
    }
}
