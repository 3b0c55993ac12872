//! Backward of the simple API: from dL/dimages to the gradients by the scene, the cameras and the settings.

use super::pixels;
use super::shared::Shared;
use super::slot::{Saved, Slot};
use super::{Frame, Renderer, StageTime};
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Role};
use crate::frame::decode::Decoder;
use crate::frame::frame_plan::{Differentiate, FramePlan, GradientPlan};
use crate::gradients::{GradientRequest, Gradients, ImageGradient};
use crate::image::Image;
use crate::scene::Settings;
use std::sync::Arc;

fn refused<T>(what: &str, fix: &str) -> Result<T> {
    Err(Error::Backward { what: what.into(), fix: fix.into() })
}

impl Renderer {
    /// Computes the gradients in `wanted` of a loss, from its gradients by the frame's images.
    ///
    /// The frame must come from this renderer's [`Renderer::render_saved`]. It can be differentiated any number of
    /// times, also after other frames. Gradients of a mesh are summed over its views. Equal input and an equal request give
    /// equal bits; a request for more gradients may change the last places of each.
    ///
    /// # Errors
    /// [`Error::Backward`] for a frame that was not saved, one of another renderer, or an upstream gradient that does not fit
    /// it; [`Error::NotFinite`] where single precision cannot hold the gradient; otherwise as [`Renderer::render`].
    pub fn backward(&mut self, frame: &Frame, upstream: &ImageGradient, wanted: &GradientRequest) -> Result<Gradients> {
        let Some(owner) = &frame.owner else {
            return refused("the frame was rendered for looking at only", "render it with Renderer::render_saved");
        };
        let Some(at) = self.slots.iter().position(|slot| slot.is_owned_by(owner)) else {
            return refused("another renderer made the frame", "differentiate a frame with the renderer that made it");
        };
        let Some(saved) = self.slots[at].saved.take() else {
            return refused("the frame's saved state is gone", "render it again");
        };
        let result = self.backward_saved(at, &saved, upstream, wanted);
        self.slots[at].saved = Some(saved);
        result
    }

    /// Device time of every stage of the latest backward pass, in order; 0 for a stage that was not needed. Empty unless
    /// [`Renderer::time_stages`] asked for it, or where the queue has no timestamps.
    pub fn backward_timings(&self) -> &[StageTime] {
        &self.backward_timings
    }

    fn backward_saved(
        &mut self,
        at: usize,
        saved: &Saved,
        upstream: &ImageGradient,
        wanted: &GradientRequest,
    ) -> Result<Gradients> {
        let s = &saved.settings;
        let (width, height) = (s.width as usize, s.height as usize);
        let channels = saved.plan.shape.features() as usize;
        upstream.validate(s.outputs, saved.cameras.len(), height, width, channels)?;
        let plan = self.slots[at].plan_backward(&saved.plan, s, upstream, wanted)?;
        self.make_room(at, &[saved.plan.buffers(), plan.buffers()].concat(), true)?;
        let slot = &mut self.slots[at];
        slot.write_upstream(upstream)?;
        slot.prepare_backward(&self.shared, &plan, wanted, self.timed)?;
        slot.backward.commands.submit_and_wait()?;
        self.backward_timings = slot.backward.timings(self.timed)?;
        let decoder = Decoder {
            frame: &saved.plan,
            plan: &plan,
            wanted,
            tables: &slot.inputs.tables,
            cameras: &saved.cameras,
            settings: &saved.settings,
            lights: &saved.lights,
        };
        let contents = slot.buffers.contents()?;
        decoder.decode_floats(&|id, count| contents.floats(id, count))
    }
}

impl Slot {
    /// The last plan if nothing that it depends on has changed, else a new one.
    fn plan_backward(
        &mut self,
        frame: &Arc<FramePlan>,
        settings: &Settings,
        upstream: &ImageGradient,
        wanted: &GradientRequest,
    ) -> Result<Arc<GradientPlan>> {
        let largest = |image: &Image| f64::from(image.data.iter().fold(0.0f32, |m, &x| m.max(x.abs())));
        let differentiate = Differentiate {
            upstream: upstream.outputs(),
            wanted: *wanted,
            largest_upstream: if !wanted.texels {
                0.0
            } else if frame.forward.modes.opacity != 0 {
                let of = |image: &Option<Image>| image.as_ref().map_or(0.0, largest);
                let texels = self.inputs.tables.texels.iter().flatten().map(|x| f64::from(x.abs()));
                let brightest = settings.background_color.iter().map(|x| x.abs()).chain(texels).fold(1.0, f64::max);
                let shaded = (of(&upstream.color) * brightest).max(of(&upstream.depth) * settings.far);
                let features = self.inputs.tables.features.iter().flatten().map(|x| f64::from(x.abs()));
                let channels = upstream.features.as_ref().map_or(0, |features| features.channels) as f64;
                let features = of(&upstream.features) * channels * features.fold(0.0, f64::max);
                shaded.max(of(&upstream.silhouette)).max(of(&upstream.normal)).max(features)
            } else {
                upstream.color.as_ref().map_or(0.0, largest)
            },
        };
        if let Some((planned_for, d, plan)) = &self.backward.planned
            && *d == differentiate
            && (Arc::ptr_eq(planned_for, frame) || planned_for == frame)
        {
            return Ok(plan.clone());
        }
        let plan = Arc::new(GradientPlan::new(frame, &differentiate)?);
        self.backward.planned = Some((frame.clone(), differentiate, plan.clone()));
        Ok(plan)
    }

    fn write_upstream(&mut self, upstream: &ImageGradient) -> Result<()> {
        let alpha = upstream.silhouette.as_ref();
        if let Some(color) = &upstream.color {
            let from = color.data.as_chunks::<3>().0;
            let mut bytes = self.buffers.bytes_mut(BufferId::UpstreamColor, 16 * from.len())?;
            let texels = bytemuck::cast_slice_mut(&mut bytes);
            pixels::join(texels, from, alpha.map(|alpha| &alpha.data[..]));
        } else if let Some(alpha) = alpha {
            self.buffers.write(BufferId::UpstreamSilhouette, bytemuck::cast_slice(&alpha.data))?;
        }
        if let Some(depth) = &upstream.depth {
            self.buffers.write(BufferId::UpstreamDepths, bytemuck::cast_slice(&depth.data))?;
        }
        if let Some(features) = &upstream.features {
            let stride = features.channels.next_multiple_of(4);
            let pixels = features.data.chunks_exact(features.channels);
            let mut bytes = self.buffers.bytes_mut(BufferId::UpstreamFeatures, 4 * stride * pixels.len())?;
            let floats: &mut [f32] = bytemuck::cast_slice_mut(&mut bytes);
            for (to, from) in floats.chunks_exact_mut(stride).zip(pixels) {
                to[..from.len()].copy_from_slice(from);
                to[from.len()..].fill(0.0);
            }
        }
        if let Some(normal) = &upstream.normal {
            let from = normal.data.as_chunks::<3>().0;
            let mut bytes = self.buffers.bytes_mut(BufferId::UpstreamNormals, 16 * from.len())?;
            pixels::join(bytemuck::cast_slice_mut(&mut bytes), from, None);
        }
        Ok(())
    }

    /// Records the pass's commands unless they are recorded already.
    fn prepare_backward(
        &mut self,
        shared: &Shared,
        plan: &Arc<GradientPlan>,
        wanted: &GradientRequest,
        timed: bool,
    ) -> Result<()> {
        let same = |recorded: &Arc<GradientPlan>| Arc::ptr_eq(recorded, plan) || recorded == plan;
        if self.backward.recorded.as_ref().is_some_and(|(recorded, _, times)| *times == timed && same(recorded)) {
            return Ok(());
        }
        let Some((_, frame, _)) = &self.recorded else {
            return refused("the frame's commands are gone", "render it again");
        };
        let parts = self.buffers.parts(plan.buffers().iter().map(|b| b.id))?;
        let bindings = shared.rasterizer.bind_backward_parts(plan, &parts, frame)?;
        let (rasterizer, buffers) = (&shared.rasterizer, &self.buffers);
        let times = self.backward.times.as_ref().filter(|_| timed);
        self.backward.recorded = None;
        self.backward.commands.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times)?;
            }
            for (id, buffer) in buffers.shared() {
                if id.row().role == Role::Input && plan.buffer(id).is_some() {
                    buffer.record_upload(recorder)?;
                }
            }
            rasterizer.backward(recorder, plan, &bindings, times)?;
            for (id, buffer) in buffers.shared() {
                let read = match id {
                    BufferId::CornerGradients => wanted.uvs,
                    BufferId::TexelSums => wanted.texels,
                    BufferId::VertexGradients => wanted.positions || wanted.colors,
                    BufferId::FeatureGradients => wanted.features,
                    BufferId::Totals => true,
                    _ => false,
                };
                if read {
                    buffer.record_download(recorder)?;
                }
            }
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.backward.recorded = Some((plan.clone(), bindings, timed));
        Ok(())
    }
}
