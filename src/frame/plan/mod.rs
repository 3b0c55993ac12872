//! The plan of a forward frame: buffer sizes, dispatch counts and constants, from counts and settings, without a device.
//!
//! Memory in bytes, with V vertices and S triangle records over all views (one for each triangle; two if triangles may
//! cross the near plane), P pixels over all views, B bins (64×32 pixels) of a view and N over all views, T tiles (8×4
//! pixels) over all views, C and L the capacities of the bins' and the tiles' lists, Q the texels of a shading record
//! (4; +2 with textures, +3 with normals, +3 F; 1 for the silhouette alone) and F those of a vertex's features, four each:
//!
//! `32 V + (32 V smooth) + 80 S + 16 Q S + B S/8 + 8 N + 12¼ C + 52 T + 4 L + 16 P colour, or 4 P silhouette alone,
//! + 4 P depth + 16 P normal + 16 F P`, and for backward `16 P + 8 T + 8 S` and 8 a cell (64×32 pixels) that a box has beyond its first.
//!
//! Textures with an alpha give the silhouette alone shading records too.
//!
//! On a software device, for views of more than some 45,000 records, lists without room are walked in several turns.
//! That takes 2836 bytes more for each of at most 4096 tiles, 128 more where textures have an alpha, and 1024 F for features.
//!
//! Nothing grows with pixels × triangles.

mod backward;
mod capacity;
mod frame;
mod modes;
mod rare;
#[cfg(test)]
mod tests;
mod walked_tiles;

pub use backward::{BackwardInput, BackwardPlan, wants_vertices};
pub use capacity::Capacity;
pub use frame::{FramePush, split};
pub use modes::{DepthSpan, Lenses, Modes, Sampling};
pub use rare::Rare;
pub use walked_tiles::Walks;

use crate::constants as c;
use crate::error::{Error, Result};
use crate::frame::buffers::{ForwardCounts, Sizes, TableLengths, Totals};
use crate::scene::{Lights, Settings};
use modes::clips;

/// The counts of the mesh that one view sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewSize {
    /// Vertices of its mesh.
    pub vertices: u32,
    /// Triangles of its mesh.
    pub triangles: u32,
}

/// One view's range in the buffers that hold all views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewRange {
    /// First transformed vertex.
    pub screen_base: u32,
    /// Index of the first triangle record.
    pub record_base: u32,
    /// First bin.
    pub bin_base: u32,
    /// First word of the bins' bitmaps.
    pub word_base: u32,
    /// Triangle records.
    pub records: u32,
    /// Words of each bin's bitmap.
    pub words: u32,
}

/// The sizes, counts and constants of a forward frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ForwardPlan {
    /// The push constants.
    pub push: FramePush,
    /// Specialization constants.
    pub modes: Modes,
    /// The least number of lanes that bin_coarse may have.
    pub coarse_lanes: u32,
    /// The kernels that few frames need.
    pub rare: Rare,
    /// How tiles are processed whose lists have no room.
    pub walks: Walks,
    /// Each view's range in the buffers.
    pub views: Vec<ViewRange>,
    /// Bytes of every buffer.
    pub sizes: Sizes,
    /// Workgroups of each stage.
    pub groups: Groups,
    /// Vertices, records, pixels and so on of all views together.
    pub totals: Totals,
}

/// Workgroups of each stage that does not walk a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Named as the stages.
pub struct Groups {
    pub vertex: [u32; 3],
    pub triangle: [u32; 3],
    pub bin_coarse: [u32; 3],
    pub bin_fine: [u32; 3],
}

/// The input of a forward plan.
#[derive(Clone, Debug)]
pub struct PlanInput<'a> {
    /// The frame's settings, validated.
    pub settings: &'a Settings,
    /// The culling radius squared in units of σ, from [`Settings::cutoff_of`].
    pub cutoff: f64,
    /// The counts of the mesh that each view sees, in order.
    pub views: &'a [ViewSize],
    /// Lengths of the mesh tables, which hold one mesh that every view sees, or one for each view.
    pub tables: TableLengths,
    /// The lights, validated.
    pub lights: &'a Lights,
    /// The features of each vertex.
    pub features: u32,
    /// The kinds of texture that the meshes have.
    pub sampling: Sampling,
    /// Whether triangles may lie across the near plane or beyond the far plane.
    pub depth_span: DepthSpan,
    /// The kinds of the cameras.
    pub lenses: Lenses,
    /// Room for lists; see [`Capacity::estimate`].
    pub capacity: Capacity,
    /// Whether the frame keeps what backward needs.
    pub save: bool,
    /// The most loop passes of one invocation, over all its loops, that the device executes correctly.
    pub loop_passes: u32,
    /// The kernels that few frames need; without one of them a frame may be incomplete.
    pub rare: Rare,
}

impl PlanInput<'_> {
    /// Texels of a vertex's features, four features each; 0 without an image of them.
    fn feature_texels(&self) -> u32 {
        if self.settings.outputs.features { self.features.div_ceil(4) } else { 0 }
    }
}

impl ForwardPlan {
    /// The plan of a frame.
    ///
    /// # Errors
    /// [`Error::Limit`] if a count exceeds what the kernels can address with 32-bit indices.
    pub fn new(input: &PlanInput) -> Result<Self> {
        let mut frame = frame::push_of(input.settings, input.cutoff);
        frame.coarse_capacity = input.capacity.coarse;
        frame.list_capacity = input.capacity.list;
        frame.cell_capacity = if input.save { input.capacity.cells } else { 0 };
        frame.view_count = input.views.len() as u32;
        frame.mesh_count = input.tables.meshes as u32;
        frame.light_count = input.lights.directional.len() as u32;
        let (views, totals) = ranges_of(input, &frame)?;
        let modes = Modes::new(input);
        let coarse_lanes = coarse_lanes(&views);
        frame.record_count = totals.records as u32;
        let walks = Walks::new(input.rare.walked, &frame, &views, &totals, input.loop_passes);
        let sizes = Sizes::of_frame(&counts_of(input, &frame, &modes, totals, walks));
        let most = |f: fn(&ViewSize) -> u32| input.views.iter().map(f).max().unwrap_or(0);
        let count = input.views.len() as u32;
        let linear = |n: u32| [n.div_ceil(c::LINEAR_GROUP), count, 1];
        let bins = [frame.bins_x * frame.bins_y, count, 1];
        let groups = Groups {
            vertex: linear(most(|v| v.vertices)),
            triangle: linear(most(|v| v.triangles)),
            bin_coarse: bins,
            bin_fine: bins,
        };
        Ok(Self { push: frame, modes, coarse_lanes, rare: input.rare, walks, views, sizes, groups, totals })
    }

    /// The push constants of the same frame with other settings and lights; `None` where these need other kernels or sizes.
    /// `input` is that of the plan, but for its views, which are not looked at.
    pub(crate) fn push_with(&self, input: &PlanInput) -> Option<FramePush> {
        let FramePush { width, height, coarse_capacity, list_capacity, cell_capacity, .. } = self.push;
        let FramePush { light_count, record_count, view_count, mesh_count, .. } = self.push;
        let push = frame::push_of(input.settings, input.cutoff);
        let same = (push.width, push.height) == (width, height)
            && input.lights.directional.len() as u32 == light_count
            && Modes::new(input) == self.modes;
        same.then_some(FramePush {
            coarse_capacity,
            list_capacity,
            cell_capacity,
            light_count,
            record_count,
            view_count,
            mesh_count,
            ..push
        })
    }
}

/// Whether triangles have shading records: for colour, depth or normals, to reject fragments beyond the far plane, or for
/// textures with an alpha.
fn shades(modes: &Modes) -> bool {
    let in_range = modes.depth_range == c::DEPTH_RANGE_INSIDE;
    modes.outputs & !c::OUTPUT_SILHOUETTE != 0 || !in_range || modes.opacity != 0
}

fn counts_of(input: &PlanInput, push: &FramePush, modes: &Modes, totals: Totals, walks: Walks) -> ForwardCounts {
    let sampled = input.sampling.surface || input.sampling.image;
    let record = c::SHADING_TEXELS
        + u32::from(sampled) * c::SHADING_COORDINATE_TEXELS
        + u32::from(input.settings.outputs.normal) * c::SHADING_NORMAL_TEXELS
        + 3 * modes.feature_texels;
    ForwardCounts {
        tables: input.tables,
        views: input.views.len() as u64,
        lights: input.lights.directional.len() as u64,
        totals,
        capacity: [push.coarse_capacity, push.list_capacity, push.cell_capacity].map(u64::from),
        outputs: input.settings.outputs,
        smooth: modes.smooth != 0,
        shading_texels: if shades(modes) { record } else { 0 },
        save: input.save,
        feature_texels: modes.feature_texels.into(),
        walk_words: c::WALK_STATE_WORDS
            + modes.opacity * c::WALK_OPACITY_WORDS
            + modes.feature_texels * c::WALK_FEATURE_WORDS,
        resumed: walks.resumed_tiles(&totals),
        resumed_rows: walks.rows(&totals).into(),
    }
}

/// The most records for each lane of bin_coarse. Its loops take up to two and a half iterations for each entry of a bin, and
/// Mesa's software driver ends loops after 65535 iterations, which would lose the remaining entries.
const RECORDS_PER_LANE: u32 = 1 << 14;
/// The workgroup size that every Vulkan device supports. It is enough: Mesa's software driver has no room for the geometry of
/// two million records.
const MOST_LANES: u32 = 128;

/// The least number of lanes that bin_coarse may have.
fn coarse_lanes(views: &[ViewRange]) -> u32 {
    let most = views.iter().map(|v| v.records).max().unwrap_or(0);
    most.div_ceil(RECORDS_PER_LANE).next_power_of_two().min(MOST_LANES)
}

/// Fails for more views than a frame may have.
pub(crate) fn validate_views(needed: u64) -> Result<()> {
    const MOST: u64 = 1 << 18;
    if needed <= MOST {
        return Ok(());
    }
    let (what, limit_name) = ("one frame".into(), "views of a frame");
    let fix = "render them in several frames".into();
    Err(Error::Limit { what, needed, unit: "views", limit_name, limit: MOST, fix })
}

/// A float, and one row of workgroups, must be able to count the triangles of a mesh.
pub const MOST_TRIANGLES: u64 = 1 << 22;

fn ranges_of(input: &PlanInput, frame: &FramePush) -> Result<(Vec<ViewRange>, Totals)> {
    validate_views(input.views.len() as u64)?;
    let pieces = if clips(input) { 2 } else { 1 };
    let bins = u64::from(frame.bins_x) * u64::from(frame.bins_y);
    let mut t = Totals::default();
    let mut views = Vec::with_capacity(input.views.len());
    for size in input.views {
        let records = u64::from(size.triangles) * pieces;
        let words = records.div_ceil(u64::from(c::WORD_BITS));
        views.push(ViewRange {
            screen_base: t.vertices as u32,
            record_base: t.records as u32,
            bin_base: t.bins as u32,
            word_base: t.words as u32,
            records: records as u32,
            words: words as u32,
        });
        t.vertices += u64::from(size.vertices);
        t.records += records;
        t.bins += bins;
        t.words += words * bins;
        t.tiles += u64::from(frame.tiles_x) * u64::from(frame.tiles_y);
        t.pixels += u64::from(frame.width) * u64::from(frame.height);
    }
    // Kernels index texels with i32; the widest record has 9 texels and those of its features.
    let features = u64::from(input.feature_texels());
    let index = |what: &str, needed: u64, fix: &str| -> Result<()> {
        let limit = i32::MAX as u64;
        if needed <= limit {
            return Ok(());
        }
        let (what, fix) = (what.to_owned(), fix.to_owned());
        Err(Error::Limit { what, needed, unit: "elements", limit_name: "32-bit index", limit, fix })
    };
    // As are those of `partials`, of which cells beyond the first have entries too.
    let cells = if input.save && features > 0 { u64::from(input.capacity.cells) } else { 0 };
    index(
        "the triangle records of all views",
        (9 + 3 * features) * t.records + (11 + 3 * features) * cells,
        "render fewer views or triangles in one frame",
    )?;
    index("the vertices of all views", 3 * t.vertices, "render fewer views in one frame")?;
    let pixel = if features > 0 { 2 + features } else { 1 };
    index("the images of all views", pixel * t.pixels, "render fewer views in one frame, or smaller images")?;
    index("the bins' bitmaps", t.words, "render fewer views in one frame, or smaller images")?;
    let triangles = input.views.iter().map(|v| u64::from(v.triangles)).max().unwrap_or(0);
    if triangles > MOST_TRIANGLES {
        let fix = "split the mesh".into();
        let what = "one mesh".into();
        let limit_name = "triangles of a mesh";
        return Err(Error::Limit {
            what,
            needed: triangles,
            unit: "triangles",
            limit_name,
            limit: MOST_TRIANGLES,
            fix,
        });
    }
    Ok((views, t))
}
