//! Buffers that we make and own, with the host's access to those that are mapped.

use super::super::buffer_desc::{BufferDesc, Location, TexelFormat};
use super::super::buffer_part::{BufferPart, create_view};
use super::super::keep::{Kept, Uses};
use super::super::result::Named;
use super::access::{Access, HostUse, Mapped, MappedMut};
use super::allocation::allocation;
use super::context::{Context, ContextInner};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use std::ptr::NonNull;
use std::sync::{Arc, PoisonError};

/// A buffer with memory of its own.
#[derive(Debug)]
pub struct Buffer {
    inner: Arc<BufferInner>,
    whole: BufferPart,
}

struct BufferInner {
    shared: Arc<ContextInner>,
    raw: vk::Buffer,
    /// Null where there is none.
    view: vk::BufferView,
    /// Null until memory is bound.
    allocation: Allocation,
    /// The host may use the mapping. gpu-allocator maps whatever can be, but what one device maps, another does not.
    host: bool,
    access: Arc<Access>,
    name: String,
    size: u64,
    usage: vk::BufferUsageFlags,
}

impl Buffer {
    /// Makes a buffer. Its content is undefined.
    ///
    /// # Errors
    /// [`Error::Limit`] where the device cannot bind it as a whole in the ways that its usage and texels say, or cannot
    /// allocate it in one piece; [`Error::OutOfMemory`]; [`Error::Vulkan`] for a usage that is none of
    /// [`BufferDesc::USAGES`].
    pub fn new(context: &Context, desc: &BufferDesc<'_>) -> Result<Self> {
        let shared = context.shared();
        let device = &shared.device;
        let size = desc.validate(device.limits())?;
        let mut usage = desc.usage | vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        if desc.texels.is_some() {
            usage |= vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
        }
        let info = vk::BufferCreateInfo::default().size(size).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: a plain creation; `BufferInner` destroys it, on errors below as well.
        let raw = unsafe { device.raw().create_buffer(&info, None) }.named("vkCreateBuffer")?;
        let mut inner = BufferInner {
            shared: shared.clone(),
            raw,
            view: vk::BufferView::null(),
            allocation: Allocation::default(),
            host: false,
            access: Arc::new(Access::new(desc.name)),
            name: desc.name.to_string(),
            size,
            usage,
        };
        device.name_object(raw, desc.name);
        inner.allocate(desc.location)?;
        if let Some(texels) = desc.texels {
            // SAFETY: the buffer has the usage, its memory is bound, and it outlives the view (`BufferInner::drop`).
            inner.view = unsafe { create_view(device, raw, 0, size, texels, desc.name) }?;
        }
        let inner = Arc::new(inner);
        let view = desc.texels.map(|texels| (inner.view, texels));
        let device = device.raw().handle();
        let whole = BufferPart { device, raw, offset: 0, range: size, usage, view, keep: Some(inner.clone()) };
        Ok(Self { inner, whole })
    }

    /// The buffer as a whole.
    pub fn whole(&self) -> &BufferPart {
        &self.whole
    }

    /// A part of it, without a texel view.
    pub fn part(&self, offset: u64, range: u64) -> Result<BufferPart> {
        self.check(offset, range)?;
        Ok(BufferPart { offset, range, view: None, ..self.whole.clone() })
    }

    /// A part of it with a texel view of its own. The buffer must have been made with `texels` or the usage.
    pub fn texel_part(&self, offset: u64, range: u64, format: TexelFormat) -> Result<BufferPart> {
        self.check(offset, range)?;
        if !self.inner.usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
            return Err(self.misuse("it was made without the usage UNIFORM_TEXEL_BUFFER"));
        }
        let part = self.part(offset, range)?;
        // SAFETY: usage and range were checked, and the part keeps the buffer.
        unsafe { part.with_view(&self.inner.shared.device, format, &self.inner.name) }
    }

    /// Its size in bytes, as rounded up.
    pub fn size(&self) -> u64 {
        self.inner.size
    }

    /// The host can [`write`](Self::write) and [`read`](Self::read) it.
    pub fn is_mapped(&self) -> bool {
        self.inner.mapped().is_some()
    }

    /// Writes bytes at an offset. Commands that are submitted from now on read them.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where the bytes lie outside the buffer, the host cannot map it, or a pending command buffer uses
    /// it.
    pub fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        let (target, _use) = self.map(offset, bytes.len() as u64)?;
        // SAFETY: the target has room for the bytes and is not in use by the device (`map`); `&mut self` excludes slices of
        // it, so `bytes` does not overlap with it.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), target.as_ptr(), bytes.len()) };
        Ok(())
    }

    /// Reads bytes at an offset, as of the last [`barrier_to_host`](crate::vulkan::Recorder::barrier_to_host) executed.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let (source, _use) = self.map(offset, bytes.len() as u64)?;
        // SAFETY: the source has as many bytes and is not in use by the device (`map`); the host writes it through `&mut self`
        // only, and `bytes`, a `&mut`, cannot be a part of it.
        unsafe { std::ptr::copy_nonoverlapping(source.as_ptr(), bytes.as_mut_ptr(), bytes.len()) };
        Ok(())
    }

    /// The bytes that [`read`](Self::read) would copy, where they are. Until they are dropped, no command buffer that uses
    /// this buffer can be submitted.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn bytes(&self, offset: u64, range: u64) -> Result<Mapped<'_>> {
        let (source, used) = self.map(offset, range)?;
        // SAFETY: the mapping lives as long as `self`, host writers need `&mut self`, and `used` is of this buffer.
        Ok(unsafe { Mapped::new(NonNull::slice_from_raw_parts(source, range as usize), used) })
    }

    /// Bytes at an offset, to be filled where they are; otherwise as [`bytes`](Self::bytes).
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn bytes_mut(&mut self, offset: u64, range: u64) -> Result<MappedMut<'_>> {
        let (target, used) = self.map(offset, range)?;
        // SAFETY: the mapping lives as long as `self`, which is borrowed mutably, and `used` is of this buffer.
        Ok(unsafe { MappedMut::new(NonNull::slice_from_raw_parts(target, range as usize), used) })
    }

    /// The mapped address of a range that lies inside the buffer, and a use that keeps the device from it.
    fn map(&self, offset: u64, range: u64) -> Result<(NonNull<u8>, HostUse<'_>)> {
        self.check(offset, range)?;
        let base = self.inner.mapped().ok_or_else(|| self.misuse("the host cannot reach it: it is not mapped"))?;
        let used = self.inner.access.by_host()?;
        // SAFETY: the offset is within the buffer, which lies within the mapping.
        Ok((unsafe { base.add(offset as usize) }, used))
    }

    fn check(&self, offset: u64, range: u64) -> Result<()> {
        if offset.checked_add(range).is_some_and(|end| end <= self.inner.size) {
            return Ok(());
        }
        let size = self.inner.size;
        Err(self.misuse(&format!("bytes {offset} and {range} more lie outside its {size}")))
    }

    fn misuse(&self, what: &str) -> Error {
        Error::Vulkan { call: "buffer access", result: format!("buffer `{}`: {what}", self.inner.name) }
    }
}

impl BufferInner {
    /// Finds memory and binds it.
    fn allocate(&mut self, location: Location) -> Result<()> {
        let device = self.shared.device.raw();
        // SAFETY: the buffer was just made.
        let mut requirements = unsafe { device.get_buffer_memory_requirements(self.raw) };
        let direct = requirements.memory_type_bits & self.shared.direct_types;
        self.host = match location {
            Location::Device => false,
            Location::DeviceMapped => direct != 0,
            Location::Upload | Location::Readback => true,
        };
        let location = match location {
            Location::DeviceMapped if direct != 0 => {
                requirements.memory_type_bits = direct;
                MemoryLocation::CpuToGpu
            }
            Location::Device | Location::DeviceMapped => MemoryLocation::GpuOnly,
            Location::Upload => MemoryLocation::CpuToGpu,
            Location::Readback => MemoryLocation::GpuToCpu,
        };
        let desc = AllocationCreateDesc {
            name: &self.name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        };
        let mut allocator = self.shared.allocator.lock().unwrap_or_else(PoisonError::into_inner);
        self.allocation = allocator.allocate(&desc).map_err(|e| allocation(&self.name, self.size, &e))?;
        drop(allocator);
        // SAFETY: the memory was allocated for this buffer's requirements and is bound once.
        unsafe { device.bind_buffer_memory(self.raw, self.allocation.memory(), self.allocation.offset()) }
            .named("vkBindBufferMemory")
    }

    /// The mapping, if the host may use it without flushing.
    fn mapped(&self) -> Option<NonNull<u8>> {
        let coherent = self.allocation.memory_properties().contains(vk::MemoryPropertyFlags::HOST_COHERENT);
        self.allocation.mapped_ptr().filter(|_| self.host && coherent).map(NonNull::cast)
    }
}

impl Kept for BufferInner {
    fn uses(&self, uses: &mut Uses) {
        if self.host {
            uses.mapped.push(self.access.clone());
        }
    }
}

impl Drop for BufferInner {
    fn drop(&mut self) {
        let device = self.shared.device.raw();
        // SAFETY: the device is done with both: whatever recorded them kept this Inner until then. Null is ignored.
        unsafe {
            device.destroy_buffer_view(self.view, self.shared.device.callbacks());
            device.destroy_buffer(self.raw, None);
        }
        let allocation = std::mem::take(&mut self.allocation);
        if !allocation.is_null() {
            // An allocation of this allocator can always be freed.
            _ = self.shared.allocator.lock().unwrap_or_else(PoisonError::into_inner).free(allocation);
        }
    }
}

impl std::fmt::Debug for BufferInner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mapped = self.mapped().is_some();
        f.debug_struct("BufferInner")
            .field("name", &self.name)
            .field("size", &self.size)
            .field("mapped", &mapped)
            .finish()
    }
}
