//! Commands that are recorded once and submitted as often as their numbers are the same.

use super::frame::StageTime;
use crate::error::Result;
use crate::frame::plan::FramePush;
use crate::vulkan::{CommandBuffer, Context, Recorder, TimestampPool};

/// The commands of a frame or of its gradients, which have `N` stages.
pub(super) struct Commands<const N: usize> {
    stages: [&'static str; N],
    pub buffer: CommandBuffer,
    times: Option<TimestampPool>,
    /// What they depend on besides the buffers that are bound: their numbers, and whether they are timed.
    recorded: Option<(FramePush, bool)>,
}

impl<const N: usize> Commands<N> {
    pub(super) fn new(context: &Context, name: &str, stages: [&'static str; N]) -> Result<Self> {
        Ok(Self {
            stages,
            buffer: CommandBuffer::new(context, name)?,
            times: TimestampPool::new(context.device(), context.queue_family(), N as u32 + 1)?,
            recorded: None,
        })
    }

    /// Lets go of the buffers that they use.
    pub(super) fn forget(&mut self) {
        self.recorded = None;
        self.buffer.clear();
    }

    /// Whether they were recorded with these numbers.
    pub(super) fn are_recorded(&self, push: FramePush, timed: bool) -> bool {
        self.recorded == Some((push, timed))
    }

    /// Records them with `work`, unless they are recorded already.
    pub(super) fn prepare(
        &mut self,
        push: FramePush,
        timed: bool,
        work: impl FnOnce(&mut Recorder<'_>, Option<&TimestampPool>) -> Result<()>,
    ) -> Result<()> {
        if self.are_recorded(push, timed) {
            return Ok(());
        }
        self.recorded = None;
        let times = self.times.as_ref().filter(|_| timed);
        self.buffer.record(|recorder| {
            if let Some(times) = times {
                recorder.reset_timestamps(times)?;
            }
            work(recorder, times)?;
            recorder.barrier_to_host();
            Ok(())
        })?;
        self.recorded = Some((push, timed));
        Ok(())
    }

    /// The stages' times of the latest submission; empty without timestamps.
    pub(super) fn timings(&self) -> Result<Vec<StageTime>> {
        let timed = matches!(self.recorded, Some((_, true)));
        let Some(times) = self.times.as_ref().filter(|_| timed) else {
            return Ok(Vec::new());
        };
        Ok(StageTime::between(&times.read(N as u32 + 1)?, self.stages))
    }
}
