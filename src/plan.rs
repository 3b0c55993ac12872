//! From shapes and settings to buffer sizes, dispatch counts and the numbers of a frame: pure, no Vulkan.
//!
//! Memory, in bytes, with V vertices and S slots over all views (a slot is a triangle; two where the near plane cuts the
//! mesh), P pixels over all views, B bins (64×32 pixels) and T tiles (8×4 pixels) over all views, C and L the capacities
//! of the bins' and the tiles' lists, Q the texels of a shading record (4; +2 with textures, +3 with normals):
//!
//! `32 V + (32 V smooth) + 96 S + 16 Q S + B S/8 + 8 B + 12 C + 8 T + 4 L + 16 P colour + 4 P depth + 16 P normal`,
//! and for backward `16 P + 8 S` and 8 a cell (64×32 pixels) that a box has beyond its first
//!
//! Nothing grows with pixels × triangles.

use crate::constants as c;
use crate::error::{Error, Result};
use crate::scene::{
    Background, Camera, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Lights, Parity, Settings, Shading,
    SilhouetteAggregation,
};

/// The numbers of a frame as the kernels read them (`glsl/common/frame.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[allow(missing_docs)] // Field by field the push constant block, which documents them.
pub struct FramePush {
    pub width: u32,
    pub height: u32,
    pub tiles_x: u32,
    pub tiles_y: u32,
    pub bins_x: u32,
    pub bins_y: u32,
    pub coarse_capacity: u32,
    pub list_capacity: u32,
    pub scale: f32,
    pub radius_squared: f32,
    pub radius_pixels: f32,
    pub barycentric_scale: f32,
    pub barycentric_radius: f32,
    pub near_high: f32,
    pub near_low: f32,
    pub far_high: f32,
    pub far_low: f32,
    pub score_high: f32,
    pub score_low: f32,
    pub background_whole: f32,
    pub background_rest: f32,
    pub background_red: f32,
    pub background_green: f32,
    pub background_blue: f32,
    pub light_count: u32,
    pub slot_count: u32,
    pub cell_capacity: u32,
    pub view_count: u32,
    pub mesh_count: u32,
    pub reduce_rows: u32,
    pub reduce_first: u32,
    pub texel_scale: f32,
}

const _: () = assert!(size_of::<FramePush>() == 128, "one field per member of the push constant block");

/// How the depths of a frame's meshes lie to its near and far planes; unknown is `true`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthSpan {
    /// Some triangle may cross the near plane.
    pub crosses_near: bool,
    /// Some fragment may lie beyond the far plane.
    pub crosses_far: bool,
}

/// What colours the meshes of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampling {
    /// Some mesh has surface cells.
    pub surface: bool,
    /// Some mesh has image textures.
    pub image: bool,
}

/// The size of what one view sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewSize {
    /// Vertices of its mesh.
    pub vertices: u32,
    /// Triangles of its mesh.
    pub triangles: u32,
}

/// Entries of the bins' and of the tiles' lists that memory is set aside for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    /// Entries of all bins' lists together.
    pub coarse: u32,
    /// Entries of all tiles' lists together.
    pub list: u32,
    /// Cells that large boxes have beyond their first, for backward.
    pub cells: u32,
}

/// Where one view's share of the buffers begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ViewRange {
    /// First transformed vertex.
    pub screen_base: u32,
    /// First record slot.
    pub slot_base: u32,
    /// First bin.
    pub bin_base: u32,
    /// First word of the bins' bitmaps.
    pub word_base: u32,
    /// Record slots.
    pub slots: u32,
    /// Bitmap words of a bin.
    pub words: u32,
}

/// Bytes of every buffer that a frame fills on the device; 0 where it needs none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Named as in the kernels.
pub struct BufferSizes {
    pub vertices: u64,
    pub vertex_shading: u64,
    pub geometry: u64,
    pub shading: u64,
    pub boxes: u64,
    pub bin_bits: u64,
    pub bin_ranges: u64,
    pub coarse_slots: u64,
    pub coarse_words: u64,
    pub tile_ranges: u64,
    pub tile_slots: u64,
    pub status: u64,
    pub color: u64,
    pub silhouette: u64,
    pub depths: u64,
    pub normals: u64,
    pub saved: u64,
    pub cell_ranges: u64,
    pub cells: u64,
}

impl BufferSizes {
    /// All of them together.
    pub fn total(&self) -> u64 {
        let BufferSizes { vertices, vertex_shading, geometry, shading, boxes, bin_bits, bin_ranges, .. } = *self;
        let BufferSizes { coarse_slots, coarse_words, tile_ranges, tile_slots, status, .. } = *self;
        let BufferSizes { color, silhouette, depths, normals, saved, cell_ranges, cells, .. } = *self;
        let records = vertices + vertex_shading + geometry + shading + boxes;
        let lists = bin_bits + bin_ranges + coarse_slots + coarse_words + tile_ranges + tile_slots + status;
        records + lists + color + silhouette + depths + normals + saved + cell_ranges + cells
    }
}

/// Everything that a frame's recording needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The push constants.
    pub frame: FramePush,
    /// Specialization constants by name.
    pub modes: Vec<(&'static str, u32)>,
    /// Each view's share of the buffers.
    pub views: Vec<ViewRange>,
    /// Bytes of every buffer.
    pub sizes: BufferSizes,
    /// Workgroups of each stage.
    pub groups: Groups,
    /// Vertices, slots and pixels of all views together.
    pub totals: Totals,
}

/// Workgroups of each stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // Named as the stages.
pub struct Groups {
    pub vertex: [u32; 3],
    pub triangle: [u32; 3],
    pub bin_coarse: [u32; 3],
    pub bin_fine: [u32; 3],
    pub forward: [u32; 3],
}

/// What a plan is made from.
#[derive(Clone, Debug)]
pub struct PlanInput<'a> {
    /// The frame's settings, judged.
    pub settings: &'a Settings,
    /// What each view sees, in order.
    pub views: &'a [ViewSize],
    /// How many meshes there are: one seen by every view, or one for each.
    pub meshes: u32,
    /// The lights, judged.
    pub lights: &'a Lights,
    /// What colours the meshes.
    pub sampling: Sampling,
    /// How the depths lie to near and far.
    pub depth_span: DepthSpan,
    /// Some camera distorts.
    pub distorted: bool,
    /// Room for lists; see [`Capacity::estimate`].
    pub capacity: Capacity,
    /// Keep what backward needs.
    pub save: bool,
}

/// A number as the sum of two floats, some 48 bits of it.
pub fn split(x: f64) -> (f32, f32) {
    let high = x as f32;
    (high, (x - f64::from(high)) as f32)
}

/// ⌈bytes / 4⌉ · 4, at least 16: no buffer that is used is empty.
pub(crate) fn bytes(count: u64, each: u64) -> u64 {
    (count * each).next_multiple_of(16).max(16)
}

impl Capacity {
    /// The larger of both, list by list.
    pub fn max(self, other: Self) -> Self {
        Self {
            coarse: self.coarse.max(other.coarse),
            list: self.list.max(other.list),
            cells: self.cells.max(other.cells),
        }
    }

    /// Room that usual meshes need, from the mean triangle that would cover each image once; the status word tells when
    /// it was not enough.
    pub fn estimate(settings: &Settings, views: &[ViewSize]) -> Self {
        let (w, h) = (f64::from(settings.width), f64::from(settings.height));
        let blur = 2.0 * settings.blur_pixels().min(w + h);
        let lists = |tile: (u32, u32), most: f64| -> f64 {
            let each = views.iter().filter(|v| v.triangles > 0).map(|v| {
                let side = (2.0 * w * h / f64::from(v.triangles)).sqrt() + blur;
                let touched = (side / f64::from(tile.0) + 1.0) * (side / f64::from(tile.1) + 1.0);
                f64::from(v.triangles) * touched.min(most)
            });
            each.sum()
        };
        let (tiles, bins) = (w * h / 32.0 + 2.0, w * h / 2048.0 + 2.0);
        let entries = |x: f64| x.min(f64::from(1 << 24)) as u32 + 1024;
        Self {
            // Every bin's list is rounded up to whole words.
            coarse: entries(lists((c::BIN_WIDTH, c::BIN_HEIGHT), bins) + bins * views.len() as f64 * 32.0),
            list: entries(lists((c::TILE_WIDTH, c::TILE_HEIGHT), tiles)),
            cells: 1024,
        }
    }
}

impl DepthSpan {
    /// From the box around a mesh, as one camera sees it.
    pub fn of(bounds: Option<([f32; 3], [f32; 3])>, camera: &Camera, settings: &Settings) -> Self {
        let Some((low, high)) = bounds else {
            return Self { crosses_near: false, crosses_far: false };
        };
        let row = camera.view()[2];
        let (mut nearest, mut farthest) = (row[3], row[3]);
        for axis in 0..3 {
            let ends = [row[axis] * f64::from(low[axis]), row[axis] * f64::from(high[axis])];
            nearest += ends[0].min(ends[1]);
            farthest += ends[0].max(ends[1]);
        }
        // A millionth for the rounding of the kernels.
        let slack = 1e-6 * (nearest.abs() + farthest.abs());
        Self { crosses_near: nearest - slack < settings.near, crosses_far: farthest + slack > settings.far }
    }

    /// True of either.
    pub fn or(self, other: Self) -> Self {
        Self {
            crosses_near: self.crosses_near || other.crosses_near,
            crosses_far: self.crosses_far || other.crosses_far,
        }
    }
}

/// The frame's numbers from its settings; capacities and counts are filled in by [`Plan::new`].
fn push_of(settings: &Settings) -> FramePush {
    let log2e = std::f64::consts::LOG2_E;
    let half_height = f64::from(settings.height) / 2.0;
    let cutoff = settings.cutoff();
    let score = log2e / ((settings.far - settings.near) * settings.gamma);
    let epsilon = settings.epsilon * if settings.parity == Parity::Official { 2.0 } else { 1.0 };
    let background = (epsilon * log2e / settings.gamma).clamp(-1e30, 1e30);
    let background_whole = background.round() as f32;
    let ((near_high, near_low), (far_high, far_low)) = (split(settings.near), split(settings.far));
    let (score_high, score_low) = split(score);
    let euclidean = settings.distance == Distance::Euclidean;
    let hard = settings.distance == Distance::Hard;
    // Both soft distances are in units of log2 weights, so the same cut-off serves them.
    let radius_squared = if hard { 0.0 } else { (cutoff * log2e) as f32 };
    let [red, green, blue] = settings.background_color.map(|x| x as f32);
    FramePush {
        width: settings.width,
        height: settings.height,
        tiles_x: settings.width.div_ceil(c::TILE_WIDTH),
        tiles_y: settings.height.div_ceil(c::TILE_HEIGHT),
        bins_x: settings.width.div_ceil(c::BIN_WIDTH),
        bins_y: settings.height.div_ceil(c::BIN_HEIGHT),
        scale: ((log2e / settings.sigma).sqrt() / half_height) as f32,
        radius_squared,
        radius_pixels: if euclidean { settings.blur_pixels() as f32 } else { 0.0 },
        barycentric_scale: (log2e / settings.sigma) as f32,
        barycentric_radius: (settings.sigma * cutoff).sqrt() as f32,
        near_high,
        near_low,
        far_high,
        far_low,
        score_high,
        score_low,
        background_whole,
        background_rest: (background - f64::from(background_whole)) as f32,
        background_red: red,
        background_green: green,
        background_blue: blue,
        ..FramePush::default()
    }
}

fn output_bits(settings: &Settings) -> u32 {
    let o = settings.outputs;
    let bit = |on: bool, bit: u32| if on { bit } else { 0 };
    bit(o.color, c::OUTPUT_COLOR)
        | bit(o.silhouette, c::OUTPUT_SILHOUETTE)
        | bit(o.depth, c::OUTPUT_DEPTH)
        | bit(o.normal, c::OUTPUT_NORMAL)
}

/// The specialization constants: everything that changes what is compiled.
fn modes_of(input: &PlanInput) -> Vec<(&'static str, u32)> {
    let s = input.settings;
    let official = s.parity == Parity::Official;
    let shaded = s.outputs.color || s.outputs.depth || s.outputs.normal;
    let depth_range = match (official, input.depth_span.crosses_far) {
        // The official silhouette counts every depth, so only shaded images care.
        (true, _) if shaded => c::DEPTH_RANGE_OFFICIAL,
        (false, true) => c::DEPTH_RANGE_FAR,
        _ => c::DEPTH_RANGE_INSIDE,
    };
    let smooth = input.lights.shading == Shading::Smooth && (s.outputs.normal || !input.lights.is_unlit());
    vec![
        ("OUTPUTS", output_bits(s)),
        ("COLOR_MODE", if s.color == ColorAggregation::Hard { c::COLOR_HARD } else { c::COLOR_SOFTMAX }),
        (
            "SILHOUETTE_MODE",
            match s.silhouette {
                SilhouetteAggregation::Product => c::SILHOUETTE_PRODUCT,
                SilhouetteAggregation::Sum => c::SILHOUETTE_SUM,
                SilhouetteAggregation::Hard => c::SILHOUETTE_HARD,
            },
        ),
        (
            "DISTANCE",
            match s.distance {
                Distance::Euclidean => c::DISTANCE_EUCLIDEAN,
                Distance::Barycentric => c::DISTANCE_BARYCENTRIC,
                Distance::Hard => c::DISTANCE_HARD,
            },
        ),
        (
            "SAMPLING",
            u32::from(input.sampling.surface) * c::SAMPLING_SURFACE
                + u32::from(input.sampling.image) * c::SAMPLING_IMAGE,
        ),
        ("PERSPECTIVE_CORRECT", u32::from(s.interpolation == Interpolation::Perspective)),
        ("COMPOSITE", u32::from(s.background == Background::Composite)),
        ("DEPTH_RANGE", depth_range),
        ("SAVE", u32::from(input.save)),
        ("NEAR_CLIP", u32::from(clips(input))),
        ("SMOOTH", u32::from(smooth)),
        ("LIT", u32::from(!input.lights.is_unlit())),
        ("FRONT_ONLY", u32::from(s.faces == Faces::Front)),
        ("CLOCKWISE_FRONT", u32::from(s.front_face == FrontFace::Clockwise)),
        ("OFFICIAL", u32::from(official)),
        ("DISTORTED", u32::from(input.distorted)),
    ]
}

/// Whether triangles may be cut by the near plane, so that each has two slots.
fn clips(input: &PlanInput) -> bool {
    input.depth_span.crosses_near && input.settings.parity == Parity::Model
}

impl Plan {
    /// Sizes, counts and numbers of a frame.
    ///
    /// # Errors
    /// [`Error::Limit`] where a count outgrows what the kernels' 32-bit indices can address.
    pub fn new(input: &PlanInput) -> Result<Self> {
        let mut frame = push_of(input.settings);
        frame.coarse_capacity = input.capacity.coarse;
        frame.list_capacity = input.capacity.list;
        frame.cell_capacity = if input.save { input.capacity.cells } else { 0 };
        frame.view_count = input.views.len() as u32;
        frame.mesh_count = input.meshes;
        frame.light_count = input.lights.directional.len() as u32;
        let modes = modes_of(input);
        let (views, totals) = ranges_of(input, &frame)?;
        frame.slot_count = totals.slots as u32;
        let sizes = sizes_of(input, &frame, &totals);
        let most = |f: fn(&ViewSize) -> u32| input.views.iter().map(f).max().unwrap_or(0);
        let count = input.views.len() as u32;
        let linear = |n: u32| [n.div_ceil(c::LINEAR_GROUP), count, 1];
        let tiles = frame.tiles_x * frame.tiles_y;
        let bins = [frame.bins_x * frame.bins_y, count, 1];
        let groups = Groups {
            vertex: linear(most(|v| v.vertices)),
            triangle: linear(most(|v| v.triangles)),
            bin_coarse: bins,
            bin_fine: bins,
            forward: [tiles.min(c::FORWARD_ROW), count, tiles.div_ceil(c::FORWARD_ROW)],
        };
        Ok(Self { frame, modes, views, sizes, groups, totals })
    }

    /// A specialization constant's value.
    pub fn mode(&self, name: &str) -> u32 {
        self.modes.iter().find(|(n, _)| *n == name).map_or(0, |(_, value)| *value)
    }

    /// Whether a shading record is made: for colour, depth or normals, or to tell fragments beyond far.
    pub fn shaded(&self) -> bool {
        self.mode("OUTPUTS") & !c::OUTPUT_SILHOUETTE != 0 || self.mode("DEPTH_RANGE") != c::DEPTH_RANGE_INSIDE
    }
}

/// Counts over all views of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Named after what is counted.
pub struct Totals {
    pub vertices: u64,
    pub slots: u64,
    pub bins: u64,
    pub words: u64,
    pub tiles: u64,
    pub pixels: u64,
}

fn ranges_of(input: &PlanInput, frame: &FramePush) -> Result<(Vec<ViewRange>, Totals)> {
    let pieces = if clips(input) { 2 } else { 1 };
    let bins = u64::from(frame.bins_x) * u64::from(frame.bins_y);
    let mut t = Totals::default();
    let mut views = Vec::with_capacity(input.views.len());
    for size in input.views {
        let slots = u64::from(size.triangles) * pieces;
        let words = slots.div_ceil(u64::from(c::WORD_BITS));
        views.push(ViewRange {
            screen_base: t.vertices as u32,
            slot_base: t.slots as u32,
            bin_base: t.bins as u32,
            word_base: t.words as u32,
            slots: slots as u32,
            words: words as u32,
        });
        t.vertices += u64::from(size.vertices);
        t.slots += slots;
        t.bins += bins;
        t.words += words * bins;
        t.tiles += u64::from(frame.tiles_x) * u64::from(frame.tiles_y);
        t.pixels += u64::from(frame.width) * u64::from(frame.height);
    }
    // Kernels index texels with i32; the widest record has 9.
    let index = |what: &str, needed: u64, mend: &str| -> Result<()> {
        let limit = i32::MAX as u64;
        if needed <= limit {
            return Ok(());
        }
        let (what, mend) = (what.to_owned(), mend.to_owned());
        Err(Error::Limit { what, needed, unit: "elements", limit_name: "32-bit index", limit, mend })
    };
    index("the triangle records of all views", 9 * t.slots, "render fewer views or triangles in one frame")?;
    index("the vertices of all views", 3 * t.vertices, "render fewer views in one frame")?;
    index("the images of all views", t.pixels, "render fewer views in one frame, or smaller images")?;
    index("the bins' bitmaps", t.words, "render fewer views in one frame, or smaller images")?;
    let triangles = input.views.iter().map(|v| u64::from(v.triangles)).max().unwrap_or(0);
    if triangles > 1 << 22 {
        let mend = "split the mesh: a float and one row of workgroups must be able to count its triangles".into();
        let what = "one mesh".into();
        let limit_name = "triangles of a mesh";
        return Err(Error::Limit { what, needed: triangles, unit: "triangles", limit_name, limit: 1 << 22, mend });
    }
    Ok((views, t))
}

fn sizes_of(input: &PlanInput, frame: &FramePush, t: &Totals) -> BufferSizes {
    let modes = modes_of(input);
    let mode = |name: &str| modes.iter().find(|(n, _)| *n == name).map_or(0, |(_, v)| *v);
    let outputs = input.settings.outputs;
    let shaded = outputs.color || outputs.depth || outputs.normal || mode("DEPTH_RANGE") != c::DEPTH_RANGE_INSIDE;
    let sampled = input.sampling.surface || input.sampling.image;
    let record = c::SHADING_TEXELS
        + u32::from(sampled) * c::SHADING_COORDINATE_TEXELS
        + u32::from(outputs.normal) * c::SHADING_NORMAL_TEXELS;
    let when = |on: bool, size: u64| if on { size } else { 0 };
    let texels = |count: u64, each: u32| bytes(count * u64::from(each), 16);
    BufferSizes {
        vertices: texels(t.vertices, c::VERTEX_TEXELS),
        vertex_shading: when(mode("SMOOTH") != 0, texels(t.vertices, c::VERTEX_SHADING_TEXELS)),
        geometry: texels(t.slots, c::GEOMETRY_TEXELS),
        shading: when(shaded, texels(t.slots, record)),
        boxes: texels(t.slots, 1),
        bin_bits: bytes(t.words, 4),
        bin_ranges: bytes(t.bins, 8),
        coarse_slots: bytes(u64::from(frame.coarse_capacity), 4),
        coarse_words: bytes(u64::from(frame.coarse_capacity), 8),
        tile_ranges: bytes(t.tiles, 8),
        tile_slots: bytes(u64::from(frame.list_capacity), 4),
        status: bytes(u64::from(c::STATUS_WORDS), 4),
        color: when(outputs.color, bytes(t.pixels, 16)),
        silhouette: when(outputs.silhouette && !outputs.color, bytes(t.pixels, 4)),
        depths: when(outputs.depth, bytes(t.pixels, 4)),
        normals: when(outputs.normal, bytes(t.pixels, 16)),
        saved: when(input.save, bytes(t.pixels, 16)),
        cell_ranges: when(input.save, bytes(t.slots, 8)),
        cells: when(input.save, bytes(u64::from(frame.cell_capacity), 8)),
    }
}
