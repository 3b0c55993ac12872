//! The device, the kernels and the limit of memory that all frames of a renderer share.

use crate::embed::{BufferRequirement, Rasterizer};
use crate::error::{Error, Result};
use crate::vulkan::Context;

/// What all frames of a renderer share.
pub(super) struct Shared {
    pub rasterizer: Rasterizer,
    pub context: Context,
    /// As [`super::RendererOptions::memory`].
    pub memory: Option<u64>,
}

impl Shared {
    /// Fails if the buffers and the `taken` bytes together exceed [`super::RendererOptions::memory`].
    pub(super) fn validate_memory<'a>(
        &self,
        buffers: impl IntoIterator<Item = &'a BufferRequirement>,
        taken: u64,
    ) -> Result<()> {
        let bytes = buffers.into_iter().map(|buffer| buffer.size).sum();
        let fix = match taken {
            0 => "allow more, or render smaller images, fewer triangles or fewer cameras at once",
            _ => "allow more, or drop saved frames, which keep their memory",
        };
        match self.memory {
            Some(most) if bytes > most.saturating_sub(taken) => Err(Error::OutOfMemory {
                what: format!("a frame, which may have {} bytes", most.saturating_sub(taken)),
                bytes,
                fix: fix.into(),
            }),
            _ => Ok(()),
        }
    }
}
