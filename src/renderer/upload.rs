//! Which inputs are on the device, and the commands that bring the others there where its memory is not the host's.

use crate::error::Result;
use crate::frame::buffers::{BufferId, BufferSet};
use crate::frame::pack::Changes;
use crate::vulkan::{CommandBuffer, Context};

/// What is to be uploaded before a frame.
pub(super) struct Uploads {
    /// Inputs that are not on the device as they are on the host.
    pub stale: Changes,
    /// Of them, those that were written for the next submission.
    written: Changes,
    /// Bytes written for the latest frame.
    pub bytes: u64,
    commands: CommandBuffer,
    /// What `commands` copies.
    recorded: Changes,
}

impl Uploads {
    pub(super) fn new(context: &Context) -> Result<Self> {
        Ok(Self {
            stale: Changes::ALL,
            written: Changes::default(),
            bytes: 0,
            commands: CommandBuffer::new(context, "softras uploads")?,
            recorded: Changes::default(),
        })
    }

    /// An input was written.
    pub(super) fn wrote(&mut self, id: BufferId, bytes: usize) {
        self.written.note(id, true);
        self.bytes += bytes as u64;
    }

    /// Records the copies of what was written. Loops change the same inputs every time, so it seldom has to.
    pub(super) fn record(&mut self, buffers: &BufferSet) -> Result<()> {
        let mut wanted = Changes::default();
        for (entry, buffer) in buffers.shared() {
            wanted.note(entry.id, self.written.has(entry.id) && !buffer.is_direct());
        }
        if wanted == self.recorded {
            return Ok(());
        }
        self.recorded = Changes::default();
        if !wanted.is_empty() {
            self.commands.record(|recorder| {
                let written = buffers.shared().filter(|(entry, _)| wanted.has(entry.id));
                written.into_iter().try_for_each(|(_, buffer)| buffer.record_upload(recorder))
            })?;
        }
        self.recorded = wanted;
        Ok(())
    }

    /// The copies, to be executed before the frame; none where the host writes to the device's memory itself.
    pub(super) fn commands(&mut self) -> Option<&mut CommandBuffer> {
        (!self.recorded.is_empty()).then_some(&mut self.commands)
    }

    /// The submission is done.
    pub(super) fn done(&mut self) {
        self.stale = self.stale.without(self.written);
        self.written = Changes::default();
    }

    /// Buffers were renewed: what was recorded copies to the old ones.
    pub(super) fn forget(&mut self) {
        self.recorded = Changes::default();
    }
}
