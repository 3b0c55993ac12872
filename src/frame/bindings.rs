//! Buffers bound to a frame's kernels, before recording, so that recording does not allocate.

use super::frame_plan::{BufferRequirement, FramePlan, GradientPlan};
use crate::error::{Error, Result};
use crate::frame::buffers::{BufferId, Parts, Sizes, UNUSED_SIZE};
use crate::frame::passes::{BACKWARD_COUNT, BackwardStages, FORWARD_COUNT, ForwardStages};
use crate::frame::plan::{Modes, Rare};
use crate::gradients::GradientRequest;
use crate::vulkan::{BufferPart, Device, Pipeline, TexelFormat, vk};
use std::sync::Arc;

/// One frame's buffers bound to the forward kernels: descriptor sets, buffer views and pipelines. Two frames in flight need
/// two of them with different buffers; inputs that are not written meanwhile may be shared.
///
/// Keep it and the buffers until every command buffer that it was recorded into has been executed for the last time or
/// freed. Drop it before the device; it may be dropped before or after its [`Rasterizer`](crate::embed::Rasterizer).
pub struct FrameBindings {
    pub(crate) stages: ForwardStages,
    pub(crate) status: BufferPart,
    pub(crate) bin_bits: BufferPart,
    pub(crate) tile_counts: BufferPart,
    /// The modes and the lanes of bin_coarse that its kernels were compiled for, and which of the rare ones there are.
    kernels: (Modes, u32, Rare),
    /// Whether the kernel of tiles without lists was compiled.
    walks: bool,
    /// Bytes bound.
    ranges: Sizes,
    pub(crate) parts: Parts,
    /// Tells these bindings from all others.
    pub(crate) identity: Arc<()>,
}

/// One frame's buffers bound to the backward kernels. Keep it, and its [`FrameBindings`], as long as the latter say.
pub struct GradientBindings {
    pub(crate) stages: BackwardStages,
    pub(crate) texel_sums: BufferPart,
    pub(crate) item_counts: BufferPart,
    pub(crate) tile_counts: BufferPart,
    pub(crate) vertex_gradients: BufferPart,
    pub(crate) wanted: GradientRequest,
    /// The buffers that are cleared first if only the device knows how many triangles there are.
    pub(crate) cleared: Vec<BufferPart>,
    /// The modes that its kernels were compiled for, and whether those for large boxes are there.
    kernels: (Modes, bool),
    ranges: Sizes,
    frame_ranges: Sizes,
}

/// Buffers, each validated against its requirement.
pub(crate) fn validated_parts(
    device: &Device,
    required: &[BufferRequirement],
    given: &[&(BufferId, BufferPart)],
) -> Result<Parts> {
    for (i, (id, _)) in given.iter().enumerate() {
        if !required.iter().any(|r| r.id == *id) {
            return host_error(format!("the plan has no buffer `{id}`"), "give those of its buffers()");
        }
        if given[..i].iter().any(|(other, _)| other == id) {
            return host_error(format!("buffer `{id}` is given twice"), "give each once");
        }
    }
    let mut parts = Parts::default();
    for requirement in required {
        let id = requirement.id;
        let Some((_, at)) = given.iter().find(|(given, _)| *given == id) else {
            return Err(missing(id));
        };
        validate(requirement, at)?;
        // A buffer view must end with a whole texel.
        let at = at.part(0, at.range() - at.range() % id.row().format.bytes())?;
        let texels = |format| at.with_texels(device, format, id.name());
        if id == BufferId::Unused {
            for format in TexelFormat::ALL {
                parts.unused.push((format, texels(format)?));
            }
        } else if requirement.usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
            parts.bound.push((id, texels(id.row().format)?));
        } else {
            parts.bound.push((id, at));
        }
    }
    Ok(parts)
}

fn missing(id: BufferId) -> Error {
    Error::Host { what: format!("there is no buffer `{id}`"), fix: "give every buffer of the plan's buffers()".into() }
}

fn get(parts: &Parts, id: BufferId) -> Result<&BufferPart> {
    parts.get(id).ok_or_else(|| missing(id))
}

fn host_error<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

fn validate(requirement: &BufferRequirement, at: &BufferPart) -> Result<()> {
    let BufferRequirement { id, size, alignment, usage, .. } = requirement;
    let range = if *id == BufferId::Unused { at.range().min(UNUSED_SIZE) } else { at.range() };
    if vk::Handle::is_null(at.raw()) {
        return host_error(format!("buffer `{id}` is null"), "give a buffer with memory bound to it");
    }
    if range < *size {
        return host_error(format!("buffer `{id}` has {range} bytes, the plan needs {size}"), "give as many");
    }
    if !at.offset().is_multiple_of(*alignment) {
        let what = format!("buffer `{id}` lies at {}, no multiple of {alignment}", at.offset());
        return host_error(what, "align it as the plan says");
    }
    if !at.usage().contains(*usage) {
        let what = format!("buffer `{id}` was made for {:?}, the plan needs {usage:?}", at.usage());
        return host_error(what, "make it with the usages that the plan lists");
    }
    Ok(())
}

/// Bytes bound for each buffer; 0 for a buffer that the plan does not have.
fn ranges_of(parts: &Parts) -> Sizes {
    let mut ranges = Sizes::NONE;
    ranges[BufferId::Unused] = if parts.unused.is_empty() { 0 } else { UNUSED_SIZE };
    for (id, part) in &parts.bound {
        ranges[*id] = part.range();
    }
    ranges
}

/// A plan may be recorded with the bindings of another plan if it needs no larger buffers and the same kernels.
fn fits(sizes: &Sizes, ranges: &Sizes, same_kernels: bool) -> Result<()> {
    if !same_kernels {
        let fix = "bind buffers for this plan: outputs, modes, lights or depth span are others";
        return host_error("the bindings were made for other kernels than the plan's".into(), fix);
    }
    match sizes.larger_than(ranges) {
        Some((id, size, range)) => {
            let what = format!("buffer `{id}` of {range} bytes is bound where the plan needs {size}");
            host_error(what, "bind a larger buffer")
        }
        None => Ok(()),
    }
}

fn kernels_of(plan: &FramePlan) -> (Modes, u32, Rare) {
    (plan.forward.modes, plan.forward.coarse_lanes, plan.forward.rare)
}

impl FrameBindings {
    pub(crate) fn new(
        device: &Device,
        pipelines: [Pipeline; FORWARD_COUNT],
        plan: &FramePlan,
        parts: Parts,
    ) -> Result<Self> {
        let stages = ForwardStages::new(device, pipelines, &|id| parts.find(id))?;
        Ok(Self {
            stages,
            status: get(&parts, BufferId::Status)?.clone(),
            bin_bits: get(&parts, BufferId::BinBits)?.clone(),
            tile_counts: get(&parts, BufferId::TileCounts)?.clone(),
            kernels: kernels_of(plan),
            walks: plan.forward.walks.needed,
            ranges: ranges_of(&parts),
            parts,
            identity: Arc::default(),
        })
    }

    /// One of the frame's buffers.
    pub(crate) fn array(&self, id: BufferId) -> Result<&BufferPart> {
        get(&self.parts, id)
    }

    /// Validates that a plan can be recorded with these bindings. It allocates only for an error.
    ///
    /// # Errors
    /// [`Error::Host`] naming the buffer that is too small, or that the kernels are compiled for other modes.
    pub fn fits(&self, plan: &FramePlan) -> Result<()> {
        fits(&plan.forward.sizes, &self.ranges, kernels_of(plan) == self.kernels)?;
        if plan.forward.walks.needed && !self.walks {
            let what = "the bindings were made for a plan whose lists have room for all that there can be".into();
            return host_error(what, "bind buffers for this plan");
        }
        Ok(())
    }
}

impl GradientBindings {
    pub(crate) fn new(
        device: &Device,
        pipelines: [Pipeline; BACKWARD_COUNT],
        plan: &GradientPlan,
        parts: &Parts,
        frame: &FrameBindings,
    ) -> Result<Self> {
        let find = |id: BufferId| parts.get(id).or_else(|| frame.parts.find(id));
        let get = |id: BufferId| find(id).cloned().ok_or_else(|| missing(id));
        let cleared = [BufferId::CornerGradients, BufferId::LightRecords];
        Ok(Self {
            stages: BackwardStages::new(device, pipelines, &find)?,
            texel_sums: get(BufferId::TexelSums)?,
            item_counts: get(BufferId::ItemCounts)?,
            tile_counts: get(BufferId::TileCounts)?,
            vertex_gradients: get(BufferId::VertexGradients)?,
            wanted: plan.wanted,
            cleared: cleared.into_iter().filter_map(|id| parts.get(id).cloned()).collect(),
            kernels: (plan.backward.modes, plan.backward.large),
            ranges: ranges_of(parts),
            frame_ranges: frame.ranges,
        })
    }

    /// Validates that a plan can be recorded with these bindings. It allocates only for an error.
    ///
    /// # Errors
    /// [`Error::Host`] naming the buffer that is too small, or that the kernels are compiled for other modes.
    pub fn fits(&self, plan: &GradientPlan) -> Result<()> {
        fits(&plan.frame_sizes, &self.frame_ranges, (plan.backward.modes, plan.backward.large) == self.kernels)?;
        fits(&plan.backward.sizes, &self.ranges, true)
    }
}

impl std::fmt::Debug for FrameBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameBindings").field("kernels", &self.kernels).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for GradientBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GradientBindings").field("kernels", &self.kernels).finish_non_exhaustive()
    }
}
