//! The renderer's state of one frame: a pass with its memory and commands, and which inputs the device has already.

use super::commands::Commands;
use super::memory::{Memory, Region};
use super::shared::Shared;
use crate::constants as c;
use crate::embed::{Pass, PassPlan};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::Differentiate;
use crate::frame::pack::{InputChanges, MeshTables, light_texels};
use crate::frame::passes::{BACKWARD_COUNT, BackwardStage, FORWARD_COUNT, ForwardStage};
use crate::frame::plan::Rare;
use crate::frame::shape::FrameShape;
use crate::frame::status::Status;
use crate::scene::{Camera, Scene, Settings};
use crate::vulkan::{CommandBuffer, Context};
use std::sync::Arc;

/// The memory and the commands of a frame's gradients, kept from one backward pass to the next.
pub(super) struct Backward {
    /// The gradients that the pass is bound for.
    pub bound: Option<Differentiate>,
    pub memory: Memory,
    pub commands: Commands<BACKWARD_COUNT>,
}

/// The inputs that belong to no mesh, as the device has them.
#[derive(Default)]
struct ViewInputs {
    shapes: Vec<[u32; 4 * c::SHAPE_TEXELS as usize]>,
    cameras: Vec<[[f32; 4]; c::CAMERA_TEXELS as usize]>,
    lights: Vec<[f32; 4]>,
}

impl ViewInputs {
    /// Takes over those of a plan, and returns the ones that differ. With `background_kept` tiles that were empty in the last frame, and
    /// still are, need not be written again.
    fn renew(&mut self, plan: &PassPlan, background_kept: bool) -> InputChanges {
        /// The word of an entry of `view_shapes` that holds the SHAPE_ flags.
        const FLAGS: usize = 11;
        let (mut shapes, lights) = (plan.frame.view_shapes(), light_texels(&plan.frame.shape.lights));
        if background_kept {
            shapes.iter_mut().for_each(|shape| shape[FLAGS] |= c::SHAPE_MARKS_VALID);
        }
        let new = Self { shapes, cameras: plan.camera_inputs(), lights };
        let mut changes = InputChanges::default();
        for ((id, old), (_, new)) in self.all().into_iter().zip(new.all()) {
            changes.note(id, old != new);
        }
        *self = new;
        changes
    }

    fn all(&self) -> [(BufferId, &[u8]); 3] {
        [
            (BufferId::ViewShapes, bytemuck::cast_slice(&self.shapes)),
            (BufferId::ViewCameras, bytemuck::cast_slice(&self.cameras)),
            (BufferId::Lights, bytemuck::cast_slice(&self.lights)),
        ]
    }
}

/// Holds one frame at a time.
pub(super) struct Slot {
    /// Shared with the saved frame in this slot and its clones.
    owner: Arc<()>,
    /// The number of the renderer's frame that it was last used for.
    pub used: u64,
    /// The latest frame's pass.
    pub pass: Option<Pass>,
    /// The meshes of the latest frame, while no pass has them.
    tables: MeshTables,
    views: ViewInputs,
    /// Inputs whose bytes on the device are not those of the host.
    stale: InputChanges,
    /// Bytes of inputs that were written for the latest frame.
    pub uploaded_bytes: u64,
    memory: Memory,
    pub commands: Commands<FORWARD_COUNT>,
    /// Copies of the inputs that differ, where the host cannot write them where they belong.
    uploads: CommandBuffer,
    /// The inputs that `uploads` copies.
    copied: InputChanges,
    /// Whether the recorded commands were the last to write to the buffers, and made a frame.
    pub finished: bool,
    pub backward: Backward,
}

impl Backward {
    fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            bound: None,
            memory: Memory::default(),
            commands: Commands::new(context, "softras backward", BackwardStage::ALL.map(BackwardStage::name))?,
        })
    }
}

/// The memory that a frame needs.
pub(super) fn region_of(plan: &PassPlan) -> Region<'_> {
    let layouts = &plan.layouts;
    let staging = [layouts.upload_size, layouts.readback_size];
    Region { arenas: &layouts.arenas, inputs: layouts.inputs().copied().collect(), outputs: &layouts.forward, staging }
}

impl Slot {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            owner: Arc::default(),
            used: 0,
            pass: None,
            tables: MeshTables::default(),
            views: ViewInputs::default(),
            stale: InputChanges::ALL,
            uploaded_bytes: 0,
            memory: Memory::default(),
            commands: Commands::new(context, "softras frame", ForwardStage::ALL.map(ForwardStage::name))?,
            uploads: CommandBuffer::new(context, "softras uploads")?,
            copied: InputChanges::default(),
            finished: false,
            backward: Backward::new(context)?,
        })
    }

    /// Whether no living frame owns it.
    pub(super) fn is_free(&self) -> bool {
        Arc::strong_count(&self.owner) == 1
    }

    /// Whether the frame with this owner was saved in this slot.
    pub(super) fn is_owned_by(&self, owner: &Arc<()>) -> bool {
        Arc::ptr_eq(&self.owner, owner)
    }

    /// Keeps the frame for backward, until every clone of what is returned is dropped.
    pub(super) fn owner(&self) -> Arc<()> {
        self.owner.clone()
    }

    /// The pass of the latest frame.
    ///
    /// # Errors
    /// [`Error::Vulkan`] before the first frame.
    pub(super) fn pass(&self) -> Result<&Pass> {
        self.pass.as_ref().ok_or_else(|| Error::Vulkan { call: "render", result: "no frame was rendered".into() })
    }

    /// Takes over the cameras, settings and lights of another frame if the pass can render it. Returns whether it can.
    pub(super) fn take(
        &mut self,
        shape: &FrameShape,
        cameras: &[Camera],
        settings: &Settings,
        rare: Rare,
    ) -> Result<bool> {
        match &mut self.pass {
            Some(pass) if pass.plan.builder.rare == rare => pass.plan.take(shape, cameras, settings),
            _ => Ok(false),
        }
    }

    /// Bytes on the device.
    pub(super) fn bytes(&self) -> u64 {
        self.memory.bytes() + self.backward.memory.bytes()
    }

    /// Bytes on the device once it is [bound](Self::bind) to a plan.
    pub(super) fn bytes_with(&self, plan: &PassPlan) -> u64 {
        self.memory.bytes_with(&region_of(plan)) + self.backward.memory.bytes()
    }

    /// Lets go of the gradients' buffers, so that they can be replaced.
    pub(super) fn unbind_gradients(&mut self) {
        self.backward.bound = None;
        self.backward.commands.forget();
        self.pass.iter_mut().for_each(Pass::forget_gradients);
    }

    /// Frees the gradients' memory.
    pub(super) fn release_gradients(&mut self) {
        self.unbind_gradients();
        self.backward.memory = Memory::default();
    }

    /// Lets go of the pass, so that its memory can be replaced, and keeps its meshes.
    fn unbind(&mut self) {
        (self.copied, self.finished) = (InputChanges::default(), false);
        self.commands.forget();
        self.uploads.clear();
        self.unbind_gradients();
        if let Some(pass) = self.pass.take() {
            self.tables = pass.into_tables();
        }
    }

    /// Frees all memory.
    pub(super) fn release(&mut self) {
        self.unbind();
        (self.memory, self.backward.memory) = (Memory::default(), Memory::default());
        (self.tables, self.views, self.stale) = (MeshTables::default(), ViewInputs::default(), InputChanges::ALL);
    }

    /// Binds a plan to memory that is large enough, in place of the last one.
    pub(super) fn bind(&mut self, shared: &Shared, plan: PassPlan) -> Result<()> {
        self.unbind();
        // Where it fails, all of the memory is gone.
        let before = std::mem::replace(&mut self.stale, InputChanges::ALL);
        self.stale = before.or(self.memory.reserve(&shared.context, &region_of(&plan))?);
        let tables = std::mem::take(&mut self.tables);
        let pass = shared.rasterizer.bind_buffers(plan, self.memory.parts()?, Some(tables))?;
        self.pass = Some(pass.with_staging(self.memory.staging()));
        Ok(())
    }

    /// Renders a frame with the pass, which took over its cameras and settings, and waits for it.
    pub(super) fn execute(&mut self, scene: &Scene, timed: bool) -> Result<Status> {
        let written = self.write_inputs(scene, timed)?;
        self.prepare(written, timed)?;
        let uploads = (!self.copied.is_empty()).then_some(&mut self.uploads);
        self.commands.buffer.submit_and_wait_after(uploads)?;
        self.stale = self.stale.without(written);
        self.status()
    }

    /// Writes the inputs whose bytes on the device differ, and returns them.
    fn write_inputs(&mut self, scene: &Scene, timed: bool) -> Result<InputChanges> {
        let Some(pass) = &mut self.pass else { return Ok(InputChanges::default()) };
        let push = pass.plan.frame.forward.push;
        // The buffers still hold the last frame's images if that frame succeeded and had the same commands.
        let background_kept = std::mem::take(&mut self.finished) && self.commands.are_recorded(push, timed);
        let tables = pass.scene.get_or_insert_default();
        let changed = tables.renew(scene, &pass.plan.frame.shape.meshes, pass.plan.tables.adjacency);
        let views = self.views.renew(&pass.plan, background_kept);
        self.stale = self.stale.or(changed).or(views);
        let mut written = InputChanges::default();
        self.uploaded_bytes = 0;
        for (id, bytes) in self.views.all().into_iter().chain(tables.all()) {
            if self.stale.has(id) && self.memory.has_input(id) {
                self.memory.write(id, bytes)?;
                written.note(id, true);
                self.uploaded_bytes += bytes.len() as u64;
            }
        }
        Ok(written)
    }

    /// Records the frame's commands unless they are recorded already, and the copies of what was written, unless these are those
    /// recorded last, as in an optimization loop.
    fn prepare(&mut self, written: InputChanges, timed: bool) -> Result<()> {
        let Some(pass) = &self.pass else { return Ok(()) };
        let push = pass.plan.frame.forward.push;
        self.commands.prepare(push, timed, |recorder, times| pass.record_forward_with(recorder, times))?;
        let copied = if self.memory.staging().is_some() { written } else { InputChanges::default() };
        if self.copied != copied {
            self.copied = InputChanges::default();
            if !copied.is_empty() {
                self.uploads.record(|recorder| pass.record_changes(recorder, copied))?;
            }
            self.copied = copied;
        }
        Ok(())
    }

    pub(super) fn status(&self) -> Result<Status> {
        let contents = self.memory.contents()?;
        let bytes = contents.bytes(BufferId::Status, Status::BYTES)?;
        let mut status = [0; Status::BYTES];
        status.copy_from_slice(bytes);
        Ok(Status::from_bytes(&status))
    }

    /// The outputs of the latest frame.
    pub(super) fn contents(&self) -> Result<super::memory::Contents<'_>> {
        self.memory.contents()
    }
}
