//! A host's buffers and images, as softras takes them.

use crate::{Error, Result};
use ash::vk::{self, Handle};

/// A part of a host's buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferRef {
    raw: vk::Buffer,
    offset: u64,
    range: u64,
    usage: vk::BufferUsageFlags,
}

impl BufferRef {
    /// A whole buffer of `size` bytes.
    ///
    /// # Safety
    /// - The buffer is of the device that it is used with, was made with at least this size and with all of these usages,
    ///   and has memory bound to it.
    /// - It stays valid until everything that it was bound to is dropped, and until every command buffer that these were
    ///   recorded into has been executed for the last time or thrown away.
    pub unsafe fn new(buffer: vk::Buffer, size: u64, usage: vk::BufferUsageFlags) -> Self {
        Self { raw: buffer, offset: 0, range: size, usage }
    }

    /// A whole buffer from a VkBuffer and VkBufferUsageFlags as plain numbers.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    pub unsafe fn from_raw(buffer: u64, size: u64, usage: u32) -> Self {
        // SAFETY: the caller's promise.
        unsafe { Self::new(vk::Buffer::from_raw(buffer), size, vk::BufferUsageFlags::from_raw(usage)) }
    }

    /// A part of a buffer that a host gave before.
    pub(super) fn known(raw: vk::Buffer, offset: u64, range: u64, usage: vk::BufferUsageFlags) -> Self {
        Self { raw, offset, range, usage }
    }

    /// `range` bytes of it from `offset` on.
    ///
    /// # Errors
    /// [`Error::Host`] where they lie outside.
    pub fn part(&self, offset: u64, range: u64) -> Result<Self> {
        if offset.checked_add(range).is_some_and(|end| end <= self.range) {
            return Ok(Self { offset: self.offset + offset, range, ..*self });
        }
        Err(Error::Host {
            what: format!("bytes {offset} and {range} more lie outside a buffer's {}", self.range),
            fix: "give a part that lies inside".into(),
        })
    }

    /// The buffer.
    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Bytes from the buffer's start.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Bytes.
    pub fn range(&self) -> u64 {
        self.range
    }

    /// The usages that the buffer was made with.
    pub fn usage(&self) -> vk::BufferUsageFlags {
        self.usage
    }
}

/// The format of a host's image. Every Vulkan device can store to each of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageFormat {
    /// R32G32B32A32_SFLOAT.
    Rgba32Float,
    /// R16G16B16A16_SFLOAT.
    Rgba16Float,
    /// R8G8B8A8_UNORM.
    Rgba8Unorm,
    /// R32_SFLOAT.
    R32Float,
}

impl ImageFormat {
    /// As Vulkan calls it.
    pub fn format(self) -> vk::Format {
        match self {
            Self::Rgba32Float => vk::Format::R32G32B32A32_SFLOAT,
            Self::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
            Self::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
            Self::R32Float => vk::Format::R32_SFLOAT,
        }
    }

    /// Numbers in a texel.
    pub fn channels(self) -> u32 {
        if self == Self::R32Float { 1 } else { 4 }
    }
}

/// A host's image, to be stored to by a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageRef {
    view: vk::ImageView,
    format: ImageFormat,
    width: u32,
    height: u32,
}

impl ImageRef {
    /// A view of one layer and one mip level, `width` × `height` texels.
    ///
    /// # Safety
    /// - The view is of type 2D, of this format, with identity swizzles, of the device that it is used with; its image was
    ///   made with the usage STORAGE, has one sample, and memory bound to it.
    /// - Both stay valid as [`BufferRef::new`] says of buffers.
    /// - When what stores to it executes, that level and layer is in the layout GENERAL.
    pub unsafe fn new(view: vk::ImageView, format: ImageFormat, width: u32, height: u32) -> Self {
        Self { view, format, width, height }
    }

    /// A view from a VkImageView as a plain number.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    pub unsafe fn from_raw(view: u64, format: ImageFormat, width: u32, height: u32) -> Self {
        // SAFETY: the caller's promise.
        unsafe { Self::new(vk::ImageView::from_raw(view), format, width, height) }
    }

    /// The view.
    pub fn raw(&self) -> vk::ImageView {
        self.view
    }

    /// The format.
    pub fn format(&self) -> ImageFormat {
        self.format
    }

    /// Texels across and down.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}

/// A host's image, to be read by a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureRef {
    view: vk::ImageView,
    layout: vk::ImageLayout,
    width: u32,
    height: u32,
}

impl TextureRef {
    /// A view of `width` × `height` texels. Texels of a view with an sRGB format are read decoded.
    ///
    /// # Safety
    /// - The view is of type 2D, of a floating-point or normalised format that the device can sample, of the device that it is
    ///   used with; its image was made with the usage SAMPLED, has one sample, and memory bound to it.
    /// - Both stay valid as [`BufferRef::new`] says of buffers.
    /// - When what reads it executes, its first level and layer is in the layout
    ///   SHADER_READ_ONLY_OPTIMAL or, where [`in_general_layout`](Self::in_general_layout) was called, GENERAL.
    pub unsafe fn new(view: vk::ImageView, width: u32, height: u32) -> Self {
        Self { view, layout: vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL, width, height }
    }

    /// A view from a VkImageView as a plain number.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    pub unsafe fn from_raw(view: u64, width: u32, height: u32) -> Self {
        // SAFETY: the caller's promise.
        unsafe { Self::new(vk::ImageView::from_raw(view), width, height) }
    }

    /// Takes the image to be in the layout GENERAL.
    pub fn in_general_layout(self) -> Self {
        Self { layout: vk::ImageLayout::GENERAL, ..self }
    }

    /// The view.
    pub fn raw(&self) -> vk::ImageView {
        self.view
    }

    /// The layout that it is in when it is read.
    pub fn layout(&self) -> vk::ImageLayout {
        self.layout
    }

    /// Texels across and down.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }
}
