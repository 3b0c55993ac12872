//! The device, the kernels and the limit of memory that all frames of a renderer share.

use crate::error::{Error, Result};
use crate::frame::rasterizer::Rasterizer;
use crate::vulkan::Context;

/// The state that all frames of a renderer share.
pub(super) struct Shared {
    pub rasterizer: Rasterizer,
    pub context: Context,
    /// As [`super::RendererOptions::memory`].
    pub memory: Option<u64>,
}

impl Shared {
    /// Fails if `bytes` for a frame and the `taken` bytes of others exceed [`super::RendererOptions::memory`].
    pub(super) fn validate_memory(&self, bytes: u64, taken: u64) -> Result<()> {
        let left = self.memory.unwrap_or(u64::MAX).saturating_sub(taken);
        if bytes <= left {
            return Ok(());
        }
        let fix = match taken {
            0 => "allow more, or render smaller images, fewer triangles or fewer cameras at once",
            _ => "allow more, or drop saved frames, which keep their memory",
        };
        Err(Error::OutOfMemory { what: format!("a frame, which may have {left} bytes"), bytes, fix: fix.into() })
    }
}
