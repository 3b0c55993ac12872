//! Command buffers that we make and own: recorded once, submitted as often as wanted.

use super::super::keep::{Keep, Uses};
use super::super::recorder::Recorder;
use super::super::result::{Named, misuse_of};
use super::context::{Context, ContextInner};
use crate::{Error, Result};
use ash::vk;
use std::sync::{Arc, PoisonError};

/// A command buffer with a pool and a fence of its own. It keeps alive what it recorded, and while it is pending the host
/// cannot reach the mapped buffers among that.
pub struct CommandBuffer {
    shared: Arc<ContextInner>,
    pool: vk::CommandPool,
    raw: vk::CommandBuffer,
    fence: vk::Fence,
    state: State,
    keep: Vec<Keep>,
    /// The mapped buffers and the timestamp marks that `keep` uses.
    uses: Uses,
    dispatches: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is nothing to submit.
    Empty,
    /// Recorded, and not in use by the device.
    Recorded,
    /// Submitted with its own fence: the device may still execute it.
    Pending,
    /// Submitted with the fence of another command buffer: the device may still execute it. It stays so where waiting
    /// failed, and is of no use then.
    Lent,
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
            uses: Uses::default(),
            dispatches: 0,
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

    /// Records anew; what was recorded before is gone. After an error the command buffer is empty.
    ///
    /// # Errors
    /// The error that `work` returns; otherwise as [`settle`](Self::settle).
    pub fn record(&mut self, work: impl FnOnce(&mut Recorder<'_>) -> Result<()>) -> Result<()> {
        self.settle()?;
        self.clear();
        let device = self.shared.device.clone();
        // SAFETY: the device is not using the buffer (`settle`), and `&mut self` keeps other threads out of the pool.
        unsafe { device.raw().reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()) }
            .named("vkResetCommandPool")?;
        // SAFETY: the buffer was just reset.
        unsafe { device.raw().begin_command_buffer(self.raw, &vk::CommandBufferBeginInfo::default()) }
            .named("vkBeginCommandBuffer")?;
        // SAFETY: the buffer is recording; what is recorded is kept until it is reset.
        let mut recorder = unsafe { Recorder::keeping(&device, self.raw, self.shared.queue_family, &mut self.keep) };
        work(&mut recorder)?;
        let dispatches = recorder.dispatches();
        drop(recorder);
        // SAFETY: the buffer is recording.
        unsafe { device.raw().end_command_buffer(self.raw) }.named("vkEndCommandBuffer")?;
        self.uses = Uses::of(&self.keep);
        self.dispatches = dispatches;
        self.state = State::Recorded;
        Ok(())
    }

    /// Forgets what was recorded, and lets go of all that it kept. What cannot be waited for stays; the next recording says so.
    pub fn clear(&mut self) {
        if self.settle().is_ok() {
            self.state = State::Empty;
            self.uses = Uses::default();
            self.dispatches = 0;
            self.keep.clear();
        }
    }

    /// Dispatches that were recorded; 0 for an empty command buffer.
    pub fn dispatches(&self) -> u32 {
        self.dispatches
    }

    /// Executes what was recorded and waits for it. Can be repeated.
    ///
    /// # Errors
    /// As [`submit`](Self::submit) and [`settle`](Self::settle).
    pub fn submit_and_wait(&mut self) -> Result<()> {
        self.submit()?;
        self.settle()
    }

    /// Executes what was recorded after another command buffer's work, in one submission, and waits for it. Both are borrowed
    /// mutably, so that neither can be submitted a second time meanwhile.
    ///
    /// # Errors
    /// As [`submit_and_wait`](Self::submit_and_wait); [`Error::Vulkan`] for a command buffer of another device.
    pub fn submit_and_wait_after(&mut self, before: Option<&mut Self>) -> Result<()> {
        let Some(before) = before else { return self.submit_and_wait() };
        if !Arc::ptr_eq(&self.shared, &before.shared) {
            return Err(misuse_of("vkQueueSubmit", "the command buffer before it is of another device"));
        }
        before.settle()?;
        before.begin()?;
        let submitted = self.submit_all(&[before.raw, self.raw]);
        if submitted.is_err() {
            before.uses.cancel();
        }
        submitted?;
        before.state = State::Lent;
        self.settle()?;
        before.uses.end();
        before.state = State::Recorded;
        Ok(())
    }

    /// Hands what was recorded to the queue and does not wait for it, unless it is still pending from the last time.
    ///
    /// # Errors
    /// [`Error::Vulkan`] where nothing was recorded, or the host holds a slice of a buffer that is used;
    /// [`Error::DeviceLost`], [`Error::OutOfMemory`].
    pub fn submit(&mut self) -> Result<()> {
        self.submit_all(&[self.raw])
    }

    /// Submits command buffers, the last of which is this one, with its fence.
    fn submit_all(&mut self, buffers: &[vk::CommandBuffer]) -> Result<()> {
        self.settle()?;
        self.begin()?;
        let submits = [vk::SubmitInfo::default().command_buffers(buffers)];
        let queue = self.shared.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the buffers are recorded and not in use, since they are ours to change and settled; the fence is
        // unsignalled; the lock guards the queue.
        let submitted = unsafe { self.shared.device.raw().queue_submit(*queue, &submits, self.fence) };
        drop(queue);
        if submitted.is_err() {
            self.uses.cancel();
        }
        submitted.named("vkQueueSubmit")?;
        self.state = State::Pending;
        Ok(())
    }

    /// Checks that there is something to submit, and takes its mapped buffers from the host.
    fn begin(&self) -> Result<()> {
        if self.state != State::Recorded {
            return Err(misuse_of("vkQueueSubmit", "nothing was recorded"));
        }
        self.uses.begin()
    }

    /// Waits for what is pending, if anything is.
    ///
    /// # Errors
    /// [`Error::DeviceLost`], [`Error::OutOfMemory`]. It is then still pending.
    pub fn settle(&mut self) -> Result<()> {
        match self.state {
            State::Empty | State::Recorded => return Ok(()),
            State::Lent => {
                let what = "the submission that it was part of could not be waited for: make a new command buffer";
                return Err(misuse_of("vkWaitForFences", what));
            }
            State::Pending => {}
        }
        let device = self.shared.device.raw();
        let fences = [self.fence];
        // SAFETY: the fence was submitted.
        unsafe { device.wait_for_fences(&fences, true, u64::MAX) }.named("vkWaitForFences")?;
        // SAFETY: it is signalled, so the queue has let go of it.
        unsafe { device.reset_fences(&fences) }.named("vkResetFences")?;
        self.uses.end();
        self.state = State::Recorded;
        Ok(())
    }
}

impl Drop for CommandBuffer {
    fn drop(&mut self) {
        match self.settle() {
            // A lost device is done with everything as well.
            Ok(()) | Err(Error::DeviceLost { .. }) => {}
            // The device may still execute it: all that it uses stays, for ever.
            Err(_) => {
                std::mem::forget((std::mem::take(&mut self.keep), self.shared.clone()));
                return;
            }
        }
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
