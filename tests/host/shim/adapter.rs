//! Shows a physical device otherwise than it is: without shuffles, timestamps or cached memory, or with its queue
//! family behind others and for compute alone. It can also leave out the barriers of recorded commands.
// The functions have the names of the driver's functions that they replace.
#![allow(non_snake_case)]

use super::real;
use ash::vk;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Families that cannot compute, shown before the driver's first.
static BEFORE: AtomicU32 = AtomicU32::new(0);
/// The flags that the driver's first family is shown with.
static FLAGS: AtomicU32 = AtomicU32::new(u32::MAX);
static NO_TIMESTAMPS: AtomicBool = AtomicBool::new(false);
static NO_SHUFFLES: AtomicBool = AtomicBool::new(false);
static NO_CACHED_MEMORY: AtomicBool = AtomicBool::new(false);
static NO_BARRIERS: AtomicBool = AtomicBool::new(false);
/// Stages that barriers have named.
static STAGES: AtomicU32 = AtomicU32::new(0);

/// Shows the device as it is.
pub fn show_all() {
    BEFORE.store(0, Relaxed);
    FLAGS.store(u32::MAX, Relaxed);
    NO_TIMESTAMPS.store(false, Relaxed);
    NO_SHUFFLES.store(false, Relaxed);
    NO_CACHED_MEMORY.store(false, Relaxed);
    NO_BARRIERS.store(false, Relaxed);
    STAGES.store(0, Relaxed);
}

/// Shows one family with these flags, behind `before` families that can only copy.
pub fn show_family(before: u32, flags: vk::QueueFlags) {
    BEFORE.store(before, Relaxed);
    FLAGS.store(flags.as_raw(), Relaxed);
}

pub fn hide_timestamps() {
    NO_TIMESTAMPS.store(true, Relaxed);
}

pub fn hide_shuffles() {
    NO_SHUFFLES.store(true, Relaxed);
}

/// Shows no host-cached memory, so that softras copies between device and host as on a discrete GPU.
pub fn hide_cached_memory() {
    NO_CACHED_MEMORY.store(true, Relaxed);
}

/// Leaves out every barrier that is recorded.
pub fn drop_barriers() {
    NO_BARRIERS.store(true, Relaxed);
}

/// Stages that barriers recorded through this loader have named.
pub fn stages() -> vk::PipelineStageFlags {
    vk::PipelineStageFlags::from_raw(STAGES.load(Relaxed))
}

/// The driver's number of a family that was shown. A shown family that only copies does not exist: it ends the test.
pub fn real_family(shown: u32) -> u32 {
    shown.checked_sub(BEFORE.load(Relaxed)).expect("a family that computes")
}

/// The driver's function that one of ours replaces.
macro_rules! real {
    ($name:ident as $kind:ty) => {
        unsafe { std::mem::transmute::<usize, $kind>(real::$name.load(Relaxed)) }
    };
}

pub unsafe extern "system" fn vkGetPhysicalDeviceQueueFamilyProperties(
    physical: vk::PhysicalDevice,
    count: *mut u32,
    families: *mut vk::QueueFamilyProperties,
) {
    let real = real!(vkGetPhysicalDeviceQueueFamilyProperties as vk::PFN_vkGetPhysicalDeviceQueueFamilyProperties);
    let before = BEFORE.load(Relaxed);
    if before == 0 && FLAGS.load(Relaxed) == u32::MAX && !NO_TIMESTAMPS.load(Relaxed) {
        return unsafe { real(physical, count, families) };
    }
    let mut number = 0;
    unsafe { real(physical, &raw mut number, std::ptr::null_mut()) };
    if families.is_null() {
        return unsafe { *count = before + 1 };
    }
    let mut first = vk::QueueFamilyProperties::default();
    number = 1;
    unsafe { real(physical, &raw mut number, &raw mut first) };
    first.queue_flags &= vk::QueueFlags::from_raw(FLAGS.load(Relaxed));
    if NO_TIMESTAMPS.load(Relaxed) {
        first.timestamp_valid_bits = 0;
    }
    let copying = vk::QueueFamilyProperties { queue_flags: vk::QueueFlags::TRANSFER, ..first };
    for i in 0..unsafe { *count }.min(before + 1) {
        unsafe { *families.add(i as usize) = if i < before { copying } else { first } };
    }
}

pub unsafe extern "system" fn vkGetPhysicalDeviceProperties2(
    physical: vk::PhysicalDevice,
    properties: *mut vk::PhysicalDeviceProperties2<'_>,
) {
    let real = real!(vkGetPhysicalDeviceProperties2 as vk::PFN_vkGetPhysicalDeviceProperties2);
    unsafe { real(physical, properties) };
    let mut next = unsafe { (*properties).p_next.cast::<vk::BaseOutStructure<'_>>() };
    while let (true, Some(link)) = (NO_SHUFFLES.load(Relaxed), unsafe { next.as_mut() }) {
        if link.s_type == vk::StructureType::PHYSICAL_DEVICE_SUBGROUP_PROPERTIES {
            let subgroups = unsafe { &mut *next.cast::<vk::PhysicalDeviceSubgroupProperties<'_>>() };
            subgroups.supported_operations = vk::SubgroupFeatureFlags::BASIC;
        }
        next = link.p_next;
    }
}

pub unsafe extern "system" fn vkGetPhysicalDeviceMemoryProperties(
    physical: vk::PhysicalDevice,
    properties: *mut vk::PhysicalDeviceMemoryProperties,
) {
    let real = real!(vkGetPhysicalDeviceMemoryProperties as vk::PFN_vkGetPhysicalDeviceMemoryProperties);
    unsafe { real(physical, properties) };
    if NO_CACHED_MEMORY.load(Relaxed) {
        let kinds = unsafe { &mut (*properties).memory_types };
        kinds.iter_mut().for_each(|kind| kind.property_flags &= !vk::MemoryPropertyFlags::HOST_CACHED);
    }
}

pub unsafe extern "system" fn vkCreateDevice(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    callbacks: *const vk::AllocationCallbacks<'_>,
    device: *mut vk::Device,
) -> vk::Result {
    let mut info = unsafe { *info };
    let queues =
        unsafe { std::slice::from_raw_parts(info.p_queue_create_infos, info.queue_create_info_count as usize) };
    let mut queues = queues.to_vec();
    for queue in &mut queues {
        queue.queue_family_index = real_family(queue.queue_family_index);
    }
    info.p_queue_create_infos = queues.as_ptr();
    let real = real!(vkCreateDevice as vk::PFN_vkCreateDevice);
    unsafe { real(physical, &raw const info, callbacks, device) }
}

pub unsafe extern "system" fn vkGetDeviceQueue(device: vk::Device, family: u32, index: u32, queue: *mut vk::Queue) {
    let real = real!(vkGetDeviceQueue as vk::PFN_vkGetDeviceQueue);
    unsafe { real(device, real_family(family), index, queue) }
}

#[allow(clippy::too_many_arguments)]
pub unsafe extern "system" fn vkCmdPipelineBarrier(
    commands: vk::CommandBuffer,
    from: vk::PipelineStageFlags,
    to: vk::PipelineStageFlags,
    dependency: vk::DependencyFlags,
    memory_count: u32,
    memory: *const vk::MemoryBarrier<'_>,
    buffer_count: u32,
    buffers: *const vk::BufferMemoryBarrier<'_>,
    image_count: u32,
    images: *const vk::ImageMemoryBarrier<'_>,
) {
    STAGES.fetch_or((from | to).as_raw(), Relaxed);
    if NO_BARRIERS.load(Relaxed) {
        return;
    }
    let real = real!(vkCmdPipelineBarrier as vk::PFN_vkCmdPipelineBarrier);
    unsafe {
        real(commands, from, to, dependency, memory_count, memory, buffer_count, buffers, image_count, images);
    }
}
