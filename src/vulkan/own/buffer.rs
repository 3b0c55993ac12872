//! Buffers that we make and own, with the host's access to those that are mapped.

use super::super::buffer_desc::{BufferDesc, Location};
use super::super::buffer_part::BufferPart;
use super::super::keep::{Keep, Kept, Uses};
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
    /// Null until memory is bound.
    allocation: Allocation,
    /// The host may use the mapping. gpu-allocator maps whatever can be, but what one device maps, another does not.
    host: bool,
    access: Arc<Access>,
    name: String,
    size: u64,
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
            allocation: Allocation::default(),
            host: false,
            access: Arc::new(Access::new(desc.name)),
            name: desc.name.to_string(),
            size,
        };
        device.name_object(raw, desc.name);
        inner.allocate(desc.location)?;
        let inner = Arc::new(inner);
        let handle = device.raw().handle();
        let keep = Some(inner.clone() as Keep);
        let whole = BufferPart { device: handle, raw, offset: 0, range: size, usage, view: None, keep };
        let whole = match desc.texels {
            Some(format) => whole.with_texels(device, format, desc.name)?,
            None => whole,
        };
        Ok(Self { inner, whole })
    }

    /// The buffer as a whole.
    pub fn whole(&self) -> &BufferPart {
        &self.whole
    }

    /// Its size in bytes, as rounded up.
    pub fn size(&self) -> u64 {
        self.inner.size
    }

    /// The host can read and write its [`bytes`](Self::bytes).
    pub fn is_mapped(&self) -> bool {
        self.inner.mapped().is_some()
    }

    /// Bytes at an offset where they are, as of the last [`barrier_to_host`](crate::vulkan::Recorder::barrier_to_host) executed. Until
    /// they are dropped, no command buffer that uses this buffer can be submitted.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where the bytes lie outside the buffer, the host cannot map it, or a pending command buffer uses
    /// it.
    pub fn bytes(&self, offset: u64, range: u64) -> Result<Mapped<'_>> {
        let (source, used) = self.map(offset, range)?;
        // SAFETY: the mapping lives as long as `self`, host writers need `&mut self`, and `used` is of this buffer.
        Ok(unsafe { Mapped::new(NonNull::slice_from_raw_parts(source, range as usize), used) })
    }

    /// Bytes at an offset, to be filled where they are, for commands that are submitted from now on; otherwise as
    /// [`bytes`](Self::bytes).
    ///
    /// # Errors
    /// As [`bytes`](Self::bytes).
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
        // SAFETY: the device is done with it: whatever recorded it kept this Inner until then.
        unsafe { device.destroy_buffer(self.raw, None) };
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
