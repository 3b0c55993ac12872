//! The frame, read top to bottom.

use crate::Result;
use crate::blank::{self, Blank};
use crate::buffers::buffer_of_binding;
use crate::constants as c;
use crate::error::Error;
use crate::plan::{BackwardPlan, FramePush, Plan};
use crate::vulkan::{
    BufferPart, DescriptorPool, DescriptorSet, Device, Kernel, Pipeline, Recorder, TimestampPool, kernels,
};

/// A stage ready to be recorded: its pipeline, specialised for a plan, and its descriptors.
#[derive(Clone)]
pub struct Stage {
    pipeline: Pipeline,
    set: DescriptorSet,
}

/// The forward stages, in the order in which they run.
pub struct ForwardStages {
    vertex: Stage,
    triangle: Stage,
    bin_coarse: Stage,
    bin_fine: Stage,
    forward: Stage,
}

/// Timestamps that a forward frame writes: before the first stage and after each.
pub const FORWARD_TIMESTAMPS: u32 = 6;

/// The stages' names, as their kernels'.
pub const FORWARD_STAGES: [&str; 5] = ["vertex", "triangle", "bin_coarse", "bin_fine", "forward"];

/// Whether a workgroup of `lanes` is one subgroup that can shuffle.
fn reads_together(device: &Device, lanes: u32) -> bool {
    let subgroups = &device.limits().subgroups;
    lanes == 8 && subgroups.shuffle && subgroups.size >= 8
}

/// The kernels of the forward stages, in order. Where a tile's eight lanes are one subgroup that can shuffle, they read
/// records together.
pub fn forward_kernels(device: &Device, lanes: u32) -> [&'static Kernel; 5] {
    let forward = if reads_together(device, lanes) { &kernels::FORWARD_SUBGROUP } else { &kernels::FORWARD };
    [&kernels::VERTEX, &kernels::TRIANGLE, &kernels::BIN_COARSE, &kernels::BIN_FINE, forward]
}

/// Binds a pipeline to buffers found by the names of its bindings.
pub fn bind<'a>(
    pool: &DescriptorPool,
    pipeline: Pipeline,
    find: &dyn Fn(&str) -> Option<&'a BufferPart>,
) -> Result<Stage> {
    let mut buffers = Vec::new();
    for binding in pipeline.kernel().bindings {
        let name = buffer_of_binding(binding.name);
        let Some(buffer) = find(&name) else {
            return Err(Error::Scene {
                what: format!("kernel `{}` needs a buffer `{name}`", pipeline.kernel().name),
                mend: "give every buffer that the plan lists".into(),
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
        pipelines: [Pipeline; 5],
        find: &dyn Fn(&str) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
        let [vertex, triangle, bin_coarse, bin_fine, forward] = pipelines;
        Ok(Self {
            vertex: bind(&pool, vertex, find)?,
            triangle: bind(&pool, triangle, find)?,
            bin_coarse: bind(&pool, bin_coarse, find)?,
            bin_fine: bind(&pool, bin_fine, find)?,
            forward: bind(&pool, forward, find)?,
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

/// One forward frame: every stage after the one before, a global barrier between them. Without triangles, and for tiles
/// without any, images are the background that they begin as.
///
/// It begins with a barrier behind all compute, copies and fills before it, and ends with one before all that follow, so
/// that what other stages and queues do to the buffers is all that the caller must order.
pub fn record_forward<'a>(
    recorder: &mut Recorder<'_>,
    plan: &Plan,
    stages: &ForwardStages,
    find: &dyn Fn(&str) -> Result<&'a BufferPart>,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let push = bytemuck::bytes_of(&plan.frame);
    recorder.begin_label("softras forward");
    recorder.barrier();
    recorder.fill(find("status")?, 0, plan.sizes.status, 0)?;
    let mut images: [Option<Blank<'_>>; 6] = [const { None }; 6];
    for (image, (name, size, pattern)) in images.iter_mut().zip(blank::of_forward(plan)) {
        if size > 0 {
            *image = Some(Blank::begin(recorder, find(name)?, size, pattern)?);
        }
    }
    if plan.totals.slots == 0 {
        stamp(recorder, times, 0)?;
        while images.iter().flatten().any(|image| !image.is_whole()) {
            recorder.barrier();
            images.iter_mut().flatten().try_for_each(|image| image.grow(recorder))?;
        }
        recorder.barrier();
        (1..FORWARD_TIMESTAMPS).try_for_each(|index| stamp(recorder, times, index))?;
        recorder.end_label();
        return Ok(());
    }
    let mut bins = Blank::begin(recorder, find("bin_bits")?, plan.sizes.bin_bits, [0; 4])?;
    no_workgroups(recorder, find("tile_counts")?, plan.tile_rows * c::TILE_COUNT_WORDS / 3)?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    let steps = [
        (&stages.vertex, plan.groups.vertex),
        (&stages.triangle, plan.groups.triangle),
        (&stages.bin_coarse, plan.groups.bin_coarse),
        (&stages.bin_fine, plan.groups.bin_fine),
    ];
    for (i, (stage, groups)) in steps.into_iter().enumerate() {
        recorder.begin_label(stage.pipeline.kernel().name);
        // Triangles are the first to mark bins, forward to draw.
        bins.finish(recorder)?;
        let last = i + 1 == 4;
        for image in images.iter_mut().flatten() {
            if last { image.finish(recorder) } else { image.grow(recorder) }?;
        }
        recorder.dispatch(&stage.pipeline, &stage.set, push, groups)?;
        recorder.barrier();
        recorder.end_label();
        stamp(recorder, times, i as u32 + 1)?;
    }
    recorder.begin_label(stages.forward.pipeline.kernel().name);
    let counts = find("tile_counts")?;
    for row in 0..plan.tile_rows {
        let Stage { pipeline, set } = &stages.forward;
        let frame = FramePush { first: row * c::FORWARD_ROW, ..plan.frame };
        let at = 4 * u64::from(row * c::TILE_COUNT_WORDS);
        recorder.dispatch_indirect(pipeline, set, bytemuck::bytes_of(&frame), counts, at)?;
    }
    recorder.barrier();
    recorder.end_label();
    stamp(recorder, times, FORWARD_TIMESTAMPS - 1)?;
    recorder.end_label();
    Ok(())
}

/// Writes the arguments of `count` indirect dispatches: no workgroups along x yet, one along y and z.
fn no_workgroups(recorder: &mut Recorder<'_>, counts: &BufferPart, count: u32) -> Result<()> {
    const AT_ONCE: u32 = 256;
    let arguments = [[0u32, 1, 1]; AT_ONCE as usize];
    for first in (0..count).step_by(AT_ONCE as usize) {
        let part = &arguments[..AT_ONCE.min(count - first) as usize];
        recorder.update(counts, 12 * u64::from(first), bytemuck::cast_slice(part))?;
    }
    Ok(())
}

/// Stages of a backward pass.
pub const BACKWARD_COUNT: usize = 10;

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
    "backward_outline",
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
fn buffer_of_stage(stage: usize, name: &str) -> &str {
    match (name, BACKWARD_STAGES[stage]) {
        ("items", "backward") => "shown_items",
        ("items", _) => "outline_items",
        ("rows", "reduce_lights") => "light_records",
        ("rows", "reduce_pixels") => "pixel_sums",
        ("rows", _) => "view_sums",
        _ => name,
    }
}

impl BackwardStages {
    /// Binds the backward pipelines, in the order of [`backward_kernels`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; BACKWARD_COUNT],
        find: &dyn Fn(&str) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
        let mut stages = Vec::with_capacity(BACKWARD_COUNT);
        for (i, pipeline) in pipelines.into_iter().enumerate() {
            stages.push(bind(&pool, pipeline, &|name| find(buffer_of_stage(i, name)))?);
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
        "backward_outline" => Some(c::ITEMS_OUTLINE),
        _ => None,
    }
}

/// Every row of one of backward_cull's lists.
fn record_items(
    recorder: &mut Recorder<'_>,
    plan: &BackwardPlan,
    stage: &Stage,
    list: u32,
    item_counts: &BufferPart,
) -> Result<()> {
    for row in 0..plan.item_rows {
        let frame = FramePush { first: row * c::FORWARD_ROW, ..plan.frame };
        let at = 4 * u64::from(row * c::ITEM_COUNT_WORDS + list);
        recorder.dispatch_indirect(&stage.pipeline, &stage.set, bytemuck::bytes_of(&frame), item_counts, at)?;
    }
    Ok(())
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
    let lights_first = plan.frame.view_count;
    let pixels_first = lights_first + plan.frame.light_count + 1;
    recorder.begin_label("softras backward");
    recorder.barrier();
    let mut texels = Blank::begin(recorder, texel_sums, plan.sizes.texel_sums, [0; 4])?;
    // The shown and the outlined items of each row.
    no_workgroups(recorder, item_counts, plan.item_rows * c::ITEM_COUNT_WORDS / 3)?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for (i, stage) in stages.stages.iter().enumerate() {
        let name = BACKWARD_STAGES[i];
        match name {
            "pixel_grad" => texels.grow(recorder)?,
            // The next is the first that adds to them.
            "backward_cull" => texels.finish(recorder)?,
            _ => {}
        }
        let mut frame = plan.frame;
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
                Some(list) => record_items(recorder, plan, stage, list, item_counts)?,
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
