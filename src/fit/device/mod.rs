//! Whole fitting steps on the device: one submission each, and nothing waited for but the losses when they are asked for.
//!
//! A step is the rasterizer's forward pass, the losses and their derivatives by the images, the regularisers, the
//! rasterizer's backward pass, the optimiser. Vertices, what the optimiser remembers, targets and neighbours stay on the
//! device; from step to step the host gives only σ, γ, the rates and the like, as push constants. All sums are taken in one
//! order, so the same input gives the same bits.
//!
//! [`HostFit`] does the same on the host, in single precision and in the same order, and gives the same bits wherever the
//! device's +, -, ×, ÷ and √ round as IEEE 754 says. It is the place for a loss of your own. [`ShapeFit`] is the same
//! method in double precision, and what both are held against.
//!
//! Smoothed parameters ([`Parametrization::Smoothed`](super::shape::Parametrization)) of up to 1536 vertices go through the
//! whole inverse of their matrix. Beyond, they are solved for by a fixed number of Chebyshev's iterations, to 1 %: a linear,
//! symmetric map, so its own transpose, and a parametrisation in its own right.

mod arithmetic;
mod buffers;
mod guard;
mod host;
mod memory;
mod plan;
mod smoother;
mod stages;
mod tables;

pub use host::HostFit;

use super::bad;
use super::shape::{ShapeFit, Step, Targets};
use crate::constants as c;
use crate::embed::{
    Differentiate, FrameBindings, FramePlan, GradientBindings, GradientPlan, Inputs, MeshShape, Rasterizer, Shape,
    Status,
};
use crate::error::Result;
use crate::frame::pipelines::Pipelines;
use crate::frame::plan::Capacity;
use crate::gradients::Wanted;
use crate::image::Image;
use crate::renderer::Renderer;
use crate::scene::{Camera, Mesh, Projection, Settings};
use crate::vulkan::{CommandBuffer, vk};
use buffers::{BufferId, Own};
use guard::Guard;
use host::{FitState, step_of};
use memory::{Memory, ROWS, Upload};
use plan::{FitPlan, unsupported, unsupported_settings};
use stages::{Numbers, Stages};

/// The kernels of this module: those of a frame have other push constants.
pub const KERNELS: [&str; 14] = [
    "loss_pool",
    "image_loss",
    "loss_sum",
    "image_upstream",
    "regularize_vertices",
    "regularize_flaps",
    "loss_record",
    "shape_gradient",
    "smooth",
    "smooth_dense",
    "step_totals",
    "optimizer",
    "position_step",
    "color_step",
];

/// A fit in progress on a renderer's device.
#[derive(Debug)]
pub struct DeviceFit {
    /// As it was when last asked for.
    shape: ShapeFit,
    cameras: Vec<Camera>,
    plan: FitPlan,
    rasterizer: Rasterizer,
    pipelines: Pipelines,
    memory: Memory,
    bound: Option<Bound>,
    /// What to begin with, until it is on the device.
    initial: Option<FitState>,
    flights: [CommandBuffer; 2],
    /// What is not a step: uploads, downloads.
    service: CommandBuffer,
    /// Steps submitted and not yet confirmed, in order.
    pending: Vec<Submitted>,
    /// Steps taken and not yet asked for.
    found: Vec<Step>,
    /// The least loss and which step found it, counted from the first of this fit.
    best: Option<(f64, usize)>,
    confirmed: usize,
    submitted: usize,
    repeated: usize,
    capacity: Option<Capacity>,
    guard: Option<Guard>,
    /// Steps that the optimisers have been given, those before this fit among them.
    steps: [i32; 2],
    device: vk::Device,
}

/// A frame, its gradients and the fit's stages, bound to the buffers.
#[derive(Debug)]
struct Bound {
    frame: FramePlan,
    gradients: GradientPlan,
    forward: FrameBindings,
    backward: GradientBindings,
    stages: Stages,
}

/// A step as it was asked for.
#[derive(Clone, Debug)]
struct Submitted {
    settings: Settings,
    rate: f64,
    color_rate: f64,
    /// The optimisers' counts in it.
    steps: [i32; 2],
}

impl DeviceFit {
    /// Takes a fit up where it is. `weights` masks pixels out: `[views, height, width, 1]`, of the targets' size.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets or weights that do not fit together, and for what [`DeviceFit::unsupported`] names;
    /// [`crate::Error::Limit`], [`crate::Error::OutOfMemory`], [`crate::Error::Vulkan`].
    pub fn new(renderer: &Renderer, fit: ShapeFit, targets: &Targets, weights: Option<&Image>) -> Result<Self> {
        let (plan, tables) = FitPlan::new(&fit, targets, weights)?;
        let context = renderer.context();
        let initial = FitState::of(&fit, &plan, &tables)?;
        let mut memory = Memory::default();
        memory.add_own(context, &plan, &tables)?;
        let mut shape = fit;
        shape.show(initial.positions.clone(), &initial.colors)?;
        Ok(Self {
            shape,
            cameras: targets.cameras.clone(),
            plan,
            rasterizer: Rasterizer::on(context.device(), Some(context.pipeline_cache().clone())),
            pipelines: Pipelines::default(),
            memory,
            bound: None,
            steps: [initial.steps, initial.color_steps],
            initial: Some(initial),
            flights: [CommandBuffer::new(context, "softras fit 0")?, CommandBuffer::new(context, "softras fit 1")?],
            service: CommandBuffer::new(context, "softras fit service")?,
            pending: Vec::new(),
            found: Vec::new(),
            best: None,
            confirmed: 0,
            submitted: 0,
            repeated: 0,
            capacity: None,
            guard: None,
            device: context.device().raw().handle(),
        })
    }

    /// Why a fit cannot run on the device and takes [`ShapeFit::step`] instead; `None` where it can.
    pub fn unsupported(fit: &ShapeFit) -> Option<String> {
        unsupported(fit)
    }

    /// Why a step with these settings cannot run on the device; `None` where it can.
    pub fn unsupported_settings(settings: &Settings) -> Option<String> {
        unsupported_settings(settings)
    }

    /// Submits a step and does not wait for it: the targets' views, compared, and vertices moved by `rate`, colours by
    /// `color_rate`. Size, outputs and `save` of the settings are the fit's own business.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for settings that [`DeviceFit::unsupported_settings`] names, or another renderer than the fit was made
    /// with; otherwise, for this step or one before it, as [`Renderer::render`].
    pub fn step(&mut self, renderer: &Renderer, settings: &Settings, rate: f64, color_rate: f64) -> Result<()> {
        if renderer.context().device().raw().handle() != self.device {
            return bad("another renderer than the fit was made with", "use the same one throughout");
        }
        if let Some(reason) = unsupported_settings(settings) {
            return bad(reason, "fit it on the host (ShapeFit)");
        }
        if self.pending.len() == ROWS {
            self.settle(renderer)?;
        }
        self.steps = [self.steps[0].saturating_add(1), self.steps[1].saturating_add(1)];
        let settings = self.plan.settings(settings);
        self.submit(renderer, Submitted { settings, rate, color_rate, steps: self.steps })
    }

    /// Waits for all steps submitted, and what those found that were not yet asked for.
    ///
    /// # Errors
    /// As [`DeviceFit::step`].
    pub fn found(&mut self, renderer: &Renderer) -> Result<Vec<Step>> {
        self.settle(renderer)?;
        Ok(std::mem::take(&mut self.found))
    }

    /// Waits for all steps, and the fit as they left it: its mesh, and all that it would resume from.
    ///
    /// # Errors
    /// As [`DeviceFit::step`].
    pub fn shape(&mut self, renderer: &Renderer) -> Result<&ShapeFit> {
        self.settle(renderer)?;
        if self.initial.is_none() {
            self.download()?;
            let mut state = self.memory.read_state(&self.plan)?;
            [state.steps, state.color_steps] = self.steps;
            state.color_steps = if self.plan.fit_colors { state.color_steps } else { 0 };
            state.put_back(&self.plan, &mut self.shape)?;
        }
        Ok(&self.shape)
    }

    /// Waits for all steps, and the mesh of least loss with the step, counted from the fit's first, that found it;
    /// `None` before the first.
    ///
    /// # Errors
    /// As [`DeviceFit::step`].
    pub fn best(&mut self, renderer: &Renderer) -> Result<Option<(Mesh, usize)>> {
        self.settle(renderer)?;
        let Some((_, step)) = self.best else { return Ok(None) };
        self.download()?;
        let count = self.plan.vertices as usize;
        let colors = if self.plan.fit_colors { self.memory.vectors(Own::BestColors, count)? } else { Vec::new() };
        let mut shape = self.shape.clone();
        shape.show(self.memory.vectors(Own::BestPositions, count)?, &colors)?;
        Ok(Some((shape.mesh().clone(), step)))
    }

    /// Steps that were submitted again so far: those that the device skipped because a frame before them had too little
    /// room, or a vertex had left the box that frames were planned for.
    pub fn repeated(&self) -> usize {
        self.repeated
    }

    /// Records a step and hands it to the queue.
    fn submit(&mut self, renderer: &Renderer, step: Submitted) -> Result<()> {
        self.prepare(renderer, &step.settings)?;
        let (Some(bound), Some(guard)) = (&self.bound, &self.guard) else {
            return bad("a step without a frame", "report this");
        };
        let Capacity { coarse, list, cells } = bound.frame.capacity();
        let numbers = Numbers {
            rates: FitPlan::rates(self.plan.method, step.steps[0], step.rate),
            color_rates: FitPlan::rates(super::optimizer::Method::ADAM, step.steps[1], step.color_rate),
            capacity: Capacity { coarse, list, cells },
            longest_list: bound.frame.longest_list(),
            row: self.pending.len() as u32,
            bounds: guard.bounds,
        };
        let (plan, memory, rasterizer) = (&self.plan, &self.memory, &self.rasterizer);
        let flight = &mut self.flights[self.submitted % 2];
        flight.record(|recorder| {
            rasterizer.forward(recorder, &bound.frame, &bound.forward, None)?;
            bound.stages.record_loss(recorder, plan, &numbers)?;
            rasterizer.backward(recorder, &bound.gradients, &bound.backward, None)?;
            bound.stages.record_step(recorder, plan, &numbers)?;
            memory.record_download(recorder, false)
        })?;
        flight.submit()?;
        self.submitted += 1;
        self.pending.push(step);
        Ok(())
    }

    /// Plans the frame of some settings, and binds what it takes unless that is bound.
    fn prepare(&mut self, renderer: &Renderer, settings: &Settings) -> Result<()> {
        let guard = match self.guard.filter(|guard| guard.fits(settings)) {
            Some(guard) => guard,
            None => Guard::new(&self.positions()?, &self.cameras, settings)?,
        };
        self.guard = Some(guard);
        let scene = self.shape.scene();
        let shape = Shape {
            meshes: scene.meshes.iter().map(MeshShape::of).collect(),
            views: self.cameras.len() as u32,
            lights: scene.lights.clone(),
            depth_span: guard.span,
            distorted: self.cameras.iter().any(|c| matches!(c.projection(), Projection::Official { .. })),
            cutoff: settings.cutoff(),
            capacity: self.capacity,
            device_counts: false,
        };
        let frame = self.rasterizer.plan(&shape, settings)?;
        self.capacity = Some(frame.capacity());
        let wanted = Wanted { positions: true, colors: self.plan.fit_colors, ..Wanted::NOTHING };
        let differentiate = Differentiate { upstream: settings.outputs, wanted, largest_upstream: 1.0 };
        let gradients = self.rasterizer.plan_backward(&frame, &differentiate)?;
        match &mut self.bound {
            Some(bound) if bound.forward.fits(&frame).is_ok() && bound.backward.fits(&gradients).is_ok() => {
                (bound.frame, bound.gradients) = (frame, gradients);
                Ok(())
            }
            _ => self.bind(renderer, settings, frame, gradients),
        }
    }

    fn bind(
        &mut self,
        renderer: &Renderer,
        settings: &Settings,
        frame: FramePlan,
        gradients: GradientPlan,
    ) -> Result<()> {
        self.flights.iter_mut().try_for_each(CommandBuffer::settle)?;
        self.bound = None;
        let context = renderer.context();
        self.memory.reserve(context, &frame, &gradients)?;
        let inputs = Inputs::new(self.shape.scene(), &self.cameras, settings, &frame);
        self.memory.write_inputs(&inputs)?;
        let upload = match self.initial.take() {
            Some(state) => {
                let colors = inputs.get(BufferId::Colors).filter(|_| !self.plan.fit_colors);
                self.memory.write_state(&state, colors)?;
                Upload::Everything
            }
            None => Upload::Inputs,
        };
        self.upload(upload)?;
        let parts = self.memory.set.parts(frame.buffers().iter().map(|b| b.id))?;
        let forward = self.rasterizer.bind_parts(&frame, parts)?;
        let parts = self.memory.set.parts(gradients.buffers().iter().map(|b| b.id))?;
        let backward = self.rasterizer.bind_backward_parts(&gradients, &parts, &forward)?;
        let stages = Stages::new(context, &mut self.pipelines, &self.plan, &self.memory)?;
        self.bound = Some(Bound { frame, gradients, forward, backward, stages });
        Ok(())
    }

    /// The vertices as they are now, once nothing is pending.
    fn positions(&mut self) -> Result<Vec<[f32; 3]>> {
        if let Some(initial) = &self.initial {
            return Ok(initial.positions.clone());
        }
        self.flights.iter_mut().try_for_each(CommandBuffer::settle)?;
        self.download()?;
        self.memory.vectors(BufferId::Positions, self.plan.vertices as usize)
    }

    /// Waits for all that is pending. Where a step could not be taken, makes room and submits it and all behind it again.
    fn settle(&mut self, renderer: &Renderer) -> Result<()> {
        loop {
            self.flights.iter_mut().try_for_each(CommandBuffer::settle)?;
            let submitted = std::mem::take(&mut self.pending);
            let Some((row, record)) = self.confirm(submitted.len())? else { return Ok(()) };
            self.recover(&record)?;
            for step in submitted.into_iter().skip(row) {
                self.repeated += 1;
                self.submit(renderer, step)?;
            }
        }
    }

    /// Takes note of steps that were taken, up to the first that was not.
    fn confirm(&mut self, rows: usize) -> Result<Option<(usize, [u32; c::RECORD_WORDS as usize])>> {
        for row in 0..rows {
            let record = self.memory.record(row)?;
            if record[c::RECORD_HALTED as usize] != 0 {
                return Ok(Some((row, record)));
            }
            let number = |at: u32| f32::from_bits(record[at as usize]);
            let penalties = [0, 1, 2, 3].map(|k| number(c::RECORD_PENALTIES + k));
            let step = step_of(&self.plan, [number(0), number(1), number(2)], penalties);
            if self.best.is_none_or(|(least, _)| step.loss < least) {
                self.best = Some((step.loss, self.confirmed));
            }
            self.found.push(step);
            self.confirmed += 1;
        }
        Ok(None)
    }

    /// Makes the step possible that a record says was not, and lets the device go on.
    fn recover(&mut self, record: &[u32; c::RECORD_WORDS as usize]) -> Result<()> {
        if record[c::RECORD_HALTED as usize] & c::HALT_OUTSIDE != 0 {
            self.guard = None;
        } else if let Some(bound) = &self.bound {
            let mut bytes = [0; Status::BYTES];
            let words = &record[c::RECORD_STATUS as usize..][..c::STATUS_WORDS as usize];
            bytes.copy_from_slice(bytemuck::cast_slice(words));
            match Status::from_bytes(&bytes).judge(&bound.frame)? {
                Some(capacity) => self.capacity = Some(capacity),
                None => return bad("the device took no step and does not say why", "report this"),
            }
        }
        self.memory.go_on()?;
        self.upload(Upload::State)
    }

    fn upload(&mut self, what: Upload) -> Result<()> {
        let memory = &self.memory;
        self.service.record(|recorder| memory.record_upload(recorder, what))?;
        self.service.submit_and_wait()
    }

    fn download(&mut self) -> Result<()> {
        let memory = &self.memory;
        self.service.record(|recorder| memory.record_download(recorder, true))?;
        self.service.submit_and_wait()
    }
}
