//! The description of a buffer: its memory, texels and usages, validated against a device's limits.

use super::adapter::Limits;
use crate::{Error, Result};
use ash::vk;

/// Where a buffer's memory lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Location {
    /// With the device.
    #[default]
    Device,
    /// With the device; mapped where the device's memory is the host's own, as [`Buffer::is_mapped`](super::Buffer::is_mapped) tells.
    DeviceMapped,
    /// With the host, for it to write.
    Upload,
    /// With the host, for it to read.
    Readback,
}

/// The format of a texel buffer's elements. Every Vulkan device can read each of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelFormat {
    /// R32_SFLOAT.
    Float,
    /// R32G32_SFLOAT.
    Float2,
    /// R32G32B32A32_SFLOAT.
    Float4,
    /// R32_UINT.
    Uint,
    /// R32G32_UINT.
    Uint2,
    /// R32G32B32A32_UINT.
    Uint4,
    /// R32_SINT.
    Int,
    /// R32G32B32A32_SINT.
    Int4,
}

impl TexelFormat {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Float, Self::Float2, Self::Float4, Self::Uint, Self::Uint2, Self::Uint4, Self::Int, Self::Int4];

    /// As Vulkan calls it.
    pub fn format(self) -> vk::Format {
        match self {
            Self::Float => vk::Format::R32_SFLOAT,
            Self::Float2 => vk::Format::R32G32_SFLOAT,
            Self::Float4 => vk::Format::R32G32B32A32_SFLOAT,
            Self::Uint => vk::Format::R32_UINT,
            Self::Uint2 => vk::Format::R32G32_UINT,
            Self::Uint4 => vk::Format::R32G32B32A32_UINT,
            Self::Int => vk::Format::R32_SINT,
            Self::Int4 => vk::Format::R32G32B32A32_SINT,
        }
    }

    /// Bytes of one element.
    pub fn bytes(self) -> u64 {
        match self {
            Self::Float | Self::Uint | Self::Int => 4,
            Self::Float2 | Self::Uint2 => 8,
            Self::Float4 | Self::Uint4 | Self::Int4 => 16,
        }
    }
}

/// The properties of a buffer to be made.
#[derive(Clone, Copy, Debug)]
pub struct BufferDesc<'a> {
    /// Its name in errors, validation messages and debuggers.
    pub name: &'a str,
    /// Its size in bytes. Rounded up to a multiple of 16, at least 16, so that an empty buffer can still be bound.
    pub size: u64,
    /// Usages beyond transfer in both directions, and uniform texels where `texels` is given.
    pub usage: vk::BufferUsageFlags,
    /// Where its memory lies.
    pub location: Location,
    /// The texel view of the whole buffer, if there is to be one.
    pub texels: Option<TexelFormat>,
}

impl Default for BufferDesc<'_> {
    /// An unnamed storage buffer with the device.
    fn default() -> Self {
        Self {
            name: "buffer",
            size: 0,
            usage: vk::BufferUsageFlags::STORAGE_BUFFER,
            location: Location::Device,
            texels: None,
        }
    }
}

pub(super) fn check_texels(limits: &Limits, name: &str, range: u64, format: TexelFormat) -> Result<()> {
    let needed = range / format.bytes();
    limit_error(name, needed, "texels", "maxTexelBufferElements", limits.max_texel_buffer_elements)
}

impl BufferDesc<'_> {
    /// The usages that a description may name. The others belong to extensions and features that no device of ours enables.
    pub const USAGES: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(
        vk::BufferUsageFlags::TRANSFER_SRC.as_raw()
            | vk::BufferUsageFlags::TRANSFER_DST.as_raw()
            | vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER.as_raw()
            | vk::BufferUsageFlags::STORAGE_BUFFER.as_raw()
            | vk::BufferUsageFlags::INDIRECT_BUFFER.as_raw(),
    );

    /// Checks that a device of these limits can bind such a buffer as a whole, in the ways that its usage and texels say,
    /// and allocate it in one piece. Returns its size in bytes, rounded up.
    ///
    /// # Errors
    /// [`Error::Limit`] naming the buffer and the limit; [`Error::Vulkan`] naming usages that are none of
    /// [`USAGES`](Self::USAGES).
    pub fn validate(&self, limits: &Limits) -> Result<u64> {
        let unknown = self.usage & !Self::USAGES;
        if !unknown.is_empty() {
            let result = format!("buffer `{}`: usage {unknown:?} is none of {:?}", self.name, Self::USAGES);
            return Err(Error::Vulkan { call: "vkCreateBuffer", result });
        }
        // A size that cannot be rounded up is beyond every limit below.
        let size = self.size.max(1).checked_next_multiple_of(16).unwrap_or(u64::MAX);
        if self.usage.contains(vk::BufferUsageFlags::STORAGE_BUFFER) {
            limit_error(self.name, size, "bytes", "maxStorageBufferRange", limits.max_storage_buffer_range)?;
        }
        if let Some(texels) = self.texels {
            check_texels(limits, self.name, size, texels)?;
        }
        limit_error(self.name, size, "bytes", "maxMemoryAllocationSize", limits.max_memory_allocation_size)?;
        Ok(size)
    }
}

pub(super) fn limit_error(
    name: &str,
    needed: u64,
    unit: &'static str,
    limit_name: &'static str,
    limit: u64,
) -> Result<()> {
    if needed <= limit {
        return Ok(());
    }
    let what = format!("buffer `{name}`");
    let fix = "render a smaller image, fewer triangles or fewer cameras at once".to_string();
    Err(Error::Limit { what, needed, unit, limit_name, limit, fix })
}
