//! The plan of a backward pass: buffer sizes, dispatch counts and modes, from a saved frame and the gradients wanted.
//!
//! Memory in bytes beyond the forward frame's, with the letters of [`crate::frame::plan`], M vertices of all meshes, I
//! = S + cells beyond the first, and Q texels of a partial gradient (3; +3 for colours, +2 for UVs, +3 for normals, +3 F):
//!
//! `16 (shaded + normal + F) P + 4 P silhouette + I (16 Q + 4 + 16 shaded + 16 silhouette) + 4 S + 32 M`, the upstream images
//! and, if needed, `16 F M` for features, `16 (3 + 3 colours + 2 UVs + 3 F) S` for corners, `32 P` for the background, `48 S` for camera, σ and γ, `32 S`
//! or `32 V` for lights, `96 S + 16 V` for smooth shading, `24` a texel, or `32` with an alpha.
//!
//! Nothing grows with pixels × triangles.

use super::modes::output_bits;
use super::{ForwardPlan, FramePush, Modes};
use crate::constants as c;
use crate::frame::buffers::{GradientCounts, Sizes};
use crate::gradients::{GradientMode, GradientRequest};
use crate::scene::Outputs;

/// Workgroups of each stage; 0 for a stage that is not needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Named as the stages.
pub struct BackwardGroups {
    pub pixel_grad: [u32; 3],
    pub backward_cull: [u32; 3],
    pub triangle_grad: [u32; 3],
    pub vertex_normal_grad: [u32; 3],
    pub vertex_grad: [u32; 3],
    pub reduce_views: [u32; 3],
    pub reduce_lights: [u32; 3],
    pub reduce_pixels: [u32; 3],
}

/// Everything that recording a backward pass needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct BackwardPlan {
    /// The push constants.
    pub push: FramePush,
    /// Specialization constants, the frame's own among them.
    pub modes: Modes,
    /// Bytes of every buffer.
    pub sizes: Sizes,
    /// Workgroups of each stage.
    pub groups: BackwardGroups,
    /// Rows of FORWARD_ROW items, each with an indirect dispatch of its own; 0 if only sums over pixels are wanted.
    pub item_rows: u32,
    /// Whether items of large boxes are processed; if not, the frame has none.
    pub large: bool,
    /// Turns of backward_long over the triangles whose further cells found no room; 0 where there can be none.
    pub long_turns: u32,
    /// Rows of tiles with a list that the pixel gradient runs over; 0 if it runs over all pixels, or not at all.
    pub tile_rows: u32,
    /// Rows of the light reduction.
    pub light_rows: u32,
    /// Rows of the pixel reduction.
    pub pixel_rows: u32,
}

/// The input of a backward plan.
#[derive(Clone, Copy, Debug)]
pub struct BackwardInput<'a> {
    /// The saved frame's plan.
    pub forward: &'a ForwardPlan,
    /// The images that have an upstream gradient.
    pub upstream: Outputs,
    /// The inputs to differentiate by.
    pub wanted: &'a GradientRequest,
    /// Whether the lights are others than [`Lights::unlit`](crate::Lights::unlit), so that normals matter to colours.
    pub lit: bool,
    /// Vertices of all meshes.
    pub vertices: u64,
    /// Vertices of the largest mesh.
    pub largest_mesh: u32,
    /// The most corners of one mesh's triangles that share a vertex.
    pub most_corners: u32,
    /// Texels of all textures.
    pub texels: u64,
    /// Fixed-point units per 1.0 of a texel's gradient.
    pub texel_scale: f32,
}

fn bit(on: bool, bit: u32) -> u32 {
    if on { bit } else { 0 }
}

/// The GRADIENT_ bits of all terms that the wanted gradients need.
fn gradient_bits(input: &BackwardInput) -> u32 {
    let w = input.wanted;
    let up = input.upstream;
    // Every image depends on the opacity, and that on texels and their coordinates.
    let sampled = up.color || input.forward.modes.opacity != 0;
    // Positions change normals, and normals change the light.
    let through_light = (w.positions && input.lit) || w.lights;
    // Where the near plane cuts an edge, the new corner mixes what both ends have, by their depths.
    let cut = (w.positions || w.camera) && input.forward.modes.near_clip != 0;
    let textured = input.forward.modes.sampling != 0;
    bit(w.positions || w.camera, c::GRADIENT_GEOMETRY)
        | bit(up.color && (w.colors || through_light || cut), c::GRADIENT_COLOR)
        | bit(sampled && (w.uvs || (textured && cut)), c::GRADIENT_COORDINATE)
        | bit(sampled && w.texels, c::GRADIENT_TEXEL)
        | bit(w.scalars, c::GRADIENT_SCALARS)
        | bit(up.normal && (w.positions || cut), c::GRADIENT_NORMAL)
        | bit(w.camera, c::GRADIENT_VIEW)
        | bit(up.color && w.lights, c::GRADIENT_LIGHTS)
        | bit(up.features && (w.features || cut), c::GRADIENT_FEATURES)
        | bit(w.background, c::GRADIENT_BACKGROUND)
}

/// The dispatch of a number of workgroups that may exceed one row: rows of FORWARD_ROW along x, the rows along z.
fn rows_of(groups: u64, y: u32) -> [u32; 3] {
    let row = u64::from(c::FORWARD_ROW);
    [groups.min(row) as u32, y, groups.div_ceil(row) as u32]
}

impl BackwardPlan {
    /// Whether one of these GRADIENT_ bits is set.
    pub fn has(&self, flags: u32) -> bool {
        self.modes.gradients & flags != 0
    }

    /// Whether gradients are carried to the triangles' corners before they are summed over vertices, views or lights.
    pub fn sums_corners(&self) -> bool {
        sums_corners(&self.modes)
    }

    /// Whether a shaded image has an upstream gradient, so that there are items visible in it.
    pub fn shades(&self) -> bool {
        self.modes.upstream & !c::OUTPUT_SILHOUETTE != 0
    }

    /// Whether the loss depends on the silhouette, so that there are items that contribute to it only: by the
    /// silhouette's own upstream gradient, or as the weight of a composited background.
    pub fn outlines(&self) -> bool {
        self.modes.upstream & c::OUTPUT_SILHOUETTE != 0 || (self.shades() && self.modes.composite != 0)
    }

    /// Texels of one triangle in `corner_gradients`.
    pub fn corner_stride(&self) -> u32 {
        corner_texels(&self.modes)
    }

    /// Sizes, counts and modes of a backward pass.
    pub fn new(input: &BackwardInput) -> Self {
        let gradients = gradient_bits(input);
        let has = |flag: u32| gradients & flag != 0;
        let forward = input.forward;
        let push = FramePush { texel_scale: input.texel_scale, ..forward.push };
        let modes = Modes {
            lit: u32::from(input.lit || input.wanted.lights),
            upstream: output_bits(input.upstream),
            gradients,
            paper: u32::from(input.wanted.mode == GradientMode::Paper),
            ..forward.modes
        };
        let modes = Modes { per_vertex: u32::from(is_per_vertex(input, &modes)), ..modes };
        let smooth = modes.smooth != 0;
        let sum_pixels = has(c::GRADIENT_BACKGROUND) || has(c::GRADIENT_SCALARS);
        let sum_views = has(c::GRADIENT_VIEW) || has(c::GRADIENT_SCALARS);
        let light_rows = if smooth { forward.totals.vertices } else { forward.totals.records };
        // Whether any gradient depends on triangles. The background's does not.
        let triangles = gradients & !c::GRADIENT_BACKGROUND != 0 && forward.totals.records > 0;
        Self {
            push,
            modes,
            sizes: Sizes::of_gradients(&counts_of(input, &modes)),
            groups: groups_of(input, &modes, sum_views, sum_pixels),
            item_rows: if triangles { item_rows(input) as u32 } else { 0 },
            large: forward.rare.large,
            long_turns: if triangles { long_turns(forward) } else { 0 },
            tile_rows: if triangles && !sum_pixels { forward.totals.tile_rows() as u32 } else { 0 },
            light_rows: light_rows as u32,
            pixel_rows: forward.totals.pixels as u32,
        }
    }
}

/// Whether the gradients by all corners at a vertex are summed before they go through the vertex's projection, once.
/// That needs a frame without clipping and without gradients through light or normals. It does not depend on what is
/// wanted, so that more wanted gradients do not change the bits of those by vertices.
fn is_per_vertex(input: &BackwardInput, modes: &Modes) -> bool {
    let lit = input.lit && input.upstream.color;
    let walks = vertex_passes(input) <= modes.loop_passes.into();
    walks && modes.near_clip == 0 && modes.smooth == 0 && !lit && !input.upstream.normal
}

/// Whether gradients by what each vertex has are wanted.
pub fn wants_vertices(wanted: &GradientRequest) -> bool {
    wanted.positions || wanted.colors || wanted.features
}

/// Texels of one triangle in `corner_gradients`.
fn corner_texels(modes: &Modes) -> u32 {
    let part = |flag: u32, texels: u32| if modes.gradients & flag != 0 { texels } else { 0 };
    3 + part(c::GRADIENT_COLOR, 3)
        + part(c::GRADIENT_FEATURES, 3 * modes.feature_texels)
        + part(c::GRADIENT_COORDINATE, 2)
}

/// Whether some sum needs the gradients by each triangle's corners. With `per_vertex` the sums over vertices do not.
fn sums_corners(modes: &Modes) -> bool {
    let by_vertex =
        if modes.per_vertex == 0 { 0 } else { c::GRADIENT_GEOMETRY | c::GRADIENT_COLOR | c::GRADIENT_FEATURES };
    modes.gradients & !(c::GRADIENT_BACKGROUND | c::GRADIENT_TEXEL | by_vertex) != 0
}

/// The most loop passes that vertex_grad.comp can take for one vertex: all its triangles may cover every cell of the
/// image, and either loop over them takes a last pass to find its end. The capacity for cells does not count, so that
/// gradients have the same bits with any capacity.
fn vertex_passes(input: &BackwardInput) -> u64 {
    let FramePush { view_count, mesh_count, .. } = input.forward.push;
    let views = if mesh_count == 1 { view_count } else { 1 };
    let of_view = u64::from(input.most_corners) * u64::from(1 + image_cells(input.forward)) + 3;
    u64::from(views) * of_view
}

/// The cells of an image, into which backward divides the boxes of triangles.
fn image_cells(forward: &ForwardPlan) -> u32 {
    let FramePush { width, height, .. } = forward.push;
    width.div_ceil(c::CELL_WIDTH) * height.div_ceil(c::CELL_HEIGHT)
}

fn item_rows(input: &BackwardInput) -> u64 {
    let items = input.forward.totals.records + u64::from(input.forward.push.cell_capacity);
    items.div_ceil(u64::from(c::FORWARD_ROW))
}

/// The turns of backward_long: each processes CELLS_PER_TURN cells of the triangles whose further cells found no room.
fn long_turns(forward: &ForwardPlan) -> u32 {
    let cells = image_cells(forward);
    let all = forward.totals.records * u64::from(cells - 1);
    if all <= forward.push.cell_capacity.into() || !forward.rare.walked {
        0
    } else {
        (cells - 1).div_ceil(c::CELLS_PER_TURN)
    }
}

fn counts_of(input: &BackwardInput, modes: &Modes) -> GradientCounts {
    let gradients = modes.gradients;
    let part = |flag: u32, texels: u32| if gradients & flag != 0 { u64::from(texels) } else { 0 };
    let up = input.upstream;
    let (totals, push) = (input.forward.totals, &input.forward.push);
    let shaded = up.color || up.depth || up.normal || up.features;
    let opacity = input.forward.modes.opacity != 0;
    GradientCounts {
        totals,
        items: totals.records + u64::from(push.cell_capacity),
        item_rows: item_rows(input),
        long: long_turns(input.forward) > 0,
        upstream: up,
        outlines: up.silhouette || (shaded && input.forward.modes.composite != 0),
        gradients,
        opacity,
        smooth: modes.smooth != 0,
        partial_texels: u64::from(c::PARTIAL_TEXELS)
            + part(c::GRADIENT_COLOR, c::PARTIAL_COLOR_TEXELS)
            + part(c::GRADIENT_COORDINATE, c::PARTIAL_COORDINATE_TEXELS)
            + part(c::GRADIENT_NORMAL, c::PARTIAL_NORMAL_TEXELS)
            + part(c::GRADIENT_FEATURES, 3 * modes.feature_texels),
        corner_texels: if modes.per_vertex == 0 || sums_corners(modes) { corner_texels(modes).into() } else { 0 },
        light_rows: if modes.smooth != 0 { totals.vertices } else { totals.records },
        feature_texels: modes.feature_texels.into(),
        wants_vertices: wants_vertices(input.wanted),
        vertices: input.vertices,
        texels: input.texels,
        sums: u64::from(push.view_count) + u64::from(push.light_count) + 2,
    }
}

fn groups_of(input: &BackwardInput, modes: &Modes, sum_views: bool, sum_pixels: bool) -> BackwardGroups {
    let gradients = modes.gradients;
    let has = |flag: u32| gradients & flag != 0;
    let when = |on: bool, groups: [u32; 3]| if on { groups } else { [0; 3] };
    let forward = input.forward;
    let views = forward.push.view_count;
    let linear = |n: u32, y: u32| [n.div_ceil(c::LINEAR_GROUP), y, 1];
    let items = forward.totals.records + u64::from(forward.push.cell_capacity);
    let triangles = gradients & !c::GRADIENT_BACKGROUND != 0 && forward.totals.records > 0;
    let vertices = wants_vertices(input.wanted);
    let corners = sums_corners(modes);
    BackwardGroups {
        pixel_grad: when(sum_pixels, rows_of(forward.totals.tiles, 1)),
        backward_cull: when(triangles, rows_of(items.div_ceil(u64::from(c::LINEAR_GROUP)), 1)),
        triangle_grad: when(corners, forward.groups.triangle),
        vertex_normal_grad: when(corners && modes.smooth != 0, forward.groups.vertex),
        vertex_grad: when(vertices, linear(input.largest_mesh, forward.push.mesh_count)),
        reduce_views: when(sum_views, [views, 1, 1]),
        reduce_lights: when(has(c::GRADIENT_LIGHTS), [forward.push.light_count + 1, 1, 1]),
        reduce_pixels: when(sum_pixels, [1, 1, 1]),
    }
}
