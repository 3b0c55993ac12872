//! The device that pipelines, descriptors and recording work on: ours or a host's.

use super::adapter::{DeviceKind, Limits};
#[cfg(feature = "renderer")]
use super::devices_lock::changing_devices;
use super::devices_lock::looking_up_devices;
#[cfg(feature = "renderer")]
use super::host::LABEL_PREFIX;
use super::host::{Callbacks, HostDevice};
#[cfg(feature = "renderer")]
use super::own::Instance;
use crate::{Error, Result};
use ash::{ext::debug_utils, vk};
use std::ffi::CString;
use std::sync::Arc;

/// A Vulkan device: functions, limits, debug names. Cheap to clone. It never destroys a host's device.
#[derive(Clone)]
pub struct Device {
    inner: Arc<DeviceInner>,
}

struct DeviceInner {
    raw: ash::Device,
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    debug_utils: Option<debug_utils::Device>,
    label_prefix: &'static str,
    limits: Limits,
    kind: DeviceKind,
    is_lavapipe: bool,
    /// The host's allocation callbacks; none on a device of ours.
    callbacks: Callbacks,
    /// The instance, if the device is ours to destroy. Dropped after the device.
    #[cfg(feature = "renderer")]
    owned: Option<Instance>,
}

/// lavapipe names its device after its engine, as in "llvmpipe (LLVM 15.0.6, 256 bits)".
fn is_lavapipe(properties: &vk::PhysicalDeviceProperties) -> bool {
    properties.device_name_as_c_str().is_ok_and(|name| name.to_bytes().starts_with(b"llvmpipe"))
}

impl Device {
    /// Takes a host's device.
    ///
    /// # Errors
    /// [`Error::NoDevice`] for a device of Vulkan 1.0, [`Error::Host`] for null handles.
    pub fn from_host(host: &HostDevice) -> Result<Self> {
        let turn = looking_up_devices();
        let (instance, raw) = host.functions()?;
        let physical = host.adapter.physical_device();
        // SAFETY: the handles are valid (the promise of `HostAdapter::new`).
        let properties = unsafe { instance.get_physical_device_properties(physical) };
        if properties.api_version < vk::API_VERSION_1_1 {
            return Err(Error::NoDevice {
                what: "the host's device has Vulkan 1.0 only".to_string(),
                fix: "softras needs Vulkan 1.1".to_string(),
            });
        }
        // SAFETY: both belong together and are of Vulkan 1.1.
        let limits = unsafe { Limits::query(&instance, physical) };
        if limits.max_memory_allocation_size == 0 {
            return Err(Error::NoDevice {
                what: "the host's instance was made for Vulkan 1.0, so the device does not tell its limits".to_string(),
                fix: "set VkApplicationInfo::apiVersion to Vulkan 1.1 or later".to_string(),
            });
        }
        let debug_utils = host.debug_utils.then(|| debug_utils::Device::new(&instance, &raw));
        drop(turn);
        let kind = DeviceKind::of(properties.device_type);
        let is_lavapipe = is_lavapipe(&properties);
        // SAFETY: the promise of `HostDevice::with_allocation_callbacks`.
        let callbacks = unsafe { Callbacks::new(host.allocation_callbacks) };
        let inner = DeviceInner {
            raw,
            instance,
            physical,
            debug_utils,
            label_prefix: host.label_prefix,
            limits,
            kind,
            is_lavapipe,
            callbacks,
            #[cfg(feature = "renderer")]
            owned: None,
        };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Makes a device with one queue of the family.
    ///
    /// It checks the bounds of buffers (robustBufferAccess, which every device has): whatever a buffer holds, a kernel that
    /// indexes with it cannot touch memory outside of the buffers that it was bound to.
    ///
    /// # Safety
    /// The physical device comes from this instance and has the queue family.
    #[cfg(feature = "renderer")]
    pub(super) unsafe fn create(
        instance: Instance,
        physical: vk::PhysicalDevice,
        queue_family: u32,
        limits: Limits,
        kind: DeviceKind,
    ) -> Result<Self, vk::Result> {
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        // SAFETY: the handle is this instance's (the caller's promise).
        let offered = unsafe { instance.raw.enumerate_device_extension_properties(physical) }?;
        // A device that offers VK_KHR_portability_subset demands that it be enabled (macOS).
        let portability = ash::khr::portability_subset::NAME;
        let needed = offered.iter().any(|e| e.extension_name_as_c_str() == Ok(portability));
        let extensions: Vec<_> = needed.then_some(portability.as_ptr()).into_iter().collect();
        // SAFETY: as above.
        let offered = unsafe { instance.raw.get_physical_device_features(physical) };
        let robust = offered.robust_buffer_access == vk::TRUE;
        // SAFETY: as above.
        let is_lavapipe = is_lavapipe(&unsafe { instance.raw.get_physical_device_properties(physical) });
        let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(robust);
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .enabled_features(&features);
        let turn = changing_devices();
        // SAFETY: the family exists (the caller's promise); the info's pointers live until the call returns.
        let raw = unsafe { instance.raw.create_device(physical, &info, None) }?;
        let debug_utils = instance.debug_utils.then(|| debug_utils::Device::new(&instance.raw, &raw));
        drop(turn);
        let functions = instance.raw.clone();
        let callbacks = Callbacks::default();
        let owned = Some(instance);
        let inner = DeviceInner {
            raw,
            instance: functions,
            physical,
            debug_utils,
            label_prefix: LABEL_PREFIX,
            limits,
            kind,
            is_lavapipe,
            callbacks,
            owned,
        };
        Ok(Self { inner: Arc::new(inner) })
    }

    /// Its limits.
    pub fn limits(&self) -> &Limits {
        &self.inner.limits
    }

    /// Its kind.
    pub fn kind(&self) -> DeviceKind {
        self.inner.kind
    }

    /// Whether its driver is Mesa's lavapipe.
    pub(super) fn is_lavapipe(&self) -> bool {
        self.inner.is_lavapipe
    }

    /// The allocation callbacks to create and destroy its objects with.
    pub(super) fn callbacks(&self) -> Option<&vk::AllocationCallbacks<'static>> {
        self.inner.callbacks.get()
    }

    /// The device's functions, for hosts that record beside us. The handle is valid as long as this device lives.
    pub fn raw(&self) -> &ash::Device {
        &self.inner.raw
    }

    /// The instance's functions.
    pub fn instance(&self) -> &ash::Instance {
        &self.inner.instance
    }

    /// The physical device.
    pub fn physical_device(&self) -> vk::PhysicalDevice {
        self.inner.physical
    }

    /// Our own instance, if the device is ours.
    #[cfg(feature = "renderer")]
    pub(super) fn owned_instance(&self) -> Option<&Instance> {
        self.inner.owned.as_ref()
    }

    /// VK_EXT_debug_utils, where it is enabled.
    pub(super) fn debug_utils(&self) -> Option<&debug_utils::Device> {
        self.inner.debug_utils.as_ref()
    }

    /// The prefix of names and labels.
    pub(super) fn label_prefix(&self) -> &'static str {
        self.inner.label_prefix
    }

    /// Names an object for validation messages and graphics debuggers.
    pub(super) fn name_object(&self, handle: impl vk::Handle, name: &str) {
        let Some(debug_utils) = self.debug_utils() else { return };
        let Ok(name) = CString::new([self.label_prefix(), name].concat()) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(handle).object_name(&name);
        let _turn = looking_up_devices();
        // SAFETY: callers pass handles that they have just made on this device. A name that fails is no loss.
        _ = unsafe { debug_utils.set_debug_utils_object_name(&info) };
    }
}

#[cfg(feature = "renderer")]
impl Drop for DeviceInner {
    fn drop(&mut self) {
        if self.owned.is_some() {
            let _turn = changing_devices();
            // SAFETY: the device is ours, and everything made with it held this Inner and is gone.
            unsafe { self.raw.destroy_device(None) };
        }
    }
}

impl std::fmt::Debug for Device {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Device({:?})", self.inner.raw.handle())
    }
}
