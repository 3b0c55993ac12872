//! The buffers that a plan's kernels are bound to, owned by the host or by softras.

use super::BufferId;
use crate::vulkan::{BufferPart, TexelFormat};

/// Buffers by their ids, and the bytes that are bound in place of buffers that the plan does not have.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// The buffers that the plan requires.
    pub bound: Vec<(BufferId, BufferPart)>,
    /// The bytes of [`BufferId::Unused`] in every format.
    pub unused: Vec<(TexelFormat, BufferPart)>,
}

impl Parts {
    /// A buffer that the plan requires; `None` where it requires none.
    pub fn get(&self, id: BufferId) -> Option<&BufferPart> {
        self.bound.iter().find(|(i, _)| *i == id).map(|(_, part)| part)
    }

    /// The unused bytes in a buffer's format.
    pub fn unused(&self, format: TexelFormat) -> Option<&BufferPart> {
        self.unused.iter().find(|(f, _)| *f == format).map(|(_, part)| part)
    }

    /// The bytes that a kernel binds for a buffer: the buffer itself, or the unused bytes where the plan requires none.
    pub fn find(&self, id: BufferId) -> Option<&BufferPart> {
        self.get(id).or_else(|| self.unused(id.row().format))
    }
}
