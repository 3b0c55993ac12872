#version 450
#extension GL_GOOGLE_include_directive : require
// Pixel gradient: computes what backward needs of a pixel. That is dL by the mixture Σ w C, V of eq. 4, and the
// pixel's factor (1 - A) dL/dA of the silhouette. For the gradients by the background it computes the pixel's own terms too.
// One workgroup a tile, one invocation a pixel. It takes the tiles that have a list (the row of `tile_items` that begins at
// frame.first), because every fragment of another pixel has D = 0: on spot at 256² a quarter of all tiles. The background's
// gradients need all tiles.
// Reads `tile_items`, the images, `saved` (pixel.glsl) and the upstream gradients. Writes:
// - `silhouette_gradients`;
// - `pixel_gradients`: (dL/dmixture rgb, V), with V of shaded_gradient below, (dL/dnormal, dL/ddepth) and dL/dfeatures; with DEPTH_ALONE
//   (integer part and fraction of the reference, V, dL/ddepth), so that backward reads one texel;
// - `pixel_sums`, which reduce.comp adds up: (dL/dC_b, dL/ds_b), (dL/ds_b times the relative log2 weight, 0, 0, 0), with the
//   background's log weight s_b = ε/γ. They are zeros if the frame is not complete;
// - with these, to `status`, whether the frame is complete. backward_cull.comp does so for the gradients by triangles.

layout(local_size_x = 32) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer color;
layout(set = 0, binding = 2) uniform samplerBuffer depths;
layout(set = 0, binding = 3) uniform samplerBuffer normals;
layout(set = 0, binding = 4) uniform samplerBuffer saved;
layout(set = 0, binding = 5) uniform samplerBuffer upstream_color;
layout(set = 0, binding = 6) uniform samplerBuffer upstream_silhouette;
layout(set = 0, binding = 7) uniform samplerBuffer upstream_depths;
layout(set = 0, binding = 8) uniform samplerBuffer upstream_normals;
layout(set = 0, binding = 9, std430) writeonly buffer PixelGradients { vec4 pixel_gradients[]; };
layout(set = 0, binding = 10, std430) writeonly buffer PixelSums { vec4 pixel_sums[]; };
layout(set = 0, binding = 11) uniform usamplerBuffer status;
layout(set = 0, binding = 12, std430) writeonly buffer Status { uint status_words[]; };
layout(set = 0, binding = 13) uniform usamplerBuffer tile_items;
layout(set = 0, binding = 14, std430) writeonly buffer SilhouetteGradients { float silhouette_gradients[]; };
layout(set = 0, binding = 15) uniform samplerBuffer feature_image;
layout(set = 0, binding = 16) uniform samplerBuffer upstream_features;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/arithmetic.glsl"
#include "common/tile.glsl"

// The values that saved_of in pixel.glsl saved of a pixel.
struct SavedPixel {
    // The pixel's log2 sum of weights, as integer part and fraction. In the hard mode the nearest record's index.
    vec2 reference;
    // Whether the pixel has weights.
    bool has_weights;
    // The silhouette's aggregate, and with LEAST_APART the aggregate without the least factor.
    float aggregate;
    float others;
};

SavedPixel saved_at(int at) {
    vec4 texel = texelFetch(saved, at);
    bool has_weights = texel.xy != (COLOR_MODE == COLOR_HARD ? NO_NEAREST : NO_WEIGHTS);
    return SavedPixel(texel.xy, has_weights, LEAST_APART ? texel.z * texel.w : texel.z, texel.z);
}

// The number of triangles, by which SILHOUETTE_SUM divides.
float count_of(int view) {
    return float(max(shape_of(view).triangle_count, 1));
}

// dL by the values of a pixel, from the upstream images.
struct Upstream {
    // By I, A, the soft depth and the soft normal.
    vec3 color;
    float alpha;
    float depth;
    vec3 normal;
};

Upstream upstream_of(int at) {
    vec4 up_color = UP_COLOR ? texelFetch(upstream_color, at) : vec4(0.0);
    float up_alpha = UP_SILHOUETTE ? (UP_COLOR ? up_color.a : texelFetch(upstream_silhouette, at).x) : 0.0;
    float up_depth = UP_DEPTH ? texelFetch(upstream_depths, at).x : 0.0;
    vec3 up_normal = UP_NORMAL ? texelFetch(upstream_normals, at).xyz : vec3(0.0);
    return Upstream(up_color.rgb, up_alpha, up_depth, up_normal);
}

// V = Σ_j w_j v_j with v_j = dL/dI · C_j + dL/ddepth z_j + dL/dnormal · n_j + dL/dfeatures · f_j, so that eq. 4 reads ∂L/∂s_j = w_j (v_j - V).
// The composite background has I = A Σ w C + (1 - A) C_b. There the product rule adds a term to dL/dA, and V and all v_j gain
// the factor A, which is returned in `mixing`.
float shaded_gradient(int at, int view, float aggregate, vec3 background, inout Upstream up, out float mixing) {
    float value = 0.0;
    float unblended = 0.0;
    if (UP_COLOR) {
        vec3 shown = texelFetch(color, at).rgb;
        value += dot(up.color, COMPOSITE ? shown - background : shown);
    }
    for (int i = 0; i < UP_FEATURE_TEXELS; ++i) {
        int texel = at * FEATURE_ROOM + i;
        value += dot(texelFetch(upstream_features, texel), texelFetch(feature_image, texel));
    }
    if (UP_DEPTH) {
        unblended += up.depth * texelFetch(depths, at).x;
    }
    if (UP_NORMAL) {
        unblended += dot(up.normal, texelFetch(normals, at).xyz);
    }
    // The hard mode's depth and normal belong to a surface and do not depend on the silhouette.
    value += COLOR_MODE == COLOR_SOFTMAX ? unblended : 0.0;
    mixing = 1.0;
    if (COMPOSITE && UP_SHADED) {
        float alpha = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 - aggregate : aggregate;
        if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
            alpha = min(alpha / count_of(view), 1.0);
        }
        // dI/dA = Σ w C - C_b = (I - C_b) / A. Where A is 0 nothing is drawn.
        up.alpha += alpha > 0.0 ? value / alpha : 0.0;
        value += UP_COLOR ? alpha * dot(up.color, background) : 0.0;
        mixing = alpha;
    }
    return value;
}

// dL/dx_j of the silhouette without the fragment's factor (eq. 4). ∂A/∂x_j is (1 - A) D_j for the product of eq. 5. For the sum
// it is D_j (1 - D_j) / n, or 0 where the sum is cut off at 1. For the hard silhouette it is 0. backward.comp multiplies by
// D_j, and with LEAST_APART also by the least factor, unless that is the fragment's own.
float silhouette_gradient(int view, SavedPixel sums, float up_alpha) {
    float factor = 0.0;
    if (SILHOUETTE_MODE == SILHOUETTE_PRODUCT) {
        factor = up_alpha * sums.others;
    } else if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        float count = count_of(view);
        factor = sums.aggregate > count ? 0.0 : up_alpha / count;
    }
    return factor;
}

// ∂I/∂C_b = w_b and ∂I/∂s_b = w_b (C_b - I) (eq. 4), with the background's weight w_b.
void write_background_gradient(int at, bool finite, SavedPixel sums, vec3 background, vec3 up_color, float value,
                               float mixing) {
    bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
    float relative = 0.0;
    float weight = 0.0;
    if (entry && UP_SHADED) {
        relative = (frame.background_exponent - sums.reference.x) + (frame.background_fraction - sums.reference.y);
        weight = exp2(min(relative, 1.0));
    } else if (COMPOSITE) {
        weight = sums.has_weights ? 1.0 - mixing : 1.0;
    } else {
        weight = sums.has_weights ? 0.0 : 1.0;
    }
    float by_weight = entry ? weight * (dot(up_color, background) - value) : 0.0;
    pixel_sums[2 * at] = finite ? vec4(up_color * weight, by_weight) : vec4(0.0);
    pixel_sums[2 * at + 1] = finite ? vec4(by_weight * relative, 0.0, 0.0, 0.0) : vec4(0.0);
}

void main() {
    int number = int(gl_WorkGroupID.z * FORWARD_ROW + gl_WorkGroupID.x);
    if (!GRAD_BACKGROUND) {
        number = int(texelFetch(tile_items, int(frame.first + gl_WorkGroupID.x)).x);
    }
    TileLocation tile = tile_location(number);
    int lane = int(gl_LocalInvocationID.x);
    ivec2 pixel = tile.corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
    int view = tile.view;
    if (view >= int(frame.view_count) || pixel.x >= int(frame.width) || pixel.y >= int(frame.height)) {
        return;
    }
    int at = pixel_index(view, pixel);
    SavedPixel sums = saved_at(at);
    Upstream up = upstream_of(at);
    vec3 background = vec3(frame.background_red, frame.background_green, frame.background_blue);
    float mixing;
    float value = shaded_gradient(at, view, sums.aggregate, background, up, mixing);
    float unblended_mixing = COLOR_MODE == COLOR_SOFTMAX ? mixing : 1.0;
    int to = at * PIXEL_STRIDE;
    if (UP_ALPHA) {
        silhouette_gradients[at] = silhouette_gradient(view, sums, up.alpha);
    }
    if (UP_SHADED) {
        vec4 surface = vec4(up.normal, up.depth) * unblended_mixing;
        pixel_gradients[to] = DEPTH_ALONE ? vec4(sums.reference, value, surface.w) : vec4(up.color * mixing, value);
        if (PIXEL_FEATURES_AT > 1) {
            pixel_gradients[to + 1] = surface;
        }
        for (int i = 0; i < UP_FEATURE_TEXELS; ++i) {
            vec4 by_features = texelFetch(upstream_features, at * FEATURE_ROOM + i);
            pixel_gradients[to + PIXEL_FEATURES_AT + i] = by_features * mixing;
        }
    }
    if (GRAD_BACKGROUND) {
        bool finite = texelFetch(status, int(STATUS_NOT_FINITE)).x == 0u;
        if (at == 0) {
            status_words[STATUS_WHOLE] = finite ? 1u : 0u;
        }
        write_background_gradient(at, finite, sums, background, up.color, value, mixing);
    }
}
