//! The simple API: a renderer that owns its device.

mod backward;

use crate::buffers::{self, BufferSet, Role, Slot};
use crate::constants as c;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::pack::{MeshTables, camera_texels, light_texels};
use crate::passes::{self, FORWARD_STAGES, FORWARD_TIMESTAMPS, ForwardStages};
use crate::pipelines::{Pipelines, Request};
use crate::plan::{Capacity, DepthSpan, Plan, PlanInput, ViewSize};
use crate::scene::{Camera, Outputs, Projection, Scene, Settings, Shading};
use crate::vulkan::{CacheFolder, CommandBuffer, Context, ContextOptions, DeviceInfo, DeviceKind, TimestampPool};

/// The longest list of triangles that a software device walks: Mesa before 23 ends an invocation's loops after 65535 passes
/// in all, without an error, and a hole in the image is worse than one.
const SOFTWARE_LONGEST_LIST: u32 = 60_000;

/// The farthest that a support may reach, in units of σ: the kernels hold D as a single-precision number, and exp(-70) is as
/// small as it may be with digits to spare for what it is multiplied with.
const FARTHEST: f64 = 70.0;

/// The cut-off of a frame, if the kernels can hold it.
fn reach_of(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<f64> {
    let cutoff = settings.cutoff_of(scene, cameras);
    if cutoff <= FARTHEST {
        return Ok(cutoff);
    }
    Err(Error::Settings {
        field: "support",
        value: format!("guaranteed, where D falls to exp(-{cutoff:.0})"),
        mend: format!(
            "the kernels follow D down to exp(-{FARTHEST}): use a larger gamma, bring near and far close around the scene, \
             use the composite background, or support probability"
        ),
    })
}

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
    pipelines: Pipelines,
    recorded: Option<(Plan, ForwardStages)>,
    backward: backward::State,
    /// The latest frame, if it was saved.
    saved: Option<backward::Saved>,
    frames: u64,
    commands: CommandBuffer,
    times: Option<TimestampPool>,
    buffers: BufferSet,
    capacity: Option<Capacity>,
    lanes: u32,
    context: Context,
}

impl std::fmt::Debug for Renderer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Renderer").field("device", &self.device_name()).field("lanes", &self.lanes).finish()
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
        // A software device's subgroups have eight lanes, and its shared memory is slow: one subgroup a tile.
        let usual = if context.info().kind == DeviceKind::Software { 8 } else { 32 };
        let lanes = options.lanes.unwrap_or(usual);
        if !(lanes.is_power_of_two() && lanes <= c::TILE_WIDTH * c::TILE_HEIGHT) {
            let mend = "use a power of two from 1 to 32".into();
            return Err(Error::Settings { field: "lanes", value: lanes.to_string(), mend });
        }
        Ok(Self {
            pipelines: Pipelines::default(),
            recorded: None,
            backward: backward::State::new(&context)?,
            saved: None,
            frames: 0,
            commands: CommandBuffer::new(&context, "softras frame")?,
            times: TimestampPool::new(context.device(), context.queue_family(), FORWARD_TIMESTAMPS)?,
            buffers: BufferSet::default(),
            capacity: options.capacity,
            lanes,
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
        scene.judge(cameras)?;
        settings.judge()?;
        let smooth = scene.lights.shading == Shading::Smooth;
        self.frames += 1;
        self.saved = None;
        let tables = MeshTables::new(scene, smooth || settings.save);
        let views: Vec<ViewSize> = (0..cameras.len())
            .map(|view| tables.layouts[scene.mesh_of_view(view)])
            .map(|mesh| ViewSize { vertices: mesh.vertices, triangles: mesh.triangles })
            .collect();
        let bounds: Vec<_> = scene.meshes.iter().map(crate::Mesh::bounds).collect();
        let inside = DepthSpan { crosses_near: false, crosses_far: false };
        let depth_span = cameras.iter().enumerate().fold(inside, |span, (view, camera)| {
            span.or(DepthSpan::of(bounds[scene.mesh_of_view(view)], camera, settings))
        });
        let distorted = cameras.iter().any(|c| matches!(c.projection(), Projection::Official { .. }));
        let cutoff = reach_of(scene, cameras, settings)?;
        let mut capacity = self.capacity.unwrap_or_else(|| Capacity::estimate(settings, &views));
        loop {
            let plan = Plan::new(&PlanInput {
                settings,
                cutoff,
                views: &views,
                meshes: scene.meshes.len() as u32,
                lights: &scene.lights,
                sampling: tables.sampling,
                depth_span,
                distorted,
                capacity,
                save: settings.save,
            })?;
            self.upload(scene, cameras, settings, &tables, &plan)?;
            self.prepare(&plan)?;
            self.commands.submit_and_wait()?;
            match self.needed(capacity)? {
                Some(more) => capacity = more,
                None => {
                    // The next frame of this kind starts with what this one needed.
                    self.capacity = Some(self.capacity.map_or(capacity, |c| c.max(capacity)));
                    let frame = self.download(cameras.len(), settings)?;
                    if settings.save {
                        self.saved = Some(backward::Saved {
                            id: self.frames,
                            plan,
                            tables,
                            cameras: cameras.to_vec(),
                            settings: settings.clone(),
                            lights: scene.lights.clone(),
                        });
                    }
                    return Ok(frame);
                }
            }
        }
    }

    /// Makes room for the plan's buffers and writes the inputs.
    fn upload(
        &mut self,
        scene: &Scene,
        cameras: &[Camera],
        settings: &Settings,
        tables: &MeshTables,
        plan: &Plan,
    ) -> Result<()> {
        let shapes = tables.view_shapes(scene, plan);
        let cameras: Vec<_> = cameras.iter().map(|camera| camera_texels(camera, settings)).collect();
        let lights = light_texels(&scene.lights);
        let inputs: [(&str, &[u8]); 12] = [
            ("view_shapes", bytemuck::cast_slice(&shapes)),
            ("view_cameras", bytemuck::cast_slice(&cameras)),
            ("positions", bytemuck::cast_slice(&tables.positions)),
            ("indices", bytemuck::cast_slice(&tables.indices)),
            ("adjacency", bytemuck::cast_slice(&tables.adjacency)),
            ("lights", bytemuck::cast_slice(&lights)),
            ("colors", bytemuck::cast_slice(&tables.colors)),
            ("uvs", bytemuck::cast_slice(&tables.uvs)),
            ("uv_indices", bytemuck::cast_slice(&tables.uv_indices)),
            ("triangle_textures", bytemuck::cast_slice(&tables.triangle_textures)),
            ("textures", bytemuck::cast_slice(&tables.textures)),
            ("texels", bytemuck::cast_slice(&tables.texels)),
        ];
        let mut renewed = false;
        for slot in buffers::FORWARD {
            let input = inputs.iter().find(|(name, _)| *name == slot.name);
            let size = input.map_or_else(|| buffers::planned_size(&plan.sizes, slot.name), |(_, b)| b.len() as u64);
            renewed |= self.buffers.reserve(&self.context, slot, size)?;
        }
        for (name, bytes) in inputs {
            self.buffers.write(name, bytes)?;
        }
        if renewed {
            self.recorded = None;
            self.backward.forget();
        }
        Ok(())
    }

    /// Records the frame's commands, unless they are recorded already.
    fn prepare(&mut self, plan: &Plan) -> Result<()> {
        if self.recorded.as_ref().is_some_and(|(recorded, _)| recorded == plan) {
            return Ok(());
        }
        let device = self.context.device().clone();
        let modes = &plan.modes;
        let lanes = self.lanes;
        let requests = passes::forward_kernels(&device, lanes).map(|kernel| Request { kernel, modes, lanes });
        let pipelines = self.pipelines.get(&self.context, requests)?;
        let buffers = &self.buffers;
        let stages = ForwardStages::new(&device, pipelines, &|name| buffers.get(name))?;
        let missing = |name: &str| Error::Vulkan { call: "descriptor binding", result: format!("no buffer {name}") };
        let status = buffers.get("status").ok_or_else(|| missing("status"))?;
        let bits = buffers.get("bin_bits").ok_or_else(|| missing("bin_bits"))?;
        let times = self.times.as_ref();
        let is_forward = |slot: Slot| buffers::FORWARD.iter().any(|f| f.name == slot.name);
        self.recorded = None;
        self.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times);
            }
            for (slot, buffer) in buffers.shared() {
                if slot.role == Role::Input && is_forward(slot) {
                    buffer.record_upload(recorder)?;
                }
            }
            recorder.barrier();
            passes::record_forward(recorder, plan, &stages, status, bits, times)?;
            for (slot, buffer) in buffers.shared() {
                if slot.role == Role::Output && is_forward(slot) {
                    buffer.record_download(recorder)?;
                }
            }
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.recorded = Some((plan.clone(), stages));
        Ok(())
    }

    /// What the frame's lists needed, when that was more than there was room for.
    fn needed(&self, had: Capacity) -> Result<Option<Capacity>> {
        let mut status = [0u32; c::STATUS_WORDS as usize];
        self.buffers.read("status", bytemuck::cast_slice_mut(&mut status))?;
        if status[c::STATUS_NOT_FINITE as usize] != 0 {
            let mend = "bring positions and camera to a scale within 1e15, and near above 1e-6".into();
            return Err(Error::NotFinite { stage: "triangle", mend });
        }
        let longest = status[c::STATUS_LONGEST_LIST as usize];
        if self.context.info().kind == DeviceKind::Software && longest > SOFTWARE_LONGEST_LIST {
            return Err(Error::Limit {
                what: "one tile of 8×4 pixels".into(),
                needed: longest.into(),
                unit: "triangles near it",
                limit_name: "passes of a loop on a software driver",
                limit: SOFTWARE_LONGEST_LIST.into(),
                mend: "render larger, nearer or with a smaller sigma, or simplify the mesh".into(),
            });
        }
        let coarse = status[c::STATUS_COARSE_NEEDED as usize];
        let list = status[c::STATUS_LIST_NEEDED as usize];
        let cells = status[c::STATUS_CELLS_NEEDED as usize];
        if coarse <= had.coarse && list <= had.list && cells <= had.cells {
            return Ok(None);
        }
        // A quarter more than was needed, so that a mesh in motion does not grow its lists every frame.
        let room = |needed: u32, had: u32| if needed > had { needed.saturating_add(needed / 4) } else { had };
        Ok(Some(Capacity {
            coarse: room(coarse, had.coarse),
            list: room(list, had.list),
            cells: room(cells, had.cells),
        }))
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
