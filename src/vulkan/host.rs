//! A host's handles, as they cross the border.

use super::adapter::{self, DeviceInfo};
use super::result::misuse_of;
use crate::{Error, Result};
use ash::vk::{self, Handle};
use std::ffi::c_void;

/// The raw handles of a host's device.
///
/// A host on this crate's ash fills in the fields; one on another ash, or on none, calls
/// [`from_raw`](Self::from_raw) with the handles as numbers.
#[derive(Clone, Copy)]
pub struct HostDevice {
    /// vkGetInstanceProcAddr of the loader that made the instance.
    pub get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    /// The instance, made for Vulkan 1.1 or later.
    pub instance: vk::Instance,
    /// The physical device, of Vulkan 1.1 or later.
    pub physical_device: vk::PhysicalDevice,
    /// The device. No feature and no extension need be enabled.
    pub device: vk::Device,
    /// VK_EXT_debug_utils is enabled on the instance: objects get names and passes labels. Usually false.
    pub debug_utils: bool,
    /// Where compiled kernels are kept; null for none. The host's to fill, to save and to destroy. It must have been
    /// made without EXTERNALLY_SYNCHRONIZED.
    pub pipeline_cache: vk::PipelineCache,
    /// What every object is created and destroyed with.
    pub allocation_callbacks: Option<vk::AllocationCallbacks<'static>>,
}

impl HostDevice {
    /// The handles that every host has; no debug names, no pipeline cache, no allocation callbacks.
    pub fn new(
        get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
        instance: vk::Instance,
        physical_device: vk::PhysicalDevice,
        device: vk::Device,
    ) -> Self {
        Self {
            get_instance_proc_addr,
            instance,
            physical_device,
            device,
            debug_utils: false,
            pipeline_cache: vk::PipelineCache::null(),
            allocation_callbacks: None,
        }
    }

    /// The same from plain numbers: a dispatchable handle is its pointer, as `Handle::as_raw` of any ash gives it.
    ///
    /// # Errors
    /// [`Error::Host`] where one of them is null.
    ///
    /// # Safety
    /// `get_instance_proc_addr` is the address of vkGetInstanceProcAddr.
    pub unsafe fn from_raw(
        get_instance_proc_addr: *const c_void,
        instance: u64,
        physical_device: u64,
        device: u64,
    ) -> Result<Self> {
        let handles = [instance, physical_device, device];
        if get_instance_proc_addr.is_null() || handles.contains(&0) {
            return Err(Error::Host {
                what: "a handle of the device is null".into(),
                mend: "give vkGetInstanceProcAddr, the instance, the physical device and the device".into(),
            });
        }
        // SAFETY: it is not null, and that function (the caller's promise).
        let function =
            unsafe { std::mem::transmute::<*const c_void, vk::PFN_vkGetInstanceProcAddr>(get_instance_proc_addr) };
        Ok(Self::new(
            function,
            vk::Instance::from_raw(instance),
            vk::PhysicalDevice::from_raw(physical_device),
            vk::Device::from_raw(device),
        ))
    }

    /// Asks a physical device what it can do, before there is a device: `device` and what follows it are not looked at
    /// and may be null.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where the loader has no instance functions.
    ///
    /// # Safety
    /// Instance and physical device are valid, belong together, and the instance was made for Vulkan 1.1 or later.
    pub unsafe fn describe(&self) -> Result<DeviceInfo> {
        if self.instance.is_null() || self.physical_device.is_null() {
            return Err(misuse_of("vkGetPhysicalDeviceProperties", "instance or physical device is null"));
        }
        let static_fn = ash::StaticFn { get_instance_proc_addr: self.get_instance_proc_addr };
        // SAFETY: the caller's promise.
        let instance = unsafe { ash::Instance::load(&static_fn, self.instance) };
        // SAFETY: the caller's promise.
        Ok(unsafe { adapter::describe(&instance, 0, self.physical_device) }.info)
    }
}

impl std::fmt::Debug for HostDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { instance, physical_device, device, debug_utils, pipeline_cache, .. } = self;
        f.debug_struct("HostDevice")
            .field("instance", instance)
            .field("physical_device", physical_device)
            .field("device", device)
            .field("debug_utils", debug_utils)
            .field("pipeline_cache", pipeline_cache)
            .field("allocation_callbacks", &self.allocation_callbacks.is_some())
            .finish()
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
