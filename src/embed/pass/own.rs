//! Passes in softras' own memory: those of the renderer, which is given its scene, cameras and settings anew for each frame, and learns
//! only afterwards which gradients are wanted.

use super::builder::{Content, PassPlan, PassView, decoded};
use super::memory::{GradientLayout, Wishes};
use super::{Pass, Staging};
use crate::embed::place::tables::Tables;
use crate::error::Result;
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::{Differentiate, GradientPlan};
use crate::frame::pack::{InputChanges, MeshTables};
use crate::frame::plan::{Capacity, Rare};
use crate::frame::rasterizer::Rasterizer;
use crate::frame::shape::FrameShape;
use crate::scene::{Camera, Settings, Shading};
use crate::vulkan::{BufferPart, Recorder};
use std::sync::Arc;

/// The largest VkBuffer that holds several buffers. Larger buffers have one of their own, so that a frame that outgrows its memory
/// gets little of it anew.
const LARGEST_ARENA: u64 = 64 << 20;

impl Rasterizer {
    /// Plans a frame of a scene that is given anew each time.
    pub(crate) fn plan_frame(
        &self,
        shape: &FrameShape,
        cameras: &[Camera],
        settings: &Settings,
        rare: Rare,
    ) -> Result<PassPlan> {
        let mut builder = self.builder(Content::Scene(None), shape.lights.clone()).settings(settings.clone());
        builder.rare = rare;
        builder.apart = Some(LARGEST_ARENA.min(self.device.limits().max_storage_buffer_range));
        let views = cameras.iter().map(|&camera| PassView::Camera(camera).camera((settings.width, settings.height)));
        let adjacency = settings.save || shape.lights.shading == Shading::Smooth;
        let tables = Arc::new(Tables { adjacency, ..Tables::default() });
        builder.plan(shape, views.collect::<Result<_>>()?, settings.clone(), tables)
    }
}

impl PassPlan {
    /// Takes over the cameras, settings and lights of another frame if it needs no other plan. Returns whether it does not.
    pub(crate) fn take(&mut self, shape: &FrameShape, cameras: &[Camera], settings: &Settings) -> Result<bool> {
        let FrameShape { meshes, views, depth_span, lenses, opacity, .. } = &self.frame.shape;
        let same = *meshes == shape.meshes
            && *views == shape.views
            && *depth_span == shape.depth_span
            && *lenses == shape.lenses
            && *opacity == shape.opacity
            && shape.capacity.is_none_or(|wished| self.has_room(wished))
            && self.frame.push_with(settings, shape.cutoff, &shape.lights)?.is_some();
        if same {
            self.set_frame(settings.clone(), shape.cutoff, Some(shape.lights.clone()))?;
            for (view, &camera) in self.cameras.iter_mut().zip(cameras) {
                view.camera = camera;
            }
        }
        Ok(same)
    }

    /// Whether its lists have as much room, or as much of it as this device can have.
    fn has_room(&self, wished: Capacity) -> bool {
        let has = self.frame.capacity;
        has.max(self.frame.within_limits(wished)) == has
    }

    /// The plan of gradients of its frame, and where their buffers lie.
    pub(crate) fn plan_gradients(&self, differentiate: &Differentiate) -> Result<(GradientPlan, GradientLayout)> {
        let plan = GradientPlan::new(&self.frame, differentiate)?;
        let read_back: Vec<BufferId> = decoded(&plan).collect();
        let wishes = Wishes { alignment: 1, apart: self.builder.apart, own: &[], read_back: &read_back };
        let layout = GradientLayout::new(plan.buffers(), &wishes, 0);
        Ok((plan, layout))
    }
}

impl Pass {
    /// Says which buffers the frame's inputs are copied from and its outputs to.
    pub(crate) fn with_staging(mut self, staging: Option<Staging>) -> Self {
        self.staging = staging;
        self
    }

    /// Binds gradients in place of those that it had.
    pub(crate) fn bind_gradients(
        &mut self,
        (plan, layout): (GradientPlan, GradientLayout),
        buffers: Vec<(BufferId, BufferPart)>,
        staging: Option<Staging>,
    ) -> Result<()> {
        self.forget_gradients();
        let given: Vec<_> = buffers.iter().collect();
        self.gradients = Some(self.rasterizer.bind_gradients(&plan, &given, &self.frame)?);
        (self.plan.gradients, self.plan.layouts.gradients) = (Some(plan), layout);
        self.gradient_staging = staging;
        self.buffers.extend(buffers);
        Ok(())
    }

    /// Lets go of the gradients' buffers.
    pub(crate) fn forget_gradients(&mut self) {
        (self.gradients, self.plan.gradients, self.gradient_staging) = (None, None, None);
        self.buffers.retain(|(id, _)| self.plan.frame.buffer(*id).is_some());
    }

    /// Records the copies of inputs that differ.
    pub(crate) fn record_changes(&self, recorder: &mut Recorder<'_>, changes: InputChanges) -> Result<()> {
        let copies = self.plan.layouts.setup.iter().filter(|copy| changes.has(copy.id));
        self.copy_in(recorder, &self.staging, copies)
    }

    /// Takes the tables of its scene out.
    pub(crate) fn into_tables(self) -> MeshTables {
        self.scene.unwrap_or_default()
    }
}
