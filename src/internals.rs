//! What this project's own tests, benchmarks and command reach of the inside. **Not part of the public interface**: semantic
//! versioning does not cover it, and any release may change or remove any of it.

pub use crate::frame::{buffers, pack, passes, pipelines, plan};

/// Raw Vulkan: devices, memory, kernels, command buffers.
pub mod vulkan {
    pub use crate::vulkan::*;
}

pub use crate::vulkan::constants;
