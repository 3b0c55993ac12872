//! A kernel compiled for a device: layouts from its reflection, specialization constants by name.

use super::adapter::Limits;
use super::cache::PipelineCache;
use super::device::Device;
use super::keep::Kept;
use super::kernel::{BindingKind, Kernel, SpecValue};
use super::result::{Named, vulkan};
use super::specialized::{Depth, specialized};
use crate::{Error, Result};
use ash::vk;
use std::collections::HashMap;
use std::sync::Arc;

/// A compute pipeline. Cheap to clone.
#[derive(Clone)]
pub struct Pipeline(Arc<PipelineInner>);

pub(super) struct PipelineInner {
    device: Device,
    kernel: &'static Kernel,
    local_size: [u32; 3],
    set_layout: vk::DescriptorSetLayout,
    layout: vk::PipelineLayout,
    raw: vk::Pipeline,
}

impl Pipeline {
    /// Compiles a kernel. Each specialization constant that is not named keeps its default.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where a name is unknown or its value of another type, or the cache is of another device;
    /// [`Error::Limit`] and [`Error::NoDevice`] where the device does not allow the kernel's workgroup, shared memory, push
    /// constants or subgroup operations.
    pub fn new(
        device: &Device,
        kernel: &'static Kernel,
        specialization: &[(&str, SpecValue)],
        cache: Option<&PipelineCache>,
    ) -> Result<Self> {
        if cache.is_some_and(|cache| cache.device().raw().handle() != device.raw().handle()) {
            return Err(kernel.misuse("vkCreateComputePipelines", "the pipeline cache is of another device"));
        }
        let constants = SpecConstants::new(kernel, specialization)?;
        let local_size = constants.local_size(kernel);
        check_limits(device, kernel, local_size)?;
        let mut inner = PipelineInner {
            device: device.clone(),
            kernel,
            local_size,
            set_layout: create_set_layout(device, kernel)?,
            layout: vk::PipelineLayout::null(),
            raw: vk::Pipeline::null(),
        };
        inner.layout = create_layout(device, kernel, inner.set_layout)?;
        let cache = cache.map_or(vk::PipelineCache::null(), PipelineCache::raw);
        inner.raw = create_pipeline(device, kernel, inner.layout, &constants, cache)?;
        device.name_object(inner.set_layout, kernel.name);
        device.name_object(inner.layout, kernel.name);
        device.name_object(inner.raw, kernel.name);
        Ok(Self(Arc::new(inner)))
    }

    /// The kernel it was made of.
    pub fn kernel(&self) -> &'static Kernel {
        self.0.kernel
    }

    pub(super) fn inner(&self) -> &Arc<PipelineInner> {
        &self.0
    }
}

impl std::fmt::Debug for Pipeline {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let PipelineInner { kernel, local_size, .. } = &*self.0;
        f.debug_struct("Pipeline").field("kernel", &kernel.name).field("local_size", local_size).finish()
    }
}

impl Kept for PipelineInner {}

impl PipelineInner {
    pub(super) fn set_layout(&self) -> vk::DescriptorSetLayout {
        self.set_layout
    }

    pub(super) fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub(super) fn device(&self) -> &Device {
        &self.device
    }
}

impl Drop for PipelineInner {
    fn drop(&mut self) {
        let (device, callbacks) = (self.device.raw(), self.device.callbacks());
        // SAFETY: all three are ours; what recorded or bound them kept this Inner until the device was done. Null is
        // ignored.
        unsafe {
            device.destroy_pipeline(self.raw, callbacks);
            device.destroy_pipeline_layout(self.layout, callbacks);
            device.destroy_descriptor_set_layout(self.set_layout, callbacks);
        }
    }
}

impl BindingKind {
    /// The usage that a buffer must have to be bound; none for an image.
    pub fn buffer_usage(self) -> vk::BufferUsageFlags {
        match self {
            Self::StorageBuffer => vk::BufferUsageFlags::STORAGE_BUFFER,
            Self::UniformTexelBufferFloat | Self::UniformTexelBufferInt | Self::UniformTexelBufferUint => {
                vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER
            }
            Self::SampledImage | Self::StorageImage(_) => vk::BufferUsageFlags::empty(),
        }
    }

    /// As Vulkan calls it.
    pub(super) fn descriptor_type(self) -> vk::DescriptorType {
        match self {
            Self::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
            Self::UniformTexelBufferFloat | Self::UniformTexelBufferInt | Self::UniformTexelBufferUint => {
                vk::DescriptorType::UNIFORM_TEXEL_BUFFER
            }
            Self::SampledImage => vk::DescriptorType::SAMPLED_IMAGE,
            Self::StorageImage(_) => vk::DescriptorType::STORAGE_IMAGE,
        }
    }
}

/// The values of specialization constants by their `constant_id`.
struct SpecConstants(HashMap<u32, u32>);

impl SpecConstants {
    fn new(kernel: &Kernel, values: &[(&str, SpecValue)]) -> Result<Self> {
        let call = "vkCreateComputePipelines";
        let mut constants = HashMap::new();
        for (name, value) in values {
            let Some(constant) = kernel.specialization.iter().find(|s| s.name == *name) else {
                let known: Vec<_> = kernel.specialization.iter().map(|s| s.name).collect();
                let what = format!("there is no specialization constant `{name}`, only {}", known.join(", "));
                return Err(kernel.misuse(call, &what));
            };
            if !constant.default.same_type(*value) {
                let what = format!("specialization constant `{name}` is of the type of {:?}", constant.default);
                return Err(kernel.misuse(call, &format!("{what}, not {value:?}")));
            }
            if constants.insert(constant.id, value.word()).is_some() {
                return Err(kernel.misuse(call, &format!("specialization constant `{name}` is given twice")));
            }
        }
        Ok(Self(constants))
    }

    /// The kernel's local size with these constants.
    fn local_size(&self, kernel: &Kernel) -> [u32; 3] {
        let given = |id: u32| self.0.get(&id).copied();
        std::array::from_fn(|axis| kernel.local_size_ids[axis].and_then(given).unwrap_or(kernel.local_size[axis]))
    }
}

/// Whether a device has a capability, by SPIR-V's name.
fn has(limits: &Limits, capability: &str) -> bool {
    match capability {
        // Every device of Vulkan 1.1 has these.
        "Shader" | "SampledBuffer" | "GroupNonUniform" => true,
        "GroupNonUniformShuffle" => limits.subgroup_shuffle,
        _ => false,
    }
}

fn check_limits(device: &Device, kernel: &Kernel, local_size: [u32; 3]) -> Result<()> {
    let limits = device.limits();
    let check = |what: &str, needed: u64, unit, limit_name, limit: u64| {
        if needed <= limit {
            return Ok(());
        }
        let (what, fix) = (format!("kernel `{}`: {what}", kernel.name), "use another device".to_string());
        Err(Error::Limit { what, needed, unit, limit_name, limit, fix })
    };
    if let Some(capability) = kernel.capabilities.iter().find(|c| !has(limits, c)) {
        let what = format!("kernel `{}` asks for {capability}, which the device lacks", kernel.name);
        return Err(Error::NoDevice { what, fix: "use another device".to_string() });
    }
    let bytes = kernel.shared_bytes.into();
    check("its shared memory", bytes, "bytes", "maxComputeSharedMemorySize", limits.max_shared_memory.into())?;
    let bytes = kernel.push_constant_bytes.into();
    check("its push constants", bytes, "bytes", "maxPushConstantsSize", limits.max_push_constants.into())?;
    if local_size.contains(&0) {
        return Err(kernel.misuse("vkCreateComputePipelines", "a workgroup without invocations"));
    }
    let invocations = local_size.iter().map(|&n| u64::from(n)).product();
    let limit = limits.max_workgroup_invocations.into();
    check("its workgroup", invocations, "invocations", "maxComputeWorkGroupInvocations", limit)?;
    let buffers = kernel.bindings.iter().filter(|b| b.kind == BindingKind::StorageBuffer).count() as u64;
    let limit = limits.max_storage_buffers.into();
    check("its set", buffers, "storage buffers", "maxPerStageDescriptorStorageBuffers", limit)?;
    let is_texels = |kind: BindingKind| kind.descriptor_type() == vk::DescriptorType::UNIFORM_TEXEL_BUFFER;
    let buffers = kernel.bindings.iter().filter(|b| is_texels(b.kind)).count() as u64;
    let limit = limits.max_texel_buffers.into();
    check("its set", buffers, "texel buffers", "maxPerStageDescriptorSampledImages", limit)?;
    local_size.iter().zip(limits.max_workgroup_size).try_for_each(|(&size, limit)| {
        check("its workgroup along an axis", size.into(), "invocations", "maxComputeWorkGroupSize", limit.into())
    })
}

fn create_set_layout(device: &Device, kernel: &Kernel) -> Result<vk::DescriptorSetLayout> {
    let bindings: Vec<_> = kernel
        .bindings
        .iter()
        .map(|b| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(b.binding)
                .descriptor_type(b.kind.descriptor_type())
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        })
        .collect();
    let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
    // SAFETY: binding numbers are distinct (build.rs); the info's pointers live until the call returns.
    unsafe { device.raw().create_descriptor_set_layout(&info, device.callbacks()) }.named("vkCreateDescriptorSetLayout")
}

fn create_layout(device: &Device, kernel: &Kernel, set: vk::DescriptorSetLayout) -> Result<vk::PipelineLayout> {
    let sets = [set];
    let push = [vk::PushConstantRange {
        stage_flags: vk::ShaderStageFlags::COMPUTE,
        offset: 0,
        size: kernel.push_constant_bytes,
    }];
    let push = if kernel.push_constant_bytes == 0 { &[][..] } else { &push[..] };
    let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(push);
    // SAFETY: the set layout lives; size is a multiple of four within the limit (check_limits).
    unsafe { device.raw().create_pipeline_layout(&info, device.callbacks()) }.named("vkCreatePipelineLayout")
}

fn create_pipeline(
    device: &Device,
    kernel: &Kernel,
    layout: vk::PipelineLayout,
    constants: &SpecConstants,
    cache: vk::PipelineCache,
) -> Result<vk::Pipeline> {
    // SwiftShader takes more than ten minutes to compile flat kernels.
    let depth = if device.is_lavapipe() { Depth::Flat } else { Depth::Cut };
    let code = specialized(kernel.spirv, &constants.0, depth);
    let info = vk::ShaderModuleCreateInfo::default().code(&code);
    // SAFETY: the words are glslang's output for Vulkan 1.1, which every device here has, less what its constants switch off.
    let module =
        unsafe { device.raw().create_shader_module(&info, device.callbacks()) }.named("vkCreateShaderModule")?;
    device.name_object(module, kernel.name);
    let stage =
        vk::PipelineShaderStageCreateInfo::default().stage(vk::ShaderStageFlags::COMPUTE).module(module).name(c"main");
    let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(layout)];
    // SAFETY: module and layout live and were made of the same reflection.
    let result = unsafe { device.raw().create_compute_pipelines(cache, &info, device.callbacks()) };
    // SAFETY: a pipeline does not need its module once it is made.
    unsafe { device.raw().destroy_shader_module(module, device.callbacks()) };
    let call = "vkCreateComputePipelines";
    let made = result.map_err(|(_, result)| vulkan(call, result))?;
    made.first().copied().ok_or_else(|| kernel.misuse(call, "no pipeline came back"))
}
