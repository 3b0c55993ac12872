//! The Vulkan loader, and an instance with debug names and validation where they are installed.

use super::super::devices_lock::changing_devices;
use super::super::result::Named;
use super::validation::{Checks, LAYER, Messenger, ValidationLog};
use crate::{Error, Result};
use ash::vk;
use std::ffi::CStr;
use std::sync::OnceLock;

/// How a machine gets a device.
pub(super) const INSTALL: &str = "install a graphics driver with Vulkan 1.1, or the software device \
    (Debian, Ubuntu: apt install libvulkan1 mesa-vulkan-drivers)";

/// The loader, opened once for the process and never closed: drivers leave threads behind that outlive their library.
fn system_entry() -> Result<&'static ash::Entry> {
    static ENTRY: OnceLock<ash::Entry> = OnceLock::new();
    if let Some(entry) = ENTRY.get() {
        return Ok(entry);
    }
    // SAFETY: opening the Vulkan loader runs its initialisers, which it is made for.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| Error::NoDevice {
        what: format!("the Vulkan loader cannot be opened ({e})"),
        fix: INSTALL.to_string(),
    })?;
    Ok(ENTRY.get_or_init(|| entry))
}

/// A Vulkan loader other than the system's: one that is linked in, or an engine's own.
#[derive(Clone, Copy, Debug)]
pub struct Loader(vk::PFN_vkGetInstanceProcAddr);

impl Loader {
    /// By its vkGetInstanceProcAddr.
    ///
    /// # Safety
    /// It is that function. It and all functions that it returns can be called for the rest of the process.
    pub unsafe fn new(get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr) -> Self {
        Self(get_instance_proc_addr)
    }

    fn entry(self) -> ash::Entry {
        // SAFETY: the promise of `new`.
        unsafe { ash::Entry::from_static_fn(ash::StaticFn { get_instance_proc_addr: self.0 }) }
    }
}

/// An instance of ours, with its messenger.
pub(in crate::vulkan) struct Instance {
    pub(in crate::vulkan) raw: ash::Instance,
    /// VK_EXT_debug_utils is enabled.
    pub(in crate::vulkan) debug_utils: bool,
    /// Messages go here; stays empty without validation.
    pub(super) log: ValidationLog,
    /// Dropped in `Drop`, before the instance.
    messenger: Option<Messenger>,
}

impl Instance {
    /// Makes an instance for Vulkan 1.1, by this loader or the system's. With `validation`, the validation layer must be installed.
    pub(super) fn new(loader: Option<Loader>, validation: bool) -> Result<Self> {
        let entry = &match loader {
            Some(loader) => loader.entry(),
            None => system_entry()?.clone(),
        };
        let extensions = extensions(entry, None)?;
        let debug_utils = extensions.iter().any(|e| e == ash::ext::debug_utils::NAME);
        let portability = extensions.iter().any(|e| e == ash::khr::portability_enumeration::NAME);

        let mut layers = Vec::new();
        let mut enabled = Vec::new();
        let mut flags = vk::InstanceCreateFlags::empty();
        if debug_utils {
            enabled.push(ash::ext::debug_utils::NAME.as_ptr());
        }
        if portability {
            enabled.push(ash::khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let checks = if validation { Some(require_validation(entry, debug_utils)?) } else { None };
        if let Some(checks) = checks {
            layers.push(LAYER.as_ptr());
            enabled.push(checks.extension().as_ptr());
        }

        let log = ValidationLog::default();
        let application = vk::ApplicationInfo::default()
            .application_name(c"softras")
            .engine_name(c"softras")
            .api_version(vk::API_VERSION_1_1);
        let info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&enabled);
        let mut messenger_info = log.create_info();
        // SAFETY: all that `info` points to lives until the call returns, but the log, which `Instance` keeps.
        let create = |info: &vk::InstanceCreateInfo<'_>| unsafe { entry.create_instance(info, None) };
        let turn = changing_devices();
        let created = match checks {
            Some(checks) => checks.chained(info.push_next(&mut messenger_info), create),
            None => create(&info),
        };
        drop(turn);
        if let Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) = created {
            return Err(Error::NoDevice {
                what: "no Vulkan driver is installed".to_string(),
                fix: INSTALL.to_string(),
            });
        }
        let raw = created.named("vkCreateInstance")?;
        let mut instance = Self { raw, debug_utils, log, messenger: None };
        if validation {
            // SAFETY: debug_utils is there (require_validation), and Drop destroys the messenger first.
            let messenger = unsafe { Messenger::new(entry, &instance.raw, instance.log.clone()) };
            instance.messenger = Some(messenger.named("vkCreateDebugUtilsMessengerEXT")?);
        }
        Ok(instance)
    }

    /// Whether validation is on.
    pub(super) fn validates(&self) -> bool {
        self.messenger.is_some()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.messenger = None;
        let _turn = changing_devices();
        // SAFETY: every device holds its Instance, so none is left; the messenger is gone.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// The names of a layer's (or the loader's own) instance extensions.
fn extensions(entry: &ash::Entry, layer: Option<&CStr>) -> Result<Vec<std::ffi::CString>> {
    // SAFETY: a plain query; the layer name is nul-terminated.
    let found = unsafe { entry.enumerate_instance_extension_properties(layer) }
        .named("vkEnumerateInstanceExtensionProperties")?;
    Ok(found.iter().filter_map(|e| e.extension_name_as_c_str().ok()).map(CStr::to_owned).collect())
}

/// The way to configure the validation layer; an error unless it is installed with all extensions that we need.
fn require_validation(entry: &ash::Entry, debug_utils: bool) -> Result<Checks> {
    // SAFETY: a plain query.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.named("vkEnumerateInstanceLayerProperties")?;
    let installed = layers.iter().any(|l| l.layer_name_as_c_str() == Ok(LAYER));
    let checks = if installed && debug_utils { Checks::offered(&extensions(entry, Some(LAYER))?) } else { None };
    checks.ok_or_else(|| Error::NoDevice {
        what: "validation was asked for, but VK_LAYER_KHRONOS_validation is not installed".to_string(),
        fix: "install it (Debian, Ubuntu: apt install vulkan-validationlayers), or unset SOFTRAS_VALIDATION"
            .to_string(),
    })
}
