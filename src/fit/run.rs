//! A shape fit on the device where it can be, else on the host.

use super::device::DeviceFit;
use super::shape::{ShapeFit, Step, Targets, steps_of_a_turn};
use crate::error::{Error, Result};
use crate::image::Image;
use crate::renderer::Renderer;
use crate::scene::{Mesh, Settings};
use std::collections::VecDeque;

/// A shape fit in progress: what to use unless a part of it is to be replaced. Its steps run on the device if that can take
/// them, in single precision and without a wait, else on the host in double precision.
#[derive(Debug)]
pub struct Fit {
    steps: Steps,
    /// Why the host takes the steps.
    reason: Option<String>,
}

#[derive(Debug)]
enum Steps {
    Device(Box<DeviceFit>),
    Host(Box<OnHost>),
}

/// A fit on the host, with what [`DeviceFit`] keeps on the device.
#[derive(Debug)]
struct OnHost {
    shape: ShapeFit,
    targets: Targets,
    /// Losses that the caller has not taken yet.
    found: Vec<Step>,
    /// The mean losses of the latest steps in which every view was compared.
    latest: VecDeque<f64>,
    /// The least mean of them, its mesh, and its step.
    best: Option<(f64, Mesh, usize)>,
    taken: usize,
}

impl OnHost {
    /// Keeps the mesh before a step if its loss is the least. The losses of steps with different views are not comparable, so
    /// it is the mean over the steps in which the views had a turn; before the first turn ends, of those there are.
    fn keep_best(&mut self, before: Mesh, loss: f64) {
        let turn = steps_of_a_turn(self.shape.options().views_per_step, self.targets.cameras.len());
        self.latest.push_back(loss);
        if self.latest.len() > turn {
            self.latest.pop_front();
        }
        let mean = self.latest.iter().sum::<f64>() / self.latest.len() as f64;
        if self.taken < turn || self.best.as_ref().is_none_or(|(least, ..)| mean < *least) {
            self.best = Some((mean, before, self.taken));
        }
    }
}

impl Fit {
    /// Continues a shape fit, on the device if that supports its options and settings like these and holds all views at once.
    /// On the host views are rendered in parts where they have to be.
    ///
    /// # Errors
    /// [`Error::Fit`](crate::Error::Fit) for targets that do not fit together; [`Error::Limit`](crate::Error::Limit),
    /// [`Error::OutOfMemory`](crate::Error::OutOfMemory), [`Error::Vulkan`](crate::Error::Vulkan).
    pub fn new(renderer: &Renderer, shape: ShapeFit, targets: &Targets, settings: &Settings) -> Result<Self> {
        let unsupported = DeviceFit::unsupported(&shape)
            .or_else(|| DeviceFit::unsupported_targets(targets))
            .or_else(|| DeviceFit::unsupported_settings(settings));
        match unsupported {
            Some(reason) => Ok(Self::on_host(shape, targets, reason)),
            None => match DeviceFit::with_room(renderer, shape.clone(), targets, settings) {
                Ok(fit) => Ok(Self { steps: Steps::Device(Box::new(fit)), reason: None }),
                Err(error @ (Error::Limit { .. } | Error::OutOfMemory { .. })) => {
                    Ok(Self::on_host(shape, targets, format!("the views are rendered in parts, since {error}")))
                }
                Err(error) => Err(error),
            },
        }
    }

    /// The same with a weight for each pixel, `[views, height, width, 1]` of the targets' size; 0 masks one out.
    ///
    /// # Errors
    /// [`Error::Fit`](crate::Error::Fit) where the host would have to take the steps, which has no weights; otherwise as
    /// [`Fit::new`].
    pub fn weighted(renderer: &Renderer, shape: ShapeFit, targets: &Targets, weights: &Image) -> Result<Self> {
        let steps = Steps::Device(Box::new(DeviceFit::new(renderer, shape, targets, Some(weights))?));
        Ok(Self { steps, reason: None })
    }

    /// Continues a shape fit on the host, for a reason that [`Fit::host_reason`] tells.
    pub fn on_host(shape: ShapeFit, targets: &Targets, reason: impl Into<String>) -> Self {
        let host = OnHost {
            shape,
            targets: targets.clone(),
            found: Vec::new(),
            latest: VecDeque::new(),
            best: None,
            taken: 0,
        };
        Self { steps: Steps::Host(Box::new(host)), reason: Some(reason.into()) }
    }

    /// Why the host takes the steps; `None` where the device does.
    pub fn host_reason(&self) -> Option<&str> {
        self.reason.as_deref()
    }

    /// Takes a step: renders the targets' views, compares them, and moves vertices with step size `rate`, in world units
    /// about the distance that a vertex moves, and colours with `color_rate`. On the device the step is submitted, not waited
    /// for. The fit sets size, outputs and `save` of the settings itself; near and far have to hold the mesh wherever it moves,
    /// see [`Settings::with_depths_of`].
    ///
    /// # Errors
    /// [`Error::Fit`](crate::Error::Fit) for settings that the device's steps do not support while those of [`Fit::new`] were, or
    /// another renderer than the fit was made with; otherwise, for this step or one before it, as [`Renderer::render`] and
    /// [`Renderer::backward`].
    pub fn step(&mut self, renderer: &mut Renderer, settings: &Settings, rate: f64, color_rate: f64) -> Result<()> {
        let host = match &mut self.steps {
            Steps::Device(fit) => return fit.step(renderer, settings, rate, color_rate),
            Steps::Host(host) => host,
        };
        let before = host.shape.mesh().clone();
        let step = host.shape.step(renderer, settings, &host.targets, rate, color_rate)?;
        host.keep_best(before, step.loss);
        host.found.push(step);
        host.taken += 1;
        Ok(())
    }

    /// Waits for all steps and returns the losses of those that were not returned before, in order.
    ///
    /// # Errors
    /// As [`Fit::step`].
    pub fn found(&mut self, renderer: &mut Renderer) -> Result<Vec<Step>> {
        match &mut self.steps {
            Steps::Device(fit) => fit.found(renderer),
            Steps::Host(host) => Ok(std::mem::take(&mut host.found)),
        }
    }

    /// Waits for all steps and returns the fit after them: its mesh, and the state that it can be resumed from.
    ///
    /// # Errors
    /// As [`Fit::step`].
    pub fn shape(&mut self, renderer: &mut Renderer) -> Result<&ShapeFit> {
        match &mut self.steps {
            Steps::Device(fit) => fit.shape(renderer),
            Steps::Host(host) => Ok(&host.shape),
        }
    }

    /// Waits for all steps and returns the mesh of least loss and the number of its step, counted from 0 in this fit; `None`
    /// before the first step.
    ///
    /// # Errors
    /// As [`Fit::step`].
    pub fn best(&mut self, renderer: &mut Renderer) -> Result<Option<(Mesh, usize)>> {
        match &mut self.steps {
            Steps::Device(fit) => fit.best(renderer),
            Steps::Host(host) => Ok(host.best.as_ref().map(|(_, mesh, step)| (mesh.clone(), *step))),
        }
    }
}
