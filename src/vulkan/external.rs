//! Memory and semaphores that another device, process or API shares through file descriptors; where the driver cannot share
//! memory, bytes that the host copies.

use super::device::Device;
use super::devices_lock::looking_up_devices;
use super::host::{HostAdapter, HostDevice};
use super::result::{Named, misuse_of};
use crate::{Error, Result};
use ash::{khr, vk};
use std::ffi::CStr;
use std::os::fd::{FromRawFd, IntoRawFd, OwnedFd};
use std::sync::{Mutex, PoisonError};

const MEMORY: vk::ExternalMemoryHandleTypeFlags = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
const SEMAPHORE: vk::ExternalSemaphoreHandleTypeFlags = vk::ExternalSemaphoreHandleTypeFlags::OPAQUE_FD;

/// The usages of Vulkan 1.0, which need no extension: bits 0 to 8.
const CORE_USAGES: vk::BufferUsageFlags = vk::BufferUsageFlags::from_raw(0x1ff);

fn validate_usage(usage: vk::BufferUsageFlags) -> Result<()> {
    if !usage.is_empty() && CORE_USAGES.contains(usage) {
        return Ok(());
    }
    Err(Error::Host {
        what: format!("usage {usage:?} of a shared buffer"),
        fix: format!("use at least one of {CORE_USAGES:?} and no other"),
    })
}

/// What a physical device can share through file descriptors. The host's device must have the extensions enabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExternalSupport {
    /// Memory of buffers, by VK_KHR_external_memory_fd.
    pub memory: bool,
    /// Semaphores, by VK_KHR_external_semaphore_fd.
    pub semaphores: bool,
}

impl ExternalSupport {
    /// Queries a physical device, for buffers of this usage (VkBufferUsageFlags of Vulkan 1.0).
    ///
    /// # Errors
    /// [`Error::Host`] for null handles or a usage of an extension; [`Error::Vulkan`].
    pub fn of(host: &HostAdapter, usage: vk::BufferUsageFlags) -> Result<Self> {
        validate_usage(usage)?;
        let (instance, physical) = (host.functions()?, host.physical_device());
        // SAFETY: the handles are valid (the promise of `HostAdapter::new`).
        let offered = unsafe { instance.enumerate_device_extension_properties(physical) }
            .named("vkEnumerateDeviceExtensionProperties")?;
        let has = |name: &CStr| offered.iter().any(|e| e.extension_name_as_c_str() == Ok(name));
        let info = vk::PhysicalDeviceExternalBufferInfo::default().usage(usage).handle_type(MEMORY);
        let mut memory = vk::ExternalBufferProperties::default();
        // SAFETY: as above; the query is of Vulkan 1.1.
        unsafe { instance.get_physical_device_external_buffer_properties(physical, &info, &mut memory) };
        let info = vk::PhysicalDeviceExternalSemaphoreInfo::default().handle_type(SEMAPHORE);
        let mut semaphore = vk::ExternalSemaphoreProperties::default();
        // SAFETY: as above.
        unsafe { instance.get_physical_device_external_semaphore_properties(physical, &info, &mut semaphore) };
        use vk::{ExternalMemoryFeatureFlags as M, ExternalSemaphoreFeatureFlags as S};
        let features = memory.external_memory_properties.external_memory_features;
        let both = S::EXPORTABLE | S::IMPORTABLE;
        Ok(Self {
            memory: has(khr::external_memory_fd::NAME) && features.contains(M::EXPORTABLE | M::IMPORTABLE),
            semaphores: has(khr::external_semaphore_fd::NAME) && semaphore.external_semaphore_features.contains(both),
        })
    }
}

/// An error unless the device knows a function of an extension, which is called nowhere else.
fn enabled(device: &Device, function: &CStr, extension: &CStr) -> Result<()> {
    let instance = device.instance();
    // SAFETY: the device is the instance's, the name ends with a zero byte.
    if unsafe { instance.get_device_proc_addr(device.raw().handle(), function.as_ptr()) }.is_some() {
        return Ok(());
    }
    Err(Error::Host {
        what: format!("the device was made without {}", extension.to_string_lossy()),
        fix: "enable it where ExternalSupport says that it is there".into(),
    })
}

/// What one device gives to another.
#[derive(Debug)]
pub enum External {
    /// The memory itself. It is exported once, and the importer sees whatever is written later.
    Memory(OwnedFd),
    /// A copy of its content, where memory cannot be shared. It is exported again after each frame.
    Bytes(Vec<u8>),
}

/// A buffer with memory of its own that can be given to another device of the same driver.
#[derive(Debug)]
pub struct ExternalBuffer {
    device: Device,
    raw: vk::Buffer,
    memory: vk::DeviceMemory,
    size: u64,
    usage: vk::BufferUsageFlags,
    shared: bool,
    /// Mapping is from one thread at a time.
    mapping: Mutex<()>,
}

impl ExternalBuffer {
    /// A buffer of `size` bytes to share: through a file descriptor with [`ExternalSupport::memory`] (the device must have
    /// VK_KHR_external_memory_fd enabled), else by copies of the host's.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], [`Error::Vulkan`]; [`Error::Host`] for no bytes, a usage of an extension, or a device without
    /// the extension or the support claimed.
    pub fn new(host: &HostDevice, size: u64, usage: vk::BufferUsageFlags, support: ExternalSupport) -> Result<Self> {
        Self::make(host, size, usage, support.memory, None)
    }

    /// A buffer of the same size and usage as the exported one, of the same memory or with the same bytes.
    ///
    /// # Errors
    /// As [`new`](Self::new); [`Error::Host`] for more or fewer bytes than `size`.
    ///
    /// # Safety
    /// [`External::Memory`] was [exported](Self::export) by a buffer of this size and usage, of a device of the same physical
    /// device and driver.
    pub unsafe fn import(
        host: &HostDevice,
        size: u64,
        usage: vk::BufferUsageFlags,
        external: External,
    ) -> Result<Self> {
        match external {
            External::Memory(fd) => Self::make(host, size, usage, true, Some(fd)),
            External::Bytes(bytes) if bytes.len() as u64 == size => {
                let made = Self::make(host, size, usage, false, None)?;
                // SAFETY: both have `size` bytes and do not overlap.
                made.mapped(|at| unsafe { at.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) })?;
                Ok(made)
            }
            External::Bytes(bytes) => Err(Error::Host {
                what: format!("{} bytes for a buffer of {size}", bytes.len()),
                fix: "import with the size of the exported buffer".into(),
            }),
        }
    }

    fn make(
        host: &HostDevice,
        size: u64,
        usage: vk::BufferUsageFlags,
        shared: bool,
        fd: Option<OwnedFd>,
    ) -> Result<Self> {
        if size == 0 {
            let (what, fix) = ("a buffer of no bytes".into(), "ask for at least one".into());
            return Err(Error::Host { what, fix });
        }
        validate_usage(usage)?;
        let device = &Device::from_host(host)?;
        if shared {
            enabled(device, c"vkGetMemoryFdKHR", khr::external_memory_fd::NAME)?;
            if !ExternalSupport::of(&host.adapter, usage)?.memory {
                let what = format!("the driver shares no memory of buffers with the usage {usage:?}");
                return Err(Error::Host { what, fix: "give what ExternalSupport::of returned".into() });
            }
        }
        let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(MEMORY);
        let mut info = vk::BufferCreateInfo::default().size(size).usage(usage);
        if shared {
            info = info.push_next(&mut external);
        }
        // SAFETY: a plain creation; `Drop` destroys it, on errors below as well.
        let raw = unsafe { device.raw().create_buffer(&info, device.callbacks()) }.named("vkCreateBuffer")?;
        let memory = vk::DeviceMemory::null();
        let mapping = Mutex::default();
        let mut made = Self { device: device.clone(), raw, memory, size, usage, shared, mapping };
        device.name_object(raw, "softras external");
        made.allocate(fd)?;
        // SAFETY: the memory was made for this buffer, and is bound once.
        unsafe { device.raw().bind_buffer_memory(raw, made.memory, 0) }.named("vkBindBufferMemory")?;
        Ok(made)
    }

    fn allocate(&mut self, fd: Option<OwnedFd>) -> Result<()> {
        let device = &self.device;
        // SAFETY: buffer and physical device live.
        let (needed, types) = unsafe {
            let needed = device.raw().get_buffer_memory_requirements(self.raw);
            (needed, device.instance().get_physical_device_memory_properties(device.physical_device()))
        };
        use vk::MemoryPropertyFlags as P;
        let wanted = if self.shared { P::DEVICE_LOCAL } else { P::HOST_VISIBLE | P::HOST_COHERENT };
        let fits = |(i, t): &(u32, &vk::MemoryType)| {
            needed.memory_type_bits >> i & 1 == 1 && t.property_flags.contains(wanted)
        };
        let call = "vkAllocateMemory";
        let Some((index, _)) = (0..).zip(types.memory_types_as_slice()).find(fits) else {
            return Err(misuse_of(call, "no memory type fits an external buffer"));
        };
        // Memory of its own: some drivers share no other.
        let mut dedicated = vk::MemoryDedicatedAllocateInfo::default().buffer(self.raw);
        let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(MEMORY);
        let fd = fd.map(IntoRawFd::into_raw_fd);
        let mut import = vk::ImportMemoryFdInfoKHR::default().handle_type(MEMORY).fd(fd.unwrap_or(-1));
        let mut info = vk::MemoryAllocateInfo::default().allocation_size(needed.size).memory_type_index(index);
        info = match (self.shared, fd) {
            (false, _) => info,
            (true, None) => info.push_next(&mut dedicated).push_next(&mut export),
            (true, Some(_)) => info.push_next(&mut dedicated).push_next(&mut import),
        };
        // SAFETY: the infos live until the call returns; the descriptor is one of such memory (the promise of `import`), and
        // the driver's if the call succeeds.
        let made = unsafe { device.raw().allocate_memory(&info, device.callbacks()) };
        if let (Err(_), Some(fd)) = (&made, fd) {
            // SAFETY: it was an OwnedFd, which the driver has not taken.
            drop(unsafe { OwnedFd::from_raw_fd(fd) });
        }
        self.memory = made.named(call)?;
        Ok(())
    }

    /// The memory, for another device to [`import`](Self::import), or a copy of its content. Wait for the commands that write
    /// it before: the driver calls that let a device write through [`raw`](Self::raw) make that the host's duty.
    ///
    /// # Errors
    /// [`Error::Vulkan`].
    pub fn export(&self) -> Result<External> {
        if !self.shared {
            let mut bytes = vec![0; self.size as usize];
            // SAFETY: both have `size` bytes and do not overlap.
            self.mapped(|at| unsafe { at.copy_to_nonoverlapping(bytes.as_mut_ptr(), bytes.len()) })?;
            return Ok(External::Bytes(bytes));
        }
        let functions = {
            let _turn = looking_up_devices();
            khr::external_memory_fd::Device::new(self.device.instance(), self.device.raw())
        };
        let info = vk::MemoryGetFdInfoKHR::default().memory(self.memory).handle_type(MEMORY);
        // SAFETY: the memory was allocated for export of this type (or imported with it).
        let fd = unsafe { functions.get_memory_fd(&info) }.named("vkGetMemoryFdKHR")?;
        // SAFETY: a new descriptor, which is ours.
        Ok(External::Memory(unsafe { OwnedFd::from_raw_fd(fd) }))
    }

    /// Calls `work` with the address of the mapped bytes of a buffer in host memory.
    fn mapped(&self, work: impl FnOnce(*mut u8)) -> Result<()> {
        let _one_at_a_time = self.mapping.lock().unwrap_or_else(PoisonError::into_inner);
        let (device, none) = (self.device.raw(), vk::MemoryMapFlags::empty());
        // SAFETY: such memory is host-visible and coherent (`allocate`), is not mapped (the lock), and is unmapped below.
        let at = unsafe { device.map_memory(self.memory, 0, vk::WHOLE_SIZE, none) }.named("vkMapMemory")?;
        work(at.cast());
        // SAFETY: it was mapped above.
        unsafe { device.unmap_memory(self.memory) };
        Ok(())
    }

    /// The buffer: for a [`BufferRef`](super::BufferRef), which must not outlive it.
    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    /// Bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// What it was made for.
    pub fn usage(&self) -> vk::BufferUsageFlags {
        self.usage
    }
}

impl Drop for ExternalBuffer {
    fn drop(&mut self) {
        let (device, callbacks) = (self.device.raw(), self.device.callbacks());
        // SAFETY: both are ours; the host keeps this as long as the device uses them (`raw`). Null is ignored.
        unsafe {
            device.destroy_buffer(self.raw, callbacks);
            device.free_memory(self.memory, callbacks);
        }
    }
}

/// A semaphore that another device can wait for, or signal.
#[derive(Debug)]
pub struct ExternalSemaphore {
    device: Device,
    raw: vk::Semaphore,
}

impl ExternalSemaphore {
    /// A binary semaphore to share. The device must have VK_KHR_external_semaphore_fd enabled.
    ///
    /// # Errors
    /// [`Error::NoDevice`] without [`ExternalSupport::semaphores`]: wait for a fence on the host instead.
    pub fn new(host: &HostDevice, support: ExternalSupport) -> Result<Self> {
        if !support.semaphores {
            return Err(Error::NoDevice {
                what: "the driver shares no semaphores".into(),
                fix: "wait for a fence on the host between the two devices".into(),
            });
        }
        let device = &Device::from_host(host)?;
        enabled(device, c"vkGetSemaphoreFdKHR", khr::external_semaphore_fd::NAME)?;
        if !ExternalSupport::of(&host.adapter, vk::BufferUsageFlags::TRANSFER_SRC)?.semaphores {
            let what = "the driver shares no semaphores".into();
            return Err(Error::Host { what, fix: "give what ExternalSupport::of returned".into() });
        }
        let mut export = vk::ExportSemaphoreCreateInfo::default().handle_types(SEMAPHORE);
        let info = vk::SemaphoreCreateInfo::default().push_next(&mut export);
        // SAFETY: the info's pointers live until the call returns; `Drop` destroys it.
        let raw = unsafe { device.raw().create_semaphore(&info, device.callbacks()) }.named("vkCreateSemaphore")?;
        device.name_object(raw, "softras external");
        Ok(Self { device: device.clone(), raw })
    }

    /// A semaphore of this device that stands for the exported one.
    ///
    /// # Errors
    /// As [`new`](Self::new); [`Error::Vulkan`].
    ///
    /// # Safety
    /// The descriptor was [exported](Self::export) by a semaphore of a device of the same physical device and driver.
    pub unsafe fn import(host: &HostDevice, support: ExternalSupport, fd: OwnedFd) -> Result<Self> {
        let made = Self::new(host, support)?;
        let functions = {
            let _turn = looking_up_devices();
            khr::external_semaphore_fd::Device::new(made.device.instance(), made.device.raw())
        };
        let fd = fd.into_raw_fd();
        let info = vk::ImportSemaphoreFdInfoKHR::default().semaphore(made.raw).handle_type(SEMAPHORE).fd(fd);
        // SAFETY: the semaphore was just made; the descriptor is one of a semaphore's (the caller's promise), and the driver's
        // if the call succeeds.
        let result = unsafe { functions.import_semaphore_fd(&info) };
        if result.is_err() {
            // SAFETY: it was an OwnedFd, which the driver has not taken.
            drop(unsafe { OwnedFd::from_raw_fd(fd) });
        }
        result.named("vkImportSemaphoreFdKHR")?;
        Ok(made)
    }

    /// The semaphore, for another device to [`import`](Self::import).
    ///
    /// # Errors
    /// [`Error::Vulkan`].
    pub fn export(&self) -> Result<OwnedFd> {
        let functions = {
            let _turn = looking_up_devices();
            khr::external_semaphore_fd::Device::new(self.device.instance(), self.device.raw())
        };
        let info = vk::SemaphoreGetFdInfoKHR::default().semaphore(self.raw).handle_type(SEMAPHORE);
        // SAFETY: the semaphore was made for export of this type.
        let fd = unsafe { functions.get_semaphore_fd(&info) }.named("vkGetSemaphoreFdKHR")?;
        // SAFETY: a new descriptor, which is ours.
        Ok(unsafe { OwnedFd::from_raw_fd(fd) })
    }

    /// The semaphore.
    pub fn raw(&self) -> vk::Semaphore {
        self.raw
    }
}

impl Drop for ExternalSemaphore {
    fn drop(&mut self) {
        // SAFETY: it is ours; the host keeps this as long as the device uses it (`raw`).
        unsafe { self.device.raw().destroy_semaphore(self.raw, self.device.callbacks()) };
    }
}
