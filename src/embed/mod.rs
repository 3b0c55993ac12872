//! The embedded API: softras on a host's device, in a host's command buffer, with a host's memory.
//!
//! [`Rasterizer`] holds the kernels on a device. A frame goes through three steps, each with types of its own:
//!
//! 1. **Plan**, from counts and settings, without memory: [`FramePlan`] from a [`FrameShape`] lists the buffers that a frame
//!    needs, and [`GradientPlan`] from [`Differentiate`] those that its gradients need besides.
//! 2. **Bind**, once: [`FrameBindings`] and [`GradientBindings`] check the host's buffers and write the descriptors.
//!    [`Arena`] divides one buffer into many, and [`Inputs`] lays out the bytes of a scene in the host's memory.
//! 3. **Record**, every frame, without allocating: the stages of a frame, then those of its gradients. [`Status`] says
//!    whether the lists had room, and [`Decoder`] turns the bytes of the gradients into [`Gradients`](crate::Gradients).
//!
//! Steps around these three take a host's own data: [`Geometry`] reads vertex and index buffers, [`Counts`] takes numbers of
//! triangles that only the device knows, and [`FrameImage`] stores into images. [`Pass`] does all of it for a program that
//! wants no layer between its handles and its gradients.
//!
#![doc = include_str!("guide.md")]

mod arena;
mod bindings;
mod builder;
mod camera;
mod counts;
mod decode;
mod geometry;
mod inputs;
mod memory;
mod mesh;
mod pass;
mod place;
mod place_mesh;
mod plan;
mod rebind;
mod requirements;
mod shape;
mod status;
mod store;
mod tables;
mod targets;

pub use arena::Arena;
pub use bindings::{FrameBindings, GradientBindings};
pub use builder::{PassBuilder, PassPlan, PassStatus};
pub use camera::{ClipSpace, HostCamera};
pub use counts::{CountBindings, Counts};
pub use decode::Decoder;
pub use geometry::{Draw, Geometry, IndexFormat, Layout};
pub use inputs::Inputs;
pub use memory::{MemoryKind, MemoryRequirement, PassMemory};
pub use mesh::{MeshBuffers, MeshLook, PassMesh, TexelSource};
pub use pass::Pass;
pub use place::{GeometryBindings, GeometryBuffers, GeometryGradientBindings, GeometryGradients};
pub use plan::{BufferRequirement, Differentiate, FramePlan, GradientPlan};
pub use rebind::Rebound;
pub use requirements::Requirements;
pub use shape::FrameShape;
pub use status::Status;
pub use store::{FrameImage, ImageBindings};

pub use crate::frame::buffers::{BufferId, Role};
pub use crate::frame::pack::{AppearanceShape, MeshShape, camera_texels, light_texels};
pub use crate::frame::plan::{Capacity, DepthSpan};
#[cfg(all(feature = "external", unix))]
pub use crate::vulkan::external;
pub use crate::vulkan::{
    BufferRef, HostAdapter, HostCommands, HostDevice, ImageFormat, ImageRef, TextureRef, changing_devices,
};

use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::buffers::Parts;
use crate::frame::passes::{self, BACKWARD_COUNT, BackwardStage, FORWARD_COUNT, ForwardStage};
use crate::frame::pipelines::{Pipelines, Request};
#[cfg(feature = "renderer")]
use crate::frame::plan::Rare;
use crate::scene::Settings;
use crate::vulkan::{Device, Pipeline, PipelineCache, Recorder, TimestampPool};
use std::sync::{Arc, Mutex, PoisonError};

/// The kernels on a device, from which frames are planned, bound and recorded. It owns no memory, no queue and no command
/// buffer.
///
/// It may be shared between threads, and clones share its kernels; see the module's documentation.
#[derive(Clone)]
pub struct Rasterizer {
    device: Device,
    cache: Option<PipelineCache>,
    pipelines: Arc<Mutex<Pipelines>>,
    lanes: u32,
}

impl std::fmt::Debug for Rasterizer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rasterizer").field("device", &self.device).field("lanes", &self.lanes).finish_non_exhaustive()
    }
}

impl Rasterizer {
    /// A rasterizer on a host's device. Kernels are not compiled yet but when a plan is first bound, or
    /// [`prepare`](Self::prepare)d.
    ///
    /// # Errors
    /// [`Error::NoDevice`] for a device of Vulkan 1.0; [`Error::Host`] for null handles.
    pub fn new(host: &HostDevice) -> Result<Self> {
        let device = Device::from_host(host)?;
        Ok(Self::on(&device, PipelineCache::of_host(&device, host)))
    }

    /// A rasterizer on a device of a host's or of our own.
    pub(crate) fn on(device: &Device, cache: Option<PipelineCache>) -> Self {
        Self { device: device.clone(), cache, pipelines: Arc::default(), lanes: passes::default_lanes(device) }
    }

    /// Sets the number of invocations that share a tile: a power of two from 1 to 32. The default is the size of a subgroup
    /// on software devices (8 if that is unusable) and 32 elsewhere. Images do not depend on it.
    ///
    /// # Errors
    /// [`Error::Settings`] for another number.
    pub fn with_lanes(mut self, lanes: u32) -> Result<Self> {
        if !(lanes.is_power_of_two() && lanes <= c::TILE_WIDTH * c::TILE_HEIGHT) {
            let fix = "use a power of two from 1 to 32".into();
            return Err(Error::Settings { field: "lanes", value: lanes.to_string(), fix });
        }
        self.lanes = lanes;
        Ok(self)
    }

    /// Plans a frame: [`FramePlan::new`] with this device's limits.
    ///
    /// # Errors
    /// As [`FramePlan::new`].
    pub fn plan(&self, shape: &FrameShape, settings: &Settings) -> Result<FramePlan> {
        FramePlan::new(self.device.limits(), self.device.kind(), shape, settings)
    }

    /// A plan for a program that looks at the status of every frame: see [`FramePlan::of`].
    #[cfg(feature = "renderer")]
    pub(crate) fn plan_with(&self, shape: &FrameShape, settings: &Settings, rare: Rare) -> Result<FramePlan> {
        FramePlan::of(self.device.limits(), self.device.kind(), shape, settings, rare)
    }

    /// Plans the gradients of a planned frame: [`GradientPlan::new`].
    ///
    /// # Errors
    /// As [`GradientPlan::new`].
    pub fn plan_backward(&self, frame: &FramePlan, differentiate: &Differentiate) -> Result<GradientPlan> {
        GradientPlan::new(frame, differentiate)
    }

    /// Compiles a plan's kernels unless they are compiled already, in parallel on threads that end with the call. It takes
    /// some hundred milliseconds, which a loading screen can hide.
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

    /// Binds a frame's buffers: `(id, part)` for each of [`FramePlan::buffers`]. It is done once and not for every frame.
    ///
    /// # Errors
    /// [`Error::Host`] naming a buffer that is missing, unknown, too small, misaligned or made for other uses; otherwise
    /// as [`prepare`](Self::prepare).
    pub fn bind(&self, plan: &FramePlan, buffers: &[(BufferId, BufferRef)]) -> Result<FrameBindings> {
        self.bind_parts(plan, bindings::parts_of_host(&self.device, plan.buffers(), buffers)?)
    }

    /// Binds the buffers of a backward pass: `(id, part)` for each of [`GradientPlan::buffers`]; the frame's come from
    /// its own bindings, whose buffers these bindings need too.
    ///
    /// # Errors
    /// As [`bind`](Self::bind).
    pub fn bind_backward(
        &self,
        plan: &GradientPlan,
        frame: &FrameBindings,
        buffers: &[(BufferId, BufferRef)],
    ) -> Result<GradientBindings> {
        let parts = bindings::parts_of_host(&self.device, plan.buffers(), buffers)?;
        self.bind_backward_parts(plan, &parts, frame)
    }

    /// Records a frame. It does not allocate, map, submit or wait.
    ///
    /// The plan need not be the one that was bound if [`FrameBindings::fits`] accepts it: it may have another σ, γ or
    /// background colour, or another mesh that fits into the bytes bound.
    ///
    /// # Errors
    /// [`Error::Host`] if the plan does not fit the bindings, [`Error::Limit`] for more workgroups than the device allows.
    /// The commands recorded until then may be executed, but do not make a frame.
    pub fn record_forward(
        &self,
        commands: &mut HostCommands,
        plan: &FramePlan,
        bindings: &FrameBindings,
    ) -> Result<()> {
        self.forward(&mut Recorder::on_host(&self.device, commands), plan, bindings, None)
    }

    /// Records the gradients of the frame that was last recorded with the same buffers.
    ///
    /// # Errors
    /// As [`record_forward`](Self::record_forward).
    pub fn record_backward(
        &self,
        commands: &mut HostCommands,
        plan: &GradientPlan,
        bindings: &GradientBindings,
    ) -> Result<()> {
        self.backward(&mut Recorder::on_host(&self.device, commands), plan, bindings, None)
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
        let FrameBindings { stages, status, bin_bits, tile_counts, .. } = bindings;
        passes::record_forward(recorder, &plan.forward, stages, status, bin_bits, tile_counts, times)
    }

    pub(crate) fn backward(
        &self,
        recorder: &mut Recorder<'_>,
        plan: &GradientPlan,
        bindings: &GradientBindings,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        bindings.fits(plan)?;
        let GradientBindings { stages, texel_sums, item_counts, tile_counts, cleared, .. } = bindings;
        if plan.device_counts {
            recorder.barrier();
            for part in cleared {
                recorder.fill(part, 0, part.range() / 4 * 4, 0)?;
            }
        }
        passes::record_backward(recorder, &plan.backward, stages, texel_sums, item_counts, tile_counts, times)
    }

    fn forward_pipelines(&self, plan: &FramePlan) -> Result<[Pipeline; FORWARD_COUNT]> {
        let modes = &plan.forward.modes.list();
        self.pipelines(ForwardStage::ALL.map(|stage| {
            Request {
                // A stage that is never recorded is not compiled.
                kernel: if stage.is_needed(&plan.forward) { stage } else { ForwardStage::Vertex }
                    .kernel(&self.device, self.lanes),
                modes,
                lanes: match stage {
                    ForwardStage::BinCoarse => self.lanes.max(plan.forward.coarse_lanes),
                    ForwardStage::ForwardSoftLong | ForwardStage::ForwardLong => c::WORD_BITS,
                    _ => self.lanes,
                },
            }
        }))
    }

    fn backward_pipelines(&self, plan: &GradientPlan) -> Result<[Pipeline; BACKWARD_COUNT]> {
        let lanes = self.lanes;
        let small_lanes = passes::small_lanes(&self.device, lanes);
        let [small_shown, small_outline] = passes::small_pixels(&self.device, lanes);
        let of_all = plan.backward.modes.list().into_iter().chain([
            ("SMALL_LANES", small_lanes),
            ("SMALL_SHOWN_PIXELS", small_shown),
            ("SMALL_OUTLINE_PIXELS", small_outline),
        ]);
        let modes = BackwardStage::ALL.map(|stage| of_all.clone().chain(stage.modes()).collect::<Vec<_>>());
        self.pipelines(BackwardStage::ALL.map(|stage| Request {
            // As for frames.
            kernel:
                if stage.is_needed(&plan.backward) { stage } else { BackwardStage::Cull }.kernel(&self.device, lanes),
            modes: &modes[stage as usize],
            lanes: if stage.takes_small_items() { small_lanes } else { lanes },
        }))
    }

    fn pipelines<const N: usize>(&self, requests: [Request<'_>; N]) -> Result<[Pipeline; N]> {
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        pipelines.get(&self.device, self.cache.as_ref(), requests)
    }
}
