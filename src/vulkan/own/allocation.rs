//! Device memory through gpu-allocator: its sizes, the memory types that need no copies, and its errors.

use super::super::adapter::DeviceKind;
use super::super::device::Device;
use super::super::result::vulkan;
use crate::{Error, Result};
use ash::vk;
use gpu_allocator::vulkan::{Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationError, AllocationSizes, AllocatorDebugSettings};

const MIB: u64 = 1 << 20;

/// An allocator of the device's memory.
pub(super) fn allocator(device: &Device) -> Result<Allocator> {
    Allocator::new(&AllocatorCreateDesc {
        instance: device.instance().clone(),
        device: device.raw().clone(),
        physical_device: device.physical_device(),
        debug_settings: AllocatorDebugSettings::default(),
        buffer_device_address: false,
        allocation_sizes: AllocationSizes::new(64 * MIB, 16 * MIB).with_max_device_memblock_size(256 * MIB),
    })
    .map_err(|error| allocation("allocator", 0, &error))
}

/// The bits of [`ContextInner::direct_types`](super::context::ContextInner::direct_types): only where the device's memory is the host's own, since a discrete GPU's
/// mappable memory is slow to read and scarce.
pub(super) fn direct_types(device: &Device, kind: DeviceKind) -> u32 {
    if !matches!(kind, DeviceKind::Integrated | DeviceKind::Software) {
        return 0;
    }
    let wanted = vk::MemoryPropertyFlags::DEVICE_LOCAL
        | vk::MemoryPropertyFlags::HOST_VISIBLE
        | vk::MemoryPropertyFlags::HOST_COHERENT
        | vk::MemoryPropertyFlags::HOST_CACHED;
    // SAFETY: the physical device is the instance's.
    let memory = unsafe { device.instance().get_physical_device_memory_properties(device.physical_device()) };
    let types = (0u32..).zip(memory.memory_types_as_slice());
    types.filter(|(_, t)| t.property_flags.contains(wanted)).map(|(index, _)| 1 << index).sum()
}

/// gpu-allocator's error for the buffer `name` of `bytes` bytes.
pub(super) fn allocation(name: &str, bytes: u64, error: &AllocationError) -> Error {
    match error {
        AllocationError::OutOfMemory => out_of_memory(name, bytes),
        // gpu-allocator maps only the device's; the host's reaches us as text.
        AllocationError::Internal(text) if text.contains("OUT_OF_HOST_MEMORY") => out_of_memory(name, bytes),
        AllocationError::Internal(text) if text.contains("DEVICE_LOST") => {
            vulkan("vkAllocateMemory", vk::Result::ERROR_DEVICE_LOST)
        }
        other => Error::Vulkan { call: "vkAllocateMemory", result: format!("{other} (buffer `{name}`)") },
    }
}

fn out_of_memory(name: &str, bytes: u64) -> Error {
    Error::OutOfMemory {
        what: format!("buffer `{name}`"),
        bytes,
        fix: "free device memory, or render a smaller image, fewer triangles or fewer cameras at once".to_string(),
    }
}
