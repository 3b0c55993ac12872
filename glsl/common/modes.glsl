// The modes of a frame are specialization constants: they are fixed when a pipeline is made, so the driver compiles no code for
// other modes. README.md lists them. Needs constants.glsl.

layout(constant_id = 1) const uint OUTPUTS = 3;
layout(constant_id = 2) const uint COLOR_MODE = 0;
layout(constant_id = 3) const uint SILHOUETTE_MODE = 0;
layout(constant_id = 4) const uint DISTANCE = 0;
layout(constant_id = 5) const uint SAMPLING = 0;
layout(constant_id = 6) const bool PERSPECTIVE_CORRECT = false;
layout(constant_id = 7) const bool COMPOSITE = false;
layout(constant_id = 8) const uint DEPTH_RANGE = 0;
layout(constant_id = 9) const bool SAVE = false;
layout(constant_id = 10) const bool NEAR_CLIP = false;
layout(constant_id = 11) const bool SMOOTH = false;
layout(constant_id = 12) const bool LIT = false;
layout(constant_id = 13) const bool FRONT_ONLY = false;
layout(constant_id = 14) const bool CLOCKWISE_FRONT = false;
layout(constant_id = 15) const bool OFFICIAL = false;
layout(constant_id = 16) const bool DISTORTED = false;
// Whether some camera is orthographic. Its depth is linear on the screen.
layout(constant_id = 34) const bool PARALLEL = false;
// Whether forward_soft serves the frame's modes.
layout(constant_id = 17) const bool SOFT = false;
// The most passes that all loops of an invocation together may take on the device.
layout(constant_id = 18) const uint LOOP_PASSES = 60000;
// Whether the frame draws tiles whose lists are not in memory (walked_tile.glsl). Then `tile_items` has entries without a
// length.
layout(constant_id = 19) const bool WALKS = true;
// Whether some texture has an alpha below 1. Then D' = α D takes the place of D in eq. 2, 3 and 5.
layout(constant_id = 25) const bool OPACITY = false;
// Where a triangle is sampled outside itself.
layout(constant_id = 29) const uint SURFACE_POINT = 0;
// Whether some mesh gives the normals of its vertices (`vertex_normals`).
layout(constant_id = 27) const bool GIVEN_NORMALS = false;
// Texels of a vertex's features, four features each (`features`).
layout(constant_id = 33) const uint FEATURE_TEXELS = 0;

// Constant expressions here use sums and products for logic. glslang compiles ?:, && and || to branches, which cannot stand
// outside a function.

// Whether any image needs the weights of eq. 3.
const bool SHADED = (OUTPUTS & (OUTPUT_COLOR | OUTPUT_DEPTH | OUTPUT_NORMAL | OUTPUT_FEATURES)) != 0u;
const bool WANT_COLOR = (OUTPUTS & OUTPUT_COLOR) != 0u;
const bool WANT_DEPTH = (OUTPUTS & OUTPUT_DEPTH) != 0u;
const bool WANT_NORMAL = (OUTPUTS & OUTPUT_NORMAL) != 0u;
// The composite background needs the silhouette even if the caller does not.
const bool WANT_SILHOUETTE = ((OUTPUTS & OUTPUT_SILHOUETTE) | uint(COMPOSITE) * uint(SHADED)) != 0u;
// The shading record has the depth and the texture coordinates too. So a silhouette needs it with a depth range, or if textures
// have alpha.
const bool WANT_SHADING = (uint(SHADED) | DEPTH_RANGE | uint(OPACITY)) != 0u;
// Whether the least factor of the product of eq. 5 is kept apart (pixel.glsl).
const bool LEAST_APART = uint(OPACITY) * uint(SILHOUETTE_MODE == SILHOUETTE_PRODUCT) != 0u;
// Whether the tile lists have front faces before back faces, which front faces mostly hide. The hard mode has one order for
// all, because the first of equally near triangles wins.
const bool PARTED = uint(SHADED) * uint(COLOR_MODE == COLOR_SOFTMAX) != 0u;
// FEATURE_TEXELS as a signed number, for loops.
const int FEATURES = int(FEATURE_TEXELS);
// The length of an array of one vertex's features, which must not be 0.
const int FEATURE_ROOM = FEATURES + int(FEATURES == 0);
// The offsets of the normals and the features in a shading record, and the strides of the records, in texels. Without shading the geometry
// record's tail is a texel of its own.
const int GEOMETRY_STRIDE = int(GEOMETRY_TEXELS) + int(!WANT_SHADING);
const int SHADING_NORMAL_AT = int(SHADING_TEXELS) + int(SAMPLING != SAMPLING_NONE) * int(SHADING_COORDINATE_TEXELS);
const int SHADING_FEATURES_AT = SHADING_NORMAL_AT + int(WANT_NORMAL) * int(SHADING_NORMAL_TEXELS);
const int SHADING_STRIDE = SHADING_FEATURES_AT + 3 * FEATURES;
// The saved reference of a pixel without weights, in the soft mode and in the hard mode (saved_of in pixel.glsl).
const vec2 NO_WEIGHTS = vec2(0.0, 1e30);
const vec2 NO_NEAREST = vec2(-1.0);
