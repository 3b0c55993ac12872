//! The table of buffers, one row for each: name, element format, role, usages and size.

use super::{ForwardCounts, GradientCounts, Role, UNUSED_SIZE, bytes};
use crate::constants as c;
use crate::vulkan::{TexelFormat, vk};

/// A buffer's size in bytes from the counts of its pass; 0 if the pass does not need the buffer.
#[derive(Clone, Copy)]
pub enum Formula {
    /// For a buffer of a forward frame.
    Frame(fn(&ForwardCounts) -> u64),
    /// For a buffer that a backward pass adds.
    Gradients(fn(&GradientCounts) -> u64),
}

/// The description of a buffer.
#[derive(Clone, Copy)]
pub struct Row {
    /// The binding's name in the kernels, and the buffer's label in debuggers.
    pub name: &'static str,
    /// The element that kernels read.
    pub format: TexelFormat,
    /// Who fills it.
    pub role: Role,
    /// Usages beyond those that follow from the kernels' bindings.
    pub usage: vk::BufferUsageFlags,
    /// Its size.
    pub size: Formula,
}

macro_rules! table {
    (
        frame { $($(#[$frame_doc:meta])* $frame:ident $frame_row:tt;)* }
        gradients { $($(#[$gradient_doc:meta])* $gradient:ident $gradient_row:tt;)* }
    ) => {
        /// A buffer of a frame or of its gradients.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum BufferId {
            $($(#[$frame_doc])* $frame,)*
            $($(#[$gradient_doc])* $gradient,)*
        }

        impl BufferId {
            /// Every buffer: those of a forward frame, then those that a backward pass adds.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$frame,)* $(Self::$gradient,)*];
            pub(crate) const COUNT: usize = [$(stringify!($frame),)* $(stringify!($gradient),)*].len();

            /// Its row of the table.
            pub(crate) fn row(self) -> &'static Row {
                static ROWS: [Row; BufferId::COUNT] =
                    [$(table!(@row Frame $frame_row),)* $(table!(@row Gradients $gradient_row),)*];
                &ROWS[self as usize]
            }
        }
    };
    (@row $pass:ident ($name:literal, $format:ident, $role:ident, [$($usage:ident),*], $size:expr)) => {
        Row {
            name: $name,
            format: TexelFormat::$format,
            role: Role::$role,
            usage: vk::BufferUsageFlags::from_raw(0 $(| vk::BufferUsageFlags::$usage.as_raw())*),
            size: Formula::$pass($size),
        }
    };
}

/// The size if the condition holds, else 0.
fn when(on: bool, size: u64) -> u64 {
    if on { size } else { 0 }
}

/// Bytes of `count` records, each of `each` texels of 16 bytes.
fn texels(count: u64, each: u32) -> u64 {
    bytes(count * u64::from(each), 16)
}

table! {
    frame {
        /// Each view's mesh, and its ranges in the frame's buffers.
        ViewShapes("view_shapes", Uint4, Input, [STORAGE_BUFFER],
            |f| f.views * 16 * u64::from(c::SHAPE_TEXELS));
        /// Each view's camera.
        ViewCameras("view_cameras", Float4, Input, [], |f| f.views * 16 * u64::from(c::CAMERA_TEXELS));
        /// x, y, z of every vertex of every mesh, in world space. A host's geometry can be written into it.
        Positions("positions", Float, Input, [STORAGE_BUFFER], |f| 12 * f.tables.vertices);
        /// Three vertex numbers of every triangle, counted from the mesh's first vertex.
        Indices("indices", Uint, Input, [STORAGE_BUFFER], |f| 12 * f.tables.triangles);
        /// The triangle corners that share a vertex, for every vertex: for gradients and smooth shading.
        Adjacency("adjacency", Uint, Input, [], |f| 4 * f.tables.adjacency);
        /// x, y, z of a unit normal for every vertex of every mesh, if some mesh has normals; 0 where smooth shading is
        /// to take the mean of the triangles' normals.
        VertexNormals("vertex_normals", Float, Input, [], |f| 4 * f.tables.normals);
        /// The ambient light, then direction and colour of each directional one.
        Lights("lights", Float4, Input, [], |f| 16 * (1 + 2 * f.lights));
        /// r, g, b of each mesh or of each of its vertices. A host's geometry can be written into it.
        Colors("colors", Float, Input, [STORAGE_BUFFER], |f| 4 * f.tables.colors);
        /// Features of every vertex of every mesh, four a texel and zeros behind the last, if there is an image of them.
        Features("features", Float4, Input, [], |f| when(f.feature_texels > 0, bytes(f.tables.features, 16)));
        /// u, v of the meshes that have images.
        Uvs("uvs", Float, Input, [], |f| 4 * f.tables.uvs);
        /// Three UV numbers of every triangle of those meshes.
        UvIndices("uv_indices", Uint, Input, [], |f| 4 * f.tables.uv_indices);
        /// The entry of `textures` of every triangle of a mesh with several images.
        TriangleTextures("triangle_textures", Uint, Input, [], |f| 4 * f.tables.triangle_textures);
        /// First texel, size and kind of every texture.
        Textures("textures", Uint4, Input, [], |f| 16 * f.tables.textures);
        /// r, g, b and alpha of every texel.
        Texels("texels", Float4, Input, [], |f| 16 * f.tables.texels);
        /// Vertices as each view sees them.
        Vertices("vertices", Float4, Workspace, [], |f| texels(f.totals.vertices, c::VERTEX_TEXELS));
        /// Normals and light of the vertices, with smooth shading.
        VertexShading("vertex_shading", Float4, Workspace, [],
            |f| when(f.smooth, texels(f.totals.vertices, c::VERTEX_SHADING_TEXELS)));
        /// Each triangle record's edges, from which signed edge distances are computed.
        Geometry("geometry", Float4, Workspace, [], |f| texels(f.totals.records, f.geometry_texels()));
        /// Each triangle record's colours, depths and normals, after the last two numbers of its edges.
        Shading("shading", Float4, Workspace, [],
            |f| when(f.shading_texels > 0, texels(f.totals.records, f.shading_texels)));
        /// The box of pixels that each triangle's support can reach.
        Boxes("boxes", Int4, Workspace, [], |f| texels(f.totals.records, 1));
        /// One bit for each bin and triangle.
        BinBits("bin_bits", Uint, Workspace, [TRANSFER_SRC, TRANSFER_DST], |f| bytes(f.totals.words, 4));
        /// The range of each bin's list.
        BinRanges("bin_ranges", Uint2, Workspace, [], |f| bytes(f.totals.bins, 8));
        /// The bins' lists of record indices.
        CoarseRecords("coarse_records", Uint, Workspace, [], |f| bytes(f.capacity[0], 4));
        /// For every 32 entries of the bins' lists, which of the bin's tiles each entry reaches.
        CoarseWords("coarse_words", Uint, Workspace, [],
            |f| bytes(f.capacity[0].div_ceil(c::WORD_BITS.into()), 4 * u64::from(c::BLOCK_WORDS)));
        /// Three lists of tiles: those with entries, and the ranges of their lists; the empty ones, with those walked
        /// in several turns; those that the general kernel draws again, with those walked in one turn.
        TileItems("tile_items", Uint4, Workspace, [], |f| bytes(f.totals.tiles, 48));
        /// Arguments of the indirect dispatches over tiles.
        TileCounts("tile_counts", Uint, Workspace, [TRANSFER_DST, INDIRECT_BUFFER],
            |f| bytes(f.totals.tile_rows() * u64::from(c::TILE_COUNT_WORDS) + 3 * f.resumed_rows, 4));
        /// The state of the walks of tiles that are processed in several turns.
        WalkState("walk_state", Uint, Workspace, [],
            |f| when(f.resumed > 0, bytes(f.resumed, 4 * u64::from(f.walk_words))));
        /// The tiles that the last frame left empty.
        TileMarks("tile_marks", Uint, Workspace, [], |f| bytes(f.totals.tiles, 4));
        /// The tiles' lists of record indices.
        TileRecords("tile_records", Uint, Workspace, [], |f| bytes(f.capacity[1], 4));
        /// Whether the frame is valid, and how much room its lists needed.
        Status("status", Uint, Output, [TRANSFER_DST], |_| bytes(c::STATUS_WORDS.into(), 4));
        /// Linear r, g, b and the silhouette of every pixel.
        Color("color", Float4, Output, [UNIFORM_TEXEL_BUFFER], |f| when(f.outputs.color, bytes(f.totals.pixels, 16)));
        /// The silhouette of every pixel, if colour is not rendered.
        Silhouette("silhouette", Float, Output, [UNIFORM_TEXEL_BUFFER],
            |f| when(f.outputs.silhouette && !f.outputs.color, bytes(f.totals.pixels, 4)));
        /// Σ w z of every pixel in world units.
        Depths("depths", Float, Output, [UNIFORM_TEXEL_BUFFER],
            |f| when(f.outputs.depth, bytes(f.totals.pixels, 4)));
        /// Σ w n of every pixel in world space, and 0.
        Normals("normals", Float4, Output, [UNIFORM_TEXEL_BUFFER],
            |f| when(f.outputs.normal, bytes(f.totals.pixels, 16)));
        /// Σ w f of every pixel's features, as `features` has those of a vertex.
        FeatureImage("feature_image", Float4, Output, [UNIFORM_TEXEL_BUFFER],
            |f| when(f.feature_texels > 0, bytes(f.totals.pixels * f.feature_texels, 16)));
        /// Every pixel's state after aggregation, which backward starts from.
        Saved("saved", Float4, Workspace, [], |f| when(f.save, bytes(f.totals.pixels, 16)));
        /// Every tile's least log sum and largest transmittance, by which backward skips items.
        TileBounds("tile_bounds", Float2, Workspace, [], |f| when(f.save, bytes(f.totals.tiles, 8)));
        /// The range in `cells` of each triangle record's cells beyond its first.
        CellRanges("cell_ranges", Uint2, Workspace, [], |f| when(f.save, bytes(f.totals.records, 8)));
        /// The cells that the boxes of large triangles have beyond their first.
        Cells("cells", Uint2, Workspace, [], |f| when(f.save, bytes(f.capacity[2], 8)));
        /// Bound in place of every buffer that the frame does not have.
        Unused("unused", Float, Workspace, [STORAGE_BUFFER, UNIFORM_TEXEL_BUFFER], |_| UNUSED_SIZE);
    }
    gradients {
        /// dL by `color`: r, g, b and the silhouette of every pixel.
        UpstreamColor("upstream_color", Float4, Input, [], |g| when(g.upstream.color, bytes(g.totals.pixels, 16)));
        /// dL by `silhouette`.
        UpstreamSilhouette("upstream_silhouette", Float, Input, [],
            |g| when(g.upstream.silhouette && !g.upstream.color, bytes(g.totals.pixels, 4)));
        /// dL by `depths`.
        UpstreamDepths("upstream_depths", Float, Input, [], |g| when(g.upstream.depth, bytes(g.totals.pixels, 4)));
        /// dL by `normals`; the fourth component is not read.
        UpstreamNormals("upstream_normals", Float4, Input, [], |g| when(g.upstream.normal, bytes(g.totals.pixels, 16)));
        /// dL by `feature_image`.
        UpstreamFeatures("upstream_features", Float4, Input, [],
            |g| when(g.upstream.features, bytes(g.totals.pixels * g.feature_texels, 16)));
        /// Every pixel's factors of the gradients through shaded images.
        PixelGradients("pixel_gradients", Float4, Workspace, [],
            |g| when(g.pixel_texels() > 0, bytes(g.totals.pixels * g.pixel_texels(), 16)));
        /// Every pixel's factor of the gradients through the silhouette.
        SilhouetteGradients("silhouette_gradients", Float, Workspace, [],
            |g| when(g.outlines, bytes(g.totals.pixels, 4)));
        /// Every pixel's terms of the gradients by background, σ and γ.
        PixelSums("pixel_sums", Float4, Workspace, [],
            |g| when(g.has(c::GRADIENT_BACKGROUND | c::GRADIENT_SCALARS), bytes(g.totals.pixels, 32)));
        /// The items that are visible in a shaded image.
        ShownItems("shown_items", Uint4, Workspace, [], |g| when(g.shaded(), bytes(g.items, 16)));
        /// The items that contribute to the silhouette only.
        OutlineItems("outline_items", Uint4, Workspace, [], |g| when(g.outlines, bytes(g.items, 16)));
        /// The triangle records whose further cells found no room.
        LongRecords("long_records", Uint, Workspace, [], |g| when(g.long, bytes(g.totals.records, 4)));
        /// Arguments of the indirect dispatches over items.
        ItemCounts("item_counts", Uint, Workspace, [TRANSFER_DST, INDIRECT_BUFFER],
            |g| bytes(g.item_rows * u64::from(c::ITEM_COUNT_WORDS), 4));
        /// Whether each item has an entry in `partials`, and how many further cells each record has.
        ItemMarks("item_marks", Uint, Workspace, [], |g| bytes(g.items, 4));
        /// Each item's sum over its pixels.
        Partials("partials", Float4, Workspace, [], |g| bytes(g.items * g.partial_texels, 16));
        /// Gradients by the light at a triangle's corners, with smooth shading.
        CornerLights("corner_lights", Float4, Workspace, [], |g| when(g.smooth, bytes(g.totals.records, 96)));
        /// Rows of the reduction over lights. Cleared if only the device knows how many triangles there are.
        LightRecords("light_records", Float4, Workspace, [TRANSFER_DST],
            |g| when(g.has(c::GRADIENT_LIGHTS), bytes(g.light_rows, 32)));
        /// Gradients by the area-weighted normals of vertices, with smooth shading.
        AreaGradients("area_gradients", Float4, Workspace, [], |g| when(g.smooth, bytes(g.totals.vertices, 16)));
        /// Rows of the reduction over views.
        ViewSums("view_sums", Float4, Workspace, [],
            |g| when(g.has(c::GRADIENT_VIEW | c::GRADIENT_SCALARS), bytes(g.totals.records, 48)));
        /// Gradients by the corners of triangles. Cleared if only the device knows how many triangles there are.
        CornerGradients("corner_gradients", Float4, Output, [TRANSFER_DST],
            |g| when(g.corner_texels > 0, bytes(g.totals.records * g.corner_texels, 16)));
        /// dL by position and colour of every vertex: x, y, z, 0, r, g, b, 0.
        VertexGradients("vertex_gradients", Float4, Output, [], |g| when(g.wants_vertices, bytes(g.vertices, 32)));
        /// dL by the features of every vertex, as `features` has them.
        FeatureGradients("feature_gradients", Float4, Output, [],
            |g| when(g.has(c::GRADIENT_FEATURES), bytes(g.vertices * g.feature_texels, 16)));
        /// dL by every texel: three sums in fixed point of 64 bits, four where some texture has an alpha.
        TexelSums("texel_sums", Uint, Output, [TRANSFER_SRC, TRANSFER_DST],
            |g| when(g.has(c::GRADIENT_TEXEL) && g.totals.records > 0, bytes(g.texels, if g.opacity { 32 } else { 24 })));
        /// Three texels for each view, then for each light, the ambient one first, then for the pixels.
        Totals("totals", Float4, Output, [], |g| bytes(g.sums, 48));
    }
}

impl BufferId {
    /// Its name, as in the kernels.
    pub fn name(self) -> &'static str {
        self.row().name
    }
}

impl std::fmt::Display for BufferId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
