//! References to a part of a buffer, ours or a host's.

use super::buffer_desc::{TexelFormat, check_texels};
use super::device::Device;
use super::host_memory::BufferRef;
use super::keep::{Keep, Kept};
use super::result::Named;
use crate::{Error, Result};
use ash::vk;
use std::sync::Arc;

const CALL: &str = "vkCreateBufferView";

/// A part of a buffer, ours or a host's, to bind or to copy. It keeps a buffer of ours alive; of a host's buffer it
/// knows only the handles. It belongs to one device; use with another is an error.
#[derive(Clone)]
pub struct BufferPart {
    /// The device that made the buffer.
    pub(super) device: vk::Device,
    pub(super) raw: vk::Buffer,
    pub(super) offset: u64,
    pub(super) range: u64,
    pub(super) usage: vk::BufferUsageFlags,
    pub(super) view: Option<(vk::BufferView, TexelFormat)>,
    pub(super) keep: Option<Keep>,
}

impl BufferPart {
    /// A part of a host's buffer, which is one of this device's, without a texel view.
    pub fn of_host(device: &Device, at: &BufferRef) -> Self {
        let (raw, offset, range, usage) = (at.raw(), at.offset(), at.range(), at.usage());
        Self { device: device.raw().handle(), raw, offset, range, usage, view: None, keep: None }
    }

    /// A part of a host's buffer with a texel view of just that part, destroyed with the last clone of what is returned.
    ///
    /// # Errors
    /// [`Error::Vulkan`] for a buffer without the usage UNIFORM_TEXEL_BUFFER, and for a part that is misaligned;
    /// [`Error::Limit`] for one of more texels than maxTexelBufferElements.
    pub fn texels_of_host(device: &Device, at: &BufferRef, format: TexelFormat, name: &str) -> Result<Self> {
        if !at.usage().contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
            let result = format!("`{name}` was made without the usage UNIFORM_TEXEL_BUFFER");
            return Err(Error::Vulkan { call: CALL, result });
        }
        if at.raw() == vk::Buffer::null() {
            return Err(Error::Vulkan { call: CALL, result: format!("`{name}` is null") });
        }
        // SAFETY: the usage was checked, all else is the promise of `BufferRef::new`.
        unsafe { Self::of_host(device, at).with_view(device, format, name) }
    }

    /// The part with a texel view of its own, destroyed with the last clone of the returned reference.
    ///
    /// # Safety
    /// The buffer is one of this device's, has the usage UNIFORM_TEXEL_BUFFER and bound memory, and outlives the view.
    pub(super) unsafe fn with_view(&self, device: &Device, format: TexelFormat, name: &str) -> Result<Self> {
        let alignment = device.limits().texel_offset_alignment.max(1);
        if !self.offset.is_multiple_of(alignment) || !self.range.is_multiple_of(format.bytes()) {
            let (offset, range) = (self.offset, self.range);
            let result = format!("`{name}`: offset {offset} or size {range} is misaligned ({alignment}, {format:?})");
            return Err(Error::Vulkan { call: CALL, result });
        }
        if self.range == 0 {
            return Err(Error::Vulkan { call: CALL, result: format!("`{name}` is empty") });
        }
        check_texels(device.limits(), name, self.range, format)?;
        // SAFETY: the caller's promise, and the checks above.
        let view = unsafe { create_view(device, self.raw, self.offset, self.range, format, name) }?;
        let owner = TexelView { device: device.clone(), view, buffer: self.keep.clone() };
        Ok(Self { view: Some((view, format)), keep: Some(Arc::new(owner)), ..*self })
    }

    /// The buffer.
    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Bytes from the buffer's start.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Size in bytes.
    pub fn range(&self) -> u64 {
        self.range
    }

    /// The usages that the buffer was made with.
    pub fn usage(&self) -> vk::BufferUsageFlags {
        self.usage
    }

    /// The texel view, and what its texels are.
    pub(super) fn view(&self) -> Option<(vk::BufferView, TexelFormat)> {
        self.view
    }

    /// Whether the buffer is one of this device's.
    pub(super) fn is_of(&self, device: &Device) -> bool {
        self.device == device.raw().handle()
    }
}

impl std::fmt::Debug for BufferPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { raw, offset, range, view, .. } = self;
        write!(f, "BufferPart({raw:?}, {offset}..+{range}, {view:?})")
    }
}

/// A texel view of a part of a buffer.
struct TexelView {
    device: Device,
    view: vk::BufferView,
    #[cfg_attr(not(feature = "renderer"), expect(dead_code, reason = "it only keeps the buffer"))]
    buffer: Option<Keep>,
}

impl Kept for TexelView {
    #[cfg(feature = "renderer")]
    fn uses(&self, uses: &mut super::keep::Uses) {
        self.buffer.iter().for_each(|buffer| buffer.uses(uses));
    }
}

impl Drop for TexelView {
    fn drop(&mut self) {
        // SAFETY: the device is done with it: whatever recorded it kept this View until then.
        unsafe { self.device.raw().destroy_buffer_view(self.view, self.device.callbacks()) };
    }
}

/// # Safety
/// The buffer has the usage UNIFORM_TEXEL_BUFFER and bound memory; the part lies inside it.
pub(super) unsafe fn create_view(
    device: &Device,
    buffer: vk::Buffer,
    offset: u64,
    range: u64,
    format: TexelFormat,
    name: &str,
) -> Result<vk::BufferView> {
    let info = vk::BufferViewCreateInfo::default().buffer(buffer).format(format.format()).offset(offset).range(range);
    // SAFETY: the caller's promise; every device reads these formats as uniform texels.
    let view = unsafe { device.raw().create_buffer_view(&info, device.callbacks()) }.named(CALL)?;
    device.name_object(view, name);
    Ok(view)
}
