//! Recording of work into a command buffer, ours or a host's.

use super::buffer_part::BufferPart;
use super::descriptors::DescriptorSet;
use super::device::Device;
use super::host::HostCommands;
use super::keep::Keep;
use super::pipeline::Pipeline;
use super::result::misuse_of;
use super::timestamps::TimestampPool;
use crate::{Error, Result};
use ash::vk;
use std::ffi::CStr;
use std::sync::Arc;

/// Bytes of a label that are shown.
const LONGEST_LABEL: usize = 63;

/// Bytes of push constants that every device has room for, and the most that a kernel has.
const MOST_PUSHED: usize = 128;

/// Records into a command buffer. It never allocates device memory, submits or waits.
///
/// Work is not ordered by itself: put a [`barrier`](Self::barrier) between work and what depends on it.
pub struct Recorder<'a> {
    device: Device,
    raw: vk::CommandBuffer,
    /// The objects that our own command buffer must keep alive; a host does so itself.
    keep: Option<&'a mut Vec<Keep>>,
    /// The queue family of our own command buffer. A host's is not known.
    family: Option<u32>,
    /// The timestamp pool that was reset last, and the least index that was not written since.
    times: Option<(TimestampPool, u32)>,
    /// A host's pool, and its next query.
    host_times: Option<&'a mut (vk::QueryPool, u32)>,
    /// Labels that are open.
    labels: u32,
    dispatches: u32,
    /// The push constants of the last dispatch. They stay bound for every layout with a range of the same size.
    pushed: [u8; MOST_PUSHED],
    pushed_bytes: usize,
}

impl<'a> Recorder<'a> {
    /// Records into a host's command buffer.
    pub fn on_host(device: &Device, commands: &'a mut HostCommands) -> Self {
        let mut recorder = Self::with(device, commands.raw(), None, None);
        recorder.host_times = commands.timestamps.as_mut();
        recorder
    }

    /// Records into a command buffer of ours, which keeps what is recorded.
    ///
    /// # Safety
    /// As for [`HostCommands::new`], but for what `keep` keeps; the command buffer is of a pool of this queue family.
    #[cfg(feature = "renderer")]
    pub(super) unsafe fn keeping(
        device: &Device,
        raw: vk::CommandBuffer,
        family: u32,
        keep: &'a mut Vec<Keep>,
    ) -> Self {
        Self::with(device, raw, Some(keep), Some(family))
    }

    fn with(device: &Device, raw: vk::CommandBuffer, keep: Option<&'a mut Vec<Keep>>, family: Option<u32>) -> Self {
        Self {
            device: device.clone(),
            raw,
            keep,
            family,
            times: None,
            host_times: None,
            labels: 0,
            dispatches: 0,
            pushed: [0; MOST_PUSHED],
            pushed_bytes: 0,
        }
    }

    /// Dispatches recorded so far, direct and indirect ones.
    pub fn dispatches(&self) -> u32 {
        self.dispatches
    }

    /// The command buffer.
    #[cfg(test)]
    pub fn raw(&self) -> vk::CommandBuffer {
        self.raw
    }

    /// Runs a kernel over `groups` workgroups. With none along an axis, nothing is recorded.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where the set is of another kernel or device, or the push constants have another size than the
    /// kernel's; [`Error::Limit`] where there are more workgroups than the device allows.
    pub fn dispatch(&mut self, pipeline: &Pipeline, set: &DescriptorSet, push: &[u8], groups: [u32; 3]) -> Result<()> {
        for (axis, (&needed, limit)) in groups.iter().zip(self.device.limits().max_workgroup_count).enumerate() {
            if needed > limit {
                return Err(Error::Limit {
                    what: format!("kernel `{}` along {}", pipeline.kernel().name, ["x", "y", "z"][axis]),
                    needed: needed.into(),
                    unit: "workgroups",
                    limit_name: "maxComputeWorkGroupCount",
                    limit: limit.into(),
                    fix: "render a smaller image, fewer triangles or fewer cameras at once".to_string(),
                });
            }
        }
        self.check(pipeline, set, push)?;
        if groups.contains(&0) {
            return Ok(());
        }
        self.bind(pipeline, set, push);
        // SAFETY: pipeline, set and push constants are bound; the counts are within the limits.
        unsafe { self.device.raw().cmd_dispatch(self.raw, groups[0], groups[1], groups[2]) };
        Ok(())
    }

    /// Runs a kernel over as many workgroups as three words at an offset in a buffer say when it executes. Only this crate may
    /// call it: nothing checks those words, so the kernel that writes them keeps them within the device's limits.
    ///
    /// # Errors
    /// As [`dispatch`](Self::dispatch), and as [`copy`](Self::copy) for the words.
    pub(crate) fn dispatch_indirect(
        &mut self,
        pipeline: &Pipeline,
        set: &DescriptorSet,
        push: &[u8],
        buffer: &BufferPart,
        offset: u64,
    ) -> Result<()> {
        self.check(pipeline, set, push)?;
        self.check_range("vkCmdDispatchIndirect", buffer, offset, 12, vk::BufferUsageFlags::INDIRECT_BUFFER)?;
        self.bind(pipeline, set, push);
        self.keep(&buffer.keep);
        // SAFETY: pipeline, set and push constants are bound; the arguments lie inside the buffer, aligned.
        unsafe { self.device.raw().cmd_dispatch_indirect(self.raw, buffer.raw(), buffer.offset() + offset) };
        Ok(())
    }

    /// Fills `size` bytes at an offset with a word. Both are multiples of four.
    ///
    /// # Errors
    /// As [`copy`](Self::copy).
    pub fn fill(&mut self, buffer: &BufferPart, offset: u64, size: u64, value: u32) -> Result<()> {
        self.check_range("vkCmdFillBuffer", buffer, offset, size, vk::BufferUsageFlags::TRANSFER_DST)?;
        if size > 0 {
            self.keep(&buffer.keep);
            let offset = buffer.offset() + offset;
            // SAFETY: the range lies inside the buffer, aligned, and is not empty.
            unsafe { self.device.raw().cmd_fill_buffer(self.raw, buffer.raw(), offset, size, value) };
        }
        Ok(())
    }

    /// Writes bytes that the command buffer holds: at most 65536, their number and the offset multiples of four.
    ///
    /// # Errors
    /// As [`copy`](Self::copy), and [`Error::Vulkan`] for more bytes.
    pub fn update(&mut self, buffer: &BufferPart, offset: u64, bytes: &[u8]) -> Result<()> {
        const MOST: usize = 65536;
        let call = "vkCmdUpdateBuffer";
        self.check_range(call, buffer, offset, bytes.len() as u64, vk::BufferUsageFlags::TRANSFER_DST)?;
        if bytes.len() > MOST {
            return Err(Error::Vulkan { call, result: format!("{} bytes, it takes {MOST}", bytes.len()) });
        }
        if !bytes.is_empty() {
            self.keep(&buffer.keep);
            // SAFETY: the range lies inside the buffer, aligned, is not empty and not too long.
            unsafe { self.device.raw().cmd_update_buffer(self.raw, buffer.raw(), buffer.offset() + offset, bytes) };
        }
        Ok(())
    }

    /// Copies `size` bytes. All three numbers are multiples of four; the ranges do not overlap.
    ///
    /// # Errors
    /// [`Error::Vulkan`] for a buffer of another device or without the usage, for a range outside of it or not aligned, and
    /// for ranges that overlap.
    pub fn copy(
        &mut self,
        source: &BufferPart,
        source_offset: u64,
        target: &BufferPart,
        target_offset: u64,
        size: u64,
    ) -> Result<()> {
        let call = "vkCmdCopyBuffer";
        self.check_range(call, source, source_offset, size, vk::BufferUsageFlags::TRANSFER_SRC)?;
        self.check_range(call, target, target_offset, size, vk::BufferUsageFlags::TRANSFER_DST)?;
        let region = vk::BufferCopy {
            src_offset: source.offset() + source_offset,
            dst_offset: target.offset() + target_offset,
            size,
        };
        let overlaps = region.src_offset.abs_diff(region.dst_offset) < size;
        if source.raw() == target.raw() && overlaps {
            return Err(Error::Vulkan { call, result: "source and target overlap".to_string() });
        }
        if size > 0 {
            self.keep(&source.keep);
            self.keep(&target.keep);
            // SAFETY: both ranges lie inside their buffers, don't overlap and are not empty.
            unsafe { self.device.raw().cmd_copy_buffer(self.raw, source.raw(), target.raw(), &[region]) };
        }
        Ok(())
    }

    /// Orders work: everything recorded so far is done, and its writes are visible, before any kernel, copy, fill or indirect
    /// dispatch recorded from now on starts.
    pub fn barrier(&mut self) {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        // DRAW_INDIRECT before as well: arguments may be overwritten next.
        let stages = S::COMPUTE_SHADER | S::TRANSFER | S::DRAW_INDIRECT;
        // Texel reads are SHADER_READ.
        let reads = A::SHADER_READ | A::TRANSFER_READ | A::INDIRECT_COMMAND_READ | A::UNIFORM_READ;
        let writes = A::SHADER_WRITE | A::TRANSFER_WRITE;
        self.memory_barrier((stages, writes), (stages, reads | writes));
    }

    /// Makes everything recorded so far visible to the host once the command buffer has been waited for.
    pub fn barrier_to_host(&mut self) {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        let from = (S::COMPUTE_SHADER | S::TRANSFER, A::SHADER_WRITE | A::TRANSFER_WRITE);
        self.memory_barrier(from, (S::HOST, A::HOST_READ));
    }

    /// Begins a named section for graphics debuggers. Sections nest.
    pub fn begin_label(&mut self, name: &str) {
        let Some(debug_utils) = self.device.debug_utils() else { return };
        let text = label_text(self.device.label_prefix(), name);
        if let Ok(name) = CStr::from_bytes_until_nul(&text) {
            let label = vk::DebugUtilsLabelEXT::default().label_name(name);
            // SAFETY: the extension is enabled, the command buffer records.
            unsafe { debug_utils.cmd_begin_debug_utils_label(self.raw, &label) };
            self.labels += 1;
        }
    }

    /// Ends the section begun last; without an open one it does nothing.
    pub fn end_label(&mut self) {
        let Some(debug_utils) = self.device.debug_utils() else { return };
        if self.labels > 0 {
            self.labels -= 1;
            // SAFETY: the extension is enabled, the command buffer records, and a section is open.
            unsafe { debug_utils.cmd_end_debug_utils_label(self.raw) };
        }
    }

    /// Makes a pool's timestamps ready to be written, which must be done before the first.
    ///
    /// # Errors
    /// [`Error::Vulkan`] for a pool of another device or queue family, and in a host's command buffer, whose queue family is
    /// not known.
    pub fn reset_timestamps(&mut self, pool: &TimestampPool) -> Result<()> {
        if !pool.0.is_of(&self.device) || self.family != Some(pool.0.family()) {
            return Err(misuse_of("vkCmdResetQueryPool", "the timestamps are of another device or queue family"));
        }
        self.keep(&Some(pool.0.clone() as Keep));
        // SAFETY: the range is the whole pool, which is of this device and kept.
        unsafe { self.device.raw().cmd_reset_query_pool(self.raw, pool.0.raw(), 0, pool.count()) };
        self.times = Some((pool.clone(), 0));
        Ok(())
    }

    /// Writes a timestamp when all that was recorded so far is done.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where the pool was not [reset](Self::reset_timestamps) last, and for an index that is not above the
    /// last one written or beyond the pool.
    pub fn timestamp(&mut self, pool: &TimestampPool, index: u32) -> Result<()> {
        let call = "vkCmdWriteTimestamp";
        let Some((_, next)) = self.times.as_mut().filter(|(reset, _)| Arc::ptr_eq(&reset.0, &pool.0)) else {
            return Err(misuse_of(call, "the pool was not reset in this recording"));
        };
        if index < *next || index >= pool.count() {
            let result = format!("timestamp {index}: the next is {next}, the pool has {}", pool.count());
            return Err(Error::Vulkan { call, result });
        }
        *next = index + 1;
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the query is one of the pool's, which `reset_timestamps` has kept, was reset and not written since; the
        // pool is of this queue family, which has timestamps (`TimestampPool::new`).
        unsafe { self.device.raw().cmd_write_timestamp(self.raw, stage, pool.0.raw(), index) };
        Ok(())
    }

    /// Writes the next timestamp of a host's pool, if it has given one.
    pub fn host_timestamp(&mut self) {
        let Some((pool, next)) = &mut self.host_times else { return };
        let stage = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: the query is one of the pool's, was reset and not written since (`HostCommands::with_timestamps`).
        unsafe { self.device.raw().cmd_write_timestamp(self.raw, stage, *pool, *next) };
        *next += 1;
    }

    fn memory_barrier(
        &mut self,
        (from, writes): (vk::PipelineStageFlags, vk::AccessFlags),
        (to, accesses): (vk::PipelineStageFlags, vk::AccessFlags),
    ) {
        let barrier = [vk::MemoryBarrier::default().src_access_mask(writes).dst_access_mask(accesses)];
        let none = vk::DependencyFlags::empty();
        // SAFETY: every stage named is one of a compute queue; each access belongs to one of the stages.
        unsafe { self.device.raw().cmd_pipeline_barrier(self.raw, from, to, none, &barrier, &[], &[]) };
    }

    /// Checks that pipeline, set and push constants belong together and to this device.
    fn check(&self, pipeline: &Pipeline, set: &DescriptorSet, push: &[u8]) -> Result<()> {
        let (call, kernel, device) = ("vkCmdDispatch", pipeline.kernel(), self.device.raw().handle());
        if !std::ptr::eq(kernel, set.kernel()) {
            return Err(kernel.misuse(call, &format!("the descriptor set is of kernel `{}`", set.kernel().name)));
        }
        if push.len() != kernel.push_constant_bytes as usize {
            let (given, wanted) = (push.len(), kernel.push_constant_bytes);
            return Err(kernel.misuse(call, &format!("{given} bytes of push constants given, it has {wanted}")));
        }
        let ours = [pipeline.inner().device(), set.inner().device()].iter().all(|d| d.raw().handle() == device);
        if ours { Ok(()) } else { Err(kernel.misuse(call, "pipeline or descriptor set is of another device")) }
    }

    /// Checks that the buffer is of this device and was made for this use, and that the bytes lie inside its part, aligned to
    /// four.
    fn check_range(
        &self,
        call: &'static str,
        buffer: &BufferPart,
        offset: u64,
        size: u64,
        usage: vk::BufferUsageFlags,
    ) -> Result<()> {
        let inside = offset.checked_add(size).is_some_and(|end| end <= buffer.range());
        let aligned = buffer.offset().wrapping_add(offset).is_multiple_of(4) && size.is_multiple_of(4);
        let why = match (buffer.is_of(&self.device), inside, aligned, buffer.usage().contains(usage)) {
            (true, true, true, true) => return Ok(()),
            (false, ..) => format!("are of {buffer:?}, which is of another device"),
            (_, false, ..) => format!("lie outside {buffer:?}"),
            (_, _, false, _) => "are not aligned to four".to_string(),
            _ => format!("are of a buffer made without the usage {usage:?}"),
        };
        Err(Error::Vulkan { call, result: format!("bytes {offset} and {size} more {why}") })
    }

    /// Binds what a dispatch needs, and counts the dispatch.
    fn bind(&mut self, pipeline: &Pipeline, set: &DescriptorSet, push: &[u8]) {
        self.dispatches += 1;
        self.keep(&Some(pipeline.inner().clone() as Keep));
        self.keep(&Some(set.inner().clone() as Keep));
        let bound = self.pushed[..self.pushed_bytes] == *push;
        self.pushed_bytes = push.len().min(MOST_PUSHED);
        self.pushed[..self.pushed_bytes].copy_from_slice(&push[..self.pushed_bytes]);
        let (device, layout, point) = (self.device.raw(), pipeline.inner().layout(), vk::PipelineBindPoint::COMPUTE);
        // SAFETY: `check` has been called: all are of this device and of one kernel, so the layouts agree, and the push
        // constants fill the layout's range. Those bound before stay bound, because the last layout's range was the same. They
        // are kept here, or by the host (`HostCommands::new`).
        unsafe {
            device.cmd_bind_pipeline(self.raw, point, pipeline.inner().raw());
            device.cmd_bind_descriptor_sets(self.raw, point, layout, 0, &[set.inner().raw()], &[]);
            if !bound && !push.is_empty() {
                device.cmd_push_constants(self.raw, layout, vk::ShaderStageFlags::COMPUTE, 0, push);
            }
        }
    }

    fn keep(&mut self, what: &Option<Keep>) {
        if let (Some(keep), Some(what)) = (&mut self.keep, what) {
            keep.push(what.clone());
        }
    }
}

/// A label's text with its prefix, cut off at what is shown. On the stack and not a CString, because recording does not allocate.
fn label_text(prefix: &str, name: &str) -> [u8; LONGEST_LABEL + 1] {
    let mut text = [0; LONGEST_LABEL + 1];
    text.iter_mut().take(LONGEST_LABEL).zip(prefix.bytes().chain(name.bytes())).for_each(|(to, letter)| *to = letter);
    text
}

/// Sections that an error left open are ended.
impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        while self.labels > 0 {
            self.end_label();
        }
    }
}

impl std::fmt::Debug for Recorder<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Recorder({:?})", self.raw)
    }
}

#[cfg(test)]
mod tests {
    use super::{LONGEST_LABEL, label_text};

    #[test]
    fn labels_begin_with_the_prefix_and_end_with_a_zero() {
        assert!(label_text("soft ", "vertex").starts_with(b"soft vertex\0"));
        let long = label_text("soft ", &"x".repeat(100));
        assert!(long.starts_with(b"soft xx") && long[LONGEST_LABEL - 1] == b'x' && long[LONGEST_LABEL] == 0);
    }
}
