//! Triangle counts that only the device knows.

use super::Rasterizer;
use super::bindings::FrameBindings;
use super::plan::FramePlan;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::vulkan::{BufferPart, BufferRef, HostCommands, Recorder, kernels};

/// Words of a host's buffer that say how many triangles of each mesh are drawn: the first ones of its `indices`.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// The first mesh's word at its start, of usage STORAGE_BUFFER.
    pub buffer: BufferRef,
    /// Bytes from one mesh's word to the next, a multiple of 4.
    pub stride: u32,
    /// They count indices, as VkDrawIndexedIndirectCommand does, not triangles.
    pub of_indices: bool,
}

/// Counts bound to a frame. To be kept as [`FrameBindings`].
pub struct CountBindings {
    stage: Stage,
    push: Push,
    groups: [u32; 3],
}

/// The push constants of `glsl/counts.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    stride: u32,
    divisor: u32,
    pieces: u32,
}

impl Rasterizer {
    /// Binds counts to a frame that was planned with [`FrameShape::device_counts`](super::FrameShape::device_counts). They serve frames
    /// of this plan; for one of another shape, bind them anew.
    ///
    /// # Errors
    /// [`Error::Host`] for a frame planned otherwise or bound for less, or counts that lie outside their buffer; otherwise as
    /// [`prepare`](Self::prepare).
    pub fn bind_counts(&self, plan: &FramePlan, frame: &FrameBindings, counts: &Counts) -> Result<CountBindings> {
        frame.fits(plan)?;
        let misfit = |what: String, fix: &str| Err(Error::Host { what, fix: fix.into() });
        if !plan.shape.device_counts {
            return misfit("the frame was planned with counts known".into(), "set FrameShape::device_counts");
        }
        let Counts { buffer, stride, of_indices } = counts;
        let meshes = plan.shape.meshes.len() as u64;
        let needed = (meshes - 1) * u64::from(*stride) + 4;
        if !stride.is_multiple_of(4) || needed > buffer.range() {
            let what = format!("{meshes} counts {stride} bytes apart in {} bytes", buffer.range());
            return misfit(what, "use a multiple of four, and bind a larger part");
        }
        let source = BufferPart::of_host(&self.device, buffer);
        let buffers = [
            ("Counts", &source),
            ("ViewShapes", frame.array(BufferId::ViewShapes)?),
            ("Boxes", frame.array(BufferId::Boxes)?),
        ];
        let stage = self.stage(&kernels::COUNTS, &[], &buffers)?;
        let push = Push {
            stride: if meshes == 1 { 0 } else { stride / 4 },
            divisor: if *of_indices { 3 } else { 1 },
            pieces: if plan.forward.modes.near_clip != 0 { 2 } else { 1 },
        };
        let most = plan.forward.views.iter().map(|view| view.records).max().unwrap_or(0);
        Ok(CountBindings { stage, push, groups: [most.div_ceil(c::LINEAR_GROUP), plan.views(), 1] })
    }

    /// Records the reading of the counts: before [`record_forward`](Self::record_forward), in every frame. More than was
    /// planned count as that. Begins and ends with barriers as that does.
    ///
    /// # Errors
    /// [`Error::Limit`] for more workgroups than the device allows.
    pub fn record_counts(&self, commands: &mut HostCommands, bindings: &CountBindings) -> Result<()> {
        let mut recorder = Recorder::on_host(&self.device, commands);
        recorder.begin_label("softras counts");
        recorder.barrier();
        bindings.stage.record(&mut recorder, bytemuck::bytes_of(&bindings.push), bindings.groups)?;
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }
}

impl std::fmt::Debug for CountBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CountBindings").field("push", &self.push).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::{Push, c, kernels};
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernel_has_them() {
        let found: Vec<_> = kernels::COUNTS.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
        let mirror = [
            ("stride", offset_of!(Push, stride)),
            ("divisor", offset_of!(Push, divisor)),
            ("pieces", offset_of!(Push, pieces)),
        ];
        assert_eq!(found, mirror);
        assert_eq!(kernels::COUNTS.local_size, [c::LINEAR_GROUP, 1, 1]);
    }
}
