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
    /// Id, offset and bytes of each buffer.
    pub parts: Vec<(BufferId, u64, u64)>,
}

impl Arena {
    /// Lays buffers one after the other, each aligned. Memory bound at an offset that the device's own
    /// VkMemoryRequirements allow keeps them aligned.
    pub fn of<'a>(buffers: impl IntoIterator<Item = &'a BufferRequirement>) -> Self {
        let mut arena =
            Self { usage: vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST, ..Self::default() };
        for requirement in buffers {
            let offset = arena.size.next_multiple_of(requirement.alignment);
            // Whole texels, so that a view of the part can cover it.
            let size = requirement.size.next_multiple_of(requirement.format.bytes());
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
