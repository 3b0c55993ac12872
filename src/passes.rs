//! The frame, read top to bottom.

use crate::Result;
use crate::buffers::buffer_of_binding;
use crate::constants as c;
use crate::error::Error;
use crate::plan::BackwardPlan;
use crate::plan::Plan;
use crate::vulkan::{
    BufferRef, DescriptorPool, DescriptorSet, Device, Kernel, Pipeline, Recorder, TimestampPool, kernels,
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
    find: &dyn Fn(&str) -> Option<&'a BufferRef>,
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
        find: &dyn Fn(&str) -> Option<&'a BufferRef>,
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

/// One forward frame: every stage after the one before, a global barrier between them.
///
/// Before: the inputs are visible to compute shaders, and no one uses the workspace or the outputs any more.
/// After: the outputs were written by compute shaders; a barrier to whatever reads them is the caller's.
pub fn record_forward(
    recorder: &mut Recorder<'_>,
    plan: &Plan,
    stages: &ForwardStages,
    status: &BufferRef,
    bin_bits: &BufferRef,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let push = bytemuck::bytes_of(&plan.frame);
    let steps = [
        (&stages.vertex, plan.groups.vertex),
        (&stages.triangle, plan.groups.triangle),
        (&stages.bin_coarse, plan.groups.bin_coarse),
        (&stages.bin_fine, plan.groups.bin_fine),
        (&stages.forward, plan.groups.forward),
    ];
    recorder.begin_label("softras forward");
    recorder.fill(status, 0, plan.sizes.status, 0)?;
    recorder.fill(bin_bits, 0, plan.sizes.bin_bits, 0)?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for (i, (stage, groups)) in steps.into_iter().enumerate() {
        recorder.begin_label(stage.pipeline.kernel().name);
        recorder.dispatch(&stage.pipeline, &stage.set, push, groups)?;
        recorder.barrier();
        recorder.end_label();
        stamp(recorder, times, i as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}

/// The backward stages, in the order in which they run; `reduce` once for views, lights and pixels each.
pub struct BackwardStages {
    stages: [Stage; 8],
}

/// The kernels of the backward stages, in order.
pub fn backward_kernels(device: &Device, lanes: u32) -> [&'static Kernel; 8] {
    let backward = if reads_together(device, lanes) { &kernels::BACKWARD_SUBGROUP } else { &kernels::BACKWARD };
    [
        &kernels::PIXEL_GRAD,
        backward,
        &kernels::TRIANGLE_GRAD,
        &kernels::VERTEX_NORMAL_GRAD,
        &kernels::VERTEX_GRAD,
        &kernels::REDUCE,
        &kernels::REDUCE,
        &kernels::REDUCE,
    ]
}

/// The stages' names in timings.
pub const BACKWARD_STAGES: [&str; 8] = [
    "pixel_grad",
    "backward",
    "triangle_grad",
    "vertex_normal_grad",
    "vertex_grad",
    "reduce_views",
    "reduce_lights",
    "reduce_pixels",
];

/// Timestamps that a backward pass writes.
pub const BACKWARD_TIMESTAMPS: u32 = 9;

/// The mode of the reduction that a stage is, and the buffer whose rows it sums.
pub fn reduction_of(stage: usize) -> (u32, &'static str) {
    match BACKWARD_STAGES[stage] {
        "reduce_lights" => (c::REDUCTION_LIGHTS, "light_records"),
        "reduce_pixels" => (c::REDUCTION_PIXELS, "pixel_sums"),
        _ => (c::REDUCTION_VIEWS, "view_sums"),
    }
}

impl BackwardStages {
    /// Binds the backward pipelines, in the order of [`backward_kernels`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; 8],
        find: &dyn Fn(&str) -> Option<&'a BufferRef>,
    ) -> Result<Self> {
        let pool = DescriptorPool::new(device, &pipelines.each_ref().map(Pipeline::kernel))?;
        let mut stages = Vec::with_capacity(8);
        for (i, pipeline) in pipelines.into_iter().enumerate() {
            let rows = reduction_of(i).1;
            stages.push(bind(&pool, pipeline, &|name| find(if name == "rows" { rows } else { name }))?);
        }
        let made: Result<[Stage; 8], _> = stages.try_into();
        made.map(|stages| Self { stages })
            .map_err(|_| Error::Vulkan { call: "descriptor binding", result: "a backward stage is missing".into() })
    }
}

/// One backward pass after its forward frame: every stage after the one before, a global barrier between them.
///
/// Before: the frame's workspace, images and `saved` are as [`record_forward`] left them, and the upstream gradients are
/// visible to compute shaders. After: the gradients were written by compute shaders.
pub fn record_backward(
    recorder: &mut Recorder<'_>,
    plan: &BackwardPlan,
    stages: &BackwardStages,
    texel_sums: &BufferRef,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let g = &plan.groups;
    let groups = [
        g.pixel_grad,
        g.backward,
        g.triangle_grad,
        g.vertex_normal_grad,
        g.vertex_grad,
        g.reduce_views,
        g.reduce_lights,
        g.reduce_pixels,
    ];
    let lights_first = plan.frame.view_count;
    let pixels_first = lights_first + plan.frame.light_count + 1;
    recorder.begin_label("softras backward");
    recorder.fill(texel_sums, 0, plan.sizes.texel_sums, 0)?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for (i, (stage, groups)) in stages.stages.iter().zip(groups).enumerate() {
        let mut frame = plan.frame;
        (frame.reduce_first, frame.reduce_rows) = match BACKWARD_STAGES[i] {
            "reduce_lights" => (lights_first, plan.light_rows),
            "reduce_pixels" => (pixels_first, plan.pixel_rows),
            _ => (0, 0),
        };
        if !groups.contains(&0) {
            recorder.begin_label(BACKWARD_STAGES[i]);
            recorder.dispatch(&stage.pipeline, &stage.set, bytemuck::bytes_of(&frame), groups)?;
            recorder.barrier();
            recorder.end_label();
        }
        stamp(recorder, times, i as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}
