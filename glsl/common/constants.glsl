// The constants that Rust and GLSL have in common. build.rs turns each into a Rust constant, with the comment above as its
// documentation.

// Width of a tile in pixels.
const uint TILE_WIDTH = 8u;
// Height of a tile in pixels. One subgroup of eight lanes holds 8×4 pixels in registers, four pixels a lane.
const uint TILE_HEIGHT = 4u;
// Tiles of a bin along each axis. 8×8 tiles are the 64 bits of a mask.
const uint BIN_TILES = 8u;
// Width of a bin in pixels.
const uint BIN_WIDTH = 64u;
// Height of a bin in pixels.
const uint BIN_HEIGHT = 32u;
// Workgroups of one indirect dispatch. A device need only allow 65535 along an axis, so a longer list takes several rows.
const uint FORWARD_ROW = 32768u;
// Invocations of a workgroup of the vertex and triangle stages.
const uint LINEAR_GROUP = 64u;
// First word of the three workgroup counts, in `tile_counts`, of a row of tiles with entries.
const uint TILES_FILLED = 0u;
// First word of the workgroup counts, in `tile_counts`, of a row of tiles that need the background.
const uint TILES_EMPTY = 3u;
// First word of the counts, in `tile_counts`, of a row of tiles that forward draws: a triangle is too thin for forward_soft.
const uint TILES_GENERAL = 6u;
// First word of the counts, in `tile_counts`, of a row of tiles that forward_soft_long and forward_long process in one turn.
const uint TILES_WALKED = 9u;
// Words of `tile_counts` for each row of FORWARD_ROW tiles.
const uint TILE_COUNT_WORDS = 12u;
// Tiles that forward_soft_long and forward_long process in several turns come in rows of this length. `walk_state` has an
// entry for each tile of a row. The three workgroup counts of these rows lie behind those of all other rows.
const uint RESUMED_ROW = 4096u;
// Triangles in one word of a bin's bitmap.
const uint WORD_BITS = 32u;
// Words of a block of WORD_BITS entries of a bin's list: for each tile a mask of the entries that may touch it, a mask of the
// back faces, and a mask of the thin triangles.
const uint BLOCK_WORDS = 66u;

// First word of an entry of `bin_ranges` whose bin has no list, because there was no room for it.
const uint NO_LIST = 0xffffffffu;
// Entries that a walk can collect before it adds them to the pixels: those of WORD_BITS blocks, and less than two words more.
const uint WALK_WINDOW = 1088u;
// Words of an entry of `walk_state`: 21 for each of 32 pixels, 32 entries, and where the walk stands.
const uint WALK_STATE_WORDS = 709u;
// Words that each texel of features adds to an entry of `walk_state`: eight for each of 32 pixels.
const uint WALK_FEATURE_WORDS = 256u;
// Words that textures with an alpha add to an entry of `walk_state`: one for each of 32 pixels.
const uint WALK_OPACITY_WORDS = 32u;
// Loop passes that WORD_BITS blocks take, besides one for each block with entries.
const uint WALK_GROUP_PASSES = 8u;
// Loop passes that WORD_BITS entries of a list take.
const uint WALK_LIST_PASSES = 38u;
// The most loop passes that a group of WORD_BITS blocks takes, with the entries that it completes.
const uint WALK_MOST_PASSES = 1300u;
// Value of frame.number for tiles that are walked in one turn.
const uint ONE_TURN = 0xffffffffu;

// Value in `tile_marks`: the tile's pixels hold the background.
const uint TILE_BACKGROUND = 1u;

// Flag of an entry of `view_shapes`: one colour for the whole mesh.
const uint SHAPE_UNIFORM_COLOR = 1u;
// Flag of an entry of `view_shapes`: `tile_marks` are valid. Nothing else has written to the images since they were written.
const uint SHAPE_MARKS_VALID = 2u;
// Texels (uvec4) of one entry of `view_shapes`.
const uint SHAPE_TEXELS = 4u;
// Texels (vec4) of one entry of `view_cameras`.
const uint CAMERA_TEXELS = 11u;
// Texels (vec4) of one transformed vertex.
const uint VERTEX_TEXELS = 2u;
// Texels (vec4) of one vertex's light and normal.
const uint VERTEX_SHADING_TEXELS = 2u;
// Texels (vec4) of one triangle's geometry record, without its tail.
const uint GEOMETRY_TEXELS = 4u;
// Texels (vec4) of a shading record with corner colours only. The geometry's tail is in the first of them.
const uint SHADING_TEXELS = 4u;
// Texels (vec4) that texture coordinates add to a shading record.
const uint SHADING_COORDINATE_TEXELS = 2u;
// Texels (vec4) that normals add to a shading record.
const uint SHADING_NORMAL_TEXELS = 3u;

// Bit of OUTPUTS: the colour image.
const uint OUTPUT_COLOR = 1u;
// Bit of OUTPUTS: the silhouette image.
const uint OUTPUT_SILHOUETTE = 2u;
// Bit of OUTPUTS: the depth image.
const uint OUTPUT_DEPTH = 4u;
// Bit of OUTPUTS: the normal image.
const uint OUTPUT_NORMAL = 8u;
// Bit of OUTPUTS: the image of features.
const uint OUTPUT_FEATURES = 16u;

// COLOR_MODE: the depth-weighted softmax of eq. 2 and 3.
const uint COLOR_SOFTMAX = 0u;
// COLOR_MODE: the nearest covering triangle.
const uint COLOR_HARD = 1u;

// SILHOUETTE_MODE: 1 - product of complements, eq. 5.
const uint SILHOUETTE_PRODUCT = 0u;
// SILHOUETTE_MODE: sum of D over the number of triangles, at most 1.
const uint SILHOUETTE_SUM = 1u;
// SILHOUETTE_MODE: 1 if any D > 1/2, else 0.
const uint SILHOUETTE_HARD = 2u;

// DISTANCE: squared distance to the boundary, d² of eq. 1.
const uint DISTANCE_EUCLIDEAN = 0u;
// DISTANCE: square of the smallest barycentric coordinate.
const uint DISTANCE_BARYCENTRIC = 1u;
// DISTANCE: D is 1 inside and 0 outside.
const uint DISTANCE_HARD = 2u;

// SURFACE_POINT: outside a triangle b̂ is that of the triangle's nearest point.
const uint SURFACE_POINT_NEAREST = 0u;
// SURFACE_POINT: b̂ is clamp(b, 0, 1) over its sum, as in the paper.
const uint SURFACE_POINT_CLIP = 1u;

// SAMPLING: corner colours only.
const uint SAMPLING_NONE = 0u;
// SAMPLING bit: some mesh has surface cells.
const uint SAMPLING_SURFACE = 1u;
// SAMPLING bit: some mesh has image textures.
const uint SAMPLING_IMAGE = 2u;

// DEPTH_RANGE: every fragment lies within [near, far].
const uint DEPTH_RANGE_INSIDE = 0u;
// DEPTH_RANGE: fragments beyond far are dropped.
const uint DEPTH_RANGE_FAR = 1u;
// DEPTH_RANGE: fragments outside [near, far] contribute to the silhouette only, as in the official code.
const uint DEPTH_RANGE_OFFICIAL = 2u;

// Projection kind: x / z.
const uint PROJECTION_PERSPECTIVE = 0u;
// Projection kind: x at every depth.
const uint PROJECTION_ORTHOGRAPHIC = 1u;
// Projection kind: x / (z + 1e-5), then distorted.
const uint PROJECTION_OFFICIAL = 2u;
// Projection kind: vertices are given on the screen.
const uint PROJECTION_SCREEN = 3u;

// Kind of texture: surface cells, looked up without interpolation.
const uint TEXTURE_SURFACE = 0u;
// Kind of texture: an image that repeats.
const uint TEXTURE_REPEAT = 1u;
// Kind of texture: an image whose border texels continue outside it.
const uint TEXTURE_CLAMP = 2u;

// Word of `status`: entries that the bins' lists need.
const uint STATUS_COARSE_NEEDED = 0u;
// Word of `status`: entries that the tiles' lists need.
const uint STATUS_LIST_NEEDED = 1u;
// Word of `status`: not 0 when a projected vertex is not finite.
const uint STATUS_NOT_FINITE = 2u;
// Word of `status`: tiles that forward_soft_long and forward_long process in several turns.
const uint STATUS_RESUMED_TILES = 3u;
// Word of `status`: cells that large pixel boxes need beyond their first.
const uint STATUS_CELLS_NEEDED = 4u;
// Word of `status`: tiles that have a list.
const uint STATUS_FILLED_TILES = 5u;
// Word of `status`: tiles that received the background.
const uint STATUS_EMPTY_TILES = 6u;
// Word of `status`: 1 once a backward pass has found its frame complete, so that its gradients may be used. 0 before that, and
// if a vertex is not finite: then all gradients are zero.
const uint STATUS_WHOLE = 7u;
// Word of `status`: tiles whose lists are not in memory, in one turn or several.
const uint STATUS_WALKED_TILES = 8u;
// Word of `status`: tiles with a list that have a triangle too thin for forward_soft.
const uint STATUS_THIN_TILES = 9u;
// Word of `status`: not 0 if, in a frame that is saved, a triangle's box has more pixels than LARGE_BOX or several cells.
const uint STATUS_LARGE_BOXES = 10u;
// Number of words of `status`.
const uint STATUS_WORDS = 11u;

// Bit of GRADIENTS, the gradients that backward computes: by the vertices' positions on the image. Those by world positions and
// the camera follow from them.
const uint GRADIENT_GEOMETRY = 1u;
// Bit of GRADIENTS: by corner colours. Those by vertex colours and lights follow from them.
const uint GRADIENT_COLOR = 2u;
// Bit of GRADIENTS: by texture coordinates.
const uint GRADIENT_COORDINATE = 4u;
// Bit of GRADIENTS: by the texels of surfaces and images.
const uint GRADIENT_TEXEL = 8u;
// Bit of GRADIENTS: by sigma and gamma.
const uint GRADIENT_SCALARS = 16u;
// Bit of GRADIENTS: by corner normals, through the normal image.
const uint GRADIENT_NORMAL = 32u;
// Bit of GRADIENTS: by the camera.
const uint GRADIENT_VIEW = 64u;
// Bit of GRADIENTS: by the lights.
const uint GRADIENT_LIGHTS = 128u;
// Bit of GRADIENTS: by the background's colour and score ε.
const uint GRADIENT_BACKGROUND = 256u;
// Bit of GRADIENTS: by the vertices' features.
const uint GRADIENT_FEATURES = 512u;

// REDUCTION: sums over each view's triangles.
const uint REDUCTION_VIEWS = 0u;
// REDUCTION: sums over vertices or triangles, one for each light.
const uint REDUCTION_LIGHTS = 1u;
// REDUCTION: sums over all pixels.
const uint REDUCTION_PIXELS = 2u;

// First word of the three workgroup counts, in `item_counts`, of a row of items visible in the shaded images.
const uint ITEMS_SHOWN = 0u;
// First word of the workgroup counts, in `item_counts`, of a row of items that contribute to the silhouette only.
const uint ITEMS_OUTLINE = 3u;
// Offset from a list's workgroup counts to those of its small items.
const uint ITEMS_SMALL = 6u;
// Offset from a list's workgroup counts to the number of its small items.
const uint ITEMS_SMALL_NUMBER = 12u;
// First word of the workgroup counts, in `item_counts`, of a row of records whose further cells found no room.
const uint ITEMS_LONG = 18u;
// Words of `item_counts` for each row of FORWARD_ROW items.
const uint ITEM_COUNT_WORDS = 21u;
// Bit of an entry of `item_marks`: the item has an entry in `partials`.
const uint MARK_SUMMED = 1u;
// Bit of an entry of `item_marks`: the record's box has several cells, each an item or, without room, part of the first item.
const uint MARK_LARGE = 2u;
// The lowest bit of the number of a record's further items in an entry of `item_marks`.
const uint MARK_FURTHER_BIT = 2u;
// First word of an entry of `cells` that belongs to no record.
const uint NO_RECORD = 0xffffffffu;
// Cells of a record that one turn of backward_long processes. With one lane a cell takes 1106 loop passes.
const uint CELLS_PER_TURN = 48u;
// Lanes of a workgroup of small items, if its subgroups need nothing of each other. llvmpipe makes an allocation for every
// workgroup: with 64 in place of 8 lanes silhouettes of 64² and 256² take 0.95 of the time, colours 0.99.
const uint SMALL_GROUP = 64u;

// Width of a cell in pixels. Backward splits larger pixel boxes into cells, which run in parallel.
const uint CELL_WIDTH = 64u;
// Height of a cell in pixels.
const uint CELL_HEIGHT = 32u;
// Pixels of the largest box that one lane of a software device processes alone in backward.
const uint LARGE_BOX = 1024u;
// Texels (vec4) of an entry of `partials` without its optional parts.
const uint PARTIAL_TEXELS = 3u;
// Texels (vec4) that corner colours add to an entry of `partials`.
const uint PARTIAL_COLOR_TEXELS = 3u;
// Texels (vec4) that texture coordinates add to an entry of `partials`.
const uint PARTIAL_COORDINATE_TEXELS = 2u;
// Texels (vec4) that corner normals add to an entry of `partials`.
const uint PARTIAL_NORMAL_TEXELS = 3u;

// Invocations in a workgroup of the self test.
const uint SELFTEST_LOCAL_SIZE = 64u;
// The offset that the self test adds by default.
const float SELFTEST_OFFSET = 0.5;

// Use of a host's buffer of gradients by a place kernel: write the gradients.
const uint TARGET_WRITE = 0u;
// Use of a host's buffer of gradients by a place kernel: write zeros, before several meshes add theirs.
const uint TARGET_CLEAR = 1u;
// Use of a host's buffer of gradients by a place kernel: add the gradients, if several meshes share the buffer.
const uint TARGET_ADD = 2u;

// Bit of the flags of `store`: encode colour as sRGB.
const uint STORE_SRGB = 1u;
// Bit of the flags of `store`: store the triangles' colour alone, not multiplied by the silhouette.
const uint STORE_STRAIGHT = 2u;
// Bit of the flags of `store`: store the triangles' colour alone, multiplied by the silhouette.
const uint STORE_PREMULTIPLIED = 4u;
// Bit of the flags of `store`: the images are blended with the background by the silhouette.
const uint STORE_COMPOSITE = 8u;
// Bit of the flags of `store`: store the value of the host's depth buffer in place of the view depth.
const uint STORE_DEPTH = 16u;
// Bit of the flags of `store`: the host's projection has perspective.
const uint STORE_PERSPECTIVE = 32u;
