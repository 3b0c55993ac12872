//! The inputs that are not on the device yet, and the commands that copy them there if its memory is not mapped.

use crate::error::Result;
use crate::frame::buffers::{BufferId, BufferSet};
use crate::frame::pack::InputChanges;
use crate::vulkan::{CommandBuffer, Context};

/// The inputs to upload before a frame.
pub(super) struct Uploads {
    /// Inputs whose bytes on the device are not those of the host.
    pub stale: InputChanges,
    /// The stale inputs that were written for the next submission.
    written: InputChanges,
    /// Bytes written for the latest frame.
    pub bytes: u64,
    commands: CommandBuffer,
    /// The inputs that `commands` copies.
    recorded: InputChanges,
}

impl Uploads {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            stale: InputChanges::ALL,
            written: InputChanges::default(),
            bytes: 0,
            commands: CommandBuffer::new(context, "softras uploads")?,
            recorded: InputChanges::default(),
        })
    }

    /// Notes that an input was written.
    pub(super) fn wrote(&mut self, id: BufferId, bytes: usize) {
        self.written.note(id, true);
        self.bytes += bytes as u64;
    }

    /// Records the copies of the inputs that were written, unless they are those recorded last, as in an optimization loop.
    pub(super) fn record(&mut self, buffers: &BufferSet) -> Result<()> {
        let mut wanted = InputChanges::default();
        for (id, buffer) in buffers.shared() {
            wanted.note(id, self.written.has(id) && !buffer.is_direct());
        }
        if wanted == self.recorded {
            return Ok(());
        }
        self.recorded = InputChanges::default();
        if !wanted.is_empty() {
            self.commands.record(|recorder| {
                let written = buffers.shared().filter(|(id, _)| wanted.has(*id));
                written.into_iter().try_for_each(|(_, buffer)| buffer.record_upload(recorder))
            })?;
        }
        self.recorded = wanted;
        Ok(())
    }

    /// The copies, to be executed before the frame; `None` if the host writes to the device's memory itself.
    pub(super) fn commands(&mut self) -> Option<&mut CommandBuffer> {
        (!self.recorded.is_empty()).then_some(&mut self.commands)
    }

    /// Notes that the submission is complete.
    pub(super) fn done(&mut self) {
        self.stale = self.stale.without(self.written);
        self.written = InputChanges::default();
    }

    /// Forgets the recorded copies, whose buffers were replaced.
    pub(super) fn forget(&mut self) {
        self.recorded = InputChanges::default();
    }
}
