//! Buffers bound to a frame's kernels, made before recording so that recording only records.

use super::plan::{BufferRequirement, FRAME_SLOTS, FramePlan, GRADIENT_SLOTS, GradientPlan};
use crate::error::{Error, Result};
use crate::frame::buffers::{BACKWARD, FORWARD, UNUSED, UNUSED_SIZE};
use crate::frame::passes::{self, BACKWARD_COUNT, BackwardStages, ForwardStages};
use crate::gradients::Wanted;
use crate::vulkan::{BufferPart, BufferRef, Device, Pipeline, TexelFormat, vk};

/// One frame's buffers bound to the forward kernels: descriptor sets, buffer views and pipelines. Two frames in flight take
/// two of them with buffers of their own; inputs that nobody writes may be shared.
///
/// Keep it, and the buffers, until every command buffer that it was recorded into has been executed for the last time or
/// thrown away; then drop it, in any order with its [`Rasterizer`](super::Rasterizer), but before the device.
pub struct FrameBindings {
    pub(super) stages: ForwardStages,
    pub(super) status: BufferPart,
    pub(super) bin_bits: BufferPart,
    pub(super) tile_counts: BufferPart,
    /// The modes of the plan that it was made for.
    modes: Vec<(&'static str, u32)>,
    /// Bytes bound, by slot.
    ranges: [u64; FRAME_SLOTS],
    pub(super) parts: Parts,
}

/// One frame's buffers bound to the backward kernels, those of its [`FrameBindings`] among them. To be kept as that.
pub struct GradientBindings {
    pub(super) stages: BackwardStages,
    pub(super) texel_sums: BufferPart,
    pub(super) item_counts: BufferPart,
    pub(super) vertex_gradients: BufferPart,
    pub(super) wanted: Wanted,
    /// What is cleared first where only the device knows how many triangles there are.
    pub(super) cleared: Vec<BufferPart>,
    modes: Vec<(&'static str, u32)>,
    ranges: [u64; GRADIENT_SLOTS],
    frame_ranges: [u64; FRAME_SLOTS],
}

/// Buffers by name, and what is bound where a frame has none.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub named: Vec<(&'static str, BufferPart)>,
    /// The same few bytes in every format.
    pub unused: Vec<(TexelFormat, BufferPart)>,
}

impl Parts {
    fn named(&self, name: &str) -> Option<&BufferPart> {
        self.named.iter().find(|(n, _)| *n == name).map(|(_, part)| part)
    }

    fn unused(&self, format: TexelFormat) -> Option<&BufferPart> {
        self.unused.iter().find(|(f, _)| *f == format).map(|(_, part)| part)
    }

    /// What is bound by a name: its buffer, or the unused bytes.
    pub(super) fn find(&self, name: &str) -> Option<&BufferPart> {
        let slot = || FORWARD.iter().chain(&BACKWARD).find(|slot| slot.name == name);
        self.named(name).or_else(|| self.unused(slot()?.format))
    }

    fn get(&self, name: &str) -> Result<&BufferPart> {
        self.named(name).ok_or_else(|| missing(name))
    }

    /// The host's buffers, each checked against what is required of it.
    pub(super) fn from_host(
        device: &Device,
        required: &[BufferRequirement],
        given: &[(&str, BufferRef)],
    ) -> Result<Self> {
        for (i, (name, _)) in given.iter().enumerate() {
            if !required.iter().any(|r| r.name == *name) {
                return host_error(format!("the plan has no buffer `{name}`"), "give those of its buffers()");
            }
            if given[..i].iter().any(|(n, _)| n == name) {
                return host_error(format!("buffer `{name}` is given twice"), "give each once");
            }
        }
        let mut parts = Self::default();
        for requirement in required {
            let Some((_, at)) = given.iter().find(|(name, _)| *name == requirement.name) else {
                return Err(missing(requirement.name));
            };
            judge(requirement, at)?;
            // Whole texels only: a view cannot end within one.
            let at = at.part(0, at.range() - at.range() % requirement.format.bytes())?;
            let texels = |format| BufferPart::texels_of_host(device, &at, format, requirement.name);
            if requirement.name == UNUSED.name {
                for format in TexelFormat::ALL {
                    parts.unused.push((format, texels(format)?));
                }
            } else if requirement.usage.contains(vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER) {
                parts.named.push((requirement.name, texels(requirement.format)?));
            } else {
                parts.named.push((requirement.name, BufferPart::of_host(&at)));
            }
        }
        Ok(parts)
    }
}

fn missing(name: &str) -> Error {
    Error::Host {
        what: format!("there is no buffer `{name}`"),
        fix: "give every buffer of the plan's buffers()".into(),
    }
}

fn host_error<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

fn judge(requirement: &BufferRequirement, at: &BufferRef) -> Result<()> {
    let BufferRequirement { name, size, alignment, usage, .. } = requirement;
    let range = if requirement.name == UNUSED.name { at.range().min(UNUSED_SIZE) } else { at.range() };
    if vk::Handle::is_null(at.raw()) {
        return host_error(format!("buffer `{name}` is null"), "give a buffer with memory bound to it");
    }
    if range < *size {
        return host_error(format!("buffer `{name}` has {range} bytes, the plan needs {size}"), "give as many");
    }
    if !at.offset().is_multiple_of(*alignment) {
        let what = format!("buffer `{name}` lies at {}, no multiple of {alignment}", at.offset());
        return host_error(what, "align it as the plan says");
    }
    if !at.usage().contains(*usage) {
        let what = format!("buffer `{name}` was made for {:?}, the plan needs {usage:?}", at.usage());
        return host_error(what, "make it with the usages that the plan lists");
    }
    Ok(())
}

/// Bytes bound in each slot, 0 where the frame has no such buffer.
fn ranges_of<const N: usize>(required: &[BufferRequirement], parts: &Parts) -> [u64; N] {
    let mut ranges = [0; N];
    for requirement in required {
        let part = parts.named(requirement.name).map(BufferPart::range);
        ranges[requirement.slot] = part.unwrap_or(if requirement.name == UNUSED.name { UNUSED_SIZE } else { 0 });
    }
    ranges
}

/// A plan may be recorded with what was bound for another if it needs no more and compiles to the same kernels.
fn fits(sizes: &[u64], ranges: &[u64], same_modes: bool) -> Result<()> {
    if !same_modes {
        let fix = "bind buffers for this plan: outputs, modes, lights or depth span are others";
        return host_error("the bindings were made for other kernels than the plan's".into(), fix);
    }
    match sizes.iter().zip(ranges).find(|(size, range)| size > range) {
        Some((size, range)) => {
            let what = format!("a buffer of {range} bytes is bound where the plan needs {size}");
            host_error(what, "bind larger buffers")
        }
        None => Ok(()),
    }
}

impl FrameBindings {
    pub(super) fn new(
        device: &Device,
        pipelines: [Pipeline; passes::FORWARD_COUNT],
        plan: &FramePlan,
        parts: Parts,
    ) -> Result<Self> {
        let stages = ForwardStages::new(device, pipelines, &|name| parts.find(name))?;
        Ok(Self {
            stages,
            status: parts.get("status")?.clone(),
            bin_bits: parts.get("bin_bits")?.clone(),
            tile_counts: parts.get("tile_counts")?.clone(),
            modes: plan.plan.modes.clone(),
            ranges: ranges_of(plan.buffers(), &parts),
            parts,
        })
    }

    /// One of the frame's buffers.
    pub(super) fn array(&self, name: &str) -> Result<&BufferPart> {
        self.parts.get(name)
    }

    /// Whether a plan can be recorded with it. Allocates nothing unless it cannot.
    ///
    /// # Errors
    /// [`Error::Host`] saying what is too small or otherwise compiled.
    pub fn fits(&self, plan: &FramePlan) -> Result<()> {
        fits(&plan.sizes, &self.ranges, plan.plan.modes == self.modes)
    }
}

impl GradientBindings {
    pub(super) fn new(
        device: &Device,
        pipelines: [Pipeline; BACKWARD_COUNT],
        plan: &GradientPlan,
        parts: &Parts,
        frame: &FrameBindings,
    ) -> Result<Self> {
        let find = |name: &str| parts.named(name).or_else(|| frame.parts.find(name));
        let get = |name: &str| find(name).cloned().ok_or_else(|| missing(name));
        Ok(Self {
            stages: BackwardStages::new(device, pipelines, &find)?,
            texel_sums: get("texel_sums")?,
            item_counts: get("item_counts")?,
            vertex_gradients: get("vertex_gradients")?,
            wanted: plan.wanted,
            cleared: ["corner_gradients", "light_records"].iter().filter_map(|n| parts.named(n).cloned()).collect(),
            modes: plan.plan.modes.clone(),
            ranges: ranges_of(plan.buffers(), parts),
            frame_ranges: frame.ranges,
        })
    }

    /// Whether a plan can be recorded with it. Allocates nothing unless it cannot.
    ///
    /// # Errors
    /// [`Error::Host`] saying what is too small or otherwise compiled.
    pub fn fits(&self, plan: &GradientPlan) -> Result<()> {
        fits(&plan.frame_sizes, &self.frame_ranges, plan.plan.modes == self.modes)?;
        fits(&plan.sizes, &self.ranges, true)
    }
}

impl std::fmt::Debug for FrameBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameBindings").field("modes", &self.modes).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for GradientBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GradientBindings").field("modes", &self.modes).finish_non_exhaustive()
    }
}
