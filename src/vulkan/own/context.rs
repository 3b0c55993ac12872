//! A device of our own: opened, selected, with memory, a queue and a pipeline cache.

use super::super::adapter::DeviceInfo;
use super::super::cache::PipelineCache;
use super::super::device::Device;
use super::super::result::Named;
use super::allocation::{allocator, direct_types};
use super::disk_cache::CacheFolder;
use super::instance::Instance;
use super::loader::Loader;
use super::select;
use super::validation::ValidationLog;
use crate::Result;
use ash::vk;
use gpu_allocator::vulkan::Allocator;
use std::sync::{Arc, Mutex};

/// How to open a device.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// An index, or part of a name in any case. `None`: the device that SOFTRAS_DEVICE names, else the best one:
    /// discrete GPUs come before integrated, virtual and software ones.
    pub device: Option<String>,
    /// Run under the validation layer with its checks of synchronization and best practices. SOFTRAS_VALIDATION=1 turns it on as well.
    pub validation: bool,
    /// Where compiled kernels are kept for the next process.
    pub cache: CacheFolder,
    /// The Vulkan loader; `None`: the driver that SOFTRAS_DRIVER names, else the system's loader.
    pub loader: Option<Loader>,
}

/// A device of our own, with its memory, its queue and its pipeline cache.
///
/// Buffers and command buffers share what they need of it, so they may outlive it.
pub struct Context {
    // Dropped in this order: the cache is written while the device lives.
    cache: PipelineCache,
    info: DeviceInfo,
    shared: Arc<ContextInner>,
}

/// The part of a context that buffers and command buffers need.
pub(super) struct ContextInner {
    // Before the device: dropping the allocator frees its memory.
    pub(super) allocator: Mutex<Allocator>,
    /// Only one thread at a time may submit.
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    /// Bits of the memory types that are device-local and that the host maps, coherent and cached, where reading and
    /// writing them costs the host nothing. Zero on a discrete GPU.
    pub(super) direct_types: u32,
    pub(super) device: Device,
}

impl Loader {
    /// Its devices, suitable or not, as [`Renderer::devices`](crate::Renderer::devices).
    ///
    /// # Errors
    /// [`crate::Error::NoDevice`]; [`crate::Error::Vulkan`].
    pub fn devices(&self) -> Result<Vec<DeviceInfo>> {
        Context::devices(Some(self))
    }
}

impl Context {
    /// Opens a device.
    pub fn new(options: &ContextOptions) -> Result<Self> {
        let instance = Instance::new(options.loader.as_ref(), options.validation || validation_by_environment())?;
        let environment = std::env::var("SOFTRAS_DEVICE").ok();
        let selector = options.device.as_deref().or(environment.as_deref());
        let adapter = select::select(select::list(&instance)?, selector)?;
        // A suitable device has such a family.
        let queue_family = adapter.queue_family.unwrap_or(0);
        // SAFETY: device and family were listed by this instance.
        let device =
            unsafe { Device::create(instance, adapter.physical, queue_family, adapter.info.limits, adapter.info.kind) }
                .named("vkCreateDevice")?;
        device.name_object(device.raw().handle(), "device");
        let allocator = allocator(&device)?;
        // SAFETY: the device was made with one queue of this family.
        let queue = unsafe { device.raw().get_device_queue(queue_family, 0) };
        device.name_object(queue, "queue");
        let cache = PipelineCache::in_folder(&device, &options.cache)?;
        let shared = Arc::new(ContextInner {
            allocator: Mutex::new(allocator),
            queue: Mutex::new(queue),
            queue_family,
            direct_types: direct_types(&device, adapter.info.kind),
            device,
        });
        Ok(Self { cache, info: adapter.info, shared })
    }

    /// All devices of a loader, suitable or not; `None` as in [`ContextOptions::loader`].
    pub fn devices(loader: Option<&Loader>) -> Result<Vec<DeviceInfo>> {
        let instance = Instance::new(loader, false)?;
        Ok(select::list(&instance)?.into_iter().map(|a| a.info).collect())
    }

    /// The device, for pipelines, descriptors and recording.
    pub fn device(&self) -> &Device {
        &self.shared.device
    }

    /// Which device it is.
    pub fn info(&self) -> &DeviceInfo {
        &self.info
    }

    /// The cache to make pipelines with.
    pub fn pipeline_cache(&self) -> &PipelineCache {
        &self.cache
    }

    /// The family of the queue, as [`TimestampPool`](crate::vulkan::TimestampPool) asks for.
    pub fn queue_family(&self) -> u32 {
        self.shared.queue_family
    }

    /// Whether validation is on.
    pub fn validates(&self) -> bool {
        self.device().owned_instance().is_some_and(Instance::validates)
    }

    /// All validation warnings and errors so far; they were printed to stderr as well.
    pub fn validation_messages(&self) -> Vec<String> {
        self.validation_log().messages()
    }

    /// The log of these messages, readable after the context is gone.
    pub fn validation_log(&self) -> ValidationLog {
        self.device().owned_instance().map(|instance| instance.log.clone()).unwrap_or_default()
    }

    pub(super) fn shared(&self) -> &Arc<ContextInner> {
        &self.shared
    }
}

impl std::fmt::Debug for Context {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Context").field("device", &self.info.name).field("validates", &self.validates()).finish()
    }
}

fn validation_by_environment() -> bool {
    std::env::var("SOFTRAS_VALIDATION").is_ok_and(|value| !matches!(value.as_str(), "" | "0"))
}
