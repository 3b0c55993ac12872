//! The simple API: a renderer that owns its device, and renders scenes to images and back to gradients.

mod backward;
mod commands;
mod fragments;
mod frame;
mod memory;
pub mod parts;
mod pixels;
mod shared;
mod slot;

pub use fragments::{Fragment, Fragments};
pub use frame::{Frame, FrameCounts, StageTime};

use crate::constants as c;
use crate::embed::PassPlan;
use crate::error::{Error, Result};
use crate::frame::plan::{Capacity, Rare};
use crate::frame::rasterizer::Rasterizer;
use crate::frame::shape::FrameShape;
use crate::scene::{Camera, Scene, Settings};
use crate::vulkan::{CacheFolder, Context, ContextOptions, DeviceInfo, DeviceKind, Loader};
use pixels::Spare;
use shared::Shared;
use slot::{Slot, region_of};

/// How to open a renderer.
#[derive(Clone, Debug, Default)]
pub struct RendererOptions {
    /// A device's index, or part of its name in any case. `None`: the device that `SOFTRAS_DEVICE` names, else the best
    /// one: discrete GPUs come before integrated ones, and these before software devices.
    pub device: Option<String>,
    /// Run under the Vulkan validation layers with synchronization checks; `SOFTRAS_VALIDATION=1` does so too. Open all
    /// renderers before rendering then: the layers (seen in 1.3.239) may crash if one thread opens or drops a device while
    /// another renders.
    pub validation: bool,
    /// Invocations that share a tile, 1 to 32, a power of two; `None`: a subgroup's on software devices, 32 elsewhere. The
    /// images do not depend on it.
    pub lanes: Option<u32>,
    /// The folder that keeps compiled kernels between runs.
    pub cache: CacheFolder,
    /// The Vulkan loader; `None`: the driver's file that `SOFTRAS_DRIVER` names, else the system's loader.
    pub loader: Option<Loader>,
    /// The most bytes of device memory for a frame with its gradients and all saved frames that live, or for a step of
    /// a fit. Larger frames are refused with [`Error::OutOfMemory`]. `None`: as much as the device has.
    pub memory: Option<u64>,
}

/// A device with the buffers, kernels and commands of frames, which are kept from frame to frame.
///
/// A saved frame ([`Renderer::render_saved`]) owns what [`Renderer::backward`] reads for as long as it or a clone of it lives, so
/// several can be differentiated in any order; each takes device memory of its own. The memory of dropped frames is used again.
pub struct Renderer {
    shared: Shared,
    /// At least one. A frame is rendered with the first that no living saved frame owns.
    slots: Vec<Slot>,
    /// The slot of the latest frame.
    latest: usize,
    /// The frames rendered so far.
    rendered: u64,
    timed: bool,
    backward_timings: Vec<StageTime>,
    /// The room for lists that the latest kinds of frames had or would have needed, the latest kind last.
    capacities: Vec<(Kind, Capacity)>,
    /// The rarely needed kernels that some frame has needed so far. They take as long to compile as all others
    /// together, so the first frame that needs one is rendered again with it. Lists without room are walked once a
    /// frame has needed more memory than the device can hold.
    rare: Rare,
    spare: Spare,
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
    /// [`Error::NoDevice`] without a Vulkan loader, driver or suitable device; [`Error::File`] for what SOFTRAS_DRIVER names;
    /// [`Error::Vulkan`].
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
            loader: options.loader.clone(),
        })?;
        let mut rasterizer = Rasterizer::on(context.device(), Some(context.pipeline_cache().clone()));
        if let Some(lanes) = options.lanes {
            rasterizer = rasterizer.with_lanes(lanes)?;
        }
        // On other devices lanes share all but the smallest items, so that every frame needs these kernels.
        let large = context.device().kind() != DeviceKind::Software;
        let rare = Rare { walked: false, thin: false, large };
        let shared = Shared { rasterizer, context, memory: options.memory };
        Ok(Self {
            slots: vec![Slot::new(&shared.context)?],
            shared,
            latest: 0,
            rendered: 0,
            timed: false,
            backward_timings: Vec::new(),
            rare,
            capacities: Vec::new(),
            spare: Spare::default(),
        })
    }

    /// The Vulkan devices of this machine, suitable or not, by the indices that [`RendererOptions::device`] takes.
    ///
    /// # Errors
    /// [`Error::NoDevice`] without a Vulkan loader or driver; [`Error::File`] for what SOFTRAS_DRIVER names;
    /// [`Error::Vulkan`].
    pub fn devices() -> Result<Vec<DeviceInfo>> {
        Context::devices(None)
    }

    /// The device's name, as its driver reports it.
    pub fn device_name(&self) -> &str {
        &self.shared.context.info().name
    }

    /// The device with its limits and properties.
    pub fn device_info(&self) -> &DeviceInfo {
        self.shared.context.info()
    }

    /// The messages of the validation layers so far; empty without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.shared.context.validation_messages()
    }

    /// Bytes of device memory that the renderer holds.
    pub fn device_bytes(&self) -> u64 {
        self.slots.iter().map(Slot::bytes).sum()
    }

    /// Turns timings of the stages on or off for the following frames ([`Frame::timings`],
    /// [`Renderer::backward_timings`]). They are off at first, since each stage then waits for the
    /// timestamp of the stage before.
    pub fn time_stages(&mut self, on: bool) {
        self.timed = on;
    }

    /// Counts of the latest frame, for measurements.
    ///
    /// # Errors
    /// [`Error::Vulkan`] before the first frame.
    pub fn frame_counts(&self) -> Result<FrameCounts> {
        let slot = &self.slots[self.latest];
        let needed = slot.status()?.needed;
        Ok(FrameCounts {
            list_entries: needed.list.into(),
            forward_pairs: u64::from(needed.list) * u64::from(c::TILE_WIDTH * c::TILE_HEIGHT),
            uploaded_bytes: slot.uploaded_bytes,
            dispatches: slot.commands.buffer.dispatches(),
            backward_dispatches: slot.backward.commands.buffer.dispatches(),
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
        let mut shape = FrameShape::of(scene, cameras, settings)?;
        let kind = kind_of(&shape, settings);
        let kept = self.capacities.iter().find(|(of, _)| *of == kind).map(|(_, capacity)| *capacity);
        shape.capacity = kept.map(|kept| kept.max(Capacity::estimate(settings, shape.cutoff, &shape.view_sizes())));
        let at = self.slot_for(&shape, cameras, settings)?;
        self.latest = at;
        loop {
            let status = self.slots[at].execute(scene, self.timed)?;
            let plan = &self.slots[at].pass()?.plan;
            let next = status.next(&plan.frame)?;
            if next.is_complete {
                // The next frame of this kind has room for what this one needed.
                self.keep_capacity(kind, kept.map_or(next.capacity, |kept| kept.max(next.capacity)));
                break;
            }
            self.rare = next.rare;
            let larger = plan.with_room(next.capacity, next.rare)?;
            self.bind(at, &larger)?;
        }
        let slot = &mut self.slots[at];
        slot.finished = true;
        let (contents, timings) = (slot.contents()?, slot.commands.timings()?);
        let channels = shape.features() as usize;
        let mut frame = Frame::download(&contents, cameras.len(), settings, channels, timings, &self.spare)?;
        frame.owner = settings.save.then(|| slot.owner());
        Ok(frame)
    }

    /// As [`Renderer::render`], and keeps what [`Renderer::backward`] needs of the frame for as long as the frame or a clone of it
    /// lives, whatever [`Settings::save`] says.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn render_saved(&mut self, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Frame> {
        self.render(scene, cameras, &Settings { save: true, ..settings.clone() })
    }

    fn keep_capacity(&mut self, kind: Kind, capacity: Capacity) {
        self.capacities.retain(|(of, _)| *of != kind);
        if self.capacities.len() == KINDS {
            self.capacities.remove(0);
        }
        self.capacities.push((kind, capacity));
    }

    /// A slot for the next frame, which no living frame owns, bound to a plan of it: one whose plan it already is, if there is one. A
    /// frame that is to be saved takes no slot whose memory is much larger than it needs.
    fn slot_for(&mut self, shape: &FrameShape, cameras: &[Camera], settings: &Settings) -> Result<usize> {
        self.rendered += 1;
        let most = |plan: &PassPlan| if settings.save { 4 * region_of(plan).bytes() + (1 << 20) } else { u64::MAX };
        let is_free = |slot: &Slot, plan: &PassPlan| slot.is_free() && slot.bytes() <= most(plan);
        for at in 0..self.slots.len() {
            let slot = &mut self.slots[at];
            let free = slot.pass.as_ref().is_some_and(|pass| is_free(slot, &pass.plan));
            if free && slot.take(shape, cameras, settings, self.rare)? {
                self.use_slot(at);
                return Ok(at);
            }
        }
        let plan = self.shared.rasterizer.plan_frame(shape, cameras, settings, self.rare)?;
        let at = match self.slots.iter().position(|slot| is_free(slot, &plan)) {
            Some(at) => at,
            None => {
                self.slots.push(Slot::new(&self.shared.context)?);
                self.slots.len() - 1
            }
        };
        self.use_slot(at);
        self.bind(at, &plan)?;
        Ok(at)
    }

    /// Notes that a slot is used. A loop that keeps several frames alive reuses its slots in each turn; those that it no longer uses
    /// give up their memory.
    fn use_slot(&mut self, at: usize) {
        self.slots[at].used = self.rendered;
        let recently = self.rendered.saturating_sub(2 * self.slots.len() as u64);
        self.slots.iter_mut().filter(|slot| slot.is_free() && slot.used < recently).for_each(Slot::release);
        while self.slots.last().is_some_and(|slot| slot.is_free() && slot.used < recently) {
            self.slots.pop();
        }
    }

    /// Binds a slot to a plan, for which it makes room.
    fn bind(&mut self, at: usize, plan: &PassPlan) -> Result<()> {
        let held = self.slots[at].bytes_with(plan);
        if self.make_room(at, region_of(plan).bytes(), held)? {
            self.slots[at].release();
        }
        match self.slots[at].bind(&self.shared, plan.clone()) {
            Err(Error::OutOfMemory { .. }) if self.release_free(at) => self.slots[at].bind(&self.shared, plan.clone()),
            result => result,
        }
    }

    /// Keeps the limit of memory: a frame needs `needed` bytes, and its slot is to hold `held`. If that is too much, the slots of dropped
    /// frames give up theirs. Returns whether this slot must give up what is larger than needed as well.
    fn make_room(&mut self, at: usize, needed: u64, held: u64) -> Result<bool> {
        let others = |renderer: &Self, living: bool| -> u64 {
            let others = (0..).zip(&renderer.slots).filter(|(i, slot)| *i != at && !(living && slot.is_free()));
            others.map(|(_, slot)| slot.bytes()).sum()
        };
        self.shared.validate_memory(needed, others(self, true))?;
        let most = self.shared.memory.unwrap_or(u64::MAX);
        if others(self, false) + held > most {
            self.release_free(at);
        }
        Ok(others(self, false) + held > most)
    }

    /// Frees the memory of every slot whose frame was dropped, except slot `but`. Returns whether any was freed.
    fn release_free(&mut self, but: usize) -> bool {
        let mut any = false;
        for (_, slot) in self.slots.iter_mut().enumerate().filter(|(i, slot)| *i != but && slot.is_free()) {
            any |= slot.bytes() > 0;
            slot.release();
        }
        any
    }
}

/// Frames that are expected to need as much room for lists: of the same size, with as many views and triangles.
type Kind = (u32, u32, u32, u64);

/// The kinds of frames whose capacities are kept.
const KINDS: usize = 16;

fn kind_of(shape: &FrameShape, settings: &Settings) -> Kind {
    let triangles = shape.meshes.iter().map(|mesh| u64::from(mesh.triangles)).sum();
    (settings.width, settings.height, shape.views, triangles)
}
