//! Buffers of our own, and references to a part of any buffer.

use super::adapter::Limits;
use super::context::{Context, Shared};
use super::device::Device;
use super::result::{Named, allocation};
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use std::any::Any;
use std::sync::{Arc, PoisonError};

/// Something that must live on until the device is done with it.
pub(super) type Keep = Arc<dyn Any + Send + Sync>;

/// Where a buffer's memory lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Location {
    /// With the device.
    #[default]
    Device,
    /// With the device; mapped where the device's memory is the host's own, as [`Buffer::is_mapped`] tells.
    DeviceMapped,
    /// With the host, for it to write.
    Upload,
    /// With the host, for it to read.
    Readback,
}

/// What a texel buffer's elements are. Every Vulkan device can read each of these.
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

/// What a buffer is to be.
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

/// A buffer with memory of its own.
#[derive(Debug)]
pub struct Buffer {
    inner: Arc<Inner>,
    whole: BufferPart,
}

struct Inner {
    shared: Arc<Shared>,
    raw: vk::Buffer,
    /// Null where there is none.
    view: vk::BufferView,
    /// Null until memory is bound.
    allocation: Allocation,
    /// The host may use the mapping. gpu-allocator maps whatever can be, but what one device maps, another does not.
    host: bool,
    name: String,
    size: u64,
    usage: vk::BufferUsageFlags,
}

/// A part of a buffer, ours or a host's, to bind or to copy. Keeps a buffer of ours alive; of a host's it knows only
/// the handles.
#[derive(Clone)]
pub struct BufferPart {
    raw: vk::Buffer,
    offset: u64,
    range: u64,
    view: Option<vk::BufferView>,
    pub(super) keep: Option<Keep>,
}

impl Buffer {
    /// Makes a buffer. Its content is undefined.
    ///
    /// [`Error::Limit`] where the device can't bind it as a whole in the ways that its usage and texels say, or not
    /// allocate it in one piece; [`Error::OutOfMemory`].
    pub fn new(context: &Context, desc: &BufferDesc<'_>) -> Result<Self> {
        let shared = context.shared();
        let device = &shared.device;
        let size = desc.size.max(1).next_multiple_of(16);
        let mut usage = desc.usage | vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
        if desc.texels.is_some() {
            usage |= vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
        }
        desc.judge(device.limits())?;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage).sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: a plain creation; `Inner` destroys it, on errors below as well.
        let raw = unsafe { device.raw().create_buffer(&info, None) }.named("vkCreateBuffer")?;
        let mut inner = Inner {
            shared: shared.clone(),
            raw,
            view: vk::BufferView::null(),
            allocation: Allocation::default(),
            host: false,
            name: desc.name.to_string(),
            size,
            usage,
        };
        device.name_object(raw, desc.name);
        inner.allocate(desc.location)?;
        if let Some(texels) = desc.texels {
            // SAFETY: the buffer has the usage, its memory is bound, and it outlives the view (`Inner::drop`).
            inner.view = unsafe { create_view(device, raw, 0, size, texels, desc.name) }?;
        }
        let inner = Arc::new(inner);
        let view = desc.texels.map(|_| inner.view);
        let whole = BufferPart { raw, offset: 0, range: size, view, keep: Some(inner.clone()) };
        Ok(Self { inner, whole })
    }

    /// The buffer as a whole.
    pub fn whole(&self) -> &BufferPart {
        &self.whole
    }

    /// A part of it, without a texel view.
    pub fn part(&self, offset: u64, range: u64) -> Result<BufferPart> {
        self.check(offset, range)?;
        Ok(BufferPart { raw: self.inner.raw, offset, range, view: None, keep: Some(self.inner.clone()) })
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

    /// Its name.
    pub fn name(&self) -> &str {
        &self.inner.name
    }

    /// Its size in bytes, as rounded up.
    pub fn size(&self) -> u64 {
        self.inner.size
    }

    /// The host can [`write`](Self::write) and [`read`](Self::read) it.
    pub fn is_mapped(&self) -> bool {
        self.inner.mapped().is_some()
    }

    /// Writes bytes at an offset. Visible to what is submitted from now on.
    pub fn write(&mut self, offset: u64, bytes: &[u8]) -> Result<()> {
        let target = self.address(offset, bytes.len() as u64)?;
        // SAFETY: target has room for the bytes (`address`), is mapped and coherent as long as the allocation lives;
        // `&mut self` keeps other host threads out, and `bytes` can't overlap with a mapping nobody has a slice of.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), target, bytes.len()) };
        Ok(())
    }

    /// Reads bytes at an offset, as of the last [`barrier_to_host`](super::Recorder::barrier_to_host) executed.
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<()> {
        let source = self.address(offset, bytes.len() as u64)?;
        // SAFETY: as in `write`; writers need `&mut self`.
        unsafe { std::ptr::copy_nonoverlapping(source, bytes.as_mut_ptr(), bytes.len()) };
        Ok(())
    }

    /// Bytes at an offset where they are, as [`read`](Self::read) would copy them.
    pub fn bytes(&self, offset: u64, range: u64) -> Result<&[u8]> {
        let source = self.address(offset, range)?;
        // SAFETY: as in `read`: inside a mapping that lives as long as `self`, and host writers need `&mut self`.
        Ok(unsafe { std::slice::from_raw_parts(source, range as usize) })
    }

    /// Bytes at an offset, to be filled where they are. Visible to what is submitted from now on.
    pub fn bytes_mut(&mut self, offset: u64, range: u64) -> Result<&mut [u8]> {
        let target = self.address(offset, range)?;
        // SAFETY: as in `write`; a mapping's bytes are some bytes to the host, whoever wrote them.
        Ok(unsafe { std::slice::from_raw_parts_mut(target, range as usize) })
    }

    /// The mapped address of a range that lies inside the buffer.
    fn address(&self, offset: u64, range: u64) -> Result<*mut u8> {
        self.check(offset, range)?;
        let base = self.inner.mapped().ok_or_else(|| self.misuse("the host cannot reach it: it is not mapped"))?;
        // SAFETY: offset is within the buffer, which lies within the mapping.
        Ok(unsafe { base.as_ptr().add(offset as usize) })
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

impl BufferPart {
    /// A part of a host's buffer, with a texel view of just that part if the kernel reads it as texels.
    ///
    /// # Safety
    /// - The handles are valid, of the device they will be used with, and have the usages of how they are used.
    /// - They stay valid until all work recorded with them has been executed or thrown away.
    /// - The part lies inside the buffer.
    pub unsafe fn from_raw(buffer: vk::Buffer, offset: u64, range: u64, view: Option<vk::BufferView>) -> Self {
        Self { raw: buffer, offset, range, view, keep: None }
    }

    /// The same part with a texel view of its own, destroyed with the last clone of the returned reference.
    ///
    /// # Safety
    /// The buffer is of this device, has the usage UNIFORM_TEXEL_BUFFER and bound memory, and outlives the view.
    pub unsafe fn with_view(&self, device: &Device, format: TexelFormat, name: &str) -> Result<Self> {
        let alignment = device.limits().texel_offset_alignment.max(1);
        if !self.offset.is_multiple_of(alignment) || !self.range.is_multiple_of(format.bytes()) {
            let (offset, range) = (self.offset, self.range);
            let result = format!("`{name}`: offset {offset} or size {range} is misaligned ({alignment}, {format:?})");
            return Err(Error::Vulkan { call: "vkCreateBufferView", result });
        }
        check_texels(device.limits(), name, self.range, format)?;
        // SAFETY: the caller's promise, and the checks above.
        let view = unsafe { create_view(device, self.raw, self.offset, self.range, format, name) }?;
        let owner = View { device: device.clone(), view, _buffer: self.keep.clone() };
        Ok(Self { view: Some(view), keep: Some(Arc::new(owner)), ..*self })
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

    /// The texel view.
    pub fn view(&self) -> Option<vk::BufferView> {
        self.view
    }
}

impl std::fmt::Debug for BufferPart {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { raw, offset, range, view, .. } = self;
        write!(f, "BufferPart({raw:?}, {offset}..+{range}, {view:?})")
    }
}

impl Inner {
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
    fn mapped(&self) -> Option<std::ptr::NonNull<u8>> {
        let coherent = self.allocation.memory_properties().contains(vk::MemoryPropertyFlags::HOST_COHERENT);
        self.allocation.mapped_ptr().filter(|_| self.host && coherent).map(std::ptr::NonNull::cast)
    }
}

impl Drop for Inner {
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

impl std::fmt::Debug for Inner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mapped = self.mapped().is_some();
        f.debug_struct("Inner").field("name", &self.name).field("size", &self.size).field("mapped", &mapped).finish()
    }
}

/// A texel view apart from its buffer's.
struct View {
    device: Device,
    view: vk::BufferView,
    _buffer: Option<Keep>,
}

impl Drop for View {
    fn drop(&mut self) {
        // SAFETY: the device is done with it: whatever recorded it kept this View until then.
        unsafe { self.device.raw().destroy_buffer_view(self.view, self.device.callbacks()) };
    }
}

/// # Safety
/// The buffer has the usage UNIFORM_TEXEL_BUFFER and bound memory; the part lies inside it.
unsafe fn create_view(
    device: &Device,
    buffer: vk::Buffer,
    offset: u64,
    range: u64,
    format: TexelFormat,
    name: &str,
) -> Result<vk::BufferView> {
    let info = vk::BufferViewCreateInfo::default().buffer(buffer).format(format.format()).offset(offset).range(range);
    // SAFETY: the caller's promise; every device reads these formats as uniform texels.
    let view = unsafe { device.raw().create_buffer_view(&info, device.callbacks()) }.named("vkCreateBufferView")?;
    device.name_object(view, name);
    Ok(view)
}

fn check_texels(limits: &Limits, name: &str, range: u64, format: TexelFormat) -> Result<()> {
    let needed = range / format.bytes();
    limit_error(name, needed, "texels", "maxTexelBufferElements", limits.max_texel_buffer_elements)
}

impl BufferDesc<'_> {
    /// Checks that a device of these limits can bind such a buffer as a whole, in the ways that its usage and texels say,
    /// and allocate it in one piece.
    ///
    /// # Errors
    /// [`Error::Limit`] naming the buffer and the limit.
    pub fn judge(&self, limits: &Limits) -> Result<()> {
        let size = self.size.max(1).next_multiple_of(16);
        if self.usage.contains(vk::BufferUsageFlags::STORAGE_BUFFER) {
            limit_error(self.name, size, "bytes", "maxStorageBufferRange", limits.max_storage_buffer_range)?;
        }
        if self.usage.contains(vk::BufferUsageFlags::UNIFORM_BUFFER) {
            limit_error(self.name, size, "bytes", "maxUniformBufferRange", limits.max_uniform_buffer_range)?;
        }
        if let Some(texels) = self.texels {
            check_texels(limits, self.name, size, texels)?;
        }
        limit_error(self.name, size, "bytes", "maxMemoryAllocationSize", limits.max_memory_allocation_size)
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
    let mend = "render a smaller image, fewer triangles or fewer cameras at once".to_string();
    Err(Error::Limit { what, needed, unit, limit_name, limit, mend })
}
