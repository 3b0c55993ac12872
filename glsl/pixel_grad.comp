#version 450
#extension GL_GOOGLE_include_directive : require
// Pixel gradient: what every (pixel, triangle) pair of backward needs from its pixel, made once a pixel: the upstream
// gradient of the mixture, of log(1 - silhouette), and what a fragment's weight is relative to.
// One invocation a pixel, views along y. Reads the images, `saved` and the upstream gradients; writes
// `pixel_gradients`: (dL/dmixture rgb, alpha), (weight whole, weight rest, value, dL/ddepth), (dL/dnormal, 0); and what
// reduce.comp sums over the pixels, `pixel_sums`: (dL/dbackground, dL/ds), (dL/ds times relative weight, 0, 0, 0), s the
// logarithm of the background's weight.

layout(local_size_x = 64) in;

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

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"

void main() {
    int view = int(gl_WorkGroupID.y);
    uint pixels = frame.width * frame.height;
    uint pixel = gl_WorkGroupID.z * FORWARD_ROW * LINEAR_GROUP + gl_GlobalInvocationID.x;
    if (pixel >= pixels) {
        return;
    }
    int at = int(uint(view) * pixels + pixel);
    // Whole weight, rest, inverse sum, silhouette aggregate.
    vec4 kept = texelFetch(saved, at);
    vec4 up_color = UP_COLOR ? texelFetch(upstream_color, at) : vec4(0.0);
    float up_alpha = UP_SILHOUETTE ? (UP_COLOR ? up_color.a : texelFetch(upstream_silhouette, at).x) : 0.0;
    float up_depth = UP_DEPTH ? texelFetch(upstream_depths, at).x : 0.0;
    vec3 up_normal = UP_NORMAL ? texelFetch(upstream_normals, at).xyz : vec3(0.0);
    // The images' part of the chain: I = Σ w v, or with the composite background I = A Σ w v + (1 - A) background.
    float value = 0.0;
    float unblended = 0.0;
    vec3 background = vec3(frame.background_red, frame.background_green, frame.background_blue);
    if (UP_COLOR) {
        vec3 shown = texelFetch(color, at).rgb;
        value += dot(up_color.rgb, COMPOSITE ? shown - background : shown);
    }
    if (UP_DEPTH) {
        unblended += up_depth * texelFetch(depths, at).x;
    }
    if (UP_NORMAL) {
        unblended += dot(up_normal, texelFetch(normals, at).xyz);
    }
    // The hard mode's depth and normal are a surface's, whatever the silhouette.
    value += COLOR_MODE == COLOR_SOFTMAX ? unblended : 0.0;
    float mixing = 1.0;
    if (COMPOSITE && UP_SHADED) {
        float alpha = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 - kept.w : kept.w;
        if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
            alpha = min(alpha / float(max(shape_of(view).triangle_count, 1)), 1.0);
        }
        // dI/dA = mixture - background = (I - background) / A; where A vanishes nothing is drawn.
        up_alpha += alpha > 0.0 ? value / alpha : 0.0;
        // value stays A Σ w (v - background): what fragments add to it is relative to the background too.
        value += UP_COLOR ? alpha * dot(up_color.rgb, background) : 0.0;
        mixing = alpha;
    }
    float unblended_mixing = COLOR_MODE == COLOR_SOFTMAX ? mixing : 1.0;
    // ∂A/∂x_j = (1 - A) D_j for the product; D_j (1 - D_j) / n for the sum, 0 where that is cut off at 1; 0 for the hard
    // silhouette.
    float alpha_factor = 0.0;
    if (SILHOUETTE_MODE == SILHOUETTE_PRODUCT) {
        alpha_factor = up_alpha * kept.w;
    } else if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        float count = float(max(shape_of(view).triangle_count, 1));
        alpha_factor = kept.w > count ? 0.0 : up_alpha / count;
    }
    int to = at * PIXEL_STRIDE;
    pixel_gradients[to] = vec4(up_color.rgb * mixing, alpha_factor);
    if (UP_SHADED) {
        // w = D exp2(weight - rest') with the inverse sum folded into the rest. An empty pixel weighs nothing.
        bool any = kept.z > 0.0;
        vec2 reference = any ? vec2(kept.x, kept.y - log2(kept.z)) : vec2(0.0, 1e30);
        if (COLOR_MODE == COLOR_HARD) {
            reference = any ? kept.xy : vec2(-1.0);
        }
        pixel_gradients[to + 1] = vec4(reference, value, up_depth * unblended_mixing);
        if (UP_NORMAL) {
            pixel_gradients[to + 2] = vec4(up_normal * unblended_mixing, 0.0);
        }
    }
    if (GRAD_BACKGROUND) {
        bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
        float relative = 0.0;
        float share = 0.0;
        if (entry && UP_SHADED) {
            relative = (frame.background_whole - kept.x) + (frame.background_rest - (kept.y - log2(kept.z)));
            share = exp2(min(relative, 1.0));
        } else if (COMPOSITE) {
            share = kept.z > 0.0 ? 1.0 - mixing : 1.0;
        } else {
            share = kept.z > 0.0 ? 0.0 : 1.0;
        }
        float by_weight = entry ? share * (dot(up_color.rgb, background) - value) : 0.0;
        pixel_sums[2 * at] = vec4(up_color.rgb * share, by_weight);
        pixel_sums[2 * at + 1] = vec4(by_weight * relative, 0.0, 0.0, 0.0);
    }
}
