//! A minimal headless engine on ash: an instance, a device, a queue, memory from gpu-allocator, kernels and shaders
//! written in WGSL. It knows nothing of softras, but for [`Engine::host_device`].
// An example of raw Vulkan has no other way; each block is a call whose arguments were made a few lines above it, and
// everything is destroyed in `Drop` once the device is idle. Not every user needs every part.
#![allow(unsafe_code, dead_code, missing_docs, unused_imports, clippy::undocumented_unsafe_blocks)]

mod shader;
mod validation;

pub use shader::{Compute, Overlay};
use validation::{Log, messenger_info};

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme, Allocator, AllocatorCreateDesc};
use softras::embed::{BufferRef, HostAdapter, HostCommands, HostDevice, changing_devices};
use std::sync::{Arc, Mutex};

pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The device and all that is needed to use it.
pub struct Engine {
    core: Arc<Core>,
    pub queue: vk::Queue,
    pub family: u32,
}

/// The handles and the allocator that every object of the engine keeps alive.
pub struct Core {
    pub device: ash::Device,
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    entry: ash::Entry,
    allocator: Mutex<Option<Allocator>>,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    log: Arc<Log>,
}

/// A buffer with its memory.
pub struct Buffer {
    pub raw: vk::Buffer,
    pub size: u64,
    pub usage: vk::BufferUsageFlags,
    allocation: Option<Allocation>,
    core: Arc<Core>,
}

/// A colour image with its memory and a view.
pub struct Image {
    pub raw: vk::Image,
    pub view: vk::ImageView,
    allocation: Option<Allocation>,
    core: Arc<Core>,
}

/// A command buffer and a fence: one frame in flight needs both.
pub struct Commands {
    pub raw: vk::CommandBuffer,
    pool: vk::CommandPool,
    fence: vk::Fence,
    core: Arc<Core>,
}

impl Engine {
    /// Opens the first device with a queue that draws and computes; with `validation`, under the validation layer with its
    /// checks of synchronisation and best practices.
    pub fn new(validation: bool) -> Outcome<Self> {
        Self::open(validation, false)
    }

    /// Opens a device as [`new`](Self::new) does, with every feature that Vulkan 1.0 knows and the device has.
    pub fn with_features(validation: bool) -> Outcome<Self> {
        Self::open(validation, true)
    }

    fn open(validation: bool, features: bool) -> Outcome<Self> {
        let entry = unsafe { ash::Entry::load() }?;
        let log = Arc::new(Log::default());
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        // Tests make and destroy many engines at once; a program with one device does not need this lock.
        let turn = changing_devices();
        let instance = match validation {
            true => unsafe { validation::instance(&entry, info, &log) }?,
            false => unsafe { entry.create_instance(&info, None) }?,
        };
        drop(turn);
        let messenger = if validation {
            let functions = ash::ext::debug_utils::Instance::new(&entry, &instance);
            let handle = unsafe { functions.create_debug_utils_messenger(&messenger_info(&log), None) }?;
            Some((functions, handle))
        } else {
            None
        };
        let (physical, family) = choose(&instance)?;
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let all = unsafe { instance.get_physical_device_features(physical) };
        let enabled = if features { all } else { vk::PhysicalDeviceFeatures::default() };
        let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_features(&enabled);
        let device = {
            let _turn = changing_devices();
            unsafe { instance.create_device(physical, &info, None) }?
        };
        let queue = unsafe { device.get_device_queue(family, 0) };
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.clone(),
            device: device.clone(),
            physical_device: physical,
            debug_settings: Default::default(),
            buffer_device_address: false,
            allocation_sizes: Default::default(),
        })?;
        let allocator = Mutex::new(Some(allocator));
        let core = Arc::new(Core { device, instance, physical, entry, allocator, messenger, log });
        Ok(Self { core, queue, family })
    }

    /// The physical device as softras takes it, which needs no device yet.
    pub fn host_adapter(&self) -> HostAdapter {
        let Core { instance, physical, .. } = &*self.core;
        unsafe { HostAdapter::new(self.core.get_instance_proc_addr(), instance.handle(), *physical) }
    }

    /// All that softras needs to know of this engine.
    pub fn host_device(&self) -> HostDevice {
        let host = unsafe { HostDevice::new(self.host_adapter(), self.core.device.handle()) };
        if self.core.messenger.is_some() { unsafe { host.with_debug_utils() } } else { host }
    }

    /// The messages of the validation layer; readable when the engine is gone.
    pub fn log(&self) -> Arc<Log> {
        self.core.log.clone()
    }

    pub fn device(&self) -> &ash::Device {
        &self.core.device
    }

    pub fn core(&self) -> &Arc<Core> {
        &self.core
    }

    pub fn buffer(&self, size: u64, usage: vk::BufferUsageFlags, location: MemoryLocation) -> Outcome<Buffer> {
        let core = self.core.clone();
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        let raw = unsafe { core.device.create_buffer(&info, None) }?;
        let mut made = Buffer { raw, size, usage, allocation: None, core };
        let requirements = unsafe { made.core.device.get_buffer_memory_requirements(raw) };
        let allocation = made.core.allocate(requirements, location, true)?;
        unsafe { made.core.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }?;
        made.allocation = Some(allocation);
        Ok(made)
    }

    /// An RGBA float image to store into, to draw on and to copy from.
    pub fn image(&self, width: u32, height: u32) -> Outcome<Image> {
        let usage = vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::TRANSFER_SRC;
        let usage = usage | vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::COLOR_ATTACHMENT;
        self.image_of(vk::Format::R32G32B32A32_SFLOAT, (width, height), usage)
    }

    pub fn image_of(&self, format: vk::Format, size: (u32, u32), usage: vk::ImageUsageFlags) -> Outcome<Image> {
        let core = self.core.clone();
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: size.0, height: size.1, depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(usage);
        let raw = unsafe { core.device.create_image(&info, None) }?;
        let mut made = Image { raw, view: vk::ImageView::null(), allocation: None, core };
        let requirements = unsafe { made.core.device.get_image_memory_requirements(raw) };
        let allocation = made.core.allocate(requirements, MemoryLocation::GpuOnly, false)?;
        unsafe { made.core.device.bind_image_memory(raw, allocation.memory(), allocation.offset()) }?;
        made.allocation = Some(allocation);
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(color_range());
        made.view = unsafe { made.core.device.create_image_view(&info, None) }?;
        Ok(made)
    }

    pub fn commands(&self) -> Outcome<Commands> {
        let device = &self.core.device;
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(self.family);
        let pool = unsafe { device.create_command_pool(&info, None) }?;
        let fence = vk::FenceCreateInfo::default().flags(vk::FenceCreateFlags::SIGNALED);
        let fence = unsafe { device.create_fence(&fence, None) }?;
        let mut made = Commands { raw: vk::CommandBuffer::null(), pool, fence, core: self.core.clone() };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        made.raw = unsafe { device.allocate_command_buffers(&info) }?[0];
        Ok(made)
    }

    /// Ends a frame's commands and hands them to the queue; does not wait.
    pub fn submit(&self, commands: &Commands) -> Outcome<()> {
        let device = &self.core.device;
        let buffers = [commands.raw];
        let submits = [vk::SubmitInfo::default().command_buffers(&buffers)];
        unsafe {
            device.end_command_buffer(commands.raw)?;
            device.reset_fences(&[commands.fence])?;
            device.queue_submit(self.queue, &submits, commands.fence)?;
        }
        Ok(())
    }

    /// Ends a frame's commands; they are thrown away by the next [`Commands::begin`].
    pub fn end(&self, commands: &Commands) -> Outcome<()> {
        Ok(unsafe { self.core.device.end_command_buffer(commands.raw) }?)
    }

    pub fn wait_idle(&self) -> Outcome<()> {
        Ok(unsafe { self.core.device.device_wait_idle() }?)
    }
}

impl Commands {
    /// Waits until the device is done with what was submitted last, and begins anew.
    pub fn begin(&self) -> Outcome<vk::CommandBuffer> {
        self.wait()?;
        let device = &self.core.device;
        unsafe {
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty())?;
            device.begin_command_buffer(self.raw, &vk::CommandBufferBeginInfo::default())?;
        }
        Ok(self.raw)
    }

    /// The begun command buffer as softras takes it. Keep all that is recorded until it has been waited for.
    pub fn host(&self) -> HostCommands {
        unsafe { HostCommands::new(self.raw) }
    }

    pub fn wait(&self) -> Outcome<()> {
        Ok(unsafe { self.core.device.wait_for_fences(&[self.fence], true, u64::MAX) }?)
    }
}

impl Buffer {
    /// The buffer as softras takes it. It must outlive what it is bound to.
    pub fn whole(&self) -> BufferRef {
        unsafe { BufferRef::new(self.raw, self.size, self.usage) }
    }

    /// The mapped bytes of a buffer in the host's memory.
    pub fn bytes(&self) -> &[u8] {
        self.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default()
    }

    pub fn bytes_mut(&mut self) -> &mut [u8] {
        self.allocation.as_mut().and_then(Allocation::mapped_slice_mut).unwrap_or_default()
    }

    pub fn write(&mut self, offset: u64, bytes: &[u8]) {
        let start = offset as usize;
        self.bytes_mut()[start..start + bytes.len()].copy_from_slice(bytes);
    }

    pub fn floats(&self, offset: u64, count: usize) -> Vec<f32> {
        let bytes = &self.bytes()[offset as usize..offset as usize + 4 * count];
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }
}

impl Core {
    pub fn get_instance_proc_addr(&self) -> vk::PFN_vkGetInstanceProcAddr {
        self.entry.static_fn().get_instance_proc_addr
    }

    fn allocate(
        &self,
        requirements: vk::MemoryRequirements,
        location: MemoryLocation,
        linear: bool,
    ) -> Outcome<Allocation> {
        let mut allocator = self.allocator.lock().map_err(|e| e.to_string())?;
        let allocation_scheme = AllocationScheme::GpuAllocatorManaged;
        let desc = AllocationCreateDesc { name: "engine", requirements, location, linear, allocation_scheme };
        Ok(allocator.as_mut().ok_or("the allocator is gone")?.allocate(&desc)?)
    }

    fn free(&self, allocation: Option<Allocation>) {
        if let (Ok(mut allocator), Some(allocation)) = (self.allocator.lock(), allocation) {
            _ = allocator.as_mut().map(|allocator| allocator.free(allocation));
        }
    }
}

impl Drop for Core {
    fn drop(&mut self) {
        if let Ok(mut allocator) = self.allocator.lock() {
            *allocator = None;
        }
        unsafe {
            let _turn = changing_devices();
            self.device.destroy_device(None);
            if let Some((functions, handle)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(handle, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        unsafe { self.core.device.destroy_buffer(self.raw, None) };
        self.core.free(self.allocation.take());
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        unsafe {
            self.core.device.destroy_image_view(self.view, None);
            self.core.device.destroy_image(self.raw, None);
        }
        self.core.free(self.allocation.take());
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        _ = self.wait();
        unsafe {
            self.core.device.destroy_fence(self.fence, None);
            self.core.device.destroy_command_pool(self.pool, None);
        }
    }
}

pub fn color_range() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1)
}

fn choose(instance: &ash::Instance) -> Outcome<(vk::PhysicalDevice, u32)> {
    let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let found = {
        let _turn = changing_devices();
        unsafe { instance.enumerate_physical_devices() }?
    };
    for physical in found {
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        if let Some(family) = families.iter().position(|f| f.queue_flags.contains(wanted)) {
            return Ok((physical, family as u32));
        }
    }
    Err("no device both draws and computes".into())
}
