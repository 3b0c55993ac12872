//! Many buffers in one: the simplest way to own a plan's memory.

use super::plan::BufferRequirement;
use crate::error::Result;
use crate::frame::buffers::BufferId;
use crate::vulkan::{BufferRef, vk};

/// Where each of several required buffers lies within one VkBuffer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Arena {
    /// Bytes of the VkBuffer.
    pub size: u64,
    /// Its usage: what the buffers need, and transfer in both directions.
    pub usage: vk::BufferUsageFlags,
    /// What its offset must be a multiple of where it is a part of a larger VkBuffer.
    pub alignment: u64,
    /// Id, offset and bytes of each buffer.
    pub parts: Vec<(BufferId, u64, u64)>,
}

impl Arena {
    /// Lays buffers one after the other, each aligned. Memory bound at an offset that the device's own
    /// VkMemoryRequirements allow keeps them aligned.
    pub fn of<'a>(buffers: impl IntoIterator<Item = &'a BufferRequirement>) -> Self {
        Self::aligned(buffers, 1)
    }

    /// The same where a host's own rules ask for offsets at multiples of `alignment` beyond the device's: 32 with wgpu. A
    /// power of two.
    pub fn aligned<'a>(buffers: impl IntoIterator<Item = &'a BufferRequirement>, alignment: u64) -> Self {
        let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        let alignment = alignment.max(1);
        let mut arena = Self { usage, alignment, ..Self::default() };
        for requirement in buffers {
            let own = requirement.alignment.max(alignment);
            arena.alignment = arena.alignment.max(own);
            let offset = arena.size.next_multiple_of(own);
            // Whole texels, so that a view of the part can cover it.
            let size = requirement.size.next_multiple_of(requirement.id.row().format.bytes());
            arena.parts.push((requirement.id, offset, size));
            arena.usage |= requirement.usage;
            arena.size = offset + size;
        }
        arena
    }

    /// The parts of the buffer that was made of it, to be bound.
    ///
    /// # Errors
    /// [`crate::Error::Host`] for a buffer that is smaller than [`size`](Self::size).
    pub fn refs(&self, buffer: &BufferRef) -> Result<Vec<(BufferId, BufferRef)>> {
        let part = |&(id, offset, range): &(_, u64, u64)| Ok((id, buffer.part(offset, range)?));
        self.parts.iter().map(part).collect()
    }

    /// Where one of them lies: offset and bytes.
    pub fn part(&self, id: BufferId) -> Option<(u64, u64)> {
        self.parts.iter().find(|(i, ..)| *i == id).map(|&(_, offset, size)| (offset, size))
    }
}
