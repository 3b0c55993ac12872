// What Rust and GLSL both need to know; build.rs turns every constant here into a Rust one.

// Width of a tile in pixels.
const uint TILE_WIDTH = 8u;
// Height of a tile in pixels: 8×4 is what one subgroup of eight lanes holds in registers, four pixels a lane.
const uint TILE_HEIGHT = 4u;
// Tiles of a bin along each axis; 8×8 tiles are the 64 bits of a mask.
const uint BIN_TILES = 8u;
// Width of a bin in pixels.
const uint BIN_WIDTH = 64u;
// Height of a bin in pixels.
const uint BIN_HEIGHT = 32u;
// Workgroups of one indirect dispatch, since 65535 is all that a device must offer; more go in further rows.
const uint FORWARD_ROW = 32768u;
// Invocations of a workgroup of the vertex and triangle stages.
const uint LINEAR_GROUP = 64u;
// First of the three words of `tile_counts` that are the workgroups of a row of tiles which have a list.
const uint TILES_FILLED = 0u;
// First of those of tiles that must be given the background.
const uint TILES_EMPTY = 3u;
// Words of `tile_counts` for each row of FORWARD_ROW tiles.
const uint TILE_COUNT_WORDS = 6u;
// Triangles whose bits share one word of a bin's bitmap.
const uint WORD_BITS = 32u;
// Words of a block of WORD_BITS entries of a bin's list: which of them may touch each tile, and which face away.
const uint BLOCK_WORDS = 65u;

// In `tile_marks`: the tile's pixels hold the background.
const uint MARK_BACKGROUND = 1u;

// Flags of an entry of `view_shapes`: one colour for the whole mesh.
const uint SHAPE_UNIFORM_COLOR = 1u;
// Where `tile_marks` say that a tile holds the background, it does: nobody else wrote to the images since.
const uint SHAPE_BACKGROUND_KEPT = 2u;
// Texels (uvec4) of one entry of `view_shapes`.
const uint SHAPE_TEXELS = 4u;
// Texels (vec4) of one entry of `view_cameras`.
const uint CAMERA_TEXELS = 11u;
// Texels (vec4) of one transformed vertex.
const uint VERTEX_TEXELS = 2u;
// Texels (vec4) of one vertex's light and normal.
const uint VERTEX_SHADING_TEXELS = 2u;
// Texels (vec4) of one triangle's geometry record.
const uint GEOMETRY_TEXELS = 5u;
// Texels (vec4) of a shading record with corner colours only.
const uint SHADING_TEXELS = 4u;
// Texels (vec4) that texture coordinates add to a shading record.
const uint SHADING_COORDINATE_TEXELS = 2u;
// Texels (vec4) that normals add to a shading record.
const uint SHADING_NORMAL_TEXELS = 3u;

// Bits of OUTPUTS.
const uint OUTPUT_COLOR = 1u;
// The silhouette image.
const uint OUTPUT_SILHOUETTE = 2u;
// The depth image.
const uint OUTPUT_DEPTH = 4u;
// The normal image.
const uint OUTPUT_NORMAL = 8u;

// COLOR_MODE: the depth-weighted softmax of eq. 2 and 3.
const uint COLOR_SOFTMAX = 0u;
// COLOR_MODE: the nearest covering triangle.
const uint COLOR_HARD = 1u;

// SILHOUETTE_MODE: 1 - product of complements, eq. 5.
const uint SILHOUETTE_PRODUCT = 0u;
// SILHOUETTE_MODE: sum of D over the number of triangles, at most 1.
const uint SILHOUETTE_SUM = 1u;
// SILHOUETTE_MODE: 1 where any D > 1/2.
const uint SILHOUETTE_HARD = 2u;

// DISTANCE: squared distance to the boundary.
const uint DISTANCE_EUCLIDEAN = 0u;
// DISTANCE: square of the smallest barycentric coordinate.
const uint DISTANCE_BARYCENTRIC = 1u;
// DISTANCE: inside or not.
const uint DISTANCE_HARD = 2u;

// SAMPLING: corner colours only.
const uint SAMPLING_NONE = 0u;
// SAMPLING bit: some mesh has surface cells.
const uint SAMPLING_SURFACE = 1u;
// SAMPLING bit: some mesh has image textures.
const uint SAMPLING_IMAGE = 2u;

// DEPTH_RANGE: every fragment is known to lie within [near, far].
const uint DEPTH_RANGE_INSIDE = 0u;
// DEPTH_RANGE: fragments beyond far take part in nothing.
const uint DEPTH_RANGE_FAR = 1u;
// DEPTH_RANGE: fragments outside [near, far] count in the silhouette alone, as in the official code.
const uint DEPTH_RANGE_OFFICIAL = 2u;

// Projection kinds: x / z.
const uint PROJECTION_PERSPECTIVE = 0u;
// Projection kind: x whatever the depth.
const uint PROJECTION_ORTHOGRAPHIC = 1u;
// Projection kind: x / (z + 1e-5), then distorted.
const uint PROJECTION_OFFICIAL = 2u;
// Projection kind: already on the screen.
const uint PROJECTION_SCREEN = 3u;

// Kinds of an entry of `textures`: surface cells, looked up without interpolation.
const uint TEXTURE_SURFACE = 0u;
// Kind of texture: an image that repeats.
const uint TEXTURE_REPEAT = 1u;
// Kind of texture: an image whose border continues.
const uint TEXTURE_CLAMP = 2u;

// Words of `status`: entries that the bins' lists need.
const uint STATUS_COARSE_NEEDED = 0u;
// Word of `status`: entries that the tiles' lists need.
const uint STATUS_LIST_NEEDED = 1u;
// Word of `status`: not 0 when a value that is not finite was met.
const uint STATUS_NOT_FINITE = 2u;
// Word of `status`: the longest tile list, where one is longer than LONG_LIST; and of a bin whose lists a software device
// could not write, all its entries.
const uint STATUS_LONGEST_LIST = 3u;
// Entries of a tile's list from which its length is reported.
const uint LONG_LIST = 16384u;
// Word of `status`: cells that large boxes need beyond their first.
const uint STATUS_CELLS_NEEDED = 4u;
// Tiles that have a list.
const uint STATUS_FILLED_TILES = 5u;
// Tiles that were given the background.
const uint STATUS_EMPTY_TILES = 6u;
// Words of `status`.
const uint STATUS_WORDS = 7u;

// Bits of GRADIENTS: what backward is asked for. Positions, the camera, and all that lies behind them.
const uint GRADIENT_GEOMETRY = 1u;
// Corner colours: vertex colours and lights.
const uint GRADIENT_COLOR = 2u;
// Texture coordinates.
const uint GRADIENT_COORDINATE = 4u;
// Texels of surfaces and images.
const uint GRADIENT_TEXEL = 8u;
// Sigma and gamma.
const uint GRADIENT_SCALARS = 16u;
// Corner normals, of the normal image.
const uint GRADIENT_NORMAL = 32u;

// Camera.
const uint GRADIENT_VIEW = 64u;
// Lights.
const uint GRADIENT_LIGHTS = 128u;
// Background colour and score.
const uint GRADIENT_BACKGROUND = 256u;

// REDUCTION: each view's triangles.
const uint REDUCTION_VIEWS = 0u;
// REDUCTION: each light's vertices or triangles.
const uint REDUCTION_LIGHTS = 1u;
// REDUCTION: all pixels.
const uint REDUCTION_PIXELS = 2u;

// First of the three words of `item_counts` that are the workgroups of a row of items which show.
const uint ITEMS_SHOWN = 0u;
// First of those of items that show in the silhouette alone.
const uint ITEMS_OUTLINE = 3u;
// From a list's words to those of its small items.
const uint ITEMS_SMALL = 6u;
// From a list's words to the number of its small items.
const uint ITEMS_SMALL_NUMBER = 12u;
// Words of `item_counts` for each row of FORWARD_ROW items.
const uint ITEM_COUNT_WORDS = 18u;
// Pixels of a small item, which one lane walks by itself, times the lanes of a workgroup: 256 pixels where eight lanes are
// all there are, 64 where other lanes would stand idle meanwhile.
const uint SMALL_WORK = 2048u;

// Pixels of a cell: a larger box is walked in several cells, by several invocations.
const uint CELL_WIDTH = 64u;
// Height of a cell.
const uint CELL_HEIGHT = 32u;
// Texels (vec4) of a partial gradient before its optional parts.
const uint PARTIAL_TEXELS = 3u;
// Texels (vec4) that corner colours add to a partial gradient.
const uint PARTIAL_COLOR_TEXELS = 3u;
// Texels (vec4) that texture coordinates add to a partial gradient.
const uint PARTIAL_COORDINATE_TEXELS = 2u;
// Texels (vec4) that corner normals add to a partial gradient.
const uint PARTIAL_NORMAL_TEXELS = 3u;

// Invocations in a workgroup of the self test.
const uint SELFTEST_LOCAL_SIZE = 64u;
// What the self test adds where nothing else is asked for.
const float SELFTEST_OFFSET = 0.5;

// Invocations in a workgroup of the fitting kernels, which sum in this width.
const uint FIT_GROUP = 64u;
// Pixels that an invocation of image_loss sums: summing over a workgroup costs some 30 us on a software device.
const uint LOSS_PIXELS = 64u;
// SILHOUETTE_LOSS, COLOR_LOSS: there is no such image.
const uint LOSS_NONE = 0u;
// 1 - intersection over union.
const uint LOSS_IOU = 1u;
// Absolute differences.
const uint LOSS_L1 = 2u;
// Squared differences.
const uint LOSS_L2 = 3u;
// Huber's function of differences.
const uint LOSS_HUBER = 4u;
// Keeps the IoU of two empty silhouettes finite.
const float LOSS_IOU_EPSILON = 1e-6;

// METHOD: gradient descent with momentum.
const uint METHOD_SGD = 0u;
// Adam.
const uint METHOD_ADAM = 1u;
// Adam with one pace for all parameters.
const uint METHOD_UNIFORM = 2u;

// Of a flap's first word: the official flatten loss sees it.
const uint FLAP_OFFICIAL = 0x80000000u;
// Its first triangle winds along the edge; else against it.
const uint FLAP_FIRST_ALONG = 0x40000000u;
// Its second triangle winds along the edge.
const uint FLAP_SECOND_ALONG = 0x20000000u;
// The vertex.
const uint FLAP_VERTEX = 0x1fffffffu;

// Words of `fit_state`. Why no further step is taken, 0 while steps are.
const uint FIT_HALTED = 0u;
// This step is to be taken.
const uint FIT_APPLY = 1u;
// This step's loss is the least so far.
const uint FIT_BETTER = 2u;
// The least loss so far, a float's bits.
const uint FIT_LEAST = 3u;
// Words of the whole.
const uint FIT_STATE_WORDS = 4u;
// FIT_HALTED: a frame's lists had too little room, or it met a value that is not finite.
const uint HALT_FRAME = 1u;
// FIT_HALTED: a vertex left the box that the frame was planned for.
const uint HALT_OUTSIDE = 2u;

// Words of a step's record.
const uint RECORD_WORDS = 16u;
// Of a record: the first of the four regularisers' values; the loss, the silhouettes' and the colours' lie before it.
const uint RECORD_PENALTIES = 3u;
// Of a record: FIT_HALTED as the step found it.
const uint RECORD_HALTED = 7u;
// Of a record: the frame's status.
const uint RECORD_STATUS = 8u;
