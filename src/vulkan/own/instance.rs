//! An instance with debug names and validation where they are installed.

use super::super::devices_lock::changing_devices;
use super::super::result::Named;
use super::loader::{INSTALL, Loader, system_entry};
use super::validation::{Checks, LAYER, Messenger, ValidationLog};
use crate::{Error, Result};
use ash::vk;
use std::ffi::CStr;
use std::path::Path;
use std::sync::Arc;

/// An instance of ours, with its messenger.
pub(in crate::vulkan) struct Instance {
    pub(in crate::vulkan) raw: ash::Instance,
    /// The driver's file, if it was opened without a loader.
    pub(super) driver: Option<Arc<Path>>,
    /// VK_EXT_debug_utils is enabled.
    pub(in crate::vulkan) debug_utils: bool,
    /// Messages go here; stays empty without validation.
    pub(super) log: ValidationLog,
    /// Dropped in `Drop`, before the instance.
    messenger: Option<Messenger>,
}

impl Instance {
    /// Makes an instance for Vulkan 1.1, by this loader, else the driver that SOFTRAS_DRIVER names, else the system's loader. With
    /// `validation`, the validation layer must be installed.
    pub(super) fn new(loader: Option<&Loader>, validation: bool) -> Result<Self> {
        let loader = loader.cloned().map_or_else(Loader::by_environment, |loader| Ok(Some(loader)))?;
        let driver = loader.as_ref().and_then(|loader| loader.file.clone());
        if let Some(driver) = driver.as_ref().filter(|_| validation) {
            return Err(Error::NoDevice {
                what: format!("validation needs the Vulkan loader, but {} is opened without one", driver.display()),
                fix: "unset SOFTRAS_DRIVER and name the driver by VK_DRIVER_FILES, or do without validation"
                    .to_string(),
            });
        }
        let entry = &loader.as_ref().map_or_else(system_entry, |loader| Ok(loader.entry()))?;
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
        let mut instance = Self { raw, driver, debug_utils, log, messenger: None };
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
