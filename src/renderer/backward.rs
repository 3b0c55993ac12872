//! Backward of the simple API: from dL/dimages to the gradients by the scene, the cameras and the settings.

use super::memory::Region;
use super::pixels;
use super::slot::{Slot, region_of};
use super::{Frame, Renderer, StageTime};
use crate::embed::{GradientLayout, Pass, PassPlan};
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::{Differentiate, GradientPlan};
use crate::gradients::{GradientRequest, Gradients, ImageGradient};
use crate::image::Image;
use crate::vulkan::{Context, Recorder};

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
        let plan = &self.slots[at].pass()?.plan;
        let (settings, views, channels) = (&plan.settings, plan.cameras.len(), plan.frame.shape.features() as usize);
        let (width, height) = (settings.width as usize, settings.height as usize);
        upstream.validate(settings.outputs, views, height, width, channels)?;
        self.bind_gradients(at, &self.slots[at].differentiate(upstream, wanted)?)?;
        let slot = &mut self.slots[at];
        slot.write_upstream(upstream)?;
        let Slot { pass: Some(pass), backward, .. } = slot else {
            return refused("the frame's pass is gone", "render it again");
        };
        let push = pass.gradient_plan()?.backward.push;
        let work = |recorder: &mut Recorder<'_>, times: Option<&_>| pass.record_backward_with(recorder, times);
        backward.commands.prepare(push, self.timed, work)?;
        backward.commands.buffer.submit_and_wait()?;
        self.backward_timings = backward.commands.timings()?;
        let contents = backward.memory.contents()?;
        pass.decode(wanted, &|id, count| contents.floats(id, count))
    }

    /// Device time of every stage of the latest backward pass, in order; 0 for a stage that was not needed. Empty unless
    /// [`Renderer::time_stages`] asked for it, or where the queue has no timestamps.
    pub fn backward_timings(&self) -> &[StageTime] {
        &self.backward_timings
    }

    /// Makes room for gradients and binds them, unless the frame's pass has just these.
    fn bind_gradients(&mut self, at: usize, differentiate: &Differentiate) -> Result<()> {
        if self.slots[at].backward.bound.as_ref() == Some(differentiate) {
            return Ok(());
        }
        let plan = &self.slots[at].pass()?.plan;
        let planned = plan.plan_gradients(differentiate)?;
        if plan.gradients.as_ref() == Some(&planned.0) {
            self.slots[at].note_gradients(differentiate);
            return Ok(());
        }
        let needed = region_of(plan).bytes() + gradient_region(&planned.1).bytes();
        let held = self.slots[at].bytes_with_gradients(&planned.1);
        if self.make_room(at, needed, held)? {
            self.slots[at].release_gradients();
        }
        match self.slots[at].bind_gradients(&self.shared.context, differentiate, planned.clone()) {
            Err(Error::OutOfMemory { .. }) if self.release_free(at) => {
                self.slots[at].bind_gradients(&self.shared.context, differentiate, planned)
            }
            result => result,
        }
    }
}

/// The memory that gradients need beyond the frame's.
fn gradient_region(layout: &GradientLayout) -> Region<'_> {
    let staging = [layout.upload_size, layout.readback_end];
    Region { arenas: &layout.arenas, inputs: layout.upstream.clone(), outputs: &layout.outputs, staging }
}

impl Slot {
    /// The gradients to plan for an upstream gradient.
    fn differentiate(&self, upstream: &ImageGradient, wanted: &GradientRequest) -> Result<Differentiate> {
        let pass = self.pass()?;
        let largest_upstream = if wanted.texels { largest_upstream(pass, upstream) } else { 0.0 };
        Ok(Differentiate { upstream: upstream.outputs(), wanted: *wanted, largest_upstream })
    }

    /// Bytes on the device once its pass is bound for gradients.
    fn bytes_with_gradients(&self, layout: &GradientLayout) -> u64 {
        self.bytes() - self.backward.memory.bytes() + self.backward.memory.bytes_with(&gradient_region(layout))
    }

    /// Binds its pass for gradients in memory that is large enough.
    fn bind_gradients(
        &mut self,
        context: &Context,
        differentiate: &Differentiate,
        planned: (GradientPlan, GradientLayout),
    ) -> Result<()> {
        self.unbind_gradients();
        let Some(pass) = &mut self.pass else { return refused("the frame's pass is gone", "render it again") };
        let memory = &mut self.backward.memory;
        // Upstream gradients are written for each pass.
        let _ = memory.reserve(context, &gradient_region(&planned.1))?;
        pass.bind_gradients(planned, memory.parts()?, memory.staging())?;
        self.note_gradients(differentiate);
        Ok(())
    }

    /// Notes which gradients its pass is bound for.
    fn note_gradients(&mut self, differentiate: &Differentiate) {
        self.backward.bound = Some(*differentiate);
        self.pass.iter_mut().for_each(|pass| pass.plan.builder.largest_upstream = differentiate.largest_upstream);
    }

    fn write_upstream(&mut self, upstream: &ImageGradient) -> Result<()> {
        let alpha = upstream.silhouette.as_ref();
        if let Some(color) = &upstream.color {
            let from = color.data.as_chunks::<3>().0;
            let mut bytes = self.backward.memory.bytes_mut(BufferId::UpstreamColor, 16 * from.len())?;
            let texels = bytemuck::cast_slice_mut(&mut bytes);
            pixels::join(texels, from, alpha.map(|alpha| &alpha.data[..]));
        } else if let Some(alpha) = alpha {
            self.backward.memory.write(BufferId::UpstreamSilhouette, bytemuck::cast_slice(&alpha.data))?;
        }
        if let Some(depth) = &upstream.depth {
            self.backward.memory.write(BufferId::UpstreamDepths, bytemuck::cast_slice(&depth.data))?;
        }
        if let Some(features) = &upstream.features {
            let stride = features.channels.next_multiple_of(4);
            let pixels = features.data.chunks_exact(features.channels);
            let mut bytes = self.backward.memory.bytes_mut(BufferId::UpstreamFeatures, 4 * stride * pixels.len())?;
            let floats: &mut [f32] = bytemuck::cast_slice_mut(&mut bytes);
            for (to, from) in floats.chunks_exact_mut(stride).zip(pixels) {
                to[..from.len()].copy_from_slice(from);
                to[from.len()..].fill(0.0);
            }
        }
        if let Some(normal) = &upstream.normal {
            let from = normal.data.as_chunks::<3>().0;
            let mut bytes = self.backward.memory.bytes_mut(BufferId::UpstreamNormals, 16 * from.len())?;
            pixels::join(bytemuck::cast_slice_mut(&mut bytes), from, None);
        }
        Ok(())
    }
}

/// The bound of the upstream gradients that the fixed point of texels' sums needs: see [`Differentiate::largest_upstream`].
fn largest_upstream(pass: &Pass, upstream: &ImageGradient) -> f64 {
    let largest = |image: &Image| f64::from(image.data.iter().fold(0.0f32, |m, &x| m.max(x.abs())));
    let of = |image: &Option<Image>| image.as_ref().map_or(0.0, largest);
    let PassPlan { frame, settings, .. } = &pass.plan;
    let Some(tables) = pass.scene.as_ref().filter(|_| frame.forward.modes.opacity != 0) else {
        return of(&upstream.color);
    };
    let texels = tables.texels.iter().flatten().map(|x| f64::from(x.abs()));
    let brightest = settings.background_color.iter().map(|x| x.abs()).chain(texels).fold(1.0, f64::max);
    let shaded = (of(&upstream.color) * brightest).max(of(&upstream.depth) * settings.far);
    let features = tables.features.iter().flatten().map(|x| f64::from(x.abs()));
    let channels = upstream.features.as_ref().map_or(0, |features| features.channels) as f64;
    let features = of(&upstream.features) * channels * features.fold(0.0, f64::max);
    shaded.max(of(&upstream.silhouette)).max(of(&upstream.normal)).max(features)
}
