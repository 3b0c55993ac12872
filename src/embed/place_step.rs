//! What every stage that reads or writes a host's arrays has in common: its numbers, and the checks of layouts.

use super::geometry::Layout;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::vulkan::{BufferPart, BufferRef, Recorder};

/// The numbers of `glsl/common/geometry_push.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Push {
    pub count: u32,
    pub draws: u32,
    pub first: u32,
    pub base: u32,
    pub stride: u32,
    pub offset: u32,
    pub transform_stride: u32,
    pub transform_offset: u32,
    pub select: u32,
}

/// A stage with its numbers.
pub(super) struct Step {
    pub stage: Stage,
    pub push: Push,
    pub groups: [u32; 3],
}

impl Step {
    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&self.push), self.groups)
    }
}

pub(super) fn misfit<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

/// The words of a layout whose last of `count` elements of `words` words each lies inside a buffer.
pub(super) fn layout_words(
    name: &str,
    (at, layout): &(BufferRef, Layout),
    count: u32,
    words: u64,
) -> Result<(u32, u32)> {
    let Layout { stride, offset } = *layout;
    if stride % 4 != 0 || offset % 4 != 0 || u64::from(stride) < 4 * words {
        let what = format!("{name} of {stride} bytes each, read at {offset}");
        return misfit(what, "use multiples of four, and a stride of at least what is read");
    }
    let last = u64::from(count.saturating_sub(1)) * u64::from(stride) + u64::from(offset) + 4 * words;
    validate_bytes(name, at, if count == 0 { 0 } else { last })?;
    Ok((stride / 4, offset / 4))
}

pub(super) fn validate_bytes(name: &str, at: &BufferRef, needed: u64) -> Result<()> {
    // Kernels count words with 32 bits.
    if needed > at.range() || needed > 4 * u64::from(u32::MAX) {
        return misfit(format!("{name} has {} bytes, the draws need {needed}", at.range()), "bind a larger part");
    }
    Ok(())
}

/// A frame's array has room for what is placed.
pub(super) fn validate_target(id: BufferId, target: &BufferPart, needed: u64) -> Result<()> {
    if needed > target.range() {
        let what = format!("the frame's `{id}` has {} bytes, the draws fill {needed}", target.range());
        return misfit(what, "plan the frame with a shape of as many vertices and triangles");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::Push;
    use crate::vulkan::kernels;
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernels_have_them() {
        let mirror = [
            ("count", offset_of!(Push, count)),
            ("draws", offset_of!(Push, draws)),
            ("first", offset_of!(Push, first)),
            ("base", offset_of!(Push, base)),
            ("stride", offset_of!(Push, stride)),
            ("offset", offset_of!(Push, offset)),
            ("transform_stride", offset_of!(Push, transform_stride)),
            ("transform_offset", offset_of!(Push, transform_offset)),
            ("select", offset_of!(Push, select)),
        ];
        let linear = [&kernels::PLACE, &kernels::PLACE_INDICES, &kernels::PLACE_VERTEX_GRAD];
        for kernel in linear.into_iter().chain([&kernels::PLACE_TRANSFORM_GRAD]) {
            let found: Vec<_> = kernel.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
            assert_eq!(found, mirror, "{}", kernel.name);
        }
        // PLACE_TRANSFORM_GRAD runs one workgroup for each instance, so its size is its own.
        assert!(linear.iter().all(|kernel| kernel.local_size == [crate::constants::LINEAR_GROUP, 1, 1]));
    }
}
