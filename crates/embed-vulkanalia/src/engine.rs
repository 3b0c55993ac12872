//! The engine: a device of vulkanalia's, buffers, kernels over storage buffers, one queue.

use std::ffi::{CStr, c_char, c_void};
use std::sync::Mutex;
use vulkanalia::loader::{LIBRARY, LibloadingLoader, Loader};
use vulkanalia::prelude::v1_1::*;
use vulkanalia::vk::ExtDebugUtilsExtensionInstanceCommands;

pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT,
    _: *mut c_void,
) -> vk::Bool32 {
    // The layer gives a valid message.
    let text = unsafe { CStr::from_ptr((*data).message) }.to_string_lossy().into_owned();
    MESSAGES.lock().unwrap_or_else(|e| e.into_inner()).push(text);
    vk::FALSE
}

pub struct Engine {
    pub get_instance_proc_addr: *const c_void,
    pub instance: Instance,
    pub physical: vk::PhysicalDevice,
    pub device: Device,
    messenger: Option<vk::DebugUtilsMessengerEXT>,
    queue: vk::Queue,
    pool: vk::CommandPool,
    made: Mutex<Made>,
    _entry: Entry,
}

/// The Vulkan objects that are destroyed with the engine.
#[derive(Default)]
struct Made {
    buffers: Vec<(vk::Buffer, vk::DeviceMemory)>,
    kernels: Vec<(vk::Pipeline, vk::PipelineLayout, vk::DescriptorSetLayout, vk::DescriptorPool)>,
}

/// A buffer with memory of its own, mapped if the host sees it.
#[derive(Clone, Copy)]
pub struct Buffer {
    pub raw: vk::Buffer,
    pub size: u64,
    pub usage: u32,
    mapped: *mut u8,
}

/// A compute kernel over storage buffers, bound to them.
pub struct Kernel {
    pipeline: vk::Pipeline,
    layout: vk::PipelineLayout,
    set: vk::DescriptorSet,
}

impl Engine {
    pub fn new(validation: bool) -> Outcome<Self> {
        unsafe {
            let loader = LibloadingLoader::new(LIBRARY)?;
            let get_instance_proc_addr =
                loader.load(b"vkGetInstanceProcAddr").map_err(|e| e.to_string())? as *const c_void;
            let entry = Entry::new(loader).map_err(|e| e.to_string())?;
            let application = vk::ApplicationInfo::builder().api_version(vk::make_version(1, 1, 0));
            let (layers, extensions): (&[*const c_char], &[*const c_char]) = if validation {
                (&[LAYER.as_ptr()], &[vk::EXT_DEBUG_UTILS_EXTENSION.name.as_ptr()])
            } else {
                (&[], &[])
            };
            let info = vk::InstanceCreateInfo::builder()
                .application_info(&application)
                .enabled_layer_names(layers)
                .enabled_extension_names(extensions);
            let instance = entry.create_instance(&info, None)?;
            let messenger = if validation { Some(messenger(&instance)?) } else { None };
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan device")?;
            let families = instance.get_physical_device_queue_family_properties(physical);
            let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
            let family = families.iter().position(computes).ok_or("no queue that computes")? as u32;
            let queues = [vk::DeviceQueueCreateInfo::builder().queue_family_index(family).queue_priorities(&[1.0])];
            let info = vk::DeviceCreateInfo::builder().queue_create_infos(&queues);
            let device = instance.create_device(physical, &info, None)?;
            let queue = device.get_device_queue(family, 0);
            let info = vk::CommandPoolCreateInfo::builder().queue_family_index(family);
            let pool = device.create_command_pool(&info, None)?;
            let made = Mutex::default();
            Ok(Self { get_instance_proc_addr, instance, physical, device, messenger, queue, pool, made, _entry: entry })
        }
    }

    pub fn validates(&self) -> bool {
        self.messenger.is_some()
    }

    fn made(&self) -> std::sync::MutexGuard<'_, Made> {
        self.made.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// A buffer of zeros if it is mapped.
    pub fn buffer(&self, size: u64, usage: u32, mapped: bool) -> Outcome<Buffer> {
        type Flags = vk::MemoryPropertyFlags;
        let wanted = if mapped { Flags::HOST_VISIBLE | Flags::HOST_COHERENT } else { Flags::DEVICE_LOCAL };
        let flags = vk::BufferUsageFlags::from_bits_truncate(usage);
        unsafe {
            let raw = self.device.create_buffer(&vk::BufferCreateInfo::builder().size(size).usage(flags), None)?;
            let room = self.device.get_buffer_memory_requirements(raw);
            let types = self.instance.get_physical_device_memory_properties(self.physical);
            let fits = |&i: &u32| {
                let kind = types.memory_types[i as usize].property_flags;
                room.memory_type_bits >> i & 1 == 1 && kind.contains(wanted)
            };
            let index = (0..types.memory_type_count).find(fits).ok_or("no such memory")?;
            let info = vk::MemoryAllocateInfo::builder().allocation_size(room.size).memory_type_index(index);
            let memory = self.device.allocate_memory(&info, None)?;
            self.made().buffers.push((raw, memory));
            self.device.bind_buffer_memory(raw, memory, 0)?;
            let mut buffer = Buffer { raw, size, usage, mapped: std::ptr::null_mut() };
            if mapped {
                let flags = vk::MemoryMapFlags::empty();
                buffer.mapped = self.device.map_memory(memory, 0, vk::WHOLE_SIZE, flags)?.cast();
                buffer.bytes().fill(0);
            }
            Ok(buffer)
        }
    }

    /// A kernel in WGSL over (buffer, offset, bytes), bindings 0, 1, ... of group 0.
    pub fn kernel(&self, source: &str, buffers: &[(vk::Buffer, u64, u64)]) -> Outcome<Kernel> {
        let code = compile(source)?;
        let count = buffers.len() as u32;
        let (kind, device) = (vk::DescriptorType::STORAGE_BUFFER, &self.device);
        let binding = |i| {
            vk::DescriptorSetLayoutBinding::builder()
                .binding(i)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = (0..count).map(binding).collect();
        unsafe {
            let info = vk::DescriptorSetLayoutCreateInfo::builder().bindings(&bindings);
            let sets = [device.create_descriptor_set_layout(&info, None)?];
            let layout =
                device.create_pipeline_layout(&vk::PipelineLayoutCreateInfo::builder().set_layouts(&sets), None)?;
            let sizes = [vk::DescriptorPoolSize::builder().type_(kind).descriptor_count(count)];
            let info = vk::DescriptorPoolCreateInfo::builder().max_sets(1).pool_sizes(&sizes);
            let pool = device.create_descriptor_pool(&info, None)?;
            let info = vk::ShaderModuleCreateInfo::builder().code_size(4 * code.len()).code(&code);
            let module = device.create_shader_module(&info, None)?;
            let stage = vk::PipelineShaderStageCreateInfo::builder()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(b"main\0");
            let info = [vk::ComputePipelineCreateInfo::builder().stage(stage).layout(layout)];
            let (pipelines, _) = device.create_compute_pipelines(vk::PipelineCache::null(), &info, None)?;
            device.destroy_shader_module(module, None);
            self.made().kernels.push((pipelines[0], layout, sets[0], pool));
            let info = vk::DescriptorSetAllocateInfo::builder().descriptor_pool(pool).set_layouts(&sets);
            let set = device.allocate_descriptor_sets(&info)?[0];
            for (i, &(buffer, offset, range)) in (0..).zip(buffers) {
                let part = [vk::DescriptorBufferInfo::builder().buffer(buffer).offset(offset).range(range)];
                let write = vk::WriteDescriptorSet::builder()
                    .dst_set(set)
                    .dst_binding(i)
                    .descriptor_type(kind)
                    .buffer_info(&part);
                device.update_descriptor_sets(&[write], &[] as &[vk::CopyDescriptorSet]);
            }
            Ok(Kernel { pipeline: pipelines[0], layout, set })
        }
    }

    /// A command buffer that records, to be submitted as often as one likes.
    pub fn begin(&self) -> Outcome<vk::CommandBuffer> {
        let info = vk::CommandBufferAllocateInfo::builder().command_pool(self.pool).command_buffer_count(1);
        unsafe {
            let commands = self.device.allocate_command_buffers(&info)?[0];
            let flags = vk::CommandBufferUsageFlags::SIMULTANEOUS_USE;
            self.device.begin_command_buffer(commands, &vk::CommandBufferBeginInfo::builder().flags(flags))?;
            Ok(commands)
        }
    }

    pub fn end(&self, commands: vk::CommandBuffer) -> Outcome<()> {
        Ok(unsafe { self.device.end_command_buffer(commands) }?)
    }

    /// Submits ended commands several times, and waits once.
    pub fn run(&self, commands: vk::CommandBuffer, times: usize) -> Outcome<()> {
        let buffers = [commands];
        let submission = [vk::SubmitInfo::builder().command_buffers(&buffers)];
        unsafe {
            for _ in 0..times {
                self.device.queue_submit(self.queue, &submission, vk::Fence::null())?;
            }
            Ok(self.device.queue_wait_idle(self.queue)?)
        }
    }

    /// Ends commands, runs them once and waits.
    pub fn submit(&self, commands: vk::CommandBuffer) -> Outcome<()> {
        self.end(commands)?;
        self.run(commands, 1)
    }

    /// Records a kernel over `elements` elements.
    pub fn dispatch(&self, commands: vk::CommandBuffer, (kernel, elements): (&Kernel, u64)) {
        let (device, point) = (&self.device, vk::PipelineBindPoint::COMPUTE);
        unsafe {
            device.cmd_bind_pipeline(commands, point, kernel.pipeline);
            device.cmd_bind_descriptor_sets(commands, point, kernel.layout, 0, &[kernel.set], &[]);
            device.cmd_dispatch(commands, elements.div_ceil(64) as u32, 1, 1);
        }
    }

    /// Lets the host read what kernels and copies wrote before this barrier, and write it anew.
    pub fn barrier_to_host(&self, commands: vk::CommandBuffer) {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        let barrier = [vk::MemoryBarrier::builder()
            .src_access_mask(A::SHADER_WRITE | A::TRANSFER_WRITE)
            .dst_access_mask(A::HOST_READ | A::HOST_WRITE)];
        let (from, none) = (S::COMPUTE_SHADER | S::TRANSFER, vk::DependencyFlags::empty());
        let (buffers, images): (&[vk::BufferMemoryBarrier], &[vk::ImageMemoryBarrier]) = (&[], &[]);
        unsafe { self.device.cmd_pipeline_barrier(commands, from, S::HOST, none, &barrier, buffers, images) };
    }

    /// Destroys everything; nothing may run. Returns what the validation layer said.
    pub fn close(self) -> Vec<String> {
        let made = std::mem::take(&mut *self.made());
        unsafe {
            for (pipeline, layout, sets, pool) in made.kernels {
                self.device.destroy_pipeline(pipeline, None);
                self.device.destroy_pipeline_layout(layout, None);
                self.device.destroy_descriptor_set_layout(sets, None);
                self.device.destroy_descriptor_pool(pool, None);
            }
            for (buffer, memory) in made.buffers {
                self.device.destroy_buffer(buffer, None);
                self.device.free_memory(memory, None);
            }
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            if let Some(messenger) = self.messenger {
                self.instance.destroy_debug_utils_messenger_ext(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
        std::mem::take(&mut *MESSAGES.lock().unwrap_or_else(|e| e.into_inner()))
    }
}

impl Buffer {
    /// Its bytes. The device uses them only between submission and wait.
    pub fn bytes(&mut self) -> &mut [u8] {
        if self.mapped.is_null() {
            return &mut [];
        }
        unsafe { std::slice::from_raw_parts_mut(self.mapped, self.size as usize) }
    }

    pub fn write(&mut self, bytes: &[u8]) {
        self.bytes()[..bytes.len()].copy_from_slice(bytes);
    }
}

fn messenger(instance: &Instance) -> Outcome<vk::DebugUtilsMessengerEXT> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Kind};
    let info = vk::DebugUtilsMessengerCreateInfoEXT::builder()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Kind::VALIDATION | Kind::GENERAL)
        .user_callback(Some(on_message));
    Ok(unsafe { instance.create_debug_utils_messenger_ext(&info, None) }?)
}

/// WGSL to SPIR-V.
fn compile(source: &str) -> Outcome<Vec<u32>> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), Default::default());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    Ok(naga::back::spv::write_vec(&module, &info, &naga::back::spv::Options::default(), None)?)
}
