//! The pipeline cache that kernels are compiled with: a host's, or ours with a file behind it.

use super::device::Device;
use super::host::HostDevice;
#[cfg(feature = "renderer")]
use super::own::DiskCache;
use ash::vk;
use std::sync::Arc;

/// A pipeline cache of a device. Cheap to clone.
#[derive(Clone)]
pub struct PipelineCache(Arc<CacheInner>);

struct CacheInner {
    device: Device,
    raw: vk::PipelineCache,
    /// Saves and destroys a cache of ours when it is dropped.
    #[cfg(feature = "renderer")]
    _disk: Option<DiskCache>,
}

impl PipelineCache {
    /// A host's cache, which the host saves and destroys; `None` where the host gives none.
    pub fn of_host(device: &Device, host: &HostDevice) -> Option<Self> {
        let raw = host.pipeline_cache;
        let inner = || CacheInner {
            device: device.clone(),
            raw,
            #[cfg(feature = "renderer")]
            _disk: None,
        };
        (raw != vk::PipelineCache::null()).then(|| Self(Arc::new(inner())))
    }

    /// A cache of ours, filled from the folder's file for this device and driver.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], [`crate::Error::OutOfMemory`].
    #[cfg(feature = "renderer")]
    pub fn in_folder(device: &Device, folder: &super::own::CacheFolder) -> crate::Result<Self> {
        let disk = DiskCache::new(device, folder)?;
        Ok(Self(Arc::new(CacheInner { device: device.clone(), raw: disk.raw(), _disk: Some(disk) })))
    }

    /// The handle, valid as long as this cache lives.
    pub fn raw(&self) -> vk::PipelineCache {
        self.0.raw
    }

    /// The device that it is of.
    pub(super) fn device(&self) -> &Device {
        &self.0.device
    }
}

impl std::fmt::Debug for PipelineCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "PipelineCache({:?})", self.0.raw)
    }
}
