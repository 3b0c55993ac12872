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

    /// `range` bytes of it from `offset` on, without a texel view.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where they lie outside.
    pub fn part(&self, offset: u64, range: u64) -> Result<Self> {
        if offset.checked_add(range).is_some_and(|end| end <= self.range) {
            return Ok(Self { offset: self.offset + offset, range, view: None, ..self.clone() });
        }
        let result = format!("bytes {offset} and {range} more lie outside {self:?}");
        Err(Error::Vulkan { call: "buffer access", result })
    }

    /// It with a texel view of just these bytes, destroyed with the last clone of what is returned.
    ///
    /// # Errors
    /// [`Error::Vulkan`] for a buffer of another device or without the usage UNIFORM_TEXEL_BUFFER, and for a part that is misaligned;
    /// [`Error::Limit`] for one of more texels than maxTexelBufferElements.
    pub fn with_texels(&self, device: &Device, format: TexelFormat, name: &str) -> Result<Self> {
        let fail = |what: &str| Err(Error::Vulkan { call: CALL, result: format!("`{name}` {what}") });
        if !self.usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
            return fail("was made without the usage UNIFORM_TEXEL_BUFFER");
        }
        if self.raw == vk::Buffer::null() {
            return fail("is null");
        }
        if !self.is_of(device) {
            return fail("is of another device");
        }
        let alignment = device.limits().texel_offset_alignment.max(1);
        if !self.offset.is_multiple_of(alignment) || !self.range.is_multiple_of(format.bytes()) {
            let (offset, range) = (self.offset, self.range);
            return fail(&format!("has offset {offset} or size {range}, misaligned ({alignment}, {format:?})"));
        }
        if self.range == 0 {
            return fail("is empty");
        }
        check_texels(device.limits(), name, self.range, format)?;
        let (buffer, offset, range) = (self.raw, self.offset, self.range);
        let info =
            vk::BufferViewCreateInfo::default().buffer(buffer).format(format.format()).offset(offset).range(range);
        // SAFETY: usage, device and range were checked, and every device reads these formats as uniform texels. A buffer of ours has
        // memory and is kept by the view; of a host's, both are the promise of `BufferRef::new`.
        let view = unsafe { device.raw().create_buffer_view(&info, device.callbacks()) }.named(CALL)?;
        device.name_object(view, name);
        let owner = TexelView { device: device.clone(), view, buffer: self.keep.clone() };
        Ok(Self { view: Some((view, format)), keep: Some(Arc::new(owner)), ..*self })
    }

    /// As a host refers to it.
    pub fn reference(&self) -> BufferRef {
        BufferRef::known(self.raw(), self.offset(), self.range(), self.usage())
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
