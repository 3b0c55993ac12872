//! Timestamps that the device writes between stages.

use super::device::Device;
use super::keep::Kept;
use super::result::{Named, misuse_of};
use crate::Result;
use ash::vk;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A row of timestamps that a command buffer writes and the host reads once it has been executed.
#[derive(Clone)]
pub struct TimestampPool(pub(super) Arc<TimestampInner>);

pub(super) struct TimestampInner {
    device: Device,
    raw: vk::QueryPool,
    family: u32,
    count: u32,
    /// The bits of a timestamp that count; it wraps around.
    mask: u64,
    /// Commands that reset the pool have been executed: before, its content is undefined.
    executed: Arc<AtomicBool>,
}

impl TimestampPool {
    /// Makes room for `count` timestamps, written on queues of this family; `None` where the family has no timestamps.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`], [`crate::Error::OutOfMemory`].
    pub fn new(device: &Device, queue_family: u32, count: u32) -> Result<Option<Self>> {
        // SAFETY: the physical device is the instance's.
        let families =
            unsafe { device.instance().get_physical_device_queue_family_properties(device.physical_device()) };
        let bits = families.get(queue_family as usize).map_or(0, |family| family.timestamp_valid_bits);
        if bits == 0 || device.limits().timestamp_period <= 0.0 {
            return Ok(None);
        }
        let count = count.max(1);
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(count);
        // SAFETY: a plain creation; `TimestampInner` destroys it.
        let raw = unsafe { device.raw().create_query_pool(&info, device.callbacks()) }.named("vkCreateQueryPool")?;
        device.name_object(raw, "timestamps");
        let mask = u64::MAX >> 64u32.saturating_sub(bits);
        let executed = Arc::default();
        let inner = TimestampInner { device: device.clone(), raw, family: queue_family, count, mask, executed };
        Ok(Some(Self(Arc::new(inner))))
    }

    /// How many there is room for.
    pub fn count(&self) -> u32 {
        self.0.count
    }

    /// The first `count` timestamps in milliseconds since the first one.
    ///
    /// # Errors
    /// [`crate::Error::Vulkan`] with VK_NOT_READY unless all of them have been written.
    pub fn read(&self, count: u32) -> Result<Vec<f64>> {
        let TimestampInner { device, raw, mask, executed, .. } = &*self.0;
        if !executed.load(Ordering::Acquire) {
            return Err(misuse_of("vkGetQueryPoolResults", "VK_NOT_READY: no timestamp was written yet"));
        }
        let mut ticks = vec![0u64; count.min(self.0.count) as usize];
        if ticks.is_empty() {
            return Ok(Vec::new());
        }
        // SAFETY: the pool lives, was reset, and has at least as many queries as `ticks` has elements.
        unsafe { device.raw().get_query_pool_results(*raw, 0, &mut ticks, vk::QueryResultFlags::TYPE_64) }
            .named("vkGetQueryPoolResults")?;
        let period = f64::from(device.limits().timestamp_period) * 1e-6;
        Ok(ticks.iter().map(|t| (t.wrapping_sub(ticks[0]) & mask) as f64 * period).collect())
    }
}

impl std::fmt::Debug for TimestampPool {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "TimestampPool({})", self.0.count)
    }
}

impl Kept for TimestampInner {
    #[cfg(feature = "renderer")]
    fn uses(&self, uses: &mut super::keep::Uses) {
        uses.timestamps.push(self.executed.clone());
    }
}

impl TimestampInner {
    pub(super) fn is_of(&self, device: &Device) -> bool {
        self.device.raw().handle() == device.raw().handle()
    }

    pub(super) fn family(&self) -> u32 {
        self.family
    }

    pub(super) fn raw(&self) -> vk::QueryPool {
        self.raw
    }
}

impl Drop for TimestampInner {
    fn drop(&mut self) {
        // SAFETY: the pool is ours; what recorded it kept this Inner until the device was done.
        unsafe { self.device.raw().destroy_query_pool(self.raw, self.device.callbacks()) };
    }
}
