//! Bytes of the buffers that a forward frame fills.

use super::modes::modes_of;
use super::{FramePush, PlanInput, Totals};
use crate::constants as c;

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
    pub tile_slots: u64,
    pub tile_items: u64,
    pub tile_counts: u64,
    pub tile_marks: u64,
    pub status: u64,
    pub color: u64,
    pub silhouette: u64,
    pub depths: u64,
    pub normals: u64,
    pub saved: u64,
    pub tile_bounds: u64,
    pub cell_ranges: u64,
    pub cells: u64,
}

impl BufferSizes {
    /// All of them together.
    pub fn total(&self) -> u64 {
        let BufferSizes { vertices, vertex_shading, geometry, shading, boxes, bin_bits, bin_ranges, .. } = *self;
        let BufferSizes { coarse_slots, coarse_words, tile_slots, status, .. } = *self;
        let BufferSizes { tile_items, tile_counts, tile_marks, .. } = *self;
        let BufferSizes { color, silhouette, depths, normals, saved, tile_bounds, cell_ranges, cells, .. } = *self;
        let records = vertices + vertex_shading + geometry + shading + boxes;
        let lists = bin_bits + bin_ranges + coarse_slots + coarse_words + tile_slots + status;
        let tiles = tile_items + tile_counts + tile_marks;
        records + lists + tiles + color + silhouette + depths + normals + saved + tile_bounds + cell_ranges + cells
    }
}

/// A multiple of 16, at least 16: no buffer that is used is empty.
pub(super) fn bytes(count: u64, each: u64) -> u64 {
    (count * each).next_multiple_of(16).max(16)
}

pub(super) fn sizes_of(input: &PlanInput, frame: &FramePush, t: &Totals) -> BufferSizes {
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
        coarse_words: bytes(u64::from(frame.coarse_capacity.div_ceil(c::WORD_BITS)), 4 * u64::from(c::BLOCK_WORDS)),
        tile_slots: bytes(u64::from(frame.list_capacity), 4),
        tile_items: bytes(t.tiles, 32),
        tile_counts: bytes(t.tile_rows() * u64::from(c::TILE_COUNT_WORDS), 4),
        tile_marks: bytes(t.tiles, 4),
        status: bytes(u64::from(c::STATUS_WORDS), 4),
        color: when(outputs.color, bytes(t.pixels, 16)),
        silhouette: when(outputs.silhouette && !outputs.color, bytes(t.pixels, 4)),
        depths: when(outputs.depth, bytes(t.pixels, 4)),
        normals: when(outputs.normal, bytes(t.pixels, 16)),
        saved: when(input.save, bytes(t.pixels, 16)),
        tile_bounds: when(input.save, bytes(t.tiles, 8)),
        cell_ranges: when(input.save, bytes(t.slots, 8)),
        cells: when(input.save, bytes(u64::from(frame.cell_capacity), 8)),
    }
}
