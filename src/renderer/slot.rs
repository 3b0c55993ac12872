//! The device's state of one frame: its buffers, its commands, and which inputs the device has already.

use super::frame::StageTime;
use super::inputs::Inputs;
use super::shared::Shared;
use super::upload::Uploads;
use crate::error::Result;
use crate::frame::bindings::{FrameBindings, GradientBindings};
use crate::frame::buffers::{BufferId, BufferSet, Role};
use crate::frame::frame_plan::{BufferRequirement, Differentiate, FramePlan, GradientPlan};
use crate::frame::pack::InputChanges;
use crate::frame::passes::{BACKWARD_TIMESTAMPS, BackwardStage, FORWARD_TIMESTAMPS, ForwardStage};
use crate::frame::plan::Rare;
use crate::frame::shape::FrameShape;
use crate::frame::status::Status;
use crate::scene::{Camera, Lights, Scene, Settings};
use crate::vulkan::{CommandBuffer, Context, TimestampPool};
use std::sync::Arc;

/// The input of a saved frame. Its buffers and tables are its slot's.
pub(super) struct Saved {
    pub plan: Arc<FramePlan>,
    pub cameras: Vec<Camera>,
    pub settings: Settings,
    pub lights: Lights,
}

/// The plan and the commands of backward, kept from pass to pass.
pub(super) struct Backward {
    /// The latest plan, and the input that it was made for.
    pub planned: Option<(Arc<FramePlan>, Differentiate, Arc<GradientPlan>)>,
    /// The plan of the recorded commands, and whether they are timed.
    pub recorded: Option<(Arc<GradientPlan>, GradientBindings, bool)>,
    pub commands: CommandBuffer,
    pub times: Option<TimestampPool>,
}

impl Backward {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            planned: None,
            recorded: None,
            commands: CommandBuffer::new(context, "softras backward")?,
            times: TimestampPool::new(context.device(), context.queue_family(), BACKWARD_TIMESTAMPS)?,
        })
    }

    /// Forgets the recorded commands, whose buffers were replaced.
    pub(super) fn forget(&mut self) {
        self.recorded = None;
    }

    /// The stages' times of the latest pass; empty without timestamps.
    pub(super) fn timings(&self, timed: bool) -> Result<Vec<StageTime>> {
        let Some(times) = self.times.as_ref().filter(|_| timed) else {
            return Ok(Vec::new());
        };
        let stamps = times.read(BACKWARD_TIMESTAMPS)?;
        Ok(StageTime::between(&stamps, BackwardStage::ALL.map(BackwardStage::name)))
    }
}

/// Holds one frame at a time.
pub(super) struct Slot {
    /// Shared with the saved frame in this slot and its clones.
    owner: Arc<()>,
    /// The number of the renderer's frame that it was last used for.
    pub used: u64,
    /// The latest plan, and the settings that it was made for.
    planned: Option<(Settings, Arc<FramePlan>)>,
    /// The plan of the recorded commands, and whether they are timed.
    pub recorded: Option<(Arc<FramePlan>, FrameBindings, bool)>,
    pub backward: Backward,
    /// The input of its frame, if that was saved.
    pub saved: Option<Saved>,
    /// Whether the recorded commands were the last to write to the buffers, and made a frame.
    pub finished: bool,
    pub commands: CommandBuffer,
    times: Option<TimestampPool>,
    pub inputs: Inputs,
    pub uploads: Uploads,
    pub buffers: BufferSet,
}

impl Slot {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            owner: Arc::default(),
            used: 0,
            planned: None,
            recorded: None,
            backward: Backward::new(context)?,
            saved: None,
            finished: false,
            commands: CommandBuffer::new(context, "softras frame")?,
            times: TimestampPool::new(context.device(), context.queue_family(), FORWARD_TIMESTAMPS)?,
            inputs: Inputs::default(),
            uploads: Uploads::new(context)?,
            buffers: BufferSet::default(),
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

    /// Keeps the frame for backward, until every clone of the returned owner is dropped.
    pub(super) fn save(&mut self, saved: Saved) -> Arc<()> {
        self.saved = Some(saved);
        self.owner.clone()
    }

    /// Frees the buffers.
    pub(super) fn release(&mut self) {
        self.forget();
        self.planned = None;
        self.saved = None;
        self.finished = false;
        self.inputs = Inputs::default();
        self.uploads.stale = InputChanges::ALL;
        self.buffers = BufferSet::default();
    }

    /// The latest plan, if it was made for this shape and these settings and kernels.
    pub(super) fn plan_of(&self, shape: &FrameShape, settings: &Settings, rare: Rare) -> Option<&Arc<FramePlan>> {
        let (of, plan) = self.planned.as_ref()?;
        (of == settings && plan.is_of(shape, rare)).then_some(plan)
    }

    /// Whether the latest plan is this one.
    pub(super) fn is_planned(&self, plan: &Arc<FramePlan>) -> bool {
        self.planned.as_ref().is_some_and(|(_, own)| Arc::ptr_eq(own, plan))
    }

    /// Takes the slot for a frame of this plan.
    pub(super) fn take(&mut self, plan: &Arc<FramePlan>, settings: &Settings) {
        self.saved = None;
        if !self.is_planned(plan) {
            self.planned = Some((settings.clone(), plan.clone()));
        }
    }

    /// Makes every buffer of the frame or, with `backward`, of the pass large enough.
    pub(super) fn make_room(&mut self, context: &Context, needed: &[BufferRequirement], backward: bool) -> Result<()> {
        needed.iter().try_for_each(|needed| self.reserve(context, needed.id, needed.size, backward))
    }

    /// Makes a buffer large enough. If the old one is gone, forgets the commands recorded with it.
    fn reserve(&mut self, context: &Context, id: BufferId, size: u64, backward: bool) -> Result<()> {
        let reserved = self.buffers.reserve(context, id, size);
        if !matches!(reserved, Ok(false)) {
            if backward {
                self.backward.forget();
            } else {
                self.uploads.stale.note(id, true);
                self.forget();
            }
        }
        reserved.map(drop)
    }

    /// Frees what is larger than the frame needs: all buffers, or those that backward added to the frame's.
    pub(super) fn shrink(&mut self, backward: bool) {
        match self.planned.take() {
            Some((settings, plan)) if backward => {
                self.backward.forget();
                self.buffers.retain(|id| plan.buffer(id).is_some());
                self.planned = Some((settings, plan));
            }
            planned => {
                self.release();
                self.planned = planned;
            }
        }
    }

    /// Forgets the recorded commands.
    pub(super) fn forget(&mut self) {
        self.recorded = None;
        self.backward.forget();
        self.uploads.forget();
    }

    /// Renders a frame whose buffers have room, and waits for it.
    pub(super) fn execute(
        &mut self,
        shared: &Shared,
        scene: &Scene,
        cameras: &[Camera],
        settings: &Settings,
        plan: &Arc<FramePlan>,
        timed: bool,
    ) -> Result<Status> {
        self.uploads.bytes = 0;
        self.write_inputs(scene, cameras, settings, plan, timed)?;
        self.prepare(shared, plan, timed)?;
        self.uploads.record(&self.buffers)?;
        self.commands.submit_and_wait_after(self.uploads.commands())?;
        self.uploads.done();
        self.status()
    }

    /// Writes the inputs whose bytes on the device differ.
    fn write_inputs(
        &mut self,
        scene: &Scene,
        cameras: &[Camera],
        settings: &Settings,
        plan: &Arc<FramePlan>,
        timed: bool,
    ) -> Result<()> {
        // The buffers still hold the last frame's images if that frame succeeded and had the same commands.
        self.inputs.background_kept = std::mem::take(&mut self.finished) && self.is_recorded(plan, timed);
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
    fn is_recorded(&self, plan: &Arc<FramePlan>, timed: bool) -> bool {
        self.recorded.as_ref().is_some_and(|(recorded, _, with_times)| {
            *with_times == timed && (Arc::ptr_eq(recorded, plan) || recorded.forward == plan.forward)
        })
    }

    /// Records the frame's commands unless they are recorded already.
    fn prepare(&mut self, shared: &Shared, plan: &Arc<FramePlan>, timed: bool) -> Result<()> {
        if self.is_recorded(plan, timed) {
            return Ok(());
        }
        self.recorded = None;
        let bindings = shared.rasterizer.bind_parts(plan, self.buffers.parts(plan.buffers().iter().map(|b| b.id))?)?;
        let (rasterizer, buffers) = (&shared.rasterizer, &self.buffers);
        let times = self.times.as_ref().filter(|_| timed);
        self.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times)?;
            }
            rasterizer.forward(recorder, plan, &bindings, times)?;
            for (id, buffer) in buffers.shared() {
                if id.row().role == Role::Output && plan.buffer(id).is_some() {
                    buffer.record_download(recorder)?;
                }
            }
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.recorded = Some((plan.clone(), bindings, timed));
        Ok(())
    }

    pub(super) fn status(&self) -> Result<Status> {
        let mut status = [0; Status::BYTES];
        self.buffers.read(BufferId::Status, &mut status)?;
        Ok(Status::from_bytes(&status))
    }

    /// The stages' times of the latest frame; empty without timestamps.
    pub(super) fn timings(&self, timed: bool) -> Result<Vec<StageTime>> {
        let Some(times) = self.times.as_ref().filter(|_| timed) else {
            return Ok(Vec::new());
        };
        let stamps = times.read(FORWARD_TIMESTAMPS)?;
        Ok(StageTime::between(&stamps, ForwardStage::ALL.map(ForwardStage::name)))
    }
}
