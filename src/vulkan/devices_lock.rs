//! Keeps devices from coming and going while another thread has the Vulkan loader look one up.
//!
//! The loader keeps the drivers and devices of all instances in lists of the process. It looks devices up in them in
//! vkGetDeviceProcAddr and vkSetDebugUtilsObjectNameEXT, and up to at least 1.4.341 it changes them without the lock that
//! lookups take: in vkCreateDevice and vkDestroyDevice (KhronosGroup/Vulkan-Loader, issue 2018), and in
//! vkEnumeratePhysicalDevices, which unloads drivers without a device. So two threads with a device each can end the
//! process; with Debian 13's 1.4.309 they do. All calls of this crate take turns, and a host can join them.

use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

static DEVICES: RwLock<()> = RwLock::new(());

/// Waits until no thread looks up a Vulkan device through softras, and keeps it so until the guard is dropped.
///
/// A host that makes or destroys devices in one thread, while softras works in another, holds the guard around each call of
/// vkCreateInstance, vkEnumeratePhysicalDevices, vkCreateDevice, vkDestroyDevice and vkDestroyInstance: the Vulkan loader up to
/// at least 1.4.341 changes its list of devices without a lock (KhronosGroup/Vulkan-Loader, issue 2018). Call nothing of
/// softras meanwhile: it would wait for ever. A host with one device does not need the guard.
pub fn changing_devices() -> RwLockWriteGuard<'static, ()> {
    DEVICES.write().unwrap_or_else(PoisonError::into_inner)
}

/// To be held during calls that have the loader look a device up.
pub(super) fn looking_up_devices() -> RwLockReadGuard<'static, ()> {
    DEVICES.read().unwrap_or_else(PoisonError::into_inner)
}
