//! The simple API: a renderer that owns its device.

mod backward;
mod frame;
mod upload;

pub use frame::{Frame, FrameCounts, StageTime};

use crate::constants as c;
use crate::embed::{FrameBindings, FramePlan, Inputs, Rasterizer, Shape, Status};
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::frame::buffers::{BufferId, BufferSet, Entry, Role};
use crate::frame::passes::{FORWARD_TIMESTAMPS, ForwardStage};
use crate::frame::plan::Capacity;
use crate::scene::{Camera, Scene, Settings};
use crate::vulkan::{CacheFolder, CommandBuffer, Context, ContextOptions, DeviceInfo, Loader, TimestampPool};
use std::sync::Arc;
use upload::Uploads;

/// How to open a renderer.
#[derive(Clone, Debug, Default)]
pub struct RendererOptions {
    /// A device's index, or part of its name in any case. `None`: what `SOFTRAS_DEVICE` says, else the best one: a
    /// discrete GPU before an integrated one before a software one.
    pub device: Option<String>,
    /// Run under the Vulkan validation layers with synchronization checks; `SOFTRAS_VALIDATION=1` does too. The layers
    /// (seen in 1.3.239) may crash where one thread opens or drops a device while another renders: with validation,
    /// open all renderers first.
    pub validation: bool,
    /// Invocations that share a tile, 1 to 32, a power of two; `None`: 8 on software devices, 32 elsewhere. The
    /// images do not depend on it.
    pub lanes: Option<u32>,
    /// Room for list entries to begin with, for tests of growing; `None`: estimated.
    pub capacity: Option<Capacity>,
    /// Copy between host and device even where their memory is shared, as a discrete GPU must; for tests.
    pub staging: bool,
    /// Where compiled kernels are kept between runs.
    pub cache: CacheFolder,
    /// The Vulkan loader; `None`: the system's.
    pub loader: Option<Loader>,
}

/// A device and everything that a frame needs on it, kept from frame to frame.
pub struct Renderer {
    // Dropped before the context, which they need.
    rasterizer: Rasterizer,
    /// The latest plan, and what it was made for besides its shape.
    planned: Option<(Settings, Arc<FramePlan>)>,
    recorded: Option<(Arc<FramePlan>, FrameBindings)>,
    backward: backward::State,
    /// The latest frame, if it was saved.
    saved: Option<backward::Saved>,
    frames: u64,
    /// The commands as recorded have made a frame, and nothing since.
    finished: bool,
    commands: CommandBuffer,
    times: Option<TimestampPool>,
    timed: bool,
    inputs: Inputs,
    uploads: Uploads,
    buffers: BufferSet,
    capacity: Option<Capacity>,
    context: Context,
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer").field("device", &self.device_name()).finish_non_exhaustive()
    }
}

impl Renderer {
    /// Opens the device that `SOFTRAS_DEVICE` names (index or part of the name), else the best one.
    ///
    /// # Errors
    /// [`Error::NoDevice`] without a Vulkan loader, driver or suitable device; [`Error::Vulkan`].
    pub fn new() -> Result<Self> {
        Self::with_options(&RendererOptions::default())
    }

    /// Opens a device by its index or part of its name.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_device(selector: &str) -> Result<Self> {
        Self::with_options(&RendererOptions { device: Some(selector.to_owned()), ..RendererOptions::default() })
    }

    /// Opens a device as the options say.
    ///
    /// # Errors
    /// As [`Renderer::new`]; [`Error::Settings`] for a number of lanes that does not divide a tile.
    pub fn with_options(options: &RendererOptions) -> Result<Self> {
        let context = Context::new(&ContextOptions {
            device: options.device.clone(),
            validation: options.validation,
            staging: options.staging,
            cache: options.cache.clone(),
            loader: options.loader,
        })?;
        let mut rasterizer = Rasterizer::on(context.device(), Some(context.pipeline_cache().clone()));
        if let Some(lanes) = options.lanes {
            rasterizer = rasterizer.with_lanes(lanes)?;
        }
        Ok(Self {
            rasterizer,
            planned: None,
            recorded: None,
            backward: backward::State::new(&context)?,
            saved: None,
            frames: 0,
            finished: false,
            commands: CommandBuffer::new(&context, "softras frame")?,
            times: TimestampPool::new(context.device(), context.queue_family(), FORWARD_TIMESTAMPS)?,
            timed: false,
            inputs: Inputs::default(),
            uploads: Uploads::new(&context)?,
            buffers: BufferSet::default(),
            capacity: options.capacity,
            context,
        })
    }

    /// The device's name.
    pub fn device_name(&self) -> &str {
        &self.context.info().name
    }

    /// The device and what it can do.
    pub fn device_info(&self) -> &DeviceInfo {
        self.context.info()
    }

    /// The device, its memory and its queue, for what shares them.
    pub(crate) fn context(&self) -> &Context {
        &self.context
    }

    /// What the validation layers have said so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.context.validation_messages()
    }

    /// Bytes of device memory that the renderer holds.
    pub fn device_bytes(&self) -> u64 {
        self.buffers.bytes()
    }

    /// Whether frames from now on tell the device times of their stages ([`Frame::timings`],
    /// [`Renderer::backward_timings`]). Off at first: each stage then waits for a timestamp of the one before.
    pub fn time_stages(&mut self, on: bool) {
        if self.timed != on {
            self.timed = on;
            self.forget();
        }
    }

    /// Counts of the latest frame, for measuring.
    ///
    /// # Errors
    /// [`Error::Vulkan`] before the first frame.
    pub fn frame_counts(&self) -> Result<FrameCounts> {
        let needed = self.status()?.needed;
        Ok(FrameCounts {
            list_entries: needed.list.into(),
            forward_pairs: u64::from(needed.list) * u64::from(c::TILE_WIDTH * c::TILE_HEIGHT),
            uploaded_bytes: self.uploads.bytes,
        })
    }

    /// Renders what every camera sees, all in one submission.
    ///
    /// Made to be called in a loop: of a scene that is nearly the last one only what differs is uploaded, and with counts,
    /// settings and modes that are the last ones' nothing is recorded or allocated on the device.
    ///
    /// # Errors
    /// [`Error::Scene`], [`Error::Light`], [`Error::Settings`] for input that cannot be rendered; [`Error::Limit`],
    /// [`Error::OutOfMemory`] for what the device cannot hold; [`Error::NotFinite`] when its arithmetic overflowed;
    /// [`Error::Vulkan`].
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        let mut shape = Shape::of(scene, cameras, settings)?;
        self.frames += 1;
        self.saved = None;
        self.uploads.bytes = 0;
        shape.capacity = self.capacity;
        loop {
            let plan = self.plan(&shape, settings)?;
            self.make_room(&plan)?;
            self.write_inputs(scene, cameras, settings, &plan)?;
            self.prepare(&plan)?;
            self.uploads.record(&self.buffers)?;
            self.commands.submit_and_wait_after(self.uploads.commands())?;
            self.uploads.done();
            if let Some(more) = self.status()?.judge(&plan)? {
                shape.capacity = Some(more);
                continue;
            }
            self.finished = true;
            // The next frame of this kind starts with what this one needed.
            self.capacity = Some(self.capacity.map_or(plan.capacity(), |c| c.max(plan.capacity())));
            let saved = settings.save.then_some(self.frames);
            let frame = Frame::download(&self.buffers.contents()?, cameras.len(), settings, self.timings()?, saved)?;
            self.saved = saved.map(|id| backward::Saved {
                id,
                plan,
                cameras: cameras.to_vec(),
                settings: settings.clone(),
                lights: scene.lights.clone(),
            });
            return Ok(frame);
        }
    }

    /// The last plan where nothing that it depends on has changed.
    fn plan(&mut self, shape: &Shape, settings: &Settings) -> Result<Arc<FramePlan>> {
        if let Some((planned_for, plan)) = &self.planned
            && planned_for == settings
            && plan.is_of(shape)
        {
            return Ok(plan.clone());
        }
        let plan = Arc::new(self.rasterizer.plan(shape, settings)?);
        self.planned = Some((settings.clone(), plan.clone()));
        Ok(plan)
    }

    /// Makes room for the plan's buffers.
    fn make_room(&mut self, plan: &FramePlan) -> Result<()> {
        plan.buffers().iter().try_for_each(|needed| self.reserve(needed.entry(), needed.size))
    }

    /// Room for one buffer. Where it is a new one, or there is none now, what was recorded with the old one is void.
    fn reserve(&mut self, entry: Entry<BufferId>, size: u64) -> Result<()> {
        let reserved = self.buffers.reserve(&self.context, entry, size);
        if !matches!(reserved, Ok(false)) {
            self.uploads.stale.note(entry.id, true);
            self.forget();
        }
        reserved.map(drop)
    }

    /// Everything must be recorded anew.
    fn forget(&mut self) {
        self.recorded = None;
        self.backward.forget();
        self.uploads.forget();
    }

    /// Writes the inputs that are not on the device already.
    fn write_inputs(
        &mut self,
        scene: &Scene,
        cameras: &[Camera],
        settings: &Settings,
        plan: &Arc<FramePlan>,
    ) -> Result<()> {
        // Nobody but the frame writes to its buffers, and none that failed left them half written.
        self.inputs.background_kept = std::mem::take(&mut self.finished) && self.is_recorded(plan);
        self.uploads.stale = self.uploads.stale.or(self.inputs.update(scene, cameras, settings, plan));
        for (id, bytes) in self.inputs.all() {
            if self.uploads.stale.has(id) && plan.buffer(id).is_some() {
                self.buffers.write(id, bytes)?;
                self.uploads.wrote(id, bytes.len());
            }
        }
        Ok(())
    }

    /// Whether the commands are the plan's. What it records follows from its sizes and numbers; what it was made of may
    /// differ.
    fn is_recorded(&self, plan: &Arc<FramePlan>) -> bool {
        let same = |(recorded, _): &(Arc<FramePlan>, FrameBindings)| {
            Arc::ptr_eq(recorded, plan) || recorded.forward == plan.forward
        };
        self.recorded.as_ref().is_some_and(same)
    }

    /// Records the frame's commands, unless they are recorded already.
    fn prepare(&mut self, plan: &Arc<FramePlan>) -> Result<()> {
        if self.is_recorded(plan) {
            return Ok(());
        }
        self.recorded = None;
        let bindings = self.rasterizer.bind_parts(plan, self.buffers.parts(plan.buffers().iter().map(|b| b.id))?)?;
        let (rasterizer, buffers) = (&self.rasterizer, &self.buffers);
        let times = self.times.as_ref().filter(|_| self.timed);
        let is_bound = |entry: Entry<BufferId>, role: Role| entry.role == role && plan.buffer(entry.id).is_some();
        self.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times)?;
            }
            rasterizer.forward(recorder, plan, &bindings, times)?;
            for (entry, buffer) in buffers.shared() {
                if is_bound(entry, Role::Output) {
                    buffer.record_download(recorder)?;
                }
            }
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.recorded = Some((plan.clone(), bindings));
        Ok(())
    }

    fn status(&self) -> Result<Status> {
        let mut status = [0; Status::BYTES];
        self.buffers.read(BufferId::Status, &mut status)?;
        Ok(Status::from_bytes(&status))
    }

    fn timings(&self) -> Result<Vec<StageTime>> {
        let Some(times) = self.times.as_ref().filter(|_| self.timed) else {
            return Ok(Vec::new());
        };
        let stamps = times.read(FORWARD_TIMESTAMPS)?;
        Ok(StageTime::between(&stamps, ForwardStage::ALL.map(ForwardStage::name)))
    }
}
