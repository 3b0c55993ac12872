//! The frame, read top to bottom.

use crate::Result;
use crate::constants as c;
use crate::error::Error;
use crate::frame::buffers::BufferId;
use crate::frame::plan::{BackwardPlan, ForwardPlan, FramePush};
use crate::vulkan::{
    BufferPart, DescriptorPool, DescriptorSet, Device, Kernel, Pipeline, Recorder, TimestampPool, kernels,
};

/// A stage ready to be recorded: its pipeline, specialised for a plan, and its descriptors.
#[derive(Clone)]
pub struct Stage {
    pipeline: Pipeline,
    set: DescriptorSet,
}

impl Stage {
    /// A pipeline with a set of its kernel.
    pub(crate) fn new(pipeline: Pipeline, set: DescriptorSet) -> Self {
        Self { pipeline, set }
    }

    /// Runs it.
    pub(crate) fn record(&self, recorder: &mut Recorder<'_>, push: &[u8], groups: [u32; 3]) -> Result<()> {
        recorder.dispatch(&self.pipeline, &self.set, push, groups)
    }
}

/// The forward stages, in the order in which they run.
pub struct ForwardStages {
    vertex: Stage,
    triangle: Stage,
    bin_coarse: Stage,
    bin_fine: Stage,
    background: Stage,
    forward: Stage,
}

/// Stages of a forward frame.
pub const FORWARD_COUNT: usize = 6;

/// Timestamps that a forward frame writes: before the first stage and after each.
pub const FORWARD_TIMESTAMPS: u32 = FORWARD_COUNT as u32 + 1;

/// The stages' names, as their kernels'.
pub const FORWARD_STAGES: [&str; FORWARD_COUNT] =
    ["vertex", "triangle", "bin_coarse", "bin_fine", "background", "forward"];

/// Whether a workgroup of `lanes` is one subgroup that can shuffle.
fn reads_together(device: &Device, lanes: u32) -> bool {
    let subgroups = &device.limits().subgroups;
    lanes == 8 && subgroups.shuffle && subgroups.size >= 8
}

/// The kernels of the forward stages, in order. Where a tile's eight lanes are one subgroup that can shuffle, they read
/// records together.
pub fn forward_kernels(device: &Device, lanes: u32) -> [&'static Kernel; FORWARD_COUNT] {
    let forward = if reads_together(device, lanes) { &kernels::FORWARD_SUBGROUP } else { &kernels::FORWARD };
    [&kernels::VERTEX, &kernels::TRIANGLE, &kernels::BIN_COARSE, &kernels::BIN_FINE, &kernels::BACKGROUND, forward]
}

/// Binds a pipeline to buffers found by the names of its bindings; `alias` tells the buffers of those that are another in
/// each stage.
pub fn bind<'a>(
    pool: &DescriptorPool,
    pipeline: Pipeline,
    alias: &dyn Fn(&str) -> Option<BufferId>,
    find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
) -> Result<Stage> {
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
    Ok(Stage { pipeline, set })
}

impl ForwardStages {
    /// Binds the forward pipelines, in the order of [`forward_kernels`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; FORWARD_COUNT],
        find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
        let [vertex, triangle, bin_coarse, bin_fine, background, forward] = pipelines;
        let bind = |pipeline| bind(&pool, pipeline, &|_| None, find);
        Ok(Self {
            vertex: bind(vertex)?,
            triangle: bind(triangle)?,
            bin_coarse: bind(bin_coarse)?,
            bin_fine: bind(bin_fine)?,
            background: bind(background)?,
            forward: bind(forward)?,
        })
    }
}

/// Writes a timestamp where there is a pool for them.
fn stamp(recorder: &mut Recorder<'_>, pool: Option<&TimestampPool>, index: u32) -> Result<()> {
    match pool {
        Some(pool) => recorder.timestamp(pool, index),
        None => Ok(()),
    }
}

/// A list that the device makes, in rows of FORWARD_ROW entries.
struct List<'a> {
    rows: u32,
    /// The first entry of the first row.
    first: u32,
    /// The rows' dispatch arguments, each `stride` words after the one before, the first after `offset` words.
    counts: &'a BufferPart,
    stride: u32,
    offset: u32,
}

/// Every row of a list, by a dispatch of its own. They touch nothing in common, but what a frame does not need is bound to
/// one buffer for reading and for writing, which validation takes for a hazard without barriers between them.
fn record_rows(recorder: &mut Recorder<'_>, frame: &FramePush, stage: &Stage, list: &List) -> Result<()> {
    for row in 0..list.rows {
        let frame = FramePush { first: list.first + row * c::FORWARD_ROW, ..*frame };
        let at = 4 * u64::from(row * list.stride + list.offset);
        if row > 0 {
            recorder.barrier();
        }
        recorder.dispatch_indirect(&stage.pipeline, &stage.set, bytemuck::bytes_of(&frame), list.counts, at)?;
    }
    Ok(())
}

/// The tiles that background or forward walk; those of the former lie behind the latter's room.
fn tile_list<'a>(plan: &ForwardPlan, counts: &'a BufferPart, offset: u32) -> List<'a> {
    let first = if offset == c::TILES_EMPTY { plan.totals.tiles as u32 } else { 0 };
    List { rows: plan.totals.tile_rows() as u32, first, counts, stride: c::TILE_COUNT_WORDS, offset }
}

/// Fills a buffer with 0. What is large is filled in part and copied behind itself: vkCmdFillBuffer takes lavapipe some
/// nanoseconds for each four bytes, a copy far less.
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

/// One forward frame: every stage after the one before, a global barrier between them.
///
/// It begins with a barrier behind all compute, copies and fills before it, and ends with one before all that follow, so
/// that what other stages and queues do to the buffers is all that the caller must order.
pub fn record_forward(
    recorder: &mut Recorder<'_>,
    plan: &ForwardPlan,
    stages: &ForwardStages,
    status: &BufferPart,
    bin_bits: &BufferPart,
    tile_counts: &BufferPart,
    times: Option<&TimestampPool>,
) -> Result<()> {
    enum Groups<'a> {
        Of([u32; 3]),
        On(List<'a>),
    }
    let of = |list| Groups::On(tile_list(plan, tile_counts, list));
    let steps = [
        (&stages.vertex, Groups::Of(plan.groups.vertex)),
        (&stages.triangle, Groups::Of(plan.groups.triangle)),
        (&stages.bin_coarse, Groups::Of(plan.groups.bin_coarse)),
        (&stages.bin_fine, Groups::Of(plan.groups.bin_fine)),
        (&stages.background, of(c::TILES_EMPTY)),
        (&stages.forward, of(c::TILES_FILLED)),
    ];
    recorder.begin_label("softras forward");
    recorder.barrier();
    recorder.fill(status, 0, plan.sizes[BufferId::Status], 0)?;
    no_workgroups(recorder, tile_counts, plan.totals.tile_rows() * u64::from(c::TILE_COUNT_WORDS) / 3)?;
    clear(recorder, bin_bits, plan.sizes[BufferId::BinBits])?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for (i, (stage, groups)) in steps.into_iter().enumerate() {
        recorder.begin_label(stage.pipeline.kernel().name);
        match groups {
            // Of a scene without triangles.
            Groups::Of(groups) if groups.contains(&0) => {}
            Groups::Of(groups) => {
                recorder.dispatch(&stage.pipeline, &stage.set, bytemuck::bytes_of(&plan.push), groups)?;
            }
            Groups::On(list) => record_rows(recorder, &plan.push, stage, &list)?,
        }
        recorder.barrier();
        recorder.end_label();
        stamp(recorder, times, i as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}

/// Stages of a backward pass.
pub const BACKWARD_COUNT: usize = 12;

/// The backward stages, in the order in which they run; `reduce` once for views, lights and pixels each.
pub struct BackwardStages {
    stages: [Stage; BACKWARD_COUNT],
}

/// The kernels of the backward stages, in order.
pub fn backward_kernels(device: &Device, lanes: u32) -> [&'static Kernel; BACKWARD_COUNT] {
    let (backward, outline) = if reads_together(device, lanes) {
        (&kernels::BACKWARD_SUBGROUP, &kernels::BACKWARD_OUTLINE_SUBGROUP)
    } else {
        (&kernels::BACKWARD, &kernels::BACKWARD_OUTLINE)
    };
    [
        &kernels::PIXEL_GRAD,
        &kernels::BACKWARD_CULL,
        backward,
        backward,
        outline,
        outline,
        &kernels::TRIANGLE_GRAD,
        &kernels::VERTEX_NORMAL_GRAD,
        &kernels::VERTEX_GRAD,
        &kernels::REDUCE,
        &kernels::REDUCE,
        &kernels::REDUCE,
    ]
}

/// The stages' names in timings.
pub const BACKWARD_STAGES: [&str; BACKWARD_COUNT] = [
    "pixel_grad",
    "backward_cull",
    "backward",
    "backward_small",
    "backward_outline",
    "backward_outline_small",
    "triangle_grad",
    "vertex_normal_grad",
    "vertex_grad",
    "reduce_views",
    "reduce_lights",
    "reduce_pixels",
];

/// Timestamps that a backward pass writes.
pub const BACKWARD_TIMESTAMPS: u32 = BACKWARD_COUNT as u32 + 1;

/// The mode of the reduction that a stage is.
pub fn reduction_of(stage: usize) -> u32 {
    match BACKWARD_STAGES[stage] {
        "reduce_lights" => c::REDUCTION_LIGHTS,
        "reduce_pixels" => c::REDUCTION_PIXELS,
        _ => c::REDUCTION_VIEWS,
    }
}

/// The buffer that a stage binds by a name: what several stages do to one buffer each has one name in their kernel.
fn buffer_of_stage(stage: usize, binding: &str) -> Option<BufferId> {
    match (binding, BACKWARD_STAGES[stage]) {
        ("items", "backward" | "backward_small") => Some(BufferId::ShownItems),
        ("items", _) => Some(BufferId::OutlineItems),
        ("rows", "reduce_lights") => Some(BufferId::LightRecords),
        ("rows", "reduce_pixels") => Some(BufferId::PixelSums),
        ("rows", _) => Some(BufferId::ViewSums),
        _ => None,
    }
}

impl BackwardStages {
    /// Binds the backward pipelines, in the order of [`backward_kernels`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; BACKWARD_COUNT],
        find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
        let mut stages = Vec::with_capacity(BACKWARD_COUNT);
        for (i, pipeline) in pipelines.into_iter().enumerate() {
            stages.push(bind(&pool, pipeline, &|binding| buffer_of_stage(i, binding), find)?);
        }
        let made: Result<[Stage; BACKWARD_COUNT], _> = stages.try_into();
        made.map(|stages| Self { stages })
            .map_err(|_| Error::Vulkan { call: "descriptor binding", result: "a backward stage is missing".into() })
    }
}

/// The workgroups of a stage; of the two that walk lists only the device knows them.
fn groups_of(plan: &BackwardPlan, stage: &str) -> [u32; 3] {
    let g = &plan.groups;
    match stage {
        "pixel_grad" => g.pixel_grad,
        "backward_cull" => g.backward_cull,
        "triangle_grad" => g.triangle_grad,
        "vertex_normal_grad" => g.vertex_normal_grad,
        "vertex_grad" => g.vertex_grad,
        "reduce_views" => g.reduce_views,
        "reduce_lights" => g.reduce_lights,
        _ => g.reduce_pixels,
    }
}

/// Which of backward_cull's lists a stage walks.
fn list_of(stage: &str) -> Option<u32> {
    match stage {
        "backward" => Some(c::ITEMS_SHOWN),
        "backward_small" => Some(c::ITEMS_SHOWN + c::ITEMS_SMALL),
        "backward_outline" => Some(c::ITEMS_OUTLINE),
        "backward_outline_small" => Some(c::ITEMS_OUTLINE + c::ITEMS_SMALL),
        _ => None,
    }
}

/// One backward pass after its forward frame: every stage after the one before, a global barrier between them.
///
/// The frame's workspace, images and `saved` are as [`record_forward`] left them. Begins and ends with barriers as that
/// does.
pub fn record_backward(
    recorder: &mut Recorder<'_>,
    plan: &BackwardPlan,
    stages: &BackwardStages,
    texel_sums: &BufferPart,
    item_counts: &BufferPart,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let lights_first = plan.push.view_count;
    let pixels_first = lights_first + plan.push.light_count + 1;
    recorder.begin_label("softras backward");
    recorder.barrier();
    // The shown and the outlined items of each row.
    no_workgroups(recorder, item_counts, u64::from(plan.item_rows * c::ITEM_COUNT_WORDS / 3))?;
    clear(recorder, texel_sums, plan.sizes[BufferId::TexelSums])?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for (i, stage) in stages.stages.iter().enumerate() {
        let name = BACKWARD_STAGES[i];
        let mut frame = plan.push;
        (frame.first, frame.reduce_rows) = match name {
            "reduce_lights" => (lights_first, plan.light_rows),
            "reduce_pixels" => (pixels_first, plan.pixel_rows),
            _ => (0, 0),
        };
        let list = list_of(name);
        let groups = groups_of(plan, name);
        let runs = if list.is_some() { plan.item_rows > 0 && plan.walks(name) } else { !groups.contains(&0) };
        if runs {
            recorder.begin_label(name);
            match list {
                Some(list) => {
                    let (rows, stride) = (plan.item_rows, c::ITEM_COUNT_WORDS);
                    let list = List { rows, first: 0, counts: item_counts, stride, offset: list };
                    record_rows(recorder, &plan.push, stage, &list)?;
                }
                None => recorder.dispatch(&stage.pipeline, &stage.set, bytemuck::bytes_of(&frame), groups)?,
            }
            recorder.barrier();
            recorder.end_label();
        }
        stamp(recorder, times, i as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}
