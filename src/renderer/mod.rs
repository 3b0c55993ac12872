//! The simple API: a renderer that owns its device.

mod backward;

use crate::buffers::{self, BufferSet, Role, Slot};
use crate::constants as c;
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::image::Image;
use crate::passes::{FORWARD_STAGES, FORWARD_TIMESTAMPS};
use crate::plan::Capacity;
use crate::rasterizer::{FrameBindings, FramePlan, Inputs, Rasterizer, Shape, Status};
use crate::scene::{Camera, Outputs, Scene, Settings};
use crate::vulkan::{CacheFolder, CommandBuffer, Context, ContextOptions, DeviceInfo, TimestampPool};

/// What a stage took on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// The stage's name, as its GLSL file's.
    pub stage: &'static str,
    /// Milliseconds on the device.
    pub milliseconds: f64,
}

/// What the device counted while it made a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameCounts {
    /// Entries of all tiles' lists.
    pub list_entries: u64,
    /// (pixel, triangle) pairs that the forward stage evaluated: every pixel of a tile against every entry of its list.
    pub forward_pairs: u64,
}

/// How to open a renderer.
#[derive(Clone, Debug, Default)]
pub struct RendererOptions {
    /// A device's index, or part of its name in any case. `None`: what `SOFTRAS_DEVICE` says, else the best one: a
    /// discrete GPU before an integrated one before a software one.
    pub device: Option<String>,
    /// Run under the Vulkan validation layers with synchronization checks; `SOFTRAS_VALIDATION=1` does too.
    pub validation: bool,
    /// Invocations that share a tile, 1 to 32, a power of two; `None`: 8 on software devices, 32 elsewhere. The
    /// images do not depend on it.
    pub lanes: Option<u32>,
    /// Room for list entries to begin with, for tests of growing; `None`: estimated.
    pub capacity: Option<Capacity>,
    /// Where compiled kernels are kept between runs.
    pub cache: CacheFolder,
}

/// One rendered batch.
#[derive(Clone, Debug)]
pub struct Frame {
    color: Option<Image>,
    silhouette: Option<Image>,
    depth: Option<Image>,
    normal: Option<Image>,
    timings: Vec<StageTime>,
    /// Which of its renderer's frames it is, where that kept what backward needs.
    saved: Option<u64>,
}

impl Frame {
    /// RGB, linear, `[batch, height, width, 3]`; `None` unless [`Outputs`] asked for it.
    pub fn color(&self) -> Option<&Image> {
        self.color.as_ref()
    }

    /// The silhouette in [0, 1], `[batch, height, width, 1]`; `None` unless asked for.
    pub fn silhouette(&self) -> Option<&Image> {
        self.silhouette.as_ref()
    }

    /// Σ w z in world units, `[batch, height, width, 1]`, 0 where nothing is near; `None` unless asked for.
    pub fn depth(&self) -> Option<&Image> {
        self.depth.as_ref()
    }

    /// Σ w n in world space, `[batch, height, width, 3]`; `None` unless asked for.
    pub fn normal(&self) -> Option<&Image> {
        self.normal.as_ref()
    }

    /// Device time of every stage, in the order in which they ran; empty when the queue has no timestamps.
    pub fn timings(&self) -> &[StageTime] {
        &self.timings
    }
}

/// A device and everything that a frame needs on it, kept from frame to frame.
pub struct Renderer {
    // Dropped before the context, which they need.
    rasterizer: Rasterizer,
    recorded: Option<(FramePlan, FrameBindings)>,
    backward: backward::State,
    /// The latest frame, if it was saved.
    saved: Option<backward::Saved>,
    frames: u64,
    commands: CommandBuffer,
    times: Option<TimestampPool>,
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
            cache: options.cache.clone(),
            ..ContextOptions::default()
        })?;
        let mut rasterizer = Rasterizer::on(context.device(), Some(context.pipeline_cache().clone()));
        if let Some(lanes) = options.lanes {
            rasterizer = rasterizer.with_lanes(lanes)?;
        }
        Ok(Self {
            rasterizer,
            recorded: None,
            backward: backward::State::new(&context)?,
            saved: None,
            frames: 0,
            commands: CommandBuffer::new(&context, "softras frame")?,
            times: TimestampPool::new(context.device(), context.queue_family(), FORWARD_TIMESTAMPS)?,
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

    /// Counts of the latest frame, for measuring.
    ///
    /// # Errors
    /// [`Error::Vulkan`] before the first frame.
    pub fn frame_counts(&self) -> Result<FrameCounts> {
        let mut status = [0u32; c::STATUS_WORDS as usize];
        self.buffers.read("status", bytemuck::cast_slice_mut(&mut status))?;
        let list_entries = u64::from(status[c::STATUS_LIST_NEEDED as usize]);
        Ok(FrameCounts { list_entries, forward_pairs: list_entries * u64::from(c::TILE_WIDTH * c::TILE_HEIGHT) })
    }

    /// Renders what every camera sees, all in one submission.
    ///
    /// # Errors
    /// [`Error::Scene`], [`Error::Light`], [`Error::Settings`] for input that cannot be rendered; [`Error::Limit`],
    /// [`Error::OutOfMemory`] for what the device cannot hold; [`Error::NotFinite`] when its arithmetic overflowed;
    /// [`Error::Vulkan`].
    pub fn render(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        let mut shape = Shape::of(scene, cameras, settings)?;
        self.frames += 1;
        self.saved = None;
        shape.capacity = self.capacity;
        loop {
            let plan = self.rasterizer.plan(&shape, settings)?;
            let inputs = Inputs::new(scene, cameras, settings, &plan);
            self.upload(&inputs, &plan)?;
            self.prepare(&plan)?;
            self.commands.submit_and_wait()?;
            if let Some(more) = self.status()?.judge(&plan)? {
                shape.capacity = Some(more);
                continue;
            }
            // The next frame of this kind starts with what this one needed.
            self.capacity = Some(self.capacity.map_or(plan.capacity(), |c| c.max(plan.capacity())));
            let frame = self.download(cameras.len(), settings)?;
            if settings.save {
                self.saved = Some(backward::Saved {
                    id: self.frames,
                    plan,
                    tables: inputs.tables,
                    cameras: cameras.to_vec(),
                    settings: settings.clone(),
                    lights: scene.lights.clone(),
                });
            }
            return Ok(frame);
        }
    }

    /// Makes room for the plan's buffers and writes the inputs.
    fn upload(&mut self, inputs: &Inputs, plan: &FramePlan) -> Result<()> {
        let mut renewed = false;
        for slot in buffers::FORWARD.into_iter().chain([buffers::UNUSED]) {
            if let Some(requirement) = plan.buffer(slot.name) {
                renewed |= self.buffers.reserve(&self.context, slot, requirement.size)?;
            }
        }
        for (name, bytes) in inputs.all() {
            self.buffers.write(name, bytes)?;
        }
        if renewed {
            self.recorded = None;
            self.backward.forget();
        }
        Ok(())
    }

    /// Records the frame's commands, unless they are recorded already.
    fn prepare(&mut self, plan: &FramePlan) -> Result<()> {
        // What a plan records follows from its sizes and numbers; what it was made of may differ.
        let same = |(recorded, _): &(FramePlan, FrameBindings)| recorded.plan == plan.plan;
        if self.recorded.as_ref().is_some_and(same) {
            return Ok(());
        }
        let bindings = self.rasterizer.bind_parts(plan, self.buffers.parts(plan.buffers())?)?;
        let (rasterizer, buffers, times) = (&self.rasterizer, &self.buffers, self.times.as_ref());
        let is_bound = |slot: Slot, role: Role| slot.role == role && plan.buffer(slot.name).is_some();
        self.recorded = None;
        self.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times);
            }
            for (slot, buffer) in buffers.shared() {
                if is_bound(slot, Role::Input) {
                    buffer.record_upload(recorder)?;
                }
            }
            rasterizer.forward(recorder, plan, &bindings, times)?;
            for (slot, buffer) in buffers.shared() {
                if is_bound(slot, Role::Output) {
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
        self.buffers.read("status", &mut status)?;
        Ok(Status::from_bytes(&status))
    }

    fn download(&self, batch: usize, settings: &Settings) -> Result<Frame> {
        let Outputs { color, silhouette, depth, normal } = settings.outputs;
        let (height, width) = (settings.height as usize, settings.width as usize);
        let pixels = batch * height * width;
        let image = |channels: usize, data: Vec<f32>| Image { batch, height, width, channels, data };
        let floats = |name: &str, count: usize| self.buffers.floats(name, count);
        let mut frame =
            Frame { color: None, silhouette: None, depth: None, normal: None, timings: self.timings()?, saved: None };
        frame.saved = settings.save.then_some(self.frames);
        if color {
            let texels = floats("color", 4 * pixels)?;
            frame.color = Some(image(3, rgb_of(texels)));
            if silhouette {
                frame.silhouette = Some(image(1, texels.chunks_exact(4).map(|t| t[3]).collect()));
            }
        } else if silhouette {
            frame.silhouette = Some(image(1, floats("silhouette", pixels)?.to_vec()));
        }
        if depth {
            frame.depth = Some(image(1, floats("depths", pixels)?.to_vec()));
        }
        if normal {
            frame.normal = Some(image(3, rgb_of(floats("normals", 4 * pixels)?)));
        }
        Ok(frame)
    }

    fn timings(&self) -> Result<Vec<StageTime>> {
        let Some(times) = &self.times else {
            return Ok(Vec::new());
        };
        let stamps = times.read(FORWARD_TIMESTAMPS)?;
        let spans = stamps.windows(2).map(|pair| pair[1] - pair[0]);
        Ok(FORWARD_STAGES.iter().zip(spans).map(|(&stage, milliseconds)| StageTime { stage, milliseconds }).collect())
    }
}

/// The first three of every four floats.
fn rgb_of(texels: &[f32]) -> Vec<f32> {
    let mut rgb = vec![0.0; texels.len() / 4 * 3];
    for (to, from) in rgb.chunks_exact_mut(3).zip(texels.chunks_exact(4)) {
        to.copy_from_slice(&from[..3]);
    }
    rgb
}
