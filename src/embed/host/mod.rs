//! The device, cameras, geometry and meshes of a host, as it describes them.

pub mod camera;
pub mod geometry;
pub mod mesh;
pub mod requirements;
pub mod targets;

use crate::error::{Error, Result};
use crate::vulkan::{BufferRef, vk};

/// An error about what a host gives.
pub fn misfit<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

/// Fails unless a host's buffer is not null and was made for this usage.
pub fn validate_made(name: &str, at: &BufferRef, usage: vk::BufferUsageFlags) -> Result<()> {
    if at.raw() == vk::Buffer::null() {
        return misfit(format!("{name}: the buffer is null"), "give a buffer with memory bound to it");
    }
    if !at.usage().contains(usage) {
        return misfit(format!("{name}: the buffer was made for {:?}", at.usage()), &format!("add {usage:?}"));
    }
    Ok(())
}
