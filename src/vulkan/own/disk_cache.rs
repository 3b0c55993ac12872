//! The pipeline cache of a device of ours, kept in a file for the next process. Failures of the disk are ignored, because
//! it is only a cache.

use super::super::device::Device;
use super::super::result::Named;
use crate::Result;
use ash::vk;
use std::{
    fs, io,
    io::{Read, Write},
    path::{Path, PathBuf},
};

/// Where compiled kernels are kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CacheFolder {
    /// `softras` in the user's cache folder.
    #[default]
    User,
    /// This folder.
    At(PathBuf),
    /// Nowhere.
    Nowhere,
}

/// The first bytes of our files; a checksum of the driver's data follows.
const MAGIC: &[u8; 8] = b"softras1";

/// The most bytes of a file that is read; drivers write a few hundred kilobytes.
const MOST: u64 = 64 << 20;

/// A VkPipelineCache of ours and the file that it is loaded from and saved to.
pub(in crate::vulkan) struct DiskCache {
    device: Device,
    raw: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Checksum of what the file held when it was read.
    loaded: u64,
}

impl DiskCache {
    /// A cache filled from the folder's file for this device and driver.
    pub(in crate::vulkan) fn new(device: &Device, folder: &CacheFolder) -> Result<Self> {
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
        device.name_object(raw, "pipeline cache");
        Ok(Self { device: device.clone(), raw, file, loaded: checksum(&data) })
    }

    pub(in crate::vulkan) fn raw(&self) -> vk::PipelineCache {
        self.raw
    }

    /// Writes the file, if anything changed.
    fn save(&self) {
        let Some(file) = &self.file else { return };
        // SAFETY: the cache is ours and lives.
        let Ok(data) = (unsafe { self.device.raw().get_pipeline_cache_data(self.raw) }) else { return };
        let sum = checksum(&data);
        if data.is_empty() || sum == self.loaded {
            return;
        }
        let bytes = [&MAGIC[..], &sum.to_le_bytes(), &data].concat();
        if let Some(folder) = file.parent()
            && fs::create_dir_all(folder).is_ok()
        {
            _ = replace(file, folder, &bytes);
        }
    }
}

impl Drop for DiskCache {
    fn drop(&mut self) {
        self.save();
        // SAFETY: the cache is ours; pipelines made with it do not need it any more.
        unsafe { self.device.raw().destroy_pipeline_cache(self.raw, None) };
    }
}

/// The driver's data in a file of ours, if it is complete and of this device and driver.
fn load(file: &Path, properties: &vk::PhysicalDeviceProperties) -> Option<Vec<u8>> {
    // Opening a pipe in the file's place might never end.
    if !fs::metadata(file).is_ok_and(|metadata| metadata.is_file() && metadata.len() <= MOST) {
        return None;
    }
    let mut bytes = Vec::new();
    fs::File::open(file).ok()?.take(MOST).read_to_end(&mut bytes).ok()?;
    let (sum, data) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<8>()?;
    (u64::from_le_bytes(*sum) == checksum(data) && is_header_of(data, properties)).then(|| data.to_vec())
}

/// Writes the file whole: another process reads the old one or the new one.
fn replace(file: &Path, folder: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut new = tempfile::NamedTempFile::new_in(folder)?;
    new.write_all(bytes)?;
    new.persist(file).map(drop).map_err(|error| error.error)
}

/// Whether the data begins with VkPipelineCacheHeaderVersionOne for this device.
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

/// The FNV-1a hash.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// `softras` in the user's cache folder, where the environment names one.
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
