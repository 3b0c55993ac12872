//! The commands of a frame and of its gradients: one stage after the other, with a barrier between them.
//!
//! [`record_forward`] and [`record_backward`] are read from top to bottom. Each walks through the stages of its pass in
//! order and says for every stage which buffers its kernel binds and over how many workgroups it runs. Neither allocates.

mod backward;
mod forward;

pub use backward::{BACKWARD_COUNT, BackwardStage, BackwardStages, record_backward};
pub use forward::{FORWARD_COUNT, ForwardStage, ForwardStages, record_forward};

use crate::Result;
use crate::constants as c;
use crate::error::Error;
use crate::frame::buffers::BufferId;
use crate::frame::plan::FramePush;
use crate::vulkan::{BufferPart, DescriptorPool, DescriptorSet, Device, DeviceKind, Pipeline, Recorder, TimestampPool};

/// A stage ready to be recorded: a pipeline specialized for a plan, and its descriptors.
#[derive(Clone)]
pub struct Stage {
    pipeline: Pipeline,
    set: DescriptorSet,
}

/// The work of a stage.
enum Work<'a> {
    /// Workgroups along x, y and z; a zero where the plan does not need the stage.
    Groups([u32; 3]),
    /// The rows of a list whose length only the device knows.
    List(List<'a>),
}

/// A list that an earlier stage makes, in rows.
struct List<'a> {
    /// Rows that the list has room for; 0 where the plan does not need the stage.
    rows: u32,
    /// The first entry of the first row, and the entries of a row.
    first: u32,
    row: u32,
    /// Holds the dispatch arguments of each row, `stride` words apart and beginning after `offset` words.
    counts: &'a BufferPart,
    stride: u32,
    offset: u32,
}

impl<'a> List<'a> {
    /// Rows of FORWARD_ROW entries from `first` on.
    fn of_rows(rows: u32, first: u32, counts: &'a BufferPart, stride: u32, offset: u32) -> Self {
        Self { rows, first, row: c::FORWARD_ROW, counts, stride, offset }
    }
}

impl Stage {
    /// A pipeline with a descriptor set of its kernel.
    pub(crate) fn new(pipeline: Pipeline, set: DescriptorSet) -> Self {
        Self { pipeline, set }
    }

    /// Binds a pipeline to buffers found by the names of its bindings. `alias` is asked first; it knows the bindings that
    /// stand for another buffer in each stage.
    fn bind<'a>(
        pool: &DescriptorPool,
        pipeline: Pipeline,
        alias: impl Fn(&str) -> Option<BufferId>,
        find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        let mut buffers = Vec::new();
        for binding in pipeline.kernel().bindings {
            let kernel = pipeline.kernel().name;
            let Some(id) = alias(binding.name).or_else(|| BufferId::of_binding(binding.name)) else {
                let result = format!("the binding `{}` of kernel `{kernel}` is no buffer of the table", binding.name);
                return Err(Error::Vulkan { call: "vkUpdateDescriptorSets", result });
            };
            let Some(buffer) = find(id) else {
                return Err(Error::Host {
                    what: format!("kernel `{kernel}` needs a buffer `{id}`"),
                    fix: "give every buffer of the plan's buffers()".into(),
                });
            };
            buffers.push((binding.name, buffer));
        }
        let set = pool.bind(&pipeline, &buffers)?;
        Ok(Self { pipeline, set })
    }

    /// Records a dispatch of `groups` workgroups.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &[u8], groups: [u32; 3]) -> Result<()> {
        recorder.dispatch(&self.pipeline, &self.set, push, groups)
    }

    /// Records the stage under a label and with a barrier after it; nothing where it has no work.
    fn run(&self, recorder: &mut Recorder<'_>, name: &'static str, push: &FramePush, work: &Work<'_>) -> Result<()> {
        let needed = match work {
            Work::Groups(groups) => !groups.contains(&0),
            Work::List(list) => list.rows > 0,
        };
        if !needed {
            return Ok(());
        }
        recorder.begin_label(name);
        match work {
            Work::Groups(groups) => self.record(recorder, bytemuck::bytes_of(push), *groups)?,
            Work::List(list) => self.record_rows(recorder, push, list)?,
        }
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }

    /// Records an indirect dispatch for each row of a list. The rows write to disjoint elements. The barriers between them
    /// are for the validation layers: all buffers that a frame does not need are one buffer, bound for reading and for
    /// writing, which the layers would report as a hazard.
    fn record_rows(&self, recorder: &mut Recorder<'_>, push: &FramePush, list: &List<'_>) -> Result<()> {
        for row in 0..list.rows {
            let push = FramePush { first: list.first + row * list.row, ..*push };
            let at = 4 * u64::from(row * list.stride + list.offset);
            if row > 0 {
                recorder.barrier();
            }
            recorder.dispatch_indirect(&self.pipeline, &self.set, bytemuck::bytes_of(&push), list.counts, at)?;
        }
        Ok(())
    }
}

/// Binds the pipelines of a pass, one for each stage; `alias` gets the index of the stage in the array.
fn bind_all<'a, const N: usize>(
    device: &Device,
    pipelines: [Pipeline; N],
    alias: impl Fn(usize, &str) -> Option<BufferId>,
    find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
) -> Result<[Stage; N]> {
    let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
    let mut stages = Vec::with_capacity(N);
    for (stage, pipeline) in pipelines.into_iter().enumerate() {
        stages.push(Stage::bind(&pool, pipeline, |binding| alias(stage, binding), find)?);
    }
    let missing = |_| Error::Vulkan { call: "vkUpdateDescriptorSets", result: "a stage is missing".into() };
    stages.try_into().map_err(missing)
}

/// The sizes of a subgroup for which shared_records.glsl and lanes.glsl are written.
const SUBGROUPS: std::ops::RangeInclusive<u32> = 4..=64;

/// Whether a workgroup of `lanes` invocations is one subgroup that can shuffle, so that it reads records together. The
/// subgroups of software devices are as large as they say. A GPU's driver may compile a kernel for smaller ones, but none
/// for less than eight.
fn reads_together(device: &Device, lanes: u32) -> bool {
    let limits = device.limits();
    let one_subgroup = lanes <= limits.subgroup_size && (device.kind() == DeviceKind::Software || lanes <= 8);
    limits.subgroup_shuffle && SUBGROUPS.contains(&lanes) && one_subgroup
}

/// The lanes of a tile unless the caller chooses. On software devices, whose shared memory is slow, it is a subgroup.
pub fn default_lanes(device: &Device) -> u32 {
    let most = c::TILE_WIDTH * c::TILE_HEIGHT;
    let size = device.limits().subgroup_size.min(most);
    match device.kind() {
        DeviceKind::Software if size.is_power_of_two() && reads_together(device, size) => size,
        DeviceKind::Software => 8,
        _ => most,
    }
}

/// The lanes of a workgroup of small items, where a tile has `lanes`.
pub fn small_lanes(device: &Device, lanes: u32) -> u32 {
    if reads_together(device, lanes) { c::SMALL_GROUP } else { lanes }
}

/// The pixels of the largest item that one lane processes alone: of items in shaded images, and in the silhouette only.
///
/// A lane alone needs no sums over lanes and walks the rows of its triangle rather than a box, but waits for the
/// largest item of its subgroup. On lavapipe with eight lanes a frame of spot took 0.91 of the time at 128² with 256
/// pixels instead of 32, and 0.94 at 512² with 1024 instead of 256. On a GPU the silhouette's items may be larger,
/// because their pixels are less work.
pub fn small_pixels(device: &Device, lanes: u32) -> [u32; 2] {
    match device.kind() {
        DeviceKind::Software => [c::LARGE_BOX; 2],
        _ => [256 / lanes, 2048 / lanes],
    }
}

/// Writes a timestamp if there is a pool for timestamps, ours or a host's.
fn stamp(recorder: &mut Recorder<'_>, pool: Option<&TimestampPool>, index: u32) -> Result<()> {
    recorder.host_timestamp();
    pool.map_or(Ok(()), |pool| recorder.timestamp(pool, index))
}

/// Fills a buffer with 0. Only the first part of a large buffer is filled, and copied to the rest of it: on lavapipe
/// vkCmdFillBuffer takes some nanoseconds for every four bytes, a copy far less.
fn clear(recorder: &mut Recorder<'_>, buffer: &BufferPart, size: u64) -> Result<()> {
    const LARGE: u64 = 1 << 18;
    const PARTS: u64 = 32;
    if size < LARGE {
        return recorder.fill(buffer, 0, size, 0);
    }
    let part = size.div_ceil(PARTS).next_multiple_of(16);
    recorder.fill(buffer, 0, part, 0)?;
    recorder.barrier();
    for at in (part..size).step_by(part as usize) {
        recorder.copy(buffer, 0, buffer, at, part.min(size - at))?;
    }
    Ok(())
}

/// Writes the arguments of `count` indirect dispatches: no workgroups along x yet, one along y and z.
fn no_workgroups(recorder: &mut Recorder<'_>, counts: &BufferPart, count: u64) -> Result<()> {
    const AT_ONCE: u64 = 256;
    let arguments = [[0u32, 1, 1]; AT_ONCE as usize];
    for first in (0..count).step_by(AT_ONCE as usize) {
        let part = &arguments[..AT_ONCE.min(count - first) as usize];
        recorder.update(counts, 12 * first, bytemuck::cast_slice(part))?;
    }
    Ok(())
}
