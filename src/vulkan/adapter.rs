//! The properties and limits of a physical device, as plain data.

use ash::vk;
use std::ffi::CStr;
use std::path::PathBuf;

/// A physical device, as plain data.
#[derive(Clone, Debug)]
pub struct DeviceInfo {
    /// Its index in the loader's list, by which it can be selected.
    pub index: usize,
    /// Its name, by any part of which it can be selected.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// The driver's name; empty for a device of Vulkan 1.1 and earlier.
    pub driver: String,
    /// The driver's version, as the driver writes it.
    pub driver_version: String,
    /// The driver's file, if it was opened without a Vulkan loader ([`Loader::driver`](crate::Loader::driver), SOFTRAS_DRIVER).
    pub file: Option<PathBuf>,
    /// Vulkan version, as (major, minor, patch).
    pub api_version: (u32, u32, u32),
    /// The limits that softras depends on.
    pub limits: Limits,
    /// Ok, or why softras cannot run on it.
    pub suitable: Result<(), String>,
}

/// The kind of a device, in the order of preference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU beside the processor, in the same memory.
    Integrated,
    /// A GPU of a virtual machine's host.
    Virtual,
    /// The processor itself: lavapipe, SwiftShader.
    Software,
    /// Something else.
    Other,
}

impl DeviceKind {
    /// From Vulkan's own enumeration.
    pub(super) fn of(kind: vk::PhysicalDeviceType) -> Self {
        match kind {
            vk::PhysicalDeviceType::DISCRETE_GPU => Self::Discrete,
            vk::PhysicalDeviceType::INTEGRATED_GPU => Self::Integrated,
            vk::PhysicalDeviceType::VIRTUAL_GPU => Self::Virtual,
            vk::PhysicalDeviceType::CPU => Self::Software,
            _ => Self::Other,
        }
    }
}

impl std::fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete",
            Self::Integrated => "integrated",
            Self::Virtual => "virtual",
            Self::Software => "software",
            Self::Other => "other",
        })
    }
}

/// A device's limits, by their Vulkan names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// maxStorageBufferRange in bytes.
    pub max_storage_buffer_range: u64,
    /// maxTexelBufferElements.
    pub max_texel_buffer_elements: u64,
    /// maxMemoryAllocationSize in bytes.
    pub max_memory_allocation_size: u64,
    /// maxComputeWorkGroupCount.
    pub max_workgroup_count: [u32; 3],
    /// maxComputeWorkGroupSize.
    pub max_workgroup_size: [u32; 3],
    /// maxComputeWorkGroupInvocations.
    pub max_workgroup_invocations: u32,
    /// maxComputeSharedMemorySize in bytes.
    pub max_shared_memory: u32,
    /// maxPushConstantsSize in bytes.
    pub max_push_constants: u32,
    /// maxPerStageDescriptorStorageBuffers.
    pub max_storage_buffers: u32,
    /// maxPerStageDescriptorSampledImages, which limits texel buffers as well.
    pub max_texel_buffers: u32,
    /// minStorageBufferOffsetAlignment in bytes.
    pub storage_offset_alignment: u64,
    /// minTexelBufferOffsetAlignment in bytes.
    pub texel_offset_alignment: u64,
    /// timestampPeriod in nanoseconds.
    pub timestamp_period: f32,
    /// Size of the largest device-local heap in bytes.
    pub device_heap: u64,
    /// subgroupSize: invocations in a subgroup.
    pub subgroup_size: u32,
    /// Whether compute kernels have subgroupShuffle, which Vulkan 1.1 does not promise.
    pub subgroup_shuffle: bool,
}

impl Limits {
    /// Queries a physical device.
    ///
    /// # Safety
    /// Instance and device belong together and both are of Vulkan 1.1.
    pub(super) unsafe fn query(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        let mut maintenance3 = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut properties =
            vk::PhysicalDeviceProperties2::default().push_next(&mut subgroup).push_next(&mut maintenance3);
        // SAFETY: the caller's promise; the chained structures are of Vulkan 1.1.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let limits = properties.properties.limits;
        // SAFETY: the caller's promise.
        let memory = unsafe { instance.get_physical_device_memory_properties(physical) };
        let local = |heap: &&vk::MemoryHeap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL);
        let in_compute = subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
        Self {
            max_storage_buffer_range: limits.max_storage_buffer_range.into(),
            max_texel_buffer_elements: limits.max_texel_buffer_elements.into(),
            max_memory_allocation_size: maintenance3.max_memory_allocation_size,
            max_workgroup_count: limits.max_compute_work_group_count,
            max_workgroup_size: limits.max_compute_work_group_size,
            max_workgroup_invocations: limits.max_compute_work_group_invocations,
            max_shared_memory: limits.max_compute_shared_memory_size,
            max_push_constants: limits.max_push_constants_size,
            max_storage_buffers: limits.max_per_stage_descriptor_storage_buffers,
            max_texel_buffers: limits.max_per_stage_descriptor_sampled_images,
            storage_offset_alignment: limits.min_storage_buffer_offset_alignment,
            texel_offset_alignment: limits.min_texel_buffer_offset_alignment,
            timestamp_period: limits.timestamp_period,
            device_heap: memory.memory_heaps_as_slice().iter().filter(local).map(|h| h.size).max().unwrap_or(0),
            subgroup_size: subgroup.subgroup_size,
            subgroup_shuffle: in_compute && subgroup.supported_operations.contains(vk::SubgroupFeatureFlags::SHUFFLE),
        }
    }
}

/// The properties and limits of a physical device, and whether softras can run on it.
///
/// # Safety
/// The handle comes from this instance, which is of Vulkan 1.1.
pub(super) unsafe fn describe(instance: &ash::Instance, index: usize, physical: vk::PhysicalDevice) -> DeviceInfo {
    // SAFETY: the caller's promise.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    let version = properties.api_version;
    let is_1_1 = version >= vk::API_VERSION_1_1;
    let computes = compute_family(instance, physical).is_some();
    let suitable = if !is_1_1 {
        Err("it has Vulkan 1.0 only, softras needs 1.1".to_string())
    } else if !computes {
        Err("it has no queue that computes".to_string())
    } else {
        Ok(())
    };
    let (driver, driver_version) = driver(instance, physical, &properties);
    let name = properties.device_name_as_c_str().unwrap_or(c"?").to_string_lossy().into_owned();
    DeviceInfo {
        index,
        name,
        kind: DeviceKind::of(properties.device_type),
        driver,
        driver_version,
        file: None,
        api_version: (vk::api_version_major(version), vk::api_version_minor(version), vk::api_version_patch(version)),
        // SAFETY: the handle comes from this instance, which is of Vulkan 1.1; a device of 1.0 is never used, and the loader
        // answers the 1.1 query for it all the same.
        limits: unsafe { Limits::query(instance, physical) },
        suitable,
    }
}

/// The driver's name and version; VkPhysicalDeviceDriverProperties came with 1.2.
fn driver(
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    properties: &vk::PhysicalDeviceProperties,
) -> (String, String) {
    if properties.api_version < vk::API_VERSION_1_2 {
        return (String::new(), format!("{:#x}", properties.driver_version));
    }
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut chain = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
    // SAFETY: the handle comes from this instance, and the device knows the chained structure.
    unsafe { instance.get_physical_device_properties2(physical, &mut chain) };
    let text = |text: &[std::ffi::c_char]| {
        let bytes: Vec<u8> = text.iter().map(|&c| c.to_ne_bytes()[0]).collect();
        CStr::from_bytes_until_nul(&bytes).map_or(String::new(), |c| c.to_string_lossy().into_owned())
    };
    (text(&driver.driver_name), text(&driver.driver_info))
}

/// A queue family for compute. One that also draws is preferred: it is the device's main one, with timestamps and priority.
pub(super) fn compute_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<u32> {
    // SAFETY: the handle comes from this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let computes = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE) && f.queue_count > 0;
    let draws = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::GRAPHICS);
    let all = || (0u32..).zip(&families).filter(|(_, f)| computes(f));
    all().find(|(_, f)| draws(f)).or_else(|| all().next()).map(|(index, _)| index)
}
