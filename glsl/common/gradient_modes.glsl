// The modes of the backward pass as specialization constants: which gradients it computes, and the strides that follow from
// them.
// Needs constants.glsl and modes.glsl.

// OUTPUT_ bits of the images with an upstream gradient dL/dimage.
layout(constant_id = 20) const uint UPSTREAM = 3;
// GRADIENT_ bits.
layout(constant_id = 21) const uint GRADIENTS = 3;
// Eq. 4 alone, as in the paper: the barycentrics count as constants.
layout(constant_id = 22) const bool PAPER = false;
// Whether vertex_grad.comp takes gradients from `partials`, without triangle_grad.comp. If nothing is clipped or lit, and no
// texture, normal or view needs a gradient, then all corners at a vertex have one projection.
layout(constant_id = 28) const bool PER_VERTEX = false;
// Whether every lane takes a small item of its own.
layout(constant_id = 23) const bool SMALL = false;

const bool UP_COLOR = (UPSTREAM & OUTPUT_COLOR) != 0u;
const bool UP_SILHOUETTE = (UPSTREAM & OUTPUT_SILHOUETTE) != 0u;
const bool UP_DEPTH = (UPSTREAM & OUTPUT_DEPTH) != 0u;
const bool UP_NORMAL = (UPSTREAM & OUTPUT_NORMAL) != 0u;
const bool UP_FEATURES = (UPSTREAM & OUTPUT_FEATURES) != 0u;
const bool UP_SHADED = (UPSTREAM & (OUTPUT_COLOR | OUTPUT_DEPTH | OUTPUT_NORMAL | OUTPUT_FEATURES)) != 0u;
// Whether dL/dA is needed: the composite background makes every image depend on the silhouette.
const bool UP_ALPHA = (uint(UP_SILHOUETTE) | uint(COMPOSITE) * uint(UP_SHADED)) != 0u;

const bool GRAD_GEOMETRY = (GRADIENTS & GRADIENT_GEOMETRY) != 0u;
const bool GRAD_COLOR = uint((GRADIENTS & GRADIENT_COLOR) != 0u) * uint(UP_COLOR) != 0u;
const bool GRAD_COORDINATE = uint((GRADIENTS & GRADIENT_COORDINATE) != 0u) * (uint(UP_COLOR) | uint(OPACITY)) != 0u;
const bool GRAD_SCALARS = (GRADIENTS & GRADIENT_SCALARS) != 0u;
const bool GRAD_NORMAL = uint((GRADIENTS & GRADIENT_NORMAL) != 0u) * uint(UP_NORMAL) != 0u;
const bool GRAD_FEATURES = uint((GRADIENTS & GRADIENT_FEATURES) != 0u) * uint(UP_FEATURES) != 0u;

// Texels of a vertex's features, if they have an upstream gradient, and if there is one by them.
const int UP_FEATURE_TEXELS = int(UP_FEATURES) * FEATURES;
const int GRAD_FEATURE_TEXELS = int(GRAD_FEATURES) * FEATURES;

// Offsets of the optional parts of an entry of `partials`, and its stride, in texels.
const int PARTIAL_COLOR_AT = int(PARTIAL_TEXELS);
const int PARTIAL_COORDINATE_AT = PARTIAL_COLOR_AT + int(GRAD_COLOR) * int(PARTIAL_COLOR_TEXELS);
const int PARTIAL_NORMAL_AT = PARTIAL_COORDINATE_AT + int(GRAD_COORDINATE) * int(PARTIAL_COORDINATE_TEXELS);
const int PARTIAL_FEATURES_AT = PARTIAL_NORMAL_AT + int(GRAD_NORMAL) * int(PARTIAL_NORMAL_TEXELS);
const int PARTIAL_STRIDE = PARTIAL_FEATURES_AT + 3 * GRAD_FEATURE_TEXELS;
// Whether depth is the only shaded image with an upstream gradient.
const bool DEPTH_ALONE = uint(UP_DEPTH) * uint(!UP_COLOR) * uint(!UP_NORMAL) * uint(!UP_FEATURES) != 0u;
// Texels of an entry of `pixel_gradients` (pixel_grad.comp): a second one for the normal, or for depth beside others, and then
// those of the features.
const int PIXEL_FEATURES_AT = 1 + int(uint(UP_NORMAL) | uint(UP_DEPTH) * (uint(UP_COLOR) | uint(UP_FEATURES)));
const int PIXEL_STRIDE = PIXEL_FEATURES_AT + UP_FEATURE_TEXELS;
// Gradients by the camera or by sigma and gamma are summed over a whole view.
const bool GRAD_VIEW = (GRADIENTS & (GRADIENT_VIEW | GRADIENT_SCALARS)) != 0u;
const bool GRAD_LIGHTS = (GRADIENTS & GRADIENT_LIGHTS) != 0u;
const bool GRAD_BACKGROUND = (GRADIENTS & (GRADIENT_BACKGROUND | GRADIENT_SCALARS)) != 0u;
// Texels of a record's entry of `corner_gradients` (triangle_grad.comp).
const int CORNER_FEATURES_AT = 3 + 3 * int(GRAD_COLOR);
const int CORNER_STRIDE = CORNER_FEATURES_AT + 3 * GRAD_FEATURE_TEXELS + 2 * int(GRAD_COORDINATE);
