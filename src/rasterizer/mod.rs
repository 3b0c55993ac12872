//! The embedded API: a host's device, a host's command buffer, a host's memory.

mod arena;
mod bindings;
mod inputs;
mod plan;
mod requirements;
mod shape;
mod status;

pub use arena::Arena;
pub use bindings::{BufferRef, FrameBindings, GradientBindings};
pub use inputs::Inputs;
pub use plan::{BufferRequirement, Differentiate, FramePlan, GradientPlan};
pub use requirements::{Requirements, requirements};
pub use shape::{AppearanceShape, MeshShape, Shape};
pub use status::Status;

pub(crate) use bindings::Parts;

use crate::constants as c;
use crate::error::{Error, Result};
use crate::passes::{self, BACKWARD_COUNT};
use crate::pipelines::{Pipelines, Request};
use crate::scene::Settings;
use crate::vulkan::{Device, DeviceKind, HostDevice, Pipeline, PipelineCache, Recorder, TimestampPool, vk};
use std::sync::{Mutex, PoisonError};

/// softras on a device: its kernels, and how to record them. Owns no memory, no queue and no command buffer.
///
/// It may be shared between threads; see the module's documentation.
pub struct Rasterizer {
    device: Device,
    cache: Option<PipelineCache>,
    pipelines: Mutex<Pipelines>,
    lanes: u32,
}

impl std::fmt::Debug for Rasterizer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rasterizer").field("device", &self.device).field("lanes", &self.lanes).finish_non_exhaustive()
    }
}

impl Rasterizer {
    /// softras on a host's device. Compiles nothing yet: the first plan that is bound, or
    /// [`prepare`](Self::prepare)d, does.
    ///
    /// # Errors
    /// [`Error::NoDevice`] for a device of Vulkan 1.0.
    ///
    /// # Safety
    /// - The handles are valid, belong together, and were made as [`HostDevice`]'s fields say.
    /// - They, and the allocation callbacks with what these point to, stay valid until the rasterizer and all bindings
    ///   made by it are dropped. Any thread that calls softras may call the callbacks, several at once.
    pub unsafe fn new(host: &HostDevice) -> Result<Self> {
        // SAFETY: the caller's promise.
        let device = unsafe { Device::from_host(host) }?;
        let has_cache = !vk::Handle::is_null(host.pipeline_cache);
        // SAFETY: the caller's promise.
        let cache = has_cache.then(|| unsafe { PipelineCache::from_host(&device, host.pipeline_cache) });
        Ok(Self::on(&device, cache))
    }

    /// softras on a device of either kind.
    pub(crate) fn on(device: &Device, cache: Option<PipelineCache>) -> Self {
        // A software device's subgroups have eight lanes, and its shared memory is slow: one subgroup a tile.
        let lanes = if device.kind() == DeviceKind::Software { 8 } else { 32 };
        Self { device: device.clone(), cache, pipelines: Mutex::default(), lanes }
    }

    /// The same with another number of invocations that share a tile, 1 to 32, a power of two; by default 8 on software
    /// devices, 32 elsewhere. The images do not depend on it.
    ///
    /// # Errors
    /// [`Error::Settings`] for another number.
    pub fn with_lanes(mut self, lanes: u32) -> Result<Self> {
        if !(lanes.is_power_of_two() && lanes <= c::TILE_WIDTH * c::TILE_HEIGHT) {
            let mend = "use a power of two from 1 to 32".into();
            return Err(Error::Settings { field: "lanes", value: lanes.to_string(), mend });
        }
        self.lanes = lanes;
        Ok(self)
    }

    /// What a frame of this shape takes. Pure: [`FramePlan::new`] with this device's limits.
    ///
    /// # Errors
    /// As [`FramePlan::new`].
    pub fn plan(&self, shape: &Shape, settings: &Settings) -> Result<FramePlan> {
        FramePlan::new(self.device.limits(), self.device.kind(), shape, settings)
    }

    /// What the gradients of a planned frame take. Pure: [`GradientPlan::new`].
    ///
    /// # Errors
    /// As [`GradientPlan::new`].
    pub fn plan_backward(&self, frame: &FramePlan, differentiate: &Differentiate) -> Result<GradientPlan> {
        GradientPlan::new(frame, differentiate)
    }

    /// Compiles a plan's kernels unless that was done: some hundred milliseconds that a loading screen can hide. Kernels
    /// are compiled side by side on threads that end with the call.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Limit`], [`Error::OutOfMemory`].
    pub fn prepare(&self, plan: &FramePlan) -> Result<()> {
        self.forward_pipelines(plan).map(drop)
    }

    /// The same for gradients.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare).
    pub fn prepare_backward(&self, plan: &GradientPlan) -> Result<()> {
        self.backward_pipelines(plan).map(drop)
    }

    /// Binds a frame's buffers: `(name, part)` for each of [`FramePlan::buffers`]. Done once, not every frame.
    ///
    /// # Errors
    /// [`Error::Host`] naming a buffer that is missing, unknown, too small or misaligned; otherwise as
    /// [`prepare`](Self::prepare).
    ///
    /// # Safety
    /// - Each buffer is of this device, has the usages that the plan asks for, and memory bound to it; the part lies inside.
    /// - They outlive the bindings.
    pub unsafe fn bind(&self, plan: &FramePlan, buffers: &[(&str, BufferRef)]) -> Result<FrameBindings> {
        // SAFETY: the caller's promise.
        let parts = unsafe { Parts::from_host(&self.device, plan.buffers(), buffers) }?;
        self.bind_parts(plan, parts)
    }

    /// Binds the buffers of a backward pass: `(name, part)` for each of [`GradientPlan::buffers`]; the frame's come from
    /// its own bindings.
    ///
    /// # Errors
    /// As [`bind`](Self::bind).
    ///
    /// # Safety
    /// As for [`bind`](Self::bind); the frame's buffers outlive these bindings too.
    pub unsafe fn bind_backward(
        &self,
        plan: &GradientPlan,
        frame: &FrameBindings,
        buffers: &[(&str, BufferRef)],
    ) -> Result<GradientBindings> {
        // SAFETY: the caller's promise.
        let parts = unsafe { Parts::from_host(&self.device, plan.buffers(), buffers) }?;
        self.bind_backward_parts(plan, &parts, frame)
    }

    /// Records a frame. Allocates, maps, submits and waits for nothing.
    ///
    /// The plan may be another than the one that was bound, if [`FrameBindings::fits`] says so: another σ, γ, background
    /// colour or, within the bytes bound, another mesh.
    ///
    /// # Errors
    /// [`Error::Host`] where the plan does not fit the bindings, [`Error::Limit`] for more workgroups than the device
    /// allows. What was recorded up to then is harmless, but no frame.
    ///
    /// # Safety
    /// - The command buffer is of the rasterizer's device, of a queue family that computes, in the recording state, outside
    ///   a render pass, and no other thread uses it or its pool meanwhile.
    /// - When it executes, the inputs are what their tables say (indices within range), and the buffers are synchronised as
    ///   the module's documentation says.
    /// - The bindings are kept until the command buffer has been executed for the last time or thrown away.
    pub unsafe fn record_forward(
        &self,
        command_buffer: vk::CommandBuffer,
        plan: &FramePlan,
        bindings: &FrameBindings,
    ) -> Result<()> {
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::from_raw(&self.device, command_buffer) };
        self.forward(&mut recorder, plan, bindings, None)
    }

    /// Records the gradients of the frame that was last recorded with the same buffers.
    ///
    /// # Errors
    /// As [`record_forward`](Self::record_forward).
    ///
    /// # Safety
    /// As for [`record_forward`](Self::record_forward).
    pub unsafe fn record_backward(
        &self,
        command_buffer: vk::CommandBuffer,
        plan: &GradientPlan,
        bindings: &GradientBindings,
    ) -> Result<()> {
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::from_raw(&self.device, command_buffer) };
        self.backward(&mut recorder, plan, bindings, None)
    }

    pub(crate) fn bind_parts(&self, plan: &FramePlan, parts: Parts) -> Result<FrameBindings> {
        FrameBindings::new(&self.device, self.forward_pipelines(plan)?, plan, parts)
    }

    pub(crate) fn bind_backward_parts(
        &self,
        plan: &GradientPlan,
        parts: &Parts,
        frame: &FrameBindings,
    ) -> Result<GradientBindings> {
        GradientBindings::new(&self.device, self.backward_pipelines(plan)?, plan, parts, frame)
    }

    pub(crate) fn forward(
        &self,
        recorder: &mut Recorder<'_>,
        plan: &FramePlan,
        bindings: &FrameBindings,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        bindings.fits(plan)?;
        let FrameBindings { stages, status, bin_bits, .. } = bindings;
        passes::record_forward(recorder, &plan.plan, stages, status, bin_bits, times)
    }

    pub(crate) fn backward(
        &self,
        recorder: &mut Recorder<'_>,
        plan: &GradientPlan,
        bindings: &GradientBindings,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        bindings.fits(plan)?;
        let GradientBindings { stages, texel_sums, item_counts, .. } = bindings;
        passes::record_backward(recorder, &plan.plan, stages, texel_sums, item_counts, times)
    }

    fn forward_pipelines(&self, plan: &FramePlan) -> Result<[Pipeline; 5]> {
        let (lanes, modes) = (self.lanes, &plan.plan.modes);
        let kernels = passes::forward_kernels(&self.device, lanes);
        self.pipelines(kernels.map(|kernel| Request { kernel, modes, lanes }))
    }

    fn backward_pipelines(&self, plan: &GradientPlan) -> Result<[Pipeline; BACKWARD_COUNT]> {
        let lanes = self.lanes;
        let modes: [_; BACKWARD_COUNT] = std::array::from_fn(|stage| {
            let reduction = ("REDUCTION", passes::reduction_of(stage));
            plan.plan.modes.iter().copied().chain([reduction]).collect::<Vec<_>>()
        });
        let kernels = passes::backward_kernels(&self.device, lanes);
        self.pipelines(std::array::from_fn(|i| Request { kernel: kernels[i], modes: &modes[i], lanes }))
    }

    fn pipelines<const N: usize>(&self, requests: [Request<'_>; N]) -> Result<[Pipeline; N]> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        pipelines.get(&self.device, self.cache.as_ref(), requests)
    }
}
