//! Triangle counts that only the device knows.

use crate::constants as c;
use crate::embed::host::misfit;
use crate::error::Result;
use crate::frame::bindings::FrameBindings;
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::FramePlan;
use crate::frame::passes::Stage;
use crate::frame::rasterizer::Rasterizer;
use crate::vulkan::{BufferPart, BufferRef, Recorder, kernels};

/// Words of a host's buffer that say how many triangles of each view's mesh are drawn: the first ones of its indices.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// The first mesh's word at its start, of usage STORAGE_BUFFER.
    pub buffer: BufferRef,
    /// Bytes from one mesh's word to the next, a multiple of 4.
    pub stride: u32,
    /// They count indices, as VkDrawIndexedIndirectCommand does, not triangles.
    pub of_indices: bool,
}

/// Counts bound to a frame.
pub(crate) struct CountStep {
    source: BufferRef,
    stage: Stage,
    push: CountsPush,
    groups: [u32; 3],
}

/// The push constants of `glsl/counts.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct CountsPush {
    stride: u32,
    divisor: u32,
    pieces: u32,
}

impl CountStep {
    pub fn new(rasterizer: &Rasterizer, plan: &FramePlan, frame: &FrameBindings, counts: &Counts) -> Result<Self> {
        let Counts { buffer, stride, of_indices } = counts;
        let meshes = plan.shape.meshes.len() as u64;
        let needed = (meshes - 1) * u64::from(*stride) + 4;
        if !stride.is_multiple_of(4) || needed > buffer.range() {
            let what = format!("{meshes} counts {stride} bytes apart in {} bytes", buffer.range());
            return misfit(what, "use a multiple of four, and bind a larger part");
        }
        rasterizer.validate_storage("counts", buffer, needed)?;
        let source = BufferPart::of_host(&rasterizer.device, buffer);
        let buffers = [
            ("Counts", &source),
            ("ViewShapes", frame.array(BufferId::ViewShapes)?),
            ("Boxes", frame.array(BufferId::Boxes)?),
        ];
        let stage = rasterizer.stage(&kernels::COUNTS, &[], &buffers)?;
        let push = CountsPush {
            stride: if meshes == 1 { 0 } else { stride / 4 },
            divisor: if *of_indices { 3 } else { 1 },
            pieces: if plan.forward.modes.near_clip != 0 { 2 } else { 1 },
        };
        let most = plan.forward.views.iter().map(|view| view.records).max().unwrap_or(0);
        Ok(Self { source: *buffer, stage, push, groups: [most.div_ceil(c::LINEAR_GROUP), plan.views(), 1] })
    }

    pub fn source(&self) -> &BufferRef {
        &self.source
    }

    /// Records the reading of the counts, before the frame. A larger count than planned is taken as the planned one.
    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&self.push), self.groups)
    }
}

#[cfg(test)]
mod tests {
    use super::{CountsPush, c, kernels};
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernel_has_them() {
        let found: Vec<_> = kernels::COUNTS.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
        let mirror = [
            ("stride", offset_of!(CountsPush, stride)),
            ("divisor", offset_of!(CountsPush, divisor)),
            ("pieces", offset_of!(CountsPush, pieces)),
        ];
        assert_eq!(found, mirror);
        assert_eq!(kernels::COUNTS.local_size, [c::LINEAR_GROUP, 1, 1]);
    }
}
