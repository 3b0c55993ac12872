//! The backward stages in the order in which they run, and the commands of one backward pass.

use super::{List, Stage, Work, bind_all, clear, no_workgroups, reads_together, stamp};
use crate::Result;
use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::plan::{BackwardPlan, FramePush};
use crate::vulkan::{BufferPart, Device, Kernel, Pipeline, Recorder, TimestampPool, kernels};

/// A stage of a backward pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BackwardStage {
    /// Turns dL/dimages into the factors of each pixel that a triangle may reach.
    PixelGrad,
    /// Selects the items (a triangle record within one cell of its box) that can have a gradient; small ones are listed
    /// apart.
    Cull,
    /// Sums over the pixels of each item that is visible in a shaded image.
    Shown,
    /// Sums over the pixels of each small item that is visible in a shaded image.
    ShownSmall,
    /// Sums over the pixels of each item that contributes to the silhouette only.
    Outline,
    /// Sums over the pixels of each small item that contributes to the silhouette only.
    OutlineSmall,
    /// Adds the sums over the cells that found no room to those of their triangles' first cells.
    Long,
    /// Sums each triangle's items, and carries the sums to its corners.
    TriangleGrad,
    /// Carries gradients by vertex normals to the corners, with smooth shading.
    VertexNormalGrad,
    /// Sums each vertex's corners.
    VertexGrad,
    /// Sums over each view, for cameras, σ and γ.
    ReduceViews,
    /// Sums for each light.
    ReduceLights,
    /// Sums over all pixels, for the background, σ and γ.
    ReducePixels,
}

use BackwardStage as S;

/// How many stages a backward pass has.
pub const BACKWARD_COUNT: usize = BackwardStage::ALL.len();

impl BackwardStage {
    /// Every stage, in the order in which they run.
    pub const ALL: [Self; 13] = [
        S::PixelGrad,
        S::Cull,
        S::Shown,
        S::ShownSmall,
        S::Outline,
        S::OutlineSmall,
        S::Long,
        S::TriangleGrad,
        S::VertexNormalGrad,
        S::VertexGrad,
        S::ReduceViews,
        S::ReduceLights,
        S::ReducePixels,
    ];

    /// Its name in timings and in debuggers.
    pub fn name(self) -> &'static str {
        match self {
            S::PixelGrad => "pixel_grad",
            S::Cull => "backward_cull",
            S::Shown => "backward",
            S::ShownSmall => "backward_small",
            S::Outline => "backward_outline",
            S::OutlineSmall => "backward_outline_small",
            S::Long => "backward_long",
            S::TriangleGrad => "triangle_grad",
            S::VertexNormalGrad => "vertex_normal_grad",
            S::VertexGrad => "vertex_grad",
            S::ReduceViews => "reduce_views",
            S::ReduceLights => "reduce_lights",
            S::ReducePixels => "reduce_pixels",
        }
    }

    /// Its kernel on a device. If the lanes of a tile are one subgroup that can shuffle, they read records together.
    pub fn kernel(self, device: &Device, lanes: u32) -> &'static Kernel {
        let together = reads_together(device, lanes);
        match self {
            S::PixelGrad => &kernels::PIXEL_GRAD,
            S::Cull => &kernels::BACKWARD_CULL,
            S::Shown | S::ShownSmall | S::Outline | S::OutlineSmall if together => &kernels::BACKWARD_SUBGROUP,
            S::Shown | S::ShownSmall | S::Outline | S::OutlineSmall => &kernels::BACKWARD,
            S::Long => &kernels::BACKWARD_LONG,
            S::TriangleGrad => &kernels::TRIANGLE_GRAD,
            S::VertexNormalGrad => &kernels::VERTEX_NORMAL_GRAD,
            S::VertexGrad => &kernels::VERTEX_GRAD,
            S::ReduceViews | S::ReduceLights | S::ReducePixels => &kernels::REDUCE,
        }
    }

    /// The specialization constants that tell stages of one kernel apart, by their names in GLSL.
    pub fn modes(self) -> [(&'static str, u32); 3] {
        let reduction = match self {
            S::ReduceLights => c::REDUCTION_LIGHTS,
            S::ReducePixels => c::REDUCTION_PIXELS,
            _ => c::REDUCTION_VIEWS,
        };
        let outline = matches!(self, S::Outline | S::OutlineSmall);
        let small = u32::from(self.takes_small_items());
        [("REDUCTION", reduction), ("OUTLINE", u32::from(outline)), ("SMALL", small)]
    }

    /// Whether each lane has an item of its own.
    pub fn takes_small_items(self) -> bool {
        matches!(self, S::ShownSmall | S::OutlineSmall)
    }

    /// Whether a plan may record it.
    pub fn is_needed(self, plan: &BackwardPlan) -> bool {
        match self {
            S::PixelGrad | S::Cull | S::VertexGrad => true,
            S::Shown => plan.shades() && plan.large,
            S::ShownSmall => plan.shades(),
            S::Outline => plan.outlines() && plan.large,
            S::OutlineSmall => plan.outlines(),
            S::Long => plan.long_turns > 0,
            S::TriangleGrad => plan.sums_corners(),
            S::VertexNormalGrad => plan.sums_corners() && plan.modes.smooth != 0,
            S::ReduceViews => plan.has(c::GRADIENT_VIEW | c::GRADIENT_SCALARS),
            S::ReduceLights => plan.has(c::GRADIENT_LIGHTS),
            S::ReducePixels => plan.has(c::GRADIENT_BACKGROUND | c::GRADIENT_SCALARS),
        }
    }

    /// The buffer that a binding stands for in this stage, where stages of one kernel bind different buffers.
    fn alias(self, binding: &str) -> Option<BufferId> {
        match (binding, self) {
            ("items", S::Shown | S::ShownSmall) => Some(BufferId::ShownItems),
            ("items", S::Outline | S::OutlineSmall) => Some(BufferId::OutlineItems),
            ("items", S::Long) => Some(BufferId::LongRecords),
            ("rows", S::ReduceViews) => Some(BufferId::ViewSums),
            ("rows", S::ReduceLights) => Some(BufferId::LightRecords),
            ("rows", S::ReducePixels) => Some(BufferId::PixelSums),
            _ => None,
        }
    }
}

/// The backward stages bound to the buffers of a frame and of its gradients, indexed by [`BackwardStage`].
pub struct BackwardStages([Stage; BACKWARD_COUNT]);

impl BackwardStages {
    /// Binds one pipeline for each of [`BackwardStage::ALL`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; BACKWARD_COUNT],
        find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        bind_all(device, pipelines, |stage, binding| S::ALL[stage].alias(binding), find).map(Self)
    }
}

/// Records one backward pass after its forward frame.
///
/// The frame's workspace, images and `saved` are as [`record_forward`](super::record_forward) left them. The pass
/// begins and ends with the same barriers as a frame.
pub fn record_backward(
    recorder: &mut Recorder<'_>,
    plan: &BackwardPlan,
    stages: &BackwardStages,
    texel_sums: &BufferPart,
    item_counts: &BufferPart,
    tile_counts: &BufferPart,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let groups = &plan.groups;
    let items = |offset: u32| Work::List(List::of_rows(plan.item_rows, 0, item_counts, c::ITEM_COUNT_WORDS, offset));
    // `totals` holds the sums of the views, then of the lights with the ambient one, then of the pixels.
    let (lights, pixels) = (plan.push.view_count, plan.push.view_count + plan.push.light_count + 1);
    recorder.begin_label("backward");
    recorder.barrier();
    no_workgroups(recorder, item_counts, u64::from(plan.item_rows * c::ITEM_COUNT_WORDS / 3))?;
    clear(recorder, texel_sums, plan.sizes[BufferId::TexelSums])?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for stage in S::ALL {
        if !stage.is_needed(plan) {
            stamp(recorder, times, stage as u32 + 1)?;
            continue;
        }
        let mut push = plan.push;
        let work = match stage {
            // The background's gradients need every pixel, all others only the tiles that have a list.
            S::PixelGrad if plan.tile_rows > 0 => {
                Work::List(List::of_rows(plan.tile_rows, 0, tile_counts, c::TILE_COUNT_WORDS, c::TILES_FILLED))
            }
            S::PixelGrad => Work::Groups(groups.pixel_grad),
            S::Cull => Work::Groups(groups.backward_cull),
            S::Shown => items(c::ITEMS_SHOWN),
            S::ShownSmall => items(c::ITEMS_SHOWN + c::ITEMS_SMALL),
            S::Outline => items(c::ITEMS_OUTLINE),
            S::OutlineSmall => items(c::ITEMS_OUTLINE + c::ITEMS_SMALL),
            S::Long => items(c::ITEMS_LONG),
            S::TriangleGrad => Work::Groups(groups.triangle_grad),
            S::VertexNormalGrad => Work::Groups(groups.vertex_normal_grad),
            S::VertexGrad => Work::Groups(groups.vertex_grad),
            S::ReduceViews => Work::Groups(groups.reduce_views),
            S::ReduceLights => {
                (push.first, push.number) = (lights, plan.light_rows);
                Work::Groups(groups.reduce_lights)
            }
            S::ReducePixels => {
                (push.first, push.number) = (pixels, plan.pixel_rows);
                Work::Groups(groups.reduce_pixels)
            }
        };
        let turns = if stage == S::Long { 0..plan.long_turns } else { push.number..push.number + 1 };
        for number in turns {
            stages.0[stage as usize].run(recorder, stage.name(), &FramePush { number, ..push }, &work)?;
        }
        stamp(recorder, times, stage as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::buffers::ALIASES;

    /// Each stage is found at its own index, and each buffer of an alias is bound by some stage.
    #[test]
    fn stages_are_indices_and_aliases_are_complete() {
        for (i, stage) in S::ALL.into_iter().enumerate() {
            assert_eq!(stage as usize, i, "{stage:?}");
        }
        for (i, stage) in super::super::ForwardStage::ALL.into_iter().enumerate() {
            assert_eq!(stage as usize, i, "{stage:?}");
        }
        for (binding, buffers) in ALIASES {
            let bound = |buffer: &BufferId| S::ALL.into_iter().any(|stage| stage.alias(binding) == Some(*buffer));
            assert!(buffers.iter().all(bound), "{binding}");
        }
    }
}
