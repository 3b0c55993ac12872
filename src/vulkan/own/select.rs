//! Which of the installed devices to open.

use super::super::adapter::{DeviceInfo, compute_family, describe};
use super::super::devices_lock::changing_devices;
use super::super::result::Named;
use super::instance::Instance;
use super::loader::INSTALL;
use crate::{Error, Result};
use ash::vk;
use std::path::Path;

/// A listed device with its handle.
pub(super) struct Adapter {
    pub(super) physical: vk::PhysicalDevice,
    pub(super) info: DeviceInfo,
    /// The queue family for compute.
    pub(super) queue_family: Option<u32>,
}

/// All devices of an instance, in the loader's order; of a driver's file at least one.
pub(super) fn list(instance: &Instance) -> Result<Vec<Adapter>> {
    let turn = changing_devices();
    // SAFETY: the instance lives.
    let answer = unsafe { instance.raw.enumerate_physical_devices() };
    drop(turn);
    let found = match answer {
        // The loader's answer where no driver is installed.
        Err(vk::Result::ERROR_INITIALIZATION_FAILED | vk::Result::ERROR_INCOMPATIBLE_DRIVER) => Vec::new(),
        other => other.named("vkEnumeratePhysicalDevices")?,
    };
    let file = instance.driver.as_deref().map(Path::to_owned);
    if let (Some(path), true) = (&file, found.is_empty()) {
        return Err(Error::File {
            path: path.clone(),
            line: None,
            what: "this driver has no device on this machine".to_string(),
            fix: "name the driver of a device that is here".to_string(),
        });
    }
    let adapter = |(index, physical)| {
        // SAFETY: the handle comes from this instance, which is of Vulkan 1.1.
        let info = unsafe { describe(&instance.raw, index, physical) };
        let queue_family = compute_family(&instance.raw, physical);
        Adapter { physical, info: DeviceInfo { file: file.clone(), ..info }, queue_family }
    };
    Ok(found.into_iter().enumerate().map(adapter).collect())
}

/// The device that `selector` names (an index, or part of a name in any case), or the best one that is suitable.
pub(super) fn select(adapters: Vec<Adapter>, selector: Option<&str>) -> Result<Adapter> {
    let listing = adapters.iter().map(|a| line(&a.info)).collect::<Vec<_>>().join("; ");
    let Some(selector) = selector.map(str::trim).filter(|s| !s.is_empty()) else {
        let suitable = adapters.into_iter().filter(|a| a.info.suitable.is_ok());
        return suitable.min_by_key(|a| (a.info.kind, a.info.index)).ok_or_else(|| Error::NoDevice {
            what: if listing.is_empty() {
                "there is no Vulkan device".to_string()
            } else {
                format!("no Vulkan device is suitable ({listing})")
            },
            fix: INSTALL.to_string(),
        });
    };
    // `4090` is a part of a name where no device has that index.
    let index = selector.parse::<usize>().ok().filter(|index| adapters.iter().any(|a| a.info.index == *index));
    let names = |info: &DeviceInfo| match index {
        Some(index) => info.index == index,
        None => info.name.to_lowercase().contains(&selector.to_lowercase()),
    };
    // Where several match (a GPU listed by two drivers), the best suitable one.
    let best = adapters
        .into_iter()
        .filter(|a| names(&a.info))
        .min_by_key(|a| (a.info.suitable.is_err(), a.info.kind, a.info.index));
    let what = match &best {
        Some(Adapter { info: DeviceInfo { suitable: Err(reason), name, .. }, .. }) => {
            format!("`{selector}` is {name}, but {reason}")
        }
        Some(_) => String::new(),
        None => format!("`{selector}` is no Vulkan device"),
    };
    best.filter(|a| a.info.suitable.is_ok()).ok_or_else(|| Error::NoDevice {
        what,
        fix: if listing.is_empty() {
            format!("there is none: {INSTALL}")
        } else {
            format!("choose one by its number or a part of its name, as of {listing}")
        },
    })
}

fn line(info: &DeviceInfo) -> String {
    let reason = info.suitable.as_ref().err().map_or(String::new(), |reason| format!(", {reason}"));
    format!("{}: {} ({}{reason})", info.index, info.name, info.kind)
}
