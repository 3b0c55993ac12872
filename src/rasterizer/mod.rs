//! The embedded API: softras on a host's device, in a host's command buffer, with a host's memory.
//!
//! An engine that has its own `VkDevice` gives softras the handles and buffers, and softras records. It owns no memory, no
//! queue and no command buffer; it submits nothing and waits for nothing. [`Renderer`](crate::Renderer) is built on this
//! module and on nothing else for recording, so both give the same bits.
//!
//! # In ten lines
//! ```no_run
//! use softras::rasterizer::{Arena, Differentiate, Inputs, Rasterizer, Shape, Status, requirements};
//! use softras::vulkan::{HostDevice, vk};
//! use softras::{Camera, Scene, Settings, Wanted};
//!
//! # struct Memory; impl Memory { fn write(&self, _: u64, _: &[u8]) {} fn status(&self, _: u64) -> [u8; Status::BYTES] { [0; Status::BYTES] } }
//! # fn make_buffer(_: u64, _: vk::BufferUsageFlags) -> (vk::Buffer, Memory) { (vk::Buffer::null(), Memory) }
//! # fn submit_and_wait_some_day() {}
//! # unsafe fn host(
//! #     host: HostDevice, scene: Scene, cameras: Vec<Camera>, settings: Settings, commands: vk::CommandBuffer,
//! # ) -> softras::Result<()> { unsafe {
//! // Once: is the physical device good enough, and the rasterizer on the device.
//! requirements().judge(&host)?;
//! let rasterizer = Rasterizer::new(&host)?;
//!
//! // Once for each frame in flight: what it takes, the memory, the bindings. Needs Settings::save for gradients.
//! let plan = rasterizer.plan(&Shape::of(&scene, &cameras, &settings)?, &settings)?;
//! let wanted = Differentiate { upstream: settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 };
//! let gradient_plan = rasterizer.plan_backward(&plan, &wanted)?;
//! let (arena, gradient_arena) = (Arena::of(plan.buffers()), Arena::of(gradient_plan.buffers()));
//! let (buffer, memory) = make_buffer(arena.size, arena.usage); // yours: a VkBuffer with mapped memory bound to it
//! let (gradient_buffer, _) = make_buffer(gradient_arena.size, gradient_arena.usage);
//! let forward = rasterizer.bind(&plan, &arena.refs(buffer))?;
//! let backward = rasterizer.bind_backward(&gradient_plan, &forward, &gradient_arena.refs(gradient_buffer))?;
//!
//! // The scene, and later what changes of it, before the frame is submitted.
//! for (name, bytes) in Inputs::new(&scene, &cameras, &settings, &plan).all() {
//!     if let Some((offset, _)) = arena.part(name) {
//!         memory.write(offset, bytes);
//!     }
//! }
//!
//! // Every frame, into your command buffer.
//! rasterizer.record_forward(commands, &plan, &forward)?;
//! // ... your loss kernel reads `color` and writes `upstream_color` ...
//! rasterizer.record_backward(commands, &gradient_plan, &backward)?;
//! // ... your optimiser reads `vertex_gradients` and writes `positions` ...
//! submit_and_wait_some_day();
//!
//! // When you know that the frame is done: was it whole?
//! let status = Status::from_bytes(&memory.status(arena.part("status").map_or(0, |(offset, _)| offset)));
//! if let Some(capacity) = status.judge(&plan)? {
//!     // Set Shape::capacity to it, plan and bind anew.
//! #   let _ = capacity;
//! }
//! # Ok(()) } }
//! ```
//! `examples/embed_ash.rs` is a whole engine: two frames in flight, kernels of its own between softras' passes, softras'
//! image in a VkImage with the engine's triangles on top. `examples/embed_wgpu.rs` does it with a device of wgpu's.
//!
//! # What the device needs
//! [`requirements`] says it before there is a device: Vulkan 1.1, no feature, no extension, a queue that computes, limits
//! that nearly every device exceeds. Subgroup shuffles and VK_EXT_debug_utils are used where they are there. What a frame
//! needs of maxStorageBufferRange and maxTexelBufferElements depends on its size: [`FramePlan::new`] is pure and takes
//! the limits of the description that [`Requirements::judge`] returns.
//!
//! # Buffers
//! [`FramePlan::buffers`] and [`GradientPlan::buffers`] list them: name, bytes, alignment, usage, format, and who fills
//! them ([`Role`](crate::buffers::Role)), which tells where their memory had best lie. Every buffer may be a part of a
//! larger one ([`BufferRef`]); [`Arena`] lays many in one. A buffer that is read as texels gets a view of exactly its part.
//! Buffers are of one queue family at a time: ownership is the host's to transfer.
//!
//! The host fills the inputs. [`Inputs`] has the bytes of a [`Scene`](crate::Scene); a host that has its data on the device
//! lays it out so itself:
//!
//! | buffer | element | content |
//! | --- | --- | --- |
//! | `positions` | 3 floats | every vertex of every mesh, packed: a vertex buffer of stride 12 as it is |
//! | `indices` | 3 words | every triangle, by vertices counted from its mesh's first: an index buffer of u32 as it is |
//! | `colors` | 3 floats | one for a mesh of one colour, else one a vertex |
//! | `adjacency` | words | corners by vertex, see [`MeshTables`](crate::pack::MeshTables::adjacency); changes with `indices` only |
//! | `view_cameras` | 11 vec4 | [`camera_texels`](crate::pack::camera_texels), one a view |
//! | `lights` | vec4 | [`light_texels`](crate::pack::light_texels) |
//! | `view_shapes` | 4 uvec4 | [`MeshTables::view_shapes`](crate::pack::MeshTables::view_shapes); changes with the plan only |
//! | `uvs`, `uv_indices`, `triangle_textures`, `textures`, `texels` | | see [`MeshTables`](crate::pack::MeshTables) |
//! | `upstream_color` | vec4 | dL/dr, dL/dg, dL/db, dL/dsilhouette of every pixel |
//! | `upstream_silhouette` | float | without an upstream colour |
//! | `upstream_depths`, `upstream_normals` | float, vec4 | |
//!
//! Vertices of another stride, and indices of 16 bits, stay as they are in the host's buffers:
//! [`Rasterizer::record_gather`] copies them into this layout on the device, in the frames in which they change.
//!
//! Outputs are the images ([`FramePlan::image_copy`] has their layout and copies them to a VkImage), `status`
//! ([`Status`]), and the gradients:
//!
//! | buffer | element | content |
//! | --- | --- | --- |
//! | `vertex_gradients` | 2 vec4 a vertex, as in `positions` | dL/dx, dL/dy, dL/dz, 0; dL/dr, dL/dg, dL/db, 0 |
//! | `texel_sums` | 3 × 64 bits a texel, as in `texels` | signed sums in units of 1 / [`GradientPlan::texel_scale`] |
//! | `corner_gradients`, `totals` | vec4 | triangles' corners (UVs), views, lights, background: as [`Renderer::backward`](crate::Renderer::backward) gathers them |
//!
//! Everything else is workspace: it need not be initialised, holds nothing between frames, and a frame clobbers all of it.
//! A backward pass reads what its forward frame left in the workspace, so that must not be recorded again, with the same
//! bindings, before it.
//!
//! # Synchronisation
//! Each call begins with a barrier that waits for all compute, copies, fills and indirect reads submitted before it to the
//! same queue, and ends with one that makes its writes visible to all compute, copies and indirect reads that follow. So:
//!
//! | who, before or after | what the host adds |
//! | --- | --- |
//! | a compute shader or a copy on the same queue writes inputs, or reads outputs | nothing |
//! | the CPU writes mapped inputs before vkQueueSubmit | nothing but a flush where memory is not coherent |
//! | the CPU reads mapped outputs after the fence | after: COMPUTE_SHADER + TRANSFER, SHADER_WRITE + TRANSFER_WRITE → HOST, HOST_READ |
//! | a graphics stage reads outputs or inputs (vertex or index buffer) | after: COMPUTE_SHADER, SHADER_WRITE → that stage and access; and before the next frame writes them: that stage → COMPUTE_SHADER, execution only |
//! | a graphics stage writes inputs | before: that stage and access → COMPUTE_SHADER, SHADER_READ |
//! | another queue | a semaphore, and a transfer of queue family ownership for exclusive buffers |
//!
//! softras uses no image, so no layout is its concern: [`FramePlan::image_copy`] is for a vkCmdCopyBufferToImage of the
//! host's, and layouts before and after are the host's. It leaves the command buffer with another compute pipeline, other
//! compute descriptor set 0 and push constants bound; graphics state is untouched. It records no event, no query, no
//! render pass.
//!
//! Several frames in flight need bindings and workspaces of their own; they may share inputs that nothing writes. With one
//! queue, even inputs that its own kernels write may be shared.
//!
//! # Threads and lifetimes
//! [`Rasterizer`], plans and bindings are `Send` and `Sync`, and every method takes `&self`. Threads may plan, bind and
//! record at once, each into a command buffer whose pool no other thread uses; compiling makes others that compile wait.
//!
//! Plans are plain data. Bindings keep their kernels alive: a rasterizer may be dropped before what it bound. Bindings are
//! dropped, and buffers destroyed, when the last command buffer that they were recorded into has been executed or thrown
//! away; the pipeline cache, the device and the instance when rasterizers and bindings are gone. A call that fails has made
//! nothing that stays.
//!
//! Recording takes a few microseconds and no heap allocation. Planning is plain arithmetic; binding makes descriptor sets
//! and buffer views, and compiles where [`Rasterizer::prepare`] has not.

mod arena;
mod bindings;
mod gather;
mod inputs;
mod plan;
mod requirements;
mod shape;
mod status;

pub use arena::Arena;
pub use bindings::{BufferRef, FrameBindings, GradientBindings};
pub use gather::{Gather, GatherBindings};
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
        passes::record_forward(recorder, &plan.plan, &bindings.stages, &|name| bindings.parts.get(name), times)
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
