//! The simple API: a renderer that owns its device, and renders scenes to images and back to gradients.

mod backward;
mod frame;
pub(crate) mod parts;
mod upload;

pub use frame::{Frame, FrameCounts, StageTime};

use crate::constants as c;
use crate::embed::{BufferRequirement, FrameBindings, FramePlan, Inputs, Rasterizer, Shape, Status};
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, BufferSet, Entry, Role};
use crate::frame::passes::{FORWARD_TIMESTAMPS, ForwardStage};
use crate::frame::plan::Capacity;
use crate::scene::{Camera, Scene, Settings};
use crate::vulkan::{CacheFolder, CommandBuffer, Context, ContextOptions, DeviceInfo, Loader, TimestampPool};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use upload::Uploads;

/// How to open a renderer.
#[derive(Clone, Debug, Default)]
pub struct RendererOptions {
    /// A device's index, or part of its name in any case. `None`: what `SOFTRAS_DEVICE` says, else the best one: a
    /// discrete GPU before an integrated one before a software one.
    pub device: Option<String>,
    /// Run under the Vulkan validation layers with synchronization checks; `SOFTRAS_VALIDATION=1` does so too. Open all
    /// renderers before rendering then: the layers (seen in 1.3.239) may crash if one thread opens or drops a device while
    /// another renders.
    pub validation: bool,
    /// Invocations that share a tile, 1 to 32, a power of two; `None`: a subgroup's on software devices, 32 elsewhere. The
    /// images do not depend on it.
    pub lanes: Option<u32>,
    /// The initial capacities of lists, for tests of lists without room; `None`: estimated.
    pub capacity: Option<Capacity>,
    /// Copy between host and device even if they share memory, as on a discrete GPU; for tests.
    pub staging: bool,
    /// The folder that keeps compiled kernels between runs.
    pub cache: CacheFolder,
    /// The Vulkan loader; `None`: the system's.
    pub loader: Option<Loader>,
    /// The most bytes of device memory that the buffers of a frame with its gradients, or of a step of a fit, may take. What
    /// needs more is refused with [`Error::OutOfMemory`], as by a device that has no more; `None`: what the device has.
    pub memory: Option<u64>,
}

/// Numbers the saved frames of all renderers of the process, so that no renderer takes another's frame for its own.
static FRAMES: AtomicU64 = AtomicU64::new(0);

/// A device with the buffers, kernels and commands of a frame, which are kept from frame to frame.
pub struct Renderer {
    rasterizer: Rasterizer,
    /// The latest plan, and the settings that it was made for.
    planned: Option<(Settings, Arc<FramePlan>)>,
    recorded: Option<(Arc<FramePlan>, FrameBindings)>,
    backward: backward::State,
    /// The latest frame, if it was saved.
    saved: Option<backward::Saved>,
    /// Whether the recorded commands were the last to write to the buffers, and made a frame.
    finished: bool,
    commands: CommandBuffer,
    times: Option<TimestampPool>,
    timed: bool,
    inputs: Inputs,
    uploads: Uploads,
    buffers: BufferSet,
    /// The capacity of the first frame, until it is rendered.
    initial: Option<Capacity>,
    /// What the frames so far had or would have needed.
    capacity: Option<Capacity>,
    /// Whether lists are walked that have no room: once a frame has needed more than the device can hold. The kernels for it
    /// take as long to compile as all others together, so that a frame that has too little room is rendered again instead.
    walked: bool,
    /// As [`RendererOptions::memory`].
    memory: Option<u64>,
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
            finished: false,
            commands: CommandBuffer::new(&context, "softras frame")?,
            times: TimestampPool::new(context.device(), context.queue_family(), FORWARD_TIMESTAMPS)?,
            timed: false,
            inputs: Inputs::default(),
            uploads: Uploads::new(&context)?,
            buffers: BufferSet::default(),
            initial: options.capacity,
            walked: options.capacity.is_some(),
            capacity: None,
            memory: options.memory,
            context,
        })
    }

    /// The device's name, as its driver reports it.
    pub fn device_name(&self) -> &str {
        &self.context.info().name
    }

    /// The device with its limits and properties.
    pub fn device_info(&self) -> &DeviceInfo {
        self.context.info()
    }

    /// The device, its memory and its queue, for fitting, which shares them.
    pub(crate) fn context(&self) -> &Context {
        &self.context
    }

    /// The messages of the validation layers so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.context.validation_messages()
    }

    /// Bytes of device memory that the renderer holds.
    pub fn device_bytes(&self) -> u64 {
        self.buffers.bytes()
    }

    /// Turns timings of the stages on or off for the following frames ([`Frame::timings`],
    /// [`Renderer::backward_timings`]). They are off at first, since each stage then waits for the
    /// timestamp of the stage before.
    pub fn time_stages(&mut self, on: bool) {
        if self.timed != on {
            self.timed = on;
            self.forget();
        }
    }

    /// Counts of the latest frame, for measurements.
    ///
    /// # Errors
    /// [`Error::Vulkan`] before the first frame.
    pub fn frame_counts(&self) -> Result<FrameCounts> {
        let needed = self.status()?.needed;
        Ok(FrameCounts {
            list_entries: needed.list.into(),
            forward_pairs: u64::from(needed.list) * u64::from(c::TILE_WIDTH * c::TILE_HEIGHT),
            uploaded_bytes: self.uploads.bytes,
            dispatches: self.commands.dispatches(),
            backward_dispatches: self.backward.commands.dispatches(),
        })
    }

    /// Renders the scene from every camera, all in one submission.
    ///
    /// It is made to be called in a loop: only inputs that differ from the last frame's are uploaded, and if counts,
    /// settings and modes are the same, nothing is recorded or allocated on the device.
    ///
    /// # Errors
    /// [`Error::Scene`], [`Error::Light`], [`Error::Settings`] for input that cannot be rendered; [`Error::Limit`],
    /// [`Error::OutOfMemory`] for what the device cannot hold; [`Error::NotFinite`] when its arithmetic overflowed;
    /// [`Error::Vulkan`].
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        let mut shape = Shape::of(scene, cameras, settings)?;
        self.saved = None;
        self.uploads.bytes = 0;
        let estimated = |kept: Capacity| kept.max(Capacity::estimate(settings, shape.cutoff, &shape.view_sizes()));
        shape.capacity = self.initial.take().or(self.capacity.map(estimated));
        let plan = loop {
            let plan = self.plan(&shape, settings)?;
            self.make_room(&plan)?;
            self.write_inputs(scene, cameras, settings, &plan)?;
            self.prepare(&plan)?;
            self.uploads.record(&self.buffers)?;
            self.commands.submit_and_wait_after(self.uploads.commands())?;
            self.uploads.done();
            let status = self.status()?;
            let larger = status.validate(&plan)?;
            if status.is_complete(&plan) {
                // The next frame of this kind has room for what this one needed.
                let larger = larger.unwrap_or(plan.capacity());
                self.capacity = Some(self.capacity.map_or(larger, |capacity| capacity.max(larger)));
                break plan;
            }
            self.walked = larger.is_none();
            shape.capacity = larger.or(shape.capacity);
        };
        self.finished = true;
        let saved = settings.save.then(|| FRAMES.fetch_add(1, Ordering::Relaxed));
        let frame = Frame::download(&self.buffers.contents()?, cameras.len(), settings, self.timings()?, saved)?;
        self.saved = saved.map(|id| backward::Saved {
            id,
            plan,
            cameras: cameras.to_vec(),
            settings: settings.clone(),
            lights: scene.lights.clone(),
        });
        Ok(frame)
    }

    /// As [`Renderer::render`], and keeps what [`Renderer::backward`] needs of the frame, whatever [`Settings::save`] says.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn render_saved(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        self.render(scene, cameras, &Settings { save: true, ..settings.clone() })
    }

    /// The last plan if nothing that it depends on has changed, else a new one.
    fn plan(&mut self, shape: &Shape, settings: &Settings) -> Result<Arc<FramePlan>> {
        if let Some((planned_for, plan)) = &self.planned
            && planned_for == settings
            && plan.is_of(shape, self.walked)
        {
            return Ok(plan.clone());
        }
        let plan = Arc::new(self.rasterizer.plan_walked(shape, settings, self.walked)?);
        self.planned = Some((settings.clone(), plan.clone()));
        Ok(plan)
    }

    /// Makes every buffer of the plan large enough.
    fn make_room(&mut self, plan: &FramePlan) -> Result<()> {
        self.validate_memory(plan.buffers())?;
        plan.buffers().iter().try_for_each(|needed| self.reserve(needed.entry(), needed.size))
    }

    /// Refuses buffers that together exceed [`RendererOptions::memory`].
    pub(crate) fn validate_memory<'a>(&self, buffers: impl IntoIterator<Item = &'a BufferRequirement>) -> Result<()> {
        let bytes = buffers.into_iter().map(|buffer| buffer.size).sum();
        match self.memory {
            Some(most) if bytes > most => Err(Error::OutOfMemory {
                what: format!("a frame, which may have {most} bytes"),
                bytes,
                fix: "allow more, or render smaller images, fewer triangles or fewer cameras at once".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Makes a buffer large enough. If the old one is gone, forgets the commands recorded with it.
    fn reserve(&mut self, entry: Entry<BufferId>, size: u64) -> Result<()> {
        let reserved = self.buffers.reserve(&self.context, entry, size);
        if !matches!(reserved, Ok(false)) {
            self.uploads.stale.note(entry.id, true);
            self.forget();
        }
        reserved.map(drop)
    }

    /// Forgets the recorded commands.
    fn forget(&mut self) {
        self.recorded = None;
        self.backward.forget();
        self.uploads.forget();
    }

    /// Writes the inputs whose bytes on the device differ.
    fn write_inputs(
        &mut self,
        scene: &Scene,
        cameras: &[Camera],
        settings: &Settings,
        plan: &Arc<FramePlan>,
    ) -> Result<()> {
        // The buffers still hold the last frame's images if that frame succeeded and had the same commands.
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

    /// Whether the recorded commands are the plan's. They depend on its sizes and constants only, not on the shape that it
    /// was made for.
    fn is_recorded(&self, plan: &Arc<FramePlan>) -> bool {
        let same = |(recorded, _): &(Arc<FramePlan>, FrameBindings)| {
            Arc::ptr_eq(recorded, plan) || recorded.forward == plan.forward
        };
        self.recorded.as_ref().is_some_and(same)
    }

    /// Records the frame's commands unless they are recorded already.
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
