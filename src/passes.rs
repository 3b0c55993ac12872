//! The frame, read top to bottom.

use crate::Result;
use crate::buffers::buffer_of_binding;
use crate::error::Error;
use crate::plan::Plan;
use crate::vulkan::{
    BufferRef, DescriptorPool, DescriptorSet, Device, Kernel, Pipeline, PipelineCache, Recorder, SpecValue,
    TimestampPool, kernels,
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

/// The kernels of the forward stages, in order.
pub fn forward_kernels() -> [&'static Kernel; 5] {
    [&kernels::VERTEX, &kernels::TRIANGLE, &kernels::BIN_COARSE, &kernels::BIN_FINE, &kernels::FORWARD]
}

/// A kernel's pipeline with the plan's modes.
pub fn pipeline(
    device: &Device,
    kernel: &'static Kernel,
    plan: &Plan,
    lanes: u32,
    cache: Option<&PipelineCache>,
) -> Result<Pipeline> {
    let mut values = Vec::new();
    for constant in kernel.specialization {
        let Some((_, value)) = plan.modes.iter().find(|(name, _)| *name == constant.name) else {
            if constant.name == "local_size_x" {
                values.push((constant.name, SpecValue::Uint(lanes)));
            }
            continue;
        };
        let typed = match constant.default {
            SpecValue::Bool(_) => SpecValue::Bool(*value != 0),
            _ => SpecValue::Uint(*value),
        };
        values.push((constant.name, typed));
    }
    Pipeline::new(device, kernel, &values, cache)
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
        let pool = DescriptorPool::new(device, &forward_kernels())?;
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
