//! From a saved frame and what is wanted of it to the sizes, dispatch counts and modes of a backward pass: pure, no Vulkan.
//!
//! Memory, in bytes, beyond the forward frame's, with the letters of [`crate::frame::plan`], I = S + cells beyond the first, and
//! Q the texels of a partial gradient (3; +3 for colours, +2 for UVs, +3 for normals):
//!
//! `16 (1 + shaded + normal) P + (16 Q + 32) I + 16 (3 + 3 colours + 2 UVs) S + 32 V`, and where asked for `32 P` background,
//! `48 S` camera, σ and γ, `32 S` or `32 V` lights, `96 S + 16 V` smooth shading, `24` a texel.
//!
//! Nothing grows with pixels × triangles.

use super::sizes::bytes;
use super::{FramePush, Plan};
use crate::constants as c;
use crate::gradients::{GradientMode, Wanted};

use crate::scene::Outputs;

/// Bytes of every buffer that a backward pass fills; 0 where it needs none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Named as in the kernels.
pub struct BackwardSizes {
    pub upstream_color: u64,
    pub upstream_silhouette: u64,
    pub upstream_depths: u64,
    pub upstream_normals: u64,
    pub pixel_gradients: u64,
    pub pixel_sums: u64,
    pub shown_items: u64,
    pub outline_items: u64,
    pub item_counts: u64,
    pub partials: u64,
    pub corner_gradients: u64,
    pub corner_lights: u64,
    pub light_records: u64,
    pub area_gradients: u64,
    pub view_sums: u64,
    pub vertex_gradients: u64,
    pub texel_sums: u64,
    pub totals: u64,
}

impl BackwardSizes {
    /// A buffer's bytes by its name; 0 for an unknown one.
    pub fn of(&self, name: &str) -> u64 {
        match name {
            "upstream_color" => self.upstream_color,
            "upstream_silhouette" => self.upstream_silhouette,
            "upstream_depths" => self.upstream_depths,
            "upstream_normals" => self.upstream_normals,
            "pixel_gradients" => self.pixel_gradients,
            "pixel_sums" => self.pixel_sums,
            "shown_items" => self.shown_items,
            "outline_items" => self.outline_items,
            "item_counts" => self.item_counts,
            "partials" => self.partials,
            "corner_gradients" => self.corner_gradients,
            "corner_lights" => self.corner_lights,
            "light_records" => self.light_records,
            "area_gradients" => self.area_gradients,
            "view_sums" => self.view_sums,
            "vertex_gradients" => self.vertex_gradients,
            "texel_sums" => self.texel_sums,
            "totals" => self.totals,
            _ => 0,
        }
    }
}

/// Workgroups of each stage; none where a stage is not needed.
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
    pub frame: FramePush,
    /// Specialization constants by name, the frame's own among them.
    pub modes: Vec<(&'static str, u32)>,
    /// Bytes of every buffer.
    pub sizes: BackwardSizes,
    /// Workgroups of each stage.
    pub groups: BackwardGroups,
    /// Rows of FORWARD_ROW items, each with an indirect dispatch of its own; 0 where nothing but pixels is summed.
    pub item_rows: u32,
    /// Rows of the light and pixel reductions.
    pub light_rows: u32,
    /// Rows of the pixel reduction.
    pub pixel_rows: u32,
}

/// What a backward plan is made from.
#[derive(Clone, Copy, Debug)]
pub struct BackwardInput<'a> {
    /// The saved frame's plan.
    pub forward: &'a Plan,
    /// The images that have an upstream gradient.
    pub upstream: Outputs,
    /// What to differentiate by.
    pub wanted: &'a Wanted,
    /// Whether the lights are more than a plain white.
    pub lit: bool,
    /// Vertices of all meshes, and of the largest.
    pub vertices: u64,
    /// Vertices of the largest mesh.
    pub largest_mesh: u32,
    /// Texels of all textures.
    pub texels: u64,
    /// Fixed-point units of a texel's gradient.
    pub texel_scale: f32,
}

fn bit(on: bool, bit: u32) -> u32 {
    if on { bit } else { 0 }
}

/// The GRADIENT_ bits that lead to what is wanted.
fn gradient_bits(input: &BackwardInput) -> u32 {
    let w = input.wanted;
    let up = input.upstream;
    // Light depends on normals, and normals on positions.
    let through_light = (w.positions && input.lit) || w.lights;
    bit(w.positions || w.camera, c::GRADIENT_GEOMETRY)
        | bit(up.color && (w.colors || through_light), c::GRADIENT_COLOR)
        | bit(up.color && w.uvs, c::GRADIENT_COORDINATE)
        | bit(up.color && w.texels, c::GRADIENT_TEXEL)
        | bit(w.scalars, c::GRADIENT_SCALARS)
        | bit(up.normal && w.positions, c::GRADIENT_NORMAL)
        | bit(w.camera, c::GRADIENT_VIEW)
        | bit(up.color && w.lights, c::GRADIENT_LIGHTS)
        | bit(w.background, c::GRADIENT_BACKGROUND)
}

fn upstream_bits(up: Outputs) -> u32 {
    bit(up.color, c::OUTPUT_COLOR)
        | bit(up.silhouette, c::OUTPUT_SILHOUETTE)
        | bit(up.depth, c::OUTPUT_DEPTH)
        | bit(up.normal, c::OUTPUT_NORMAL)
}

/// Workgroups along x and z for a count that may exceed one row.
fn rows_of(groups: u64, y: u32) -> [u32; 3] {
    let row = u64::from(c::FORWARD_ROW);
    [groups.min(row) as u32, y, groups.div_ceil(row) as u32]
}

impl BackwardPlan {
    /// Whether a GRADIENT_ bit is set.
    pub fn has(&self, flag: u32) -> bool {
        self.modes.iter().any(|(name, value)| *name == "GRADIENTS" && value & flag != 0)
    }

    /// Whether one of the two stages that walk items ever has any: one those that show in a shaded image, the other those
    /// that move the silhouette.
    pub fn walks(&self, stage: &str) -> bool {
        let mode = |name: &str| self.modes.iter().find(|(n, _)| *n == name).map_or(0, |(_, value)| *value);
        let shaded = mode("UPSTREAM") & !c::OUTPUT_SILHOUETTE != 0;
        let outlines = mode("UPSTREAM") & c::OUTPUT_SILHOUETTE != 0 || (shaded && mode("COMPOSITE") != 0);
        if stage.starts_with("backward_outline") { outlines } else { shaded }
    }

    /// Texels of one triangle in `corner_gradients`.
    pub fn corner_stride(&self) -> u32 {
        3 + 3 * u32::from(self.has(c::GRADIENT_COLOR)) + 2 * u32::from(self.has(c::GRADIENT_COORDINATE))
    }

    /// Sizes, counts and modes of a backward pass.
    pub fn new(input: &BackwardInput) -> Self {
        let gradients = gradient_bits(input);
        let has = |flag: u32| gradients & flag != 0;
        let forward = input.forward;
        let mut frame = forward.frame;
        frame.texel_scale = input.texel_scale;
        let mut modes = forward.modes.clone();
        modes.retain(|(name, _)| *name != "LIT");
        modes.extend([
            ("LIT", u32::from(input.lit || input.wanted.lights)),
            ("UPSTREAM", upstream_bits(input.upstream)),
            ("GRADIENTS", gradients),
            ("PAPER", u32::from(input.wanted.mode == GradientMode::Paper)),
        ]);
        let smooth = forward.mode("SMOOTH") != 0;
        let sum_pixels = has(c::GRADIENT_BACKGROUND) || has(c::GRADIENT_SCALARS);
        let sum_views = has(c::GRADIENT_VIEW) || has(c::GRADIENT_SCALARS);
        let light_rows = if smooth { forward.totals.vertices } else { forward.totals.slots };
        // What backward alone computes, or is needed by what follows it.
        let triangles = gradients & !c::GRADIENT_BACKGROUND != 0 && forward.totals.slots > 0;
        Self {
            frame,
            modes,
            sizes: sizes_of(input, gradients, smooth),
            groups: groups_of(input, gradients, smooth, sum_views, sum_pixels),
            item_rows: if triangles { item_rows(input) as u32 } else { 0 },
            light_rows: light_rows as u32,
            pixel_rows: forward.totals.pixels as u32,
        }
    }
}

fn item_rows(input: &BackwardInput) -> u64 {
    let items = input.forward.totals.slots + u64::from(input.forward.frame.cell_capacity);
    items.div_ceil(u64::from(c::FORWARD_ROW))
}

fn sizes_of(input: &BackwardInput, gradients: u32, smooth: bool) -> BackwardSizes {
    let has = |flag: u32| gradients & flag != 0;
    let when = |on: bool, size: u64| if on { size } else { 0 };
    let up = input.upstream;
    let shaded = up.color || up.depth || up.normal;
    let t = &input.forward.totals;
    let items = t.slots + u64::from(input.forward.frame.cell_capacity);
    let part = |flag: u32, texels: u32| if has(flag) { u64::from(texels) } else { 0 };
    let partial = u64::from(c::PARTIAL_TEXELS)
        + part(c::GRADIENT_COLOR, c::PARTIAL_COLOR_TEXELS)
        + part(c::GRADIENT_COORDINATE, c::PARTIAL_COORDINATE_TEXELS)
        + part(c::GRADIENT_NORMAL, c::PARTIAL_NORMAL_TEXELS);
    let corner = 3 + part(c::GRADIENT_COLOR, 3) + part(c::GRADIENT_COORDINATE, 2);
    let lights = u64::from(input.forward.frame.light_count) + 1;
    let sums = u64::from(input.forward.frame.view_count) + lights + 1;
    let light_rows = if smooth { t.vertices } else { t.slots };
    let composite = shaded && input.forward.mode("COMPOSITE") != 0;
    BackwardSizes {
        upstream_color: when(up.color, bytes(t.pixels, 16)),
        upstream_silhouette: when(up.silhouette && !up.color, bytes(t.pixels, 4)),
        upstream_depths: when(up.depth, bytes(t.pixels, 4)),
        upstream_normals: when(up.normal, bytes(t.pixels, 16)),
        pixel_gradients: bytes(t.pixels * (1 + u64::from(shaded) + u64::from(up.normal)), 16),
        pixel_sums: when(has(c::GRADIENT_BACKGROUND) || has(c::GRADIENT_SCALARS), bytes(t.pixels, 32)),
        shown_items: when(shaded, bytes(items, 16)),
        outline_items: when(up.silhouette || composite, bytes(items, 16)),
        item_counts: bytes(item_rows(input) * u64::from(c::ITEM_COUNT_WORDS), 4),
        partials: bytes(items * partial, 16),
        corner_gradients: bytes(t.slots * corner, 16),
        corner_lights: when(smooth, bytes(t.slots, 96)),
        light_records: when(has(c::GRADIENT_LIGHTS), bytes(light_rows, 32)),
        area_gradients: when(smooth, bytes(t.vertices, 16)),
        view_sums: when(has(c::GRADIENT_VIEW) || has(c::GRADIENT_SCALARS), bytes(t.slots, 48)),
        vertex_gradients: when(input.wanted.positions || input.wanted.colors, bytes(input.vertices, 32)),
        texel_sums: when(has(c::GRADIENT_TEXEL) && t.slots > 0, bytes(input.texels, 24)),
        totals: bytes(sums, 48),
    }
}

fn groups_of(input: &BackwardInput, gradients: u32, smooth: bool, sum_views: bool, sum_pixels: bool) -> BackwardGroups {
    let has = |flag: u32| gradients & flag != 0;
    let when = |on: bool, groups: [u32; 3]| if on { groups } else { [0; 3] };
    let forward = input.forward;
    let views = forward.frame.view_count;
    let linear = |n: u32, y: u32| [n.div_ceil(c::LINEAR_GROUP), y, 1];
    let pixels = u64::from(forward.frame.width) * u64::from(forward.frame.height);
    let items = forward.totals.slots + u64::from(forward.frame.cell_capacity);
    let triangles = gradients & !c::GRADIENT_BACKGROUND != 0 && forward.totals.slots > 0;
    let vertices = input.wanted.positions || input.wanted.colors;
    let corners = gradients & !(c::GRADIENT_BACKGROUND | c::GRADIENT_TEXEL) != 0;
    BackwardGroups {
        pixel_grad: when(triangles || sum_pixels, rows_of(pixels.div_ceil(u64::from(c::LINEAR_GROUP)), views)),
        backward_cull: when(triangles, rows_of(items.div_ceil(u64::from(c::LINEAR_GROUP)), 1)),
        triangle_grad: when(corners, forward.groups.triangle),
        vertex_normal_grad: when(corners && smooth, forward.groups.vertex),
        vertex_grad: when(vertices, linear(input.largest_mesh, forward.frame.mesh_count)),
        reduce_views: when(sum_views, [views, 1, 1]),
        reduce_lights: when(has(c::GRADIENT_LIGHTS), [forward.frame.light_count + 1, 1, 1]),
        reduce_pixels: when(sum_pixels, [1, 1, 1]),
    }
}
