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
    /// Aggregates the triangles of every other tile with a list.
    Forward,
    /// Aggregates those of the tiles whose lists have no room, or are longer than the device's loops walk.
    ForwardLong,
}

/// How many stages a forward frame has.
pub const FORWARD_COUNT: usize = ForwardStage::ALL.len();

/// Timestamps that a forward frame writes: before the first stage and after each.
pub const FORWARD_TIMESTAMPS: u32 = FORWARD_COUNT as u32 + 1;

impl ForwardStage {
    /// Every stage, in the order in which they run.
    pub const ALL: [Self; 7] = [
        Self::Vertex,
        Self::Triangle,
        Self::BinCoarse,
        Self::BinFine,
        Self::Background,
        Self::Forward,
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
            Self::Forward => "forward",
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
            Self::Forward if reads_together(device, lanes) => &kernels::FORWARD_SUBGROUP,
            Self::Forward => &kernels::FORWARD,
            Self::ForwardLong => &kernels::FORWARD_LONG,
        }
    }

    /// Whether a plan may record it.
    pub fn is_needed(self, plan: &ForwardPlan) -> bool {
        self != Self::ForwardLong || plan.walks.needed
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
/// It begins with a barrier after all compute, copies and fills before it, and ends with one before all that follow, so
/// the caller has to order only what other stages and queues do to the buffers.
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
    // One buffer holds two lists of tiles: those to be drawn, and after the room for them the empty ones.
    let tiles = |first: u32, offset: u32| {
        let rows = plan.totals.tile_rows() as u32;
        Work::List(List { rows, first, row: c::FORWARD_ROW, counts: tile_counts, stride: c::TILE_COUNT_WORDS, offset })
    };
    recorder.begin_label("softras forward");
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
            ForwardStage::Background => tiles(plan.totals.tiles as u32, c::TILES_EMPTY),
            ForwardStage::Forward => tiles(0, c::TILES_FILLED),
            ForwardStage::ForwardLong if !plan.walks.needed => Work::Groups([0; 3]),
            ForwardStage::ForwardLong => {
                push.number = c::ONE_TURN;
                tiles(0, c::TILES_WALKED)
            }
        };
        stages.0[stage as usize].run(recorder, stage.name(), &push, &work)?;
        if stage == ForwardStage::ForwardLong {
            record_turns(recorder, plan, &stages.0[stage as usize], tile_counts)?;
        }
        stamp(recorder, times, stage as u32 + 1)?;
    }
    recorder.end_label();
    Ok(())
}

/// Records the turns of the tiles whose walks take several: row by row, because the rows share the memory of where the
/// walks stand.
fn record_turns(
    recorder: &mut Recorder<'_>,
    plan: &ForwardPlan,
    stage: &Stage,
    tile_counts: &BufferPart,
) -> Result<()> {
    let rows = plan.walks.rows(&plan.totals);
    for row in 0..rows {
        let offset = plan.totals.tile_rows() as u32 * c::TILE_COUNT_WORDS + 3 * row;
        let first = row * c::RESUMED_ROW;
        for turn in 0..plan.walks.turns {
            let list = List { rows: 1, first, row: c::RESUMED_ROW, counts: tile_counts, stride: 3, offset };
            let push = FramePush { number: turn, ..plan.push };
            stage.run(recorder, ForwardStage::ForwardLong.name(), &push, &Work::List(list))?;
        }
    }
    Ok(())
}
