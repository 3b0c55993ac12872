//! The peak rate of a device in single-precision operations a second.
//!
//! The library runs no kernel but its own, so this one has a Vulkan device of its own, with all that one dispatch needs.

use ash::vk;
use softras::embed::changing_devices;
use softras::{DeviceInfo, Error, Result};
use std::time::Instant;

/// peak.comp.
const KERNEL: &[u8] = include_bytes!("peak.spv");
/// Operations of one pass of the kernel's loop: four steps of twelve multiply-adds.
const PASS: f64 = 4.0 * 12.0 * 2.0;
/// A run shorter than this many milliseconds is repeated with more passes.
const LONG_ENOUGH: f64 = 10.0;
/// Mesa 22.3 ends a loop after 65535 passes.
const MOST_LOOPS: u32 = 1 << 15;
const RUNS: usize = 12;
const GROUPS: u32 = 2048;
/// Invocations of all workgroups, 64 each.
const INVOCATIONS: u32 = 64 * GROUPS;

/// The kernel's push constants.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    loops: u32,
    factor: f32,
    term: f32,
}

/// Measures single-precision operations a second: the best of several runs of independent multiply-adds, each counted as
/// two operations whether or not the driver fuses them.
///
/// # Errors
/// [`Error::NoDevice`], [`Error::Vulkan`]; [`Error::NotFinite`] for a device that computes something else.
pub fn peak_flops(device: &DeviceInfo) -> Result<f64> {
    let failed = |result| Error::Vulkan { call: "the kernel that measures the peak", result: format!("VK_{result:?}") };
    let host = Host::open()?;
    let program = Program::new(&host, device.index).map_err(failed)?;
    let (mut loops, mut best, mut runs) = (1u32, 0.0f64, 0);
    while runs < RUNS {
        let milliseconds = program.run(loops).map_err(failed)?;
        if milliseconds < LONG_ENOUGH && loops < MOST_LOOPS {
            loops *= 2;
            continue;
        }
        best = best.max(PASS * f64::from(loops) * f64::from(INVOCATIONS) / milliseconds * 1e3);
        runs += 1;
    }
    if !(best.is_finite() && best > 0.0 && program.first().map_err(failed)?.is_finite()) {
        return Err(Error::NotFinite { stage: "peak", fix: "update the device's driver".into() });
    }
    Ok(best)
}

/// The loader and an instance.
struct Host {
    instance: ash::Instance,
    _entry: ash::Entry,
}

impl Host {
    fn open() -> Result<Self> {
        let failed = |what: String| Error::NoDevice { what, fix: "install a Vulkan loader and driver".into() };
        // SAFETY: opening the Vulkan loader runs its initialisers, which it is made for.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| failed(e.to_string()))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
        let mut info = vk::InstanceCreateInfo::default().application_info(&application);
        // Without it some devices of macOS are not listed, and the others have other indices.
        let portability = [ash::khr::portability_enumeration::NAME.as_ptr()];
        // SAFETY: a plain query.
        let offered = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        if offered.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::khr::portability_enumeration::NAME)) {
            let flags = vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
            info = info.flags(flags).enabled_extension_names(&portability);
        }
        let _turn = changing_devices();
        // SAFETY: all that `info` points to lives until the call returns.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(|e| failed(format!("VK_{e:?}")))?;
        Ok(Self { instance, _entry: entry })
    }

    /// The device of this index, its first queue family that computes, and the index of that.
    fn device(&self, index: usize) -> Result<(vk::PhysicalDevice, ash::Device, u32), vk::Result> {
        let (turn, instance) = (changing_devices(), &self.instance);
        // SAFETY: the instance lives, and the handles are its own.
        unsafe {
            let all = instance.enumerate_physical_devices()?;
            let physical = *all.get(index).ok_or(vk::Result::ERROR_INITIALIZATION_FAILED)?;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let computes = |f: &vk::QueueFamilyProperties| f.queue_flags.contains(vk::QueueFlags::COMPUTE);
            let family = families.iter().position(computes).ok_or(vk::Result::ERROR_INITIALIZATION_FAILED)? as u32;
            let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            // A device that offers this extension demands that it be enabled (macOS).
            let subset = ash::khr::portability_subset::NAME;
            let offered = instance.enumerate_device_extension_properties(physical)?;
            let demanded = offered.iter().any(|e| e.extension_name_as_c_str() == Ok(subset));
            let extensions: Vec<_> = demanded.then_some(subset.as_ptr()).into_iter().collect();
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
            let device = instance.create_device(physical, &info, None)?;
            drop(turn);
            Ok((physical, device, family))
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _turn = changing_devices();
        // SAFETY: programs borrow the host, so none is left.
        unsafe { self.instance.destroy_instance(None) };
    }
}

/// The kernel on a device, with its buffer of results. Handles are null until they are made.
struct Program<'a> {
    host: &'a Host,
    device: ash::Device,
    queue: vk::Queue,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    set_layout: vk::DescriptorSetLayout,
    sets: vk::DescriptorPool,
    set: vk::DescriptorSet,
    layout: vk::PipelineLayout,
    pipeline: vk::Pipeline,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
}

impl<'a> Program<'a> {
    fn new(host: &'a Host, index: usize) -> Result<Self, vk::Result> {
        let (physical, device, family) = host.device(index)?;
        // SAFETY: the device has one queue of this family.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let mut program = Self {
            host,
            device,
            queue,
            buffer: vk::Buffer::null(),
            memory: vk::DeviceMemory::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            sets: vk::DescriptorPool::null(),
            set: vk::DescriptorSet::null(),
            layout: vk::PipelineLayout::null(),
            pipeline: vk::Pipeline::null(),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
        };
        program.make_buffer(physical)?;
        program.make_pipeline()?;
        let reset = vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER;
        let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family).flags(reset);
        // SAFETY: the device lives; `drop` destroys pool and fence.
        unsafe {
            program.pool = program.device.create_command_pool(&pool, None)?;
            let one = vk::CommandBufferAllocateInfo::default().command_pool(program.pool).command_buffer_count(1);
            program.commands = program.device.allocate_command_buffers(&one)?[0];
            program.fence = program.device.create_fence(&vk::FenceCreateInfo::default(), None)?;
        }
        Ok(program)
    }

    /// A buffer in memory that the host can map, of which every device has some for every buffer.
    fn make_buffer(&mut self, physical: vk::PhysicalDevice) -> Result<(), vk::Result> {
        let info = vk::BufferCreateInfo::default()
            .size(4 * u64::from(INVOCATIONS))
            .usage(vk::BufferUsageFlags::STORAGE_BUFFER);
        let wanted = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // SAFETY: instance and device live and belong together; `drop` destroys buffer and memory.
        unsafe {
            self.buffer = self.device.create_buffer(&info, None)?;
            let needs = self.device.get_buffer_memory_requirements(self.buffer);
            let kinds = self.host.instance.get_physical_device_memory_properties(physical);
            let fits = |(i, kind): &(u32, &vk::MemoryType)| {
                needs.memory_type_bits >> i & 1 == 1 && kind.property_flags.contains(wanted)
            };
            let kind = (0..).zip(kinds.memory_types_as_slice()).find(fits);
            let kind = kind.ok_or(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)?.0;
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(kind);
            self.memory = self.device.allocate_memory(&info, None)?;
            self.device.bind_buffer_memory(self.buffer, self.memory, 0)
        }
    }

    fn make_pipeline(&mut self) -> Result<(), vk::Result> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(KERNEL));
        let words = words.map_err(|_| vk::Result::ERROR_INVALID_SHADER_NV)?;
        let bindings = [vk::DescriptorSetLayoutBinding::default()
            .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
            .descriptor_count(1)
            .stage_flags(vk::ShaderStageFlags::COMPUTE)];
        let set_layout = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let sizes = [vk::DescriptorPoolSize { ty: vk::DescriptorType::STORAGE_BUFFER, descriptor_count: 1 }];
        let sets = vk::DescriptorPoolCreateInfo::default().max_sets(1).pool_sizes(&sizes);
        let ranges = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(size_of::<Push>() as u32)];
        let buffers = [vk::DescriptorBufferInfo { buffer: self.buffer, offset: 0, range: vk::WHOLE_SIZE }];
        let device = &self.device;
        // SAFETY: the kernel is valid SPIR-V over one storage buffer and the push constants; all that the infos point to lives
        // until the calls return; `drop` destroys what stays.
        unsafe {
            self.set_layout = device.create_descriptor_set_layout(&set_layout, None)?;
            self.sets = device.create_descriptor_pool(&sets, None)?;
            let layouts = [self.set_layout];
            let set = vk::DescriptorSetAllocateInfo::default().descriptor_pool(self.sets).set_layouts(&layouts);
            self.set = device.allocate_descriptor_sets(&set)?[0];
            let write = vk::WriteDescriptorSet::default()
                .dst_set(self.set)
                .descriptor_type(vk::DescriptorType::STORAGE_BUFFER)
                .buffer_info(&buffers);
            device.update_descriptor_sets(&[write], &[]);
            let layout = vk::PipelineLayoutCreateInfo::default().set_layouts(&layouts).push_constant_ranges(&ranges);
            self.layout = device.create_pipeline_layout(&layout, None)?;
            let module = device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &info, None);
            device.destroy_shader_module(module, None);
            self.pipeline = made.map_err(|(_, result)| result)?.first().copied().unwrap_or_default();
        }
        Ok(())
    }

    /// Milliseconds of one dispatch with so many passes of the loop.
    fn run(&self, loops: u32) -> Result<f64, vk::Result> {
        // Values stay near 1, so that no operation meets infinities or denormals.
        let push = Push { loops, factor: 0.999, term: 1e-3 };
        let (device, commands, point) = (&self.device, self.commands, vk::PipelineBindPoint::COMPUTE);
        let once = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        let barrier = [vk::MemoryBarrier::default()
            .src_access_mask(vk::AccessFlags::SHADER_WRITE)
            .dst_access_mask(vk::AccessFlags::HOST_READ)];
        let (from, to) = (vk::PipelineStageFlags::COMPUTE_SHADER, vk::PipelineStageFlags::HOST);
        let submits = [vk::SubmitInfo::default().command_buffers(std::slice::from_ref(&commands))];
        // SAFETY: all handles are this device's and live, and nothing is pending: a run waits for its work.
        unsafe {
            device.begin_command_buffer(commands, &once)?;
            device.cmd_bind_pipeline(commands, point, self.pipeline);
            device.cmd_bind_descriptor_sets(commands, point, self.layout, 0, &[self.set], &[]);
            let stages = vk::ShaderStageFlags::COMPUTE;
            device.cmd_push_constants(commands, self.layout, stages, 0, bytemuck::bytes_of(&push));
            device.cmd_dispatch(commands, GROUPS, 1, 1);
            device.cmd_pipeline_barrier(commands, from, to, vk::DependencyFlags::empty(), &barrier, &[], &[]);
            device.end_command_buffer(commands)?;
            let start = Instant::now();
            device.queue_submit(self.queue, &submits, self.fence)?;
            device.wait_for_fences(&[self.fence], true, u64::MAX)?;
            let milliseconds = start.elapsed().as_secs_f64() * 1e3;
            device.reset_fences(&[self.fence])?;
            Ok(milliseconds)
        }
    }

    /// The first result of the latest run.
    fn first(&self) -> Result<f32, vk::Result> {
        // SAFETY: the memory is mapped once at a time, holds more than a float, and no work is pending.
        unsafe {
            let mapped = self.device.map_memory(self.memory, 0, 4, vk::MemoryMapFlags::empty())?;
            let first = mapped.cast::<f32>().read();
            self.device.unmap_memory(self.memory);
            Ok(first)
        }
    }
}

impl Drop for Program<'_> {
    fn drop(&mut self) {
        // SAFETY: every object is the device's, and no work is pending. A null handle is destroyed without effect.
        unsafe {
            _ = self.device.device_wait_idle();
            self.device.destroy_fence(self.fence, None);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_pipeline(self.pipeline, None);
            self.device.destroy_pipeline_layout(self.layout, None);
            self.device.destroy_descriptor_pool(self.sets, None);
            self.device.destroy_descriptor_set_layout(self.set_layout, None);
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
            let _turn = changing_devices();
            self.device.destroy_device(None);
        }
    }
}
