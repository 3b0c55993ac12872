//! Command buffers of our own: recorded once, submitted as often as wanted.

use super::buffer_part::Keep;
use super::context::{Context, Shared};
use super::recorder::Recorder;
use super::result::{Named, misuse_of};
use crate::Result;
use ash::vk;
use std::sync::{Arc, PoisonError};

/// A command buffer with a pool and a fence of its own. Keeps alive what it recorded.
pub struct CommandBuffer {
    shared: Arc<Shared>,
    pool: vk::CommandPool,
    raw: vk::CommandBuffer,
    fence: vk::Fence,
    state: State,
    keep: Vec<Keep>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nothing that could be submitted.
    Empty,
    /// Recorded, and not in use by the device.
    Recorded,
    /// Submitted: the device may still be at it.
    Pending,
}

impl CommandBuffer {
    /// Makes an empty command buffer.
    pub fn new(context: &Context, name: &str) -> Result<Self> {
        let shared = context.shared().clone();
        let mut made = Self {
            shared,
            pool: vk::CommandPool::null(),
            raw: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            state: State::Empty,
            keep: Vec::new(),
        };
        let device = made.shared.device.raw();
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(made.shared.queue_family);
        // SAFETY: plain creations; `Drop` destroys what was made, on errors as well.
        made.pool = unsafe { device.create_command_pool(&info, None) }.named("vkCreateCommandPool")?;
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(made.pool)
            .level(vk::CommandBufferLevel::PRIMARY)
            .command_buffer_count(1);
        // SAFETY: the pool was just made, and nobody else has it.
        let buffers = unsafe { device.allocate_command_buffers(&info) }.named("vkAllocateCommandBuffers")?;
        made.raw = buffers.first().copied().unwrap_or_default();
        // SAFETY: a plain creation.
        made.fence = unsafe { device.create_fence(&vk::FenceCreateInfo::default(), None) }.named("vkCreateFence")?;
        let device = &made.shared.device;
        device.name_object(made.pool, name);
        device.name_object(made.raw, name);
        device.name_object(made.fence, name);
        Ok(made)
    }

    /// Records anew; what was recorded before is gone. After an error it is empty.
    pub fn record(&mut self, work: impl FnOnce(&mut Recorder<'_>) -> Result<()>) -> Result<()> {
        self.settle()?;
        self.state = State::Empty;
        let device = self.shared.device.clone();
        // SAFETY: the device is not using the buffer (`settle`), and `&mut self` keeps other threads out of the pool.
        unsafe { device.raw().reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .named("vkResetCommandPool")?;
        self.keep.clear();
        // SAFETY: the buffer was just reset.
        unsafe { device.raw().begin_command_buffer(self.raw, &vk::CommandBufferBeginInfo::default()) }
            .named("vkBeginCommandBuffer")?;
        // SAFETY: the buffer is recording; what is recorded is kept until it is reset.
        let mut recorder = unsafe { Recorder::keeping(&device, self.raw, &mut self.keep) };
        work(&mut recorder)?;
        // SAFETY: the buffer is recording.
        unsafe { device.raw().end_command_buffer(self.raw) }.named("vkEndCommandBuffer")?;
        self.state = State::Recorded;
        Ok(())
    }

    /// Executes what was recorded and waits for it. Can be repeated.
    pub fn submit_and_wait(&mut self) -> Result<()> {
        self.submit_and_wait_after(None)
    }

    /// The same with another command buffer's work before it, in one submission.
    pub fn submit_and_wait_after(&mut self, before: Option<&Self>) -> Result<()> {
        self.submit_after(before)?;
        self.settle()
    }

    /// Has what was recorded executed and does not wait, unless it still is from the last time.
    pub fn submit(&mut self) -> Result<()> {
        self.submit_after(None)
    }

    fn submit_after(&mut self, before: Option<&Self>) -> Result<()> {
        self.settle()?;
        if self.state != State::Recorded || before.is_some_and(|b| b.state != State::Recorded) {
            return Err(misuse_of("vkQueueSubmit", "nothing was recorded"));
        }
        let device = self.shared.device.raw();
        let buffers = [before.map_or(self.raw, |b| b.raw), self.raw];
        let buffers = &buffers[usize::from(before.is_none())..];
        let submits = [vk::SubmitInfo::default().command_buffers(buffers)];
        {
            let queue = self.shared.queue.lock().unwrap_or_else(PoisonError::into_inner);
            // SAFETY: the buffers are recorded and not in use, the fence unsignalled; the lock guards the queue.
            unsafe { device.queue_submit(*queue, &submits, self.fence) }.named("vkQueueSubmit")?;
        }
        self.state = State::Pending;
        Ok(())
    }

    /// Waits for what is pending, if anything is.
    pub fn settle(&mut self) -> Result<()> {
        if self.state != State::Pending {
            return Ok(());
        }
        let device = self.shared.device.raw();
        let fences = [self.fence];
        // SAFETY: the fence was submitted.
        unsafe { device.wait_for_fences(&fences, true, u64::MAX) }.named("vkWaitForFences")?;
        // SAFETY: it is signalled, so the queue has let go of it.
        unsafe { device.reset_fences(&fences) }.named("vkResetFences")?;
        self.state = State::Recorded;
        Ok(())
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        // An error here is a lost device, which is done with everything as well.
        _ = self.settle();
        let device = self.shared.device.raw();
        // SAFETY: the device is done with them, and they are ours. Null is ignored.
        unsafe {
            device.destroy_fence(self.fence, None);
            device.destroy_command_pool(self.pool, None);
        }
    }
}

impl std::fmt::Debug for CommandBuffer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "CommandBuffer({:?}, {:?})", self.raw, self.state)
    }
}
