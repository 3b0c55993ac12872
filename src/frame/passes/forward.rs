//! The forward stages in the order in which they run, and the commands of one frame.

use super::{List, Stage, Work, bind_all, clear, no_workgroups, reads_together, stamp};
use crate::Result;
use crate::constants as c;
use crate::frame::buffers::BufferId;
use crate::frame::plan::{ForwardPlan, FramePush};
use crate::vulkan::{BufferPart, Device, Kernel, Pipeline, Recorder, TimestampPool, kernels};

/// A stage of a forward frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ForwardStage {
    /// Transforms the vertices as each view sees them.
    Vertex,
    /// Makes the records of the triangles, and marks the bins that each can reach.
    Triangle,
    /// Lists the triangles of each bin.
    BinCoarse,
    /// Lists the triangles of each tile.
    BinFine,
    /// Fills the tiles that no triangle reaches.
    Background,
    /// Aggregates the triangles of the other tiles, if the frame's modes are those of the soft model.
    ForwardSoft,
    /// Aggregates the triangles of all tiles in other modes; else of those with a triangle too thin for the stage before.
    Forward,
    /// Does the work of `ForwardSoft` for the tiles whose lists have no room, or are longer than the device's loops walk.
    ForwardSoftLong,
    /// Does the work of `Forward` for those tiles.
    ForwardLong,
}

/// How many stages a forward frame has.
pub const FORWARD_COUNT: usize = ForwardStage::ALL.len();

impl ForwardStage {
    /// Every stage, in the order in which they run.
    pub const ALL: [Self; 9] = [
        Self::Vertex,
        Self::Triangle,
        Self::BinCoarse,
        Self::BinFine,
        Self::Background,
        Self::ForwardSoft,
        Self::Forward,
        Self::ForwardSoftLong,
        Self::ForwardLong,
    ];

    /// Its name in timings and in debuggers: its GLSL file's.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vertex => "vertex",
            Self::Triangle => "triangle",
            Self::BinCoarse => "bin_coarse",
            Self::BinFine => "bin_fine",
            Self::Background => "background",
            Self::ForwardSoft => "forward_soft",
            Self::Forward => "forward",
            Self::ForwardSoftLong => "forward_soft_long",
            Self::ForwardLong => "forward_long",
        }
    }

    /// Its kernel on a device. If the lanes of a tile are one subgroup that can shuffle, they read records together.
    pub fn kernel(self, device: &Device, lanes: u32) -> &'static Kernel {
        match self {
            Self::Vertex => &kernels::VERTEX,
            Self::Triangle => &kernels::TRIANGLE,
            Self::BinCoarse => &kernels::BIN_COARSE,
            Self::BinFine => &kernels::BIN_FINE,
            Self::Background => &kernels::BACKGROUND,
            Self::ForwardSoft if reads_together(device, lanes) => &kernels::FORWARD_SOFT_SUBGROUP,
            Self::ForwardSoft => &kernels::FORWARD_SOFT,
            Self::Forward if reads_together(device, lanes) => &kernels::FORWARD_SUBGROUP,
            Self::Forward => &kernels::FORWARD,
            Self::ForwardSoftLong => &kernels::FORWARD_SOFT_LONG,
            Self::ForwardLong => &kernels::FORWARD_LONG,
        }
    }

    /// Whether a plan may record it.
    pub fn is_needed(self, plan: &ForwardPlan) -> bool {
        let soft = plan.modes.soft != 0;
        match self {
            Self::ForwardSoft => soft,
            Self::Forward => !soft || plan.rare.thin,
            Self::ForwardSoftLong => soft && plan.walks.needed,
            Self::ForwardLong => plan.walks.needed,
            _ => true,
        }
    }
}

/// The forward stages bound to the buffers of a frame, indexed by [`ForwardStage`].
pub struct ForwardStages([Stage; FORWARD_COUNT]);

impl ForwardStages {
    /// Binds one pipeline for each of [`ForwardStage::ALL`].
    pub fn new<'a>(
        device: &Device,
        pipelines: [Pipeline; FORWARD_COUNT],
        find: &dyn Fn(BufferId) -> Option<&'a BufferPart>,
    ) -> Result<Self> {
        bind_all(device, pipelines, |_, _| None, find).map(Self)
    }
}

/// Records one forward frame.
///
/// The frame begins with a barrier after all earlier compute, copies and fills, and ends with one before all later
/// ones, so the caller has to order only what other stages and queues do to the buffers.
pub fn record_forward(
    recorder: &mut Recorder<'_>,
    plan: &ForwardPlan,
    stages: &ForwardStages,
    status: &BufferPart,
    bin_bits: &BufferPart,
    tile_counts: &BufferPart,
    times: Option<&TimestampPool>,
) -> Result<()> {
    let groups = &plan.groups;
    let counts = plan.sizes[BufferId::TileCounts] / 12;
    // One buffer holds three lists of tiles, each after the room for the one before: those to be drawn, the empty ones, and
    // those that the general kernel draws again or that are walked.
    let soft = plan.modes.soft != 0;
    let count = plan.totals.tiles as u32;
    let tiles = |needed: bool, first: u32, offset: u32| {
        let rows = if needed { plan.totals.tile_rows() as u32 } else { 0 };
        Work::List(List::of_rows(rows, first, tile_counts, c::TILE_COUNT_WORDS, offset))
    };
    recorder.begin_label("forward");
    recorder.barrier();
    recorder.fill(status, 0, plan.sizes[BufferId::Status], 0)?;
    no_workgroups(recorder, tile_counts, counts)?;
    clear(recorder, bin_bits, plan.sizes[BufferId::BinBits])?;
    recorder.barrier();
    stamp(recorder, times, 0)?;
    for stage in ForwardStage::ALL {
        let mut push = plan.push;
        let work = match stage {
            ForwardStage::Vertex => Work::Groups(groups.vertex),
            ForwardStage::Triangle => Work::Groups(groups.triangle),
            ForwardStage::BinCoarse => Work::Groups(groups.bin_coarse),
            ForwardStage::BinFine => Work::Groups(groups.bin_fine),
            ForwardStage::Background => tiles(true, count, c::TILES_EMPTY),
            ForwardStage::ForwardSoft => tiles(soft, 0, c::TILES_FILLED),
            ForwardStage::Forward if soft => tiles(plan.rare.thin, 2 * count, c::TILES_GENERAL),
            ForwardStage::Forward => tiles(true, 0, c::TILES_FILLED),
            ForwardStage::ForwardSoftLong | ForwardStage::ForwardLong => {
                push.number = c::ONE_TURN;
                tiles(stage.is_needed(plan), 0, c::TILES_WALKED)
            }
        };
        stages.0[stage as usize].run(recorder, stage.name(), &push, &work)?;
        if stage == ForwardStage::ForwardLong {
            record_turns(recorder, plan, stages, tile_counts)?;
        }
        stamp(recorder, times, stage as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}

/// Records the turns of the tiles that are walked in several. The rows and the kernels run one after the other, because
/// all of them keep the state of their walks in the same `walk_state`.
fn record_turns(
    recorder: &mut Recorder<'_>,
    plan: &ForwardPlan,
    stages: &ForwardStages,
    tile_counts: &BufferPart,
) -> Result<()> {
    let kernels = [ForwardStage::ForwardSoftLong, ForwardStage::ForwardLong];
    let rows = if plan.walks.needed { plan.walks.rows(&plan.totals) } else { 0 };
    for row in 0..rows {
        let offset = plan.totals.tile_rows() as u32 * c::TILE_COUNT_WORDS + 3 * row;
        let first = row * c::RESUMED_ROW;
        for stage in kernels.into_iter().filter(|stage| stage.is_needed(plan)) {
            for turn in 0..plan.walks.turns {
                let list = List { rows: 1, first, row: c::RESUMED_ROW, counts: tile_counts, stride: 3, offset };
                let push = FramePush { number: turn, ..plan.push };
                stages.0[stage as usize].run(recorder, stage.name(), &push, &Work::List(list))?;
            }
        }
    }
    Ok(())
}

#[cfg(all(test, feature = "renderer"))]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::ForwardStage;
    use crate::frame::passes::default_lanes;
    use crate::vulkan::{CacheFolder, Context, ContextOptions, DeviceKind};

    /// A tile whose lanes are one subgroup reads records by shuffles, whatever the size of the subgroup.
    #[test]
    fn one_subgroup_reads_records_together() {
        let context = Context::new(&ContextOptions { cache: CacheFolder::Nowhere, ..Default::default() }).unwrap();
        let device = context.device();
        let (size, shuffle) = (device.limits().subgroup_size, device.limits().subgroup_shuffle);
        let most = if device.kind() == DeviceKind::Software { size } else { size.min(8) };
        for lanes in [1, 2, 4, 8, 16, 32] {
            let together = shuffle && (4..=most).contains(&lanes);
            let names = [ForwardStage::Forward, ForwardStage::ForwardSoft].map(|stage| stage.kernel(device, lanes));
            let expected =
                if together { ["forward_subgroup", "forward_soft_subgroup"] } else { ["forward", "forward_soft"] };
            assert_eq!(names.map(|kernel| kernel.name), expected, "{lanes} of {size}");
        }
        if device.kind() == DeviceKind::Software && shuffle {
            assert_eq!(default_lanes(device), size, "a tile takes one subgroup");
        }
    }
}
