//! The counts that the size formulas of the buffers take.

use crate::constants as c;
use crate::scene::Outputs;

/// Elements of the tables that hold all meshes one after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableLengths {
    /// Meshes.
    pub meshes: u64,
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Words of `adjacency`; 0 where neither gradients nor smooth shading need it.
    pub adjacency: u64,
    /// Floats of `vertex_normals`; 0 where no mesh has any.
    pub normals: u64,
    /// Floats of `colors`.
    pub colors: u64,
    /// Texels of `features`.
    pub features: u64,
    /// Floats of `uvs`.
    pub uvs: u64,
    /// Words of `uv_indices`.
    pub uv_indices: u64,
    /// Words of `triangle_textures`.
    pub triangle_textures: u64,
    /// Entries of `textures`.
    pub textures: u64,
    /// Texels.
    pub texels: u64,
}

/// Counts over all views of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // Named after what is counted.
pub struct Totals {
    pub vertices: u64,
    pub records: u64,
    pub bins: u64,
    pub words: u64,
    pub tiles: u64,
    pub pixels: u64,
}

impl Totals {
    /// Rows of FORWARD_ROW tiles, each with an indirect dispatch of its own.
    pub fn tile_rows(&self) -> u64 {
        self.tiles.div_ceil(u64::from(c::FORWARD_ROW))
    }
}

/// The counts that the sizes of a forward frame's buffers depend on.
#[derive(Clone, Copy, Debug)]
pub struct ForwardCounts {
    /// The meshes' tables.
    pub tables: TableLengths,
    /// Cameras.
    pub views: u64,
    /// Directional lights.
    pub lights: u64,
    /// Counts over all views.
    pub totals: Totals,
    /// Capacities: entries of the bins' lists, entries of the tiles' lists, and cells beyond the first of each box.
    pub capacity: [u64; 3],
    /// The images.
    pub outputs: Outputs,
    /// Vertices are lit, not triangles.
    pub smooth: bool,
    /// Texels of a shading record; 0 if triangles have none.
    pub shading_texels: u32,
    /// Texels of a vertex's features; 0 without an image of them.
    pub feature_texels: u64,
    /// The frame keeps what backward needs.
    pub save: bool,
    /// Words of the state of a walk.
    pub walk_words: u32,
    /// The most tiles walked in several turns that there is memory for.
    pub resumed: u64,
    /// Rows of RESUMED_ROW tiles that can be counted.
    pub resumed_rows: u64,
}

impl ForwardCounts {
    /// Texels of a geometry record, whose tail is in the shading record if there is one.
    pub fn geometry_texels(&self) -> u32 {
        c::GEOMETRY_TEXELS + u32::from(self.shading_texels == 0)
    }
}

/// The counts that the sizes of the buffers of a backward pass depend on.
#[derive(Clone, Copy, Debug)]
pub struct GradientCounts {
    /// Counts over all views of the frame.
    pub totals: Totals,
    /// Whether `cells` may be too small for the cells beyond the first of some triangles.
    pub long: bool,
    /// Items: the cells of all triangles' boxes.
    pub items: u64,
    /// Rows of FORWARD_ROW items.
    pub item_rows: u64,
    /// The images that have an upstream gradient.
    pub upstream: Outputs,
    /// Some triangles contribute to the silhouette's gradient.
    pub outlines: bool,
    /// GRADIENT_ bits.
    pub gradients: u32,
    /// Some image has an alpha below 1, by which there are gradients too.
    pub opacity: bool,
    /// Vertices are lit, not triangles.
    pub smooth: bool,
    /// Texels of an item's partial gradient.
    pub partial_texels: u64,
    /// Texels of a triangle's gradients by its corners.
    pub corner_texels: u64,
    /// Rows of the reduction over lights.
    pub light_rows: u64,
    /// Texels of a vertex's features; 0 without an image of them.
    pub feature_texels: u64,
    /// Gradients by positions or colours are wanted.
    pub wants_vertices: bool,
    /// Vertices of all meshes.
    pub vertices: u64,
    /// Texels of all textures.
    pub texels: u64,
    /// Sums in `totals`: of each view, of each light, of the ambient light, of the pixels.
    pub sums: u64,
}

impl GradientCounts {
    /// Whether one of these GRADIENT_ bits is set.
    pub fn has(&self, bits: u32) -> bool {
        self.gradients & bits != 0
    }

    /// Texels of a pixel's factors of the gradients.
    pub fn pixel_texels(&self) -> u64 {
        let up = self.upstream;
        let features = if up.features { self.feature_texels } else { 0 };
        u64::from(self.shaded()) + u64::from(up.normal || (up.depth && (up.color || up.features))) + features
    }

    /// Whether a shaded image has an upstream gradient.
    pub fn shaded(&self) -> bool {
        self.upstream.color || self.upstream.depth || self.upstream.normal || self.upstream.features
    }
}

/// Bytes of `count` elements of `each` bytes, rounded up to a multiple of 16; at least 16, since a buffer cannot be empty.
pub fn bytes(count: u64, each: u64) -> u64 {
    (count * each).next_multiple_of(16).max(16)
}
