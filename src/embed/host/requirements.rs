//! The requirements on a physical device, before a device is created on it.

use crate::error::{Error, Result};
use crate::vulkan::{BindingKind, DeviceInfo, HostAdapter, Kernel, kernels, vk};

/// The properties that a device must have, and those that are used if it has them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Requirements {
    /// The version of instance and device: Vulkan 1.1.
    pub api_version: u32,
    /// The flags of the queue that executes the command buffers.
    pub queue_flags: vk::QueueFlags,
    /// Enabled device features: none.
    pub features: &'static [&'static str],
    /// Enabled extensions: none.
    pub extensions: &'static [&'static str],
    /// The least values of limits, by their Vulkan names.
    pub limits: Vec<(&'static str, u64)>,
    /// Optional properties, each with its use.
    pub optional: &'static [(&'static str, &'static str)],
}

#[expect(clippy::new_without_default, reason = "a default that asks for limits would surprise")]
impl Requirements {
    /// The requirements of this version of softras.
    pub fn new() -> Self {
        let most = |f: &dyn Fn(&Kernel) -> u64| kernels::ALL.iter().map(|k| f(k)).max().unwrap_or(0);
        let bound =
            |kind: fn(BindingKind) -> bool| most(&|k| k.bindings.iter().filter(|b| kind(b.kind)).count() as u64);
        let is_texels = |kind: BindingKind| kind.buffer_usage() == vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
        Self {
            api_version: vk::API_VERSION_1_1,
            queue_flags: vk::QueueFlags::COMPUTE,
            features: &[],
            extensions: &[],
            limits: vec![
                ("maxPushConstantsSize", most(&|k| k.push_constant_bytes.into())),
                ("maxPerStageDescriptorStorageBuffers", bound(|kind| kind == BindingKind::StorageBuffer)),
                ("maxPerStageDescriptorSampledImages", bound(is_texels)),
                ("maxComputeSharedMemorySize", most(&|k| k.shared_bytes.into())),
                ("maxComputeWorkGroupInvocations", most(&|k| k.local_size.iter().map(|&n| u64::from(n)).product())),
            ],
            optional: &[
                ("subgroup shuffle in compute", "a tile's lanes read records together"),
                ("VK_EXT_debug_utils", "names and labels in graphics debuggers"),
                ("timestamps", "Renderer's timings; an embedding host times itself"),
            ],
        }
    }

    /// Validates a physical device before a device is created on it.
    ///
    /// The needs of a frame for maxStorageBufferRange and maxTexelBufferElements depend on its size;
    /// [`PassBuilder::build`](crate::embed::PassBuilder::build) validates them.
    ///
    /// # Errors
    /// [`Error::NoDevice`] saying what is missing; [`Error::Host`] for null handles.
    pub fn validate(&self, host: &HostAdapter) -> Result<DeviceInfo> {
        let info = host.describe()?;
        let fail = |what: String| Err(Error::NoDevice { what, fix: "choose another physical device".into() });
        if let Err(reason) = &info.suitable {
            return fail(format!("{}: {reason}", info.name));
        }
        let limits = &info.limits;
        for &(name, needed) in &self.limits {
            let limit: u64 = match name {
                "maxPushConstantsSize" => limits.max_push_constants.into(),
                "maxPerStageDescriptorStorageBuffers" => limits.max_storage_buffers.into(),
                "maxPerStageDescriptorSampledImages" => limits.max_texel_buffers.into(),
                "maxComputeSharedMemorySize" => limits.max_shared_memory.into(),
                _ => limits.max_workgroup_invocations.into(),
            };
            if limit < needed {
                return fail(format!("{}: {name} is {limit}, softras needs {needed}", info.name));
            }
        }
        Ok(info)
    }
}
