//! The fit's own kernels, bound to their buffers and recorded between and after the rasterizer's passes.

use super::arithmetic::Rates;
use super::buffers::{FitBuffer, Own};
use super::guard::Guard;
use super::host::{edge_scale, edge_share};
use super::memory::Memory;
use super::plan::FitPlan;
use super::smoother::Smoother;
use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Parts};
use crate::frame::pipelines::{Pipelines, Request};
use crate::vulkan::{
    BindingKind, BufferPart, Context, DescriptorPool, DescriptorSet, Kernel, Pipeline, Recorder, TexelFormat, kernels,
};

/// Kernels, some of them twice in different modes.
const COUNT: usize = 16;

/// A kernel bound to its buffers.
struct Stage {
    pipeline: Pipeline,
    set: DescriptorSet,
}

/// All stages of a step.
pub struct Stages {
    /// One reads the rendered image, the other `pyramid`.
    pool: [Stage; 2],
    image_loss: [Stage; 2],
    loss_sum: Stage,
    image_upstream: Stage,
    regularize_vertices: Stage,
    regularize_flaps: Stage,
    loss_record: Stage,
    shape_gradient: Stage,
    /// Of gradients and of steps; each for even and for odd iterations.
    smooth: [[Stage; 2]; 2],
    smooth_dense: [Stage; 2],
    centre_total: Stage,
    largest_square: Stage,
    squares: Stage,
    optimizer: Stage,
    position_step: Stage,
    color_step: Stage,
}

/// The numbers that change from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    pub rates: Rates,
    pub color_rates: Rates,
    /// The step's row in `records`.
    pub row: u32,
    /// The box and the ball that vertices must not leave.
    pub guard: Guard,
}

type Modes = Vec<(&'static str, u32)>;

/// Kernels and modes, in the order of [`Stages::new`].
fn requests(plan: &FitPlan) -> [(&'static Kernel, Modes); COUNT] {
    let color = ("FIT_COLOR", u32::from(plan.has_color));
    let losses = vec![
        color,
        ("SILHOUETTE_LOSS", plan.silhouette.code),
        ("COLOR_LOSS", plan.color.code),
        ("FIT_MASKED", u32::from(plan.masked)),
    ];
    let plain = ("PLAIN", u32::from(plan.samples == 1 && plan.levels.len() == 1));
    let upstream = losses.iter().copied().chain([plain]).collect();
    let edges = ("EDGES", u32::from(plan.has_penalty(2)));
    let logit = ("LOGIT", u32::from(plan.logit));
    let method = ("METHOD", plan.method_code());
    let gradient =
        vec![("LAPLACIAN", u32::from(plan.has_penalty(0))), edges, ("FLAPS", u32::from(plan.flap_penalties())), logit];
    let flaps = vec![("FLATTEN", u32::from(plan.has_penalty(1))), ("NORMALS", u32::from(plan.has_penalty(3)))];
    [
        (&kernels::LOSS_POOL, vec![color]),
        (&kernels::IMAGE_LOSS, losses.clone()),
        (&kernels::LOSS_SUM, vec![]),
        (&kernels::IMAGE_UPSTREAM, upstream),
        (&kernels::REGULARIZE_VERTICES, vec![edges]),
        (&kernels::REGULARIZE_FLAPS, flaps),
        (&kernels::LOSS_RECORD, losses),
        (&kernels::SHAPE_GRADIENT, gradient),
        (&kernels::SMOOTH, vec![]),
        (&kernels::STEP_TOTALS, vec![("LARGEST", 0)]),
        (&kernels::STEP_TOTALS, vec![("LARGEST", 1)]),
        (&kernels::OPTIMIZER, vec![method, logit, ("SQUARES", 1)]),
        (&kernels::OPTIMIZER, vec![method, logit, ("SQUARES", 0)]),
        (&kernels::POSITION_STEP, vec![logit]),
        (&kernels::COLOR_STEP, vec![]),
        (&kernels::SMOOTH_DENSE, vec![]),
    ]
}

/// The rendered image.
fn image_of(plan: &FitPlan) -> FitBuffer {
    FitBuffer::Frame(if plan.has_color { BufferId::Color } else { BufferId::Silhouette })
}

/// The buffer of a binding, unless the stage names another.
fn buffer_of(plan: &FitPlan, binding: &str) -> Option<FitBuffer> {
    Some(match binding {
        "rendered" => image_of(plan),
        "Upstream" if plan.has_color => BufferId::UpstreamColor.into(),
        "Upstream" => BufferId::UpstreamSilhouette.into(),
        "frame_status" => BufferId::Status.into(),
        "image_gradients" => BufferId::VertexGradients.into(),
        "NewPositions" => BufferId::Positions.into(),
        "NewColors" => BufferId::Colors.into(),
        "NewParameters" => Own::Parameters.into(),
        "NewMoments" => Own::Moments.into(),
        "NewColorMoments" => Own::ColorMoments.into(),
        other => return FitBuffer::of_binding(other),
    })
}

/// Binds kernels to buffers by name.
struct Binder<'a> {
    plan: &'a FitPlan,
    memory: &'a Memory,
    unused: Parts,
    pool: DescriptorPool,
}

impl Binder<'_> {
    /// Binds a stage. `named` gives the buffers of those bindings that differ between stages of the same kernel.
    fn stage(&self, pipeline: &Pipeline, named: &[(&str, FitBuffer)]) -> Result<Stage> {
        let mut parts = Vec::new();
        for binding in pipeline.kernel().bindings {
            let given = named.iter().find(|(n, _)| *n == binding.name).map(|(_, buffer)| *buffer);
            let buffer = given.or_else(|| buffer_of(self.plan, binding.name));
            let part = buffer.and_then(|buffer| self.find(buffer, binding.kind)).ok_or_else(|| Error::Vulkan {
                call: "vkUpdateDescriptorSets",
                result: format!("kernel `{}`: there is no buffer `{}`", pipeline.kernel().name, binding.name),
            })?;
            parts.push((binding.name, part));
        }
        let set = self.pool.bind(pipeline, &parts)?;
        Ok(Stage { pipeline: pipeline.clone(), set })
    }

    /// A buffer, or the unused bytes where the frame has no such buffer.
    fn find(&self, id: FitBuffer, kind: BindingKind) -> Option<&BufferPart> {
        let format = if kind == BindingKind::UniformTexelBufferUint { TexelFormat::Uint } else { TexelFormat::Float };
        let unused = || if matches!(id, FitBuffer::Frame(_)) { self.unused.unused(format) } else { None };
        self.memory.set.get(id).or_else(unused)
    }
}

impl Stages {
    /// Binds all stages; every buffer must have been made.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Limit`].
    pub fn new(context: &Context, pipelines: &mut Pipelines, plan: &FitPlan, memory: &Memory) -> Result<Self> {
        let requested = requests(plan);
        let request = |i: usize| Request { kernel: requested[i].0, modes: &requested[i].1, lanes: c::FIT_GROUP };
        let made: [Pipeline; COUNT] =
            pipelines.get(context.device(), Some(context.pipeline_cache()), std::array::from_fn(request))?;
        let mut sets: Vec<&'static Kernel> = made.iter().map(Pipeline::kernel).collect();
        sets.extend([&kernels::LOSS_POOL, &kernels::IMAGE_LOSS, &kernels::SMOOTH, &kernels::SMOOTH, &kernels::SMOOTH]);
        sets.push(&kernels::SMOOTH_DENSE);
        let pool = DescriptorPool::new(context.device(), &sets)?;
        let unused = memory.unused_parts()?;
        let binder = Binder { plan, memory, unused, pool };
        let [pool, loss, loss_sum, upstream, vertices, flaps, record, gradient, smooth, centre, largest, ..] = &made;
        let [.., squares, optimizer, position_step, colors, dense] = &made;
        let image = image_of(plan);
        let smoothing = |rough: Own| -> Result<[Stage; 2]> {
            let step = |newer: Own, target: Own| {
                let named = [("rough", rough), ("newer", newer), ("older", target), ("Smoothed", target)];
                binder.stage(smooth, &named.map(|(binding, own)| (binding, own.into())))
            };
            Ok([step(Own::SmoothOdd, Own::SmoothEven)?, step(Own::SmoothEven, Own::SmoothOdd)?])
        };
        // The last of an even number of steps counted from 0 writes there.
        let smoothed = plan.smoothing.is_some();
        let gradients = if smoothed { Own::SmoothOdd } else { Own::ShapeGradients };
        let changes = if smoothed { Own::SmoothOdd } else { Own::Steps };
        Ok(Self {
            pool: [binder.stage(pool, &[("finer", image)])?, binder.stage(pool, &[("finer", Own::Pyramid.into())])?],
            image_loss: [
                binder.stage(loss, &[("predicted", image)])?,
                binder.stage(loss, &[("predicted", Own::Pyramid.into())])?,
            ],
            loss_sum: binder.stage(loss_sum, &[])?,
            image_upstream: binder.stage(upstream, &[])?,
            regularize_vertices: binder.stage(vertices, &[])?,
            regularize_flaps: binder.stage(flaps, &[])?,
            loss_record: binder.stage(record, &[])?,
            shape_gradient: binder.stage(gradient, &[])?,
            smooth: [smoothing(Own::ShapeGradients)?, smoothing(Own::Steps)?],
            smooth_dense: [
                binder.stage(dense, &[("rough", Own::ShapeGradients.into()), ("Smoothed", Own::SmoothOdd.into())])?,
                binder.stage(dense, &[("rough", Own::Steps.into()), ("Smoothed", Own::SmoothOdd.into())])?,
            ],
            centre_total: binder.stage(centre, &[("parts", Own::CentrePartials.into())])?,
            largest_square: binder.stage(largest, &[("parts", Own::SquarePartials.into())])?,
            squares: binder.stage(squares, &[("gradients", gradients.into())])?,
            optimizer: binder.stage(optimizer, &[("gradients", gradients.into())])?,
            position_step: binder.stage(position_step, &[("changes", changes.into())])?,
            color_step: binder.stage(colors, &[])?,
        })
    }

    /// Records what runs between forward and backward: losses, their gradients by the images, regularizers, the record.
    ///
    /// # Errors
    /// [`Error::Limit`] for more workgroups than the device allows.
    pub fn record_loss(&self, recorder: &mut Recorder<'_>, plan: &FitPlan, numbers: &Numbers) -> Result<()> {
        recorder.begin_label("softras loss");
        self.record_pyramid(recorder, plan)?;
        for level in &plan.levels {
            let stage = &self.image_loss[usize::from(level.pyramid_first.is_some())];
            let push = [
                level.pyramid_first.unwrap_or(0),
                level.target_first,
                level.width * level.height,
                level.partial_first,
                plan.silhouette.delta.to_bits(),
                plan.color.delta.to_bits(),
            ];
            stage.record(recorder, &push, [level.blocks, plan.views, 1])?;
        }
        self.record_regularizers(recorder, plan)?;
        recorder.barrier();
        for (i, level) in plan.levels.iter().enumerate() {
            let push = [level.partial_first, level.blocks, i as u32 * plan.views];
            self.loss_sum.record(recorder, &push, [plan.views, 1, 1])?;
        }
        recorder.barrier();
        let deltas = [plan.silhouette.delta, plan.color.delta].map(f32::to_bits);
        let levels = plan.levels.len() as u32;
        let push = [plan.width, plan.height, plan.views, plan.samples, levels, deltas[0], deltas[1]];
        let groups = [plan.width.div_ceil(c::FIT_GROUP), plan.height, plan.views];
        self.image_upstream.record(recorder, &push, groups)?;
        self.record_record(recorder, plan, numbers)?;
        recorder.end_label();
        Ok(())
    }

    /// Records the pooling of every level except the rendered image, each from the next finer one.
    fn record_pyramid(&self, recorder: &mut Recorder<'_>, plan: &FitPlan) -> Result<()> {
        let (mut width, mut height, mut factor, mut from) = (plan.width, plan.height, plan.samples, None);
        for level in &plan.levels {
            if let Some(first) = level.pyramid_first {
                let count = level.width * level.height * plan.views;
                let push = [from.unwrap_or(0), width, height, first, level.width, level.height, factor, count];
                self.pool[usize::from(from.is_some())].record(recorder, &push, pixels(count))?;
                recorder.barrier();
                from = Some(first);
            }
            (width, height, factor) = (level.width, level.height, 2);
        }
        Ok(())
    }

    fn record_regularizers(&self, recorder: &mut Recorder<'_>, plan: &FitPlan) -> Result<()> {
        if plan.vertex_penalties() {
            let push = [plan.vertices, plan.edge_target.to_bits(), edge_scale(plan).to_bits()];
            self.regularize_vertices.record(recorder, &push, linear(plan.vertices))?;
        }
        if plan.flap_penalties() && plan.flaps > 0 {
            let push = [plan.flaps, plan.flatten_weight.to_bits(), plan.normal_weight.to_bits()];
            self.regularize_flaps.record(recorder, &push, linear(plan.flaps))?;
        }
        Ok(())
    }

    fn record_record(&self, recorder: &mut Recorder<'_>, plan: &FitPlan, numbers: &Numbers) -> Result<()> {
        let when = |on: bool, count: u32| if on { count } else { 0 };
        let weights = [
            plan.silhouette.weight,
            plan.color.weight,
            plan.laplacian_weight,
            plan.flatten_weight,
            plan.edge_weight,
            plan.normal_weight,
            edge_share(plan),
        ]
        .map(f32::to_bits);
        let mut push = [0; 12];
        push[..4].copy_from_slice(&[
            plan.views,
            plan.levels.len() as u32,
            when(plan.vertex_penalties(), plan.vertices),
            when(plan.flap_penalties(), plan.flaps),
        ]);
        push[4..11].copy_from_slice(&weights);
        push[11] = numbers.row;
        self.loss_record.record(recorder, &push, [1, 1, 1])
    }

    /// Records what runs after backward: the step.
    ///
    /// # Errors
    /// As [`record_loss`](Self::record_loss).
    pub fn record_step(&self, recorder: &mut Recorder<'_>, plan: &FitPlan, numbers: &Numbers) -> Result<()> {
        recorder.begin_label("softras step");
        let rows = plan.rows();
        let push = [plan.vertices, (2.0 * plan.laplacian_weight).to_bits()];
        self.shape_gradient.record(recorder, &push, linear(plan.vertices))?;
        if plan.fit_colors {
            self.color_step.record(
                recorder,
                &rates_push(plan.vertices, &numbers.color_rates),
                linear(plan.vertices),
            )?;
        }
        recorder.barrier();
        if plan.logit {
            self.centre_total.record(recorder, &[linear(plan.vertices)[0]], [1, 1, 1])?;
            recorder.barrier();
        }
        self.record_smoothing(recorder, plan, 0)?;
        let push = rates_push(rows, &numbers.rates);
        if plan.method_code() == c::METHOD_UNIFORM {
            self.squares.record(recorder, &push, linear(rows))?;
            recorder.barrier();
            self.largest_square.record(recorder, &[linear(rows)[0]], [1, 1, 1])?;
            recorder.barrier();
        }
        self.optimizer.record(recorder, &push, linear(rows))?;
        recorder.barrier();
        self.record_smoothing(recorder, plan, 1)?;
        let mut push = [plan.vertices; 11];
        let Guard { bounds, center, inverse_radius, .. } = &numbers.guard;
        let limits = bounds.as_flattened().iter().chain(center).chain([inverse_radius]);
        push[1..].iter_mut().zip(limits).for_each(|(to, from)| *to = from.to_bits());
        self.position_step.record(recorder, &push, linear(plan.vertices))?;
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }

    /// Records the smoothing of gradients (0) or of steps (1), if the fit has one.
    fn record_smoothing(&self, recorder: &mut Recorder<'_>, plan: &FitPlan, of: usize) -> Result<()> {
        let smoothing = match &plan.smoothing {
            None => return Ok(()),
            Some(Smoother::Dense) => {
                self.smooth_dense[of].record(recorder, &[plan.vertices], linear(plan.vertices))?;
                recorder.barrier();
                return Ok(());
            }
            Some(Smoother::Iterated(smoothing)) => smoothing,
        };
        for (i, omega) in smoothing.omegas.iter().enumerate() {
            let numbers = [smoothing.lambda, *omega, smoothing.relaxation].map(f32::to_bits);
            let push = [plan.vertices, i as u32, numbers[0], numbers[1], numbers[2]];
            self.smooth[of][i % 2].record(recorder, &push, linear(plan.vertices))?;
            recorder.barrier();
        }
        Ok(())
    }
}

impl Stage {
    fn record(&self, recorder: &mut Recorder<'_>, push: &[u32], groups: [u32; 3]) -> Result<()> {
        recorder.begin_label(self.pipeline.kernel().name);
        recorder.dispatch(&self.pipeline, &self.set, bytemuck::cast_slice(push), groups)?;
        recorder.end_label();
        Ok(())
    }
}

fn rates_push(rows: u32, rates: &Rates) -> [u32; 9] {
    let mut push = [rows; 9];
    push[1..].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(rates)));
    push
}

/// Workgroups for `count` invocations.
fn linear(count: u32) -> [u32; 3] {
    [count.div_ceil(c::FIT_GROUP), 1, 1]
}

/// Workgroups for a number of pixels, which may need more than one row of them.
fn pixels(count: u32) -> [u32; 3] {
    let groups = count.div_ceil(c::FIT_GROUP);
    [groups.min(c::FORWARD_ROW), groups.div_ceil(c::FORWARD_ROW), 1]
}

impl std::fmt::Debug for Stages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stages").finish_non_exhaustive()
    }
}
