//! Shape fits whose steps run entirely on the device: one submission a step, and no wait until losses or the mesh are
//! read.
//!
//! A step records the rasterizer's forward pass, the image losses and their gradients, the regularizers, the
//! rasterizer's backward pass, and the optimiser. Vertices, the optimiser's state, targets and connectivity stay on the
//! device; each step the host passes σ, γ, step sizes and the like as push constants. All sums are taken in a fixed
//! order, so the same input gives the same bits.
//!
//! [`HostFit`] computes the same steps on the host, in single precision and in the same order, and gives the same bits
//! on devices whose +, -, ×, ÷ and √ round as IEEE 754 requires. It also lets the caller insert a loss of its own.
//! [`ShapeFit`] is the same method in double precision, and the reference for both.
//!
//! For [`Parametrization::Smoothed`](super::shape::Parametrization), a mesh of up to 1536 vertices is multiplied by the
//! dense inverse of I + λ L. For larger ones a fixed number of Chebyshev iterations solves the system to 1 %. That is a
//! symmetric linear map, hence its own transpose, so gradients are exact for the parametrization that it defines.

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
use plan::FitPlan;
use stages::{Numbers, Stages};

/// The kernels of this module, which have push constants of their own.
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

/// A shape fit in progress on a renderer's device: the method of [`ShapeFit`] in single precision, one submission a
/// step.
#[derive(Debug)]
pub struct DeviceFit {
    /// The fit as of the last download.
    shape: ShapeFit,
    cameras: Vec<Camera>,
    plan: FitPlan,
    rasterizer: Rasterizer,
    pipelines: Pipelines,
    memory: Memory,
    bound: Option<Bound>,
    /// The initial state, until it is uploaded.
    initial: Option<FitState>,
    flights: [CommandBuffer; 2],
    /// The command buffer for uploads and downloads.
    service: CommandBuffer,
    /// Steps submitted whose records have not been read, in order.
    pending: Vec<Submitted>,
    /// Losses of confirmed steps that the caller has not taken yet.
    found: Vec<Step>,
    /// The least loss, and the step that found it, counted from the first of this fit.
    best: Option<(f64, usize)>,
    confirmed: usize,
    submitted: usize,
    repeated: usize,
    capacity: Option<Capacity>,
    guard: Option<Guard>,
    /// Numbers of steps of the two optimisers, including those before this fit.
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

/// The arguments of a submitted step, to submit it again.
#[derive(Clone, Debug)]
struct Submitted {
    settings: Settings,
    rate: f64,
    color_rate: f64,
    /// Numbers of steps of the two optimisers, this one included.
    steps: [i32; 2],
}

impl DeviceFit {
    /// Continues a shape fit on the device. `weights`, `[views, height, width, 1]` of the targets' size, weighs pixels;
    /// 0 masks one out.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets or weights that do not fit together, and for what [`DeviceFit::unsupported`]
    /// names; [`crate::Error::Limit`], [`crate::Error::OutOfMemory`], [`crate::Error::Vulkan`].
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

    /// Submits a step without waiting for it: renders the targets' views, compares them, and moves vertices with step
    /// size `rate` and colours with `color_rate`. The fit sets size, outputs and `save` of the settings itself.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for settings that [`DeviceFit::unsupported_settings`] names, or another renderer than the
    /// fit was made with; otherwise, for this step or one before it, as [`Renderer::render`].
    pub fn step(&mut self, renderer: &Renderer, settings: &Settings, rate: f64, color_rate: f64) -> Result<()> {
        if renderer.context().device().raw().handle() != self.device {
            return bad("another renderer than the fit was made with", "use the same one throughout");
        }
        if let Some(reason) = Self::unsupported_settings(settings) {
            return bad(reason, "fit it on the host (ShapeFit)");
        }
        if self.pending.len() == ROWS {
            self.settle(renderer)?;
        }
        self.steps = [self.steps[0].saturating_add(1), self.steps[1].saturating_add(1)];
        let settings = self.plan.settings(settings);
        self.submit(renderer, Submitted { settings, rate, color_rate, steps: self.steps })
    }

    /// Waits for all submitted steps and returns the losses of those that were not returned before, in order.
    ///
    /// # Errors
    /// As [`DeviceFit::step`].
    pub fn found(&mut self, renderer: &Renderer) -> Result<Vec<Step>> {
        self.settle(renderer)?;
        Ok(std::mem::take(&mut self.found))
    }

    /// Waits for all submitted steps and returns the fit after them: its mesh, and the state that it can be resumed
    /// from.
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

    /// Waits for all submitted steps and returns the mesh of least loss and the number of its step, counted from 0 in
    /// this fit; `None` before the first step.
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

    /// Sets the capacities of lists until a settled step tells what it needed; for tests of lists without room.
    #[doc(hidden)]
    pub fn set_capacity(&mut self, capacity: Capacity) {
        self.capacity = Some(capacity);
    }

    /// How many steps were submitted again: the device skips those in which a vertex leaves the box that is planned for.
    pub fn repeated(&self) -> usize {
        self.repeated
    }

    /// Records a step and hands it to the queue.
    fn submit(&mut self, renderer: &Renderer, step: Submitted) -> Result<()> {
        self.prepare(renderer, &step.settings)?;
        let (Some(bound), Some(guard)) = (&self.bound, &self.guard) else { return bad("no frame", "report this") };
        let numbers = Numbers {
            rates: FitPlan::rates(self.plan.method, step.steps[0], step.rate),
            color_rates: FitPlan::rates(super::optimizer::Method::ADAM, step.steps[1], step.color_rate),
            row: self.pending.len() as u32,
            guard: *guard,
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

    /// Plans the frame of these settings, and binds its buffers unless the present bindings fit.
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
            opacity: scene.meshes.iter().any(crate::scene::Mesh::has_opacity),
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
        self.memory.reserve(renderer, &frame, &gradients)?;
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

    /// The present vertices; no step may be pending.
    fn positions(&mut self) -> Result<Vec<[f32; 3]>> {
        if let Some(initial) = &self.initial {
            return Ok(initial.positions.clone());
        }
        self.flights.iter_mut().try_for_each(CommandBuffer::settle)?;
        self.download()?;
        self.memory.vectors(BufferId::Positions, self.plan.vertices as usize)
    }

    /// Waits for all pending steps. Where the device skipped one, removes the cause and submits it and all later ones again.
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

    /// Reads the records of pending steps and notes their losses and the room that their frames would have needed, up to the
    /// first step that was skipped. Returns that one's row and record.
    fn confirm(&mut self, rows: usize) -> Result<Option<(usize, [u32; c::RECORD_WORDS as usize])>> {
        for row in 0..rows {
            let record = self.memory.record(row)?;
            if record[c::RECORD_HALTED as usize] != 0 {
                return Ok(Some((row, record)));
            }
            self.capacity = self.larger(&record)?.or(self.capacity);
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

    /// Removes the cause for which the device skipped a step, as its record says, and lets the device continue.
    fn recover(&mut self, record: &[u32; c::RECORD_WORDS as usize]) -> Result<()> {
        if record[c::RECORD_HALTED as usize] & c::HALT_OUTSIDE == 0 {
            self.larger(record)?;
            return bad("the device took no step and does not say why", "report this");
        }
        self.guard = None;
        self.memory.go_on()?;
        self.upload(Upload::State)
    }

    /// The capacity with which the frame of a record would have been faster.
    fn larger(&self, record: &[u32; c::RECORD_WORDS as usize]) -> Result<Option<Capacity>> {
        let Some(bound) = &self.bound else { return Ok(None) };
        let mut bytes = [0; Status::BYTES];
        let words = &record[c::RECORD_STATUS as usize..][..c::STATUS_WORDS as usize];
        bytes.copy_from_slice(bytemuck::cast_slice(words));
        Status::from_bytes(&bytes).validate(&bound.frame)
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
