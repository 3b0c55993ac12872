//! A host's instance, device and command buffer, as it hands them to softras.

use super::adapter::{self, DeviceInfo};
use crate::{Error, Result};
use ash::vk::{self, Handle};
use std::ffi::c_void;

/// A host's physical device, which can be queried before there is a device.
#[derive(Clone, Copy)]
pub struct HostAdapter {
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    instance: vk::Instance,
    physical_device: vk::PhysicalDevice,
}

impl HostAdapter {
    /// From vkGetInstanceProcAddr of the loader that made the instance, the instance, and the physical device.
    ///
    /// # Safety
    /// - The handles are valid and belong together; the instance was made for Vulkan 1.1 or later.
    /// - They stay valid until everything made of this is dropped.
    pub unsafe fn new(
        get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
        instance: vk::Instance,
        physical_device: vk::PhysicalDevice,
    ) -> Self {
        Self { get_instance_proc_addr, instance, physical_device }
    }

    /// An adapter from plain numbers, for a host that uses another version of ash or none. The number of a dispatchable
    /// handle is its pointer, which `Handle::as_raw` of any ash returns.
    ///
    /// # Errors
    /// [`Error::Host`] where one of them is null.
    ///
    /// # Safety
    /// As for [`new`](Self::new); `get_instance_proc_addr` is the address of vkGetInstanceProcAddr.
    pub unsafe fn from_raw(get_instance_proc_addr: *const c_void, instance: u64, physical_device: u64) -> Result<Self> {
        if get_instance_proc_addr.is_null() || instance == 0 || physical_device == 0 {
            return null("vkGetInstanceProcAddr, the instance or the physical device");
        }
        // SAFETY: it is not null, and that function (the caller's promise).
        let function =
            unsafe { std::mem::transmute::<*const c_void, vk::PFN_vkGetInstanceProcAddr>(get_instance_proc_addr) };
        let (instance, physical) = (vk::Instance::from_raw(instance), vk::PhysicalDevice::from_raw(physical_device));
        // SAFETY: the caller's promise.
        Ok(unsafe { Self::new(function, instance, physical) })
    }

    /// The properties and limits of the physical device, and whether softras can run on it.
    ///
    /// # Errors
    /// [`Error::Host`] where a handle is null.
    pub fn describe(&self) -> Result<DeviceInfo> {
        let instance = self.functions()?;
        // SAFETY: the promise of `new`.
        Ok(unsafe { adapter::describe(&instance, 0, self.physical_device) })
    }

    /// The instance's functions.
    pub(super) fn functions(&self) -> Result<ash::Instance> {
        if self.instance.is_null() || self.physical_device.is_null() {
            return null("the instance or the physical device");
        }
        let static_fn = ash::StaticFn { get_instance_proc_addr: self.get_instance_proc_addr };
        // SAFETY: the promise of `new`.
        Ok(unsafe { ash::Instance::load(&static_fn, self.instance) })
    }

    /// The physical device.
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.physical_device
    }
}

fn null<T>(what: &str) -> Result<T> {
    Err(Error::Host { what: format!("{what} is null"), fix: "give handles that were made".into() })
}

/// The prefix of names and labels unless the host chooses another.
pub(super) const LABEL_PREFIX: &str = "softras ";

/// A host's device, and what softras may use with it.
#[derive(Clone, Copy)]
pub struct HostDevice {
    pub(super) adapter: HostAdapter,
    pub(super) device: vk::Device,
    pub(super) debug_utils: bool,
    pub(super) label_prefix: &'static str,
    pub(super) pipeline_cache: vk::PipelineCache,
    pub(super) allocation_callbacks: Option<vk::AllocationCallbacks<'static>>,
}

impl HostDevice {
    /// A device of this adapter, of which no feature and no extension need be enabled.
    ///
    /// # Safety
    /// - The device was made of the adapter's physical device, with a queue of a family that computes.
    /// - It stays valid until every rasterizer and pass made with it is dropped.
    pub unsafe fn new(adapter: HostAdapter, device: vk::Device) -> Self {
        let pipeline_cache = vk::PipelineCache::null();
        Self {
            adapter,
            device,
            debug_utils: false,
            label_prefix: LABEL_PREFIX,
            pipeline_cache,
            allocation_callbacks: None,
        }
    }

    /// A device from a plain number.
    ///
    /// # Errors
    /// [`Error::Host`] where it is null.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    pub unsafe fn from_raw(adapter: HostAdapter, device: u64) -> Result<Self> {
        if device == 0 {
            return null("the device");
        }
        // SAFETY: the caller's promise.
        Ok(unsafe { Self::new(adapter, vk::Device::from_raw(device)) })
    }

    /// Gives objects names, and passes labels, for graphics debuggers and validation messages.
    ///
    /// # Safety
    /// VK_EXT_debug_utils is enabled on the instance.
    pub unsafe fn with_debug_utils(self) -> Self {
        Self { debug_utils: true, ..self }
    }

    /// Begins these names and labels with `label_prefix` instead of "softras ".
    pub fn with_label_prefix(self, label_prefix: &'static str) -> Self {
        Self { label_prefix, ..self }
    }

    /// Where compiled kernels are kept. The cache is the host's to fill, to save and to destroy.
    ///
    /// # Safety
    /// It is of this device, was made without EXTERNALLY_SYNCHRONIZED, and stays valid as long as the device must.
    pub unsafe fn with_pipeline_cache(self, pipeline_cache: vk::PipelineCache) -> Self {
        Self { pipeline_cache, ..self }
    }

    /// Creates and destroys every object with these callbacks.
    ///
    /// # Safety
    /// The functions and their user data stay valid as long as the device must. Any thread that calls
    /// softras may call them, several at once.
    pub unsafe fn with_allocation_callbacks(self, callbacks: vk::AllocationCallbacks<'static>) -> Self {
        Self { allocation_callbacks: Some(callbacks), ..self }
    }

    /// The functions of instance and device.
    pub(super) fn functions(&self) -> Result<(ash::Instance, ash::Device)> {
        let instance = self.adapter.functions()?;
        if self.device.is_null() {
            return null("the device");
        }
        // SAFETY: the device is the instance's (the promise of `new`).
        let device = unsafe { ash::Device::load(instance.fp_v1_0(), self.device) };
        Ok((instance, device))
    }
}

impl std::fmt::Debug for HostAdapter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "HostAdapter({:?}, {:?})", self.instance, self.physical_device)
    }
}

impl std::fmt::Debug for HostDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { adapter, device, debug_utils, pipeline_cache, .. } = self;
        f.debug_struct("HostDevice")
            .field("adapter", adapter)
            .field("device", device)
            .field("debug_utils", debug_utils)
            .field("pipeline_cache", pipeline_cache)
            .field("allocation_callbacks", &self.allocation_callbacks.is_some())
            .finish()
    }
}

/// A host's command buffer while it records.
#[derive(Debug)]
pub struct HostCommands {
    raw: vk::CommandBuffer,
    /// A pool of timestamps, and the next query of it.
    pub(super) timestamps: Option<(vk::QueryPool, u32)>,
}

impl HostCommands {
    /// A command buffer to record into, for as long as this value is used.
    ///
    /// # Safety
    /// - It is of the device that is used with it, of a queue family that computes, in the recording state, and outside a
    ///   render pass.
    /// - No other thread uses it or its pool during a call that records into it.
    /// - All that is recorded into it (passes, and the buffers and images bound to them) is kept until it has been executed for
    ///   the last time or freed, and while it executes nobody else writes that memory.
    /// - When it executes, inputs hold what their tables say (indices within range), a backward pass follows the forward
    ///   frame that its plan was made of, and buffers and images are synchronised as the documentation of
    ///   [`embed`](crate::embed) says.
    pub unsafe fn new(raw: vk::CommandBuffer) -> Self {
        Self { raw, timestamps: None }
    }

    /// A command buffer from a plain number.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    pub unsafe fn from_raw(raw: u64) -> Self {
        // SAFETY: the caller's promise.
        unsafe { Self::new(vk::CommandBuffer::from_raw(raw)) }
    }

    /// Writes timestamps into a host's query pool, query by query from `first` on: one before the first stage of a frame and of its
    /// gradients, and one after each stage, whether it has work or not. [`Pass::stages`](crate::embed::Pass::stages)
    /// has their names.
    ///
    /// # Safety
    /// - The pool is of the command buffer's device, of type TIMESTAMP, and the queue family has timestamps.
    /// - It has a query for every timestamp, which was reset before in the same queue, and stays valid as the command buffer does.
    pub unsafe fn with_timestamps(self, pool: vk::QueryPool, first: u32) -> Self {
        Self { timestamps: Some((pool, first)), ..self }
    }

    /// The command buffer.
    pub fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }
}

/// A host's allocation callbacks, kept as long as objects made with them.
#[derive(Default)]
pub(super) struct Callbacks(Option<vk::AllocationCallbacks<'static>>);

// SAFETY: whoever makes one promises that every thread may call them (`Callbacks::new`).
unsafe impl Send for Callbacks {}
// SAFETY: as above.
unsafe impl Sync for Callbacks {}

impl Callbacks {
    /// # Safety
    /// The functions may be called from any thread, several at once, as long as this lives.
    pub(super) unsafe fn new(callbacks: Option<vk::AllocationCallbacks<'static>>) -> Self {
        Self(callbacks)
    }

    pub(super) fn get(&self) -> Option<&vk::AllocationCallbacks<'static>> {
        self.0.as_ref()
    }
}
