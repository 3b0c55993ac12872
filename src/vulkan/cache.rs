//! Compiled kernels, kept for the next process. All failures of the disk are ignored: it is only a cache.

use super::context::CacheFolder;
use super::device::Device;
use super::host::HostDevice;
use super::result::Named;
use crate::Result;
use ash::vk;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// What our files begin with; a checksum of the driver's data follows.
const MAGIC: &[u8; 8] = b"softras1";

/// Compiled kernels: ours, with a file behind it, or a host's.
#[derive(Clone)]
pub struct PipelineCache(Arc<Inner>);

struct Inner {
    device: Device,
    raw: vk::PipelineCache,
    /// Ours to destroy.
    owned: bool,
    file: Option<PathBuf>,
    /// Checksum of what the file held when it was read.
    loaded: u64,
}

impl PipelineCache {
    /// A host's cache, which stays the host's to save and to destroy; none where the host gives none.
    pub fn of_host(device: &Device, host: &HostDevice) -> Option<Self> {
        let raw = host.pipeline_cache;
        let inner = || Inner { device: device.clone(), raw, owned: false, file: None, loaded: 0 };
        (raw != vk::PipelineCache::null()).then(|| Self(Arc::new(inner())))
    }

    /// A cache of ours, filled from the folder's file for this device and driver.
    pub fn in_folder(device: &Device, folder: &CacheFolder) -> Result<Self> {
        let folder = match folder {
            CacheFolder::User => user_folder(),
            CacheFolder::At(folder) => Some(folder.clone()),
            CacheFolder::Nowhere => None,
        };
        // SAFETY: the physical device is the instance's.
        let properties = unsafe { device.instance().get_physical_device_properties(device.physical_device()) };
        let file = folder.map(|folder| folder.join(file_name(&properties)));
        let data = file.as_deref().and_then(|file| load(file, &properties)).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the data is what this driver once gave us (checked by checksum, header and name), or empty.
        let raw = unsafe { device.raw().create_pipeline_cache(&info, None) }.named("vkCreatePipelineCache")?;
        device.name_object(raw, "softras");
        let loaded = checksum(&data);
        Ok(Self(Arc::new(Inner { device: device.clone(), raw, owned: true, file, loaded })))
    }

    /// Writes the file now, if anything changed. Done by the last drop as well.
    pub fn save(&self) {
        self.0.save();
    }

    /// The file, if there is one.
    pub fn file(&self) -> Option<&Path> {
        self.0.file.as_deref()
    }

    /// The handle, valid as long as this cache lives.
    pub fn raw(&self) -> vk::PipelineCache {
        self.0.raw
    }
}

impl Inner {
    fn save(&self) {
        let Some(file) = &self.file else { return };
        // SAFETY: the cache is ours and lives.
        let Ok(data) = (unsafe { self.device.raw().get_pipeline_cache_data(self.raw) }) else { return };
        let sum = checksum(&data);
        if data.is_empty() || sum == self.loaded {
            return;
        }
        let bytes = [&MAGIC[..], &sum.to_le_bytes(), &data].concat();
        _ = write_whole(file, &bytes);
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        if self.owned {
            self.save();
            // SAFETY: the cache is ours; pipelines made with it don't need it any more.
            unsafe { self.device.raw().destroy_pipeline_cache(self.raw, None) };
        }
    }
}

impl std::fmt::Debug for PipelineCache {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PipelineCache").field("file", &self.0.file).field("owned", &self.0.owned).finish()
    }
}

/// Writes a file so that nobody ever sees half of it.
fn write_whole(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let unique = format!("{}-{}.tmp", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let temporary = file.with_extension(unique);
    let result = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, file));
    if result.is_err() {
        _ = std::fs::remove_file(&temporary);
    }
    result
}

/// The driver's data in a file of ours, if it is whole and of this device and driver.
fn load(file: &Path, properties: &vk::PhysicalDeviceProperties) -> Option<Vec<u8>> {
    let bytes = std::fs::read(file).ok()?;
    let (sum, data) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    (u64::from_le_bytes(*sum) == checksum(data) && is_header_of(data, properties)).then(|| data.to_vec())
}

/// The data begins with VkPipelineCacheHeaderVersionOne for this device.
fn is_header_of(data: &[u8], properties: &vk::PhysicalDeviceProperties) -> bool {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_ne_bytes([b[0], b[1], b[2], b[3]]));
    word(0).is_some_and(|length| length >= 32)
        && word(4) == Some(1)
        && word(8) == Some(properties.vendor_id)
        && word(12) == Some(properties.device_id)
        && data.get(16..32) == Some(&properties.pipeline_cache_uuid[..])
}

/// One file for each device, driver and version of this crate.
fn file_name(properties: &vk::PhysicalDeviceProperties) -> String {
    let mut identity = env!("CARGO_PKG_VERSION").as_bytes().to_vec();
    for word in [properties.vendor_id, properties.device_id, properties.driver_version] {
        identity.extend(word.to_le_bytes());
    }
    identity.extend(properties.pipeline_cache_uuid);
    format!("pipelines-{:016x}.bin", checksum(&identity))
}

/// FNV-1a.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// `softras` in the user's cache folder, where the environment tells of one.
fn user_folder() -> Option<PathBuf> {
    let folder = |variable: &str| std::env::var_os(variable).map(PathBuf::from).filter(|p| p.is_absolute());
    let base = if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        folder("HOME").map(|home| home.join("Library/Caches"))
    } else {
        folder("XDG_CACHE_HOME").or_else(|| folder("HOME").map(|home| home.join(".cache")))
    };
    base.map(|base| base.join("softras"))
}
