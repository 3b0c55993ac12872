//! A host's vertex and index buffers as they are: copied into the packed layout by a kernel.

use super::Rasterizer;
use super::bindings::BufferRef;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::pipelines::Request;
use crate::vulkan::{BufferPart, DescriptorPool, DescriptorSet, Pipeline, Recorder, kernels, vk};

/// How the elements of a host's array lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gather {
    /// Vertices of `stride` bytes with x, y, z as floats at `offset`; both multiples of 4. The target is `positions`, an
    /// element is a vertex.
    Positions {
        /// Bytes from one vertex to the next, 12 or more.
        stride: u32,
        /// Bytes from a vertex's start to its position.
        offset: u32,
    },
    /// Indices of 16 bits. The target is `indices`, an element is an index, three a triangle.
    Indices16 {
        /// Added to each, as a draw's vertexOffset is.
        base: u32,
    },
    /// The same of 32 bits.
    Indices32 {
        /// Added to each.
        base: u32,
    },
}

/// A host's array and the packed one it is gathered into. To be kept as [`FrameBindings`](super::FrameBindings).
pub struct GatherBindings {
    pipeline: Pipeline,
    set: DescriptorSet,
    source: u64,
    target: u64,
}

impl std::fmt::Debug for GatherBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GatherBindings").field("source", &self.source).field("target", &self.target).finish()
    }
}

/// The push constants of `glsl/gather.comp`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    count: u32,
    first: u32,
    stride: u32,
    offset: u32,
    bits: u32,
}

fn misfit<T>(what: String, mend: &str) -> Result<T> {
    Err(Error::Host { what, mend: mend.into() })
}

impl Gather {
    /// The numbers of a dispatch, judged against the bytes bound.
    fn push(self, count: u32, first: u32, bindings: &GatherBindings) -> Result<Push> {
        let (elements, last) = (u64::from(count), u64::from(count.saturating_sub(1)));
        let (read, each, mut push) = match self {
            Self::Positions { stride, offset } => {
                if stride % 4 != 0 || offset % 4 != 0 || stride < 12 {
                    return misfit(
                        format!("vertices of {stride} bytes, positions at {offset}"),
                        "use multiples of four",
                    );
                }
                let read = last * u64::from(stride) + u64::from(offset) + 12;
                (read, 12, Push { count, first, stride: stride / 4, offset: offset / 4, bits: 32 })
            }
            // Whole words are read.
            Self::Indices16 { base } => {
                ((2 * elements).next_multiple_of(4), 4, Push { count, first, stride: 0, offset: base, bits: 16 })
            }
            Self::Indices32 { base } => (4 * elements, 4, Push { count, first, stride: 0, offset: base, bits: 32 }),
        };
        if count == 0 {
            push.count = 0;
            return Ok(push);
        }
        let written = each * (u64::from(first) + elements);
        for (what, needed, bound) in [("source", read, bindings.source), ("target", written, bindings.target)] {
            if needed > bound || needed > 4 * u64::from(u32::MAX) {
                return misfit(format!("{what} of {bound} bytes, gathering needs {needed}"), "bind a larger part");
            }
        }
        Ok(push)
    }
}

impl Rasterizer {
    /// Binds a host's vertex or index buffer, of usage STORAGE_BUFFER and at an offset that
    /// minStorageBufferOffsetAlignment allows, and the frame's `positions` or `indices` that it goes into.
    ///
    /// # Errors
    /// [`Error::Vulkan`] for a misaligned offset, [`Error::Limit`] for more bytes than maxStorageBufferRange.
    ///
    /// # Safety
    /// As for [`bind`](Self::bind). The parts do not overlap.
    pub unsafe fn bind_gather(&self, source: BufferRef, target: BufferRef) -> Result<GatherBindings> {
        let request = Request { kernel: &kernels::GATHER, modes: &[], lanes: self.lanes };
        let [pipeline] = self.pipelines([request])?;
        // SAFETY: the caller's promise.
        let part = |at: BufferRef| unsafe { BufferPart::from_raw(at.buffer, at.offset, at.range, None) };
        let pool = DescriptorPool::new(&self.device, &[&kernels::GATHER])?;
        let set = pool.bind(&pipeline, &[("Source", &part(source)), ("Target", &part(target))])?;
        Ok(GatherBindings { pipeline, set, source: source.range, target: target.range })
    }

    /// Records the copy of `count` elements to those from `first` on: before [`record_forward`](Self::record_forward), in
    /// any frame in which they changed. Begins and ends with barriers as that does.
    ///
    /// # Errors
    /// [`Error::Host`] where the elements lie outside what is bound.
    ///
    /// # Safety
    /// As for [`record_forward`](Self::record_forward).
    pub unsafe fn record_gather(
        &self,
        command_buffer: vk::CommandBuffer,
        bindings: &GatherBindings,
        gather: Gather,
        count: u32,
        first: u32,
    ) -> Result<()> {
        let push = gather.push(count, first, bindings)?;
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::from_raw(&self.device, command_buffer) };
        let groups = push.count.div_ceil(c::LINEAR_GROUP);
        let groups = [groups.min(c::FORWARD_ROW), groups.div_ceil(c::FORWARD_ROW), 1];
        recorder.begin_label("softras gather");
        recorder.barrier();
        recorder.dispatch(&bindings.pipeline, &bindings.set, bytemuck::bytes_of(&push), groups)?;
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Push, kernels};
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernel_has_them() {
        let found: Vec<_> = kernels::GATHER.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
        let mirror = [
            ("count", offset_of!(Push, count)),
            ("first", offset_of!(Push, first)),
            ("stride", offset_of!(Push, stride)),
            ("offset", offset_of!(Push, offset)),
            ("bits", offset_of!(Push, bits)),
        ];
        assert_eq!(found, mirror);
        assert_eq!(kernels::GATHER.local_size, [crate::constants::LINEAR_GROUP, 1, 1]);
    }
}
