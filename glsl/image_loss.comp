#version 450
#extension GL_GOOGLE_include_directive : require
// Image loss: sums the terms of the silhouette's and the colours' losses (loss.glsl) over blocks of 4096 pixels of a view:
// weighted differences, or intersection and union.
// One workgroup a block (along x) of a view (along y); an invocation takes every 64th pixel, and the sums are added
// pairwise. Reads the rendered image or a level of `pyramid`, the targets and the mask; writes `loss_partials`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer predicted;
layout(set = 0, binding = 1) uniform samplerBuffer loss_targets;
layout(set = 0, binding = 2) uniform samplerBuffer loss_weights;
layout(set = 0, binding = 3, std430) writeonly buffer LossPartials { vec4 loss_partials[]; };

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/fit_sum.glsl"
#include "common/loss.glsl"

layout(push_constant) uniform Push {
    // The level's first pixel in `predicted`, and in targets and weights.
    uint predicted_first;
    uint target_first;
    // Pixels of a view.
    uint pixels;
    // First entry of `loss_partials` to write.
    uint first;
    float silhouette_delta;
    float color_delta;
} push;

void main() {
    uint view = gl_WorkGroupID.y;
    uint block = gl_WorkGroupID.x * FIT_GROUP * LOSS_PIXELS;
    uint pixels = push.pixels;
    precise vec4 sum = vec4(0.0);
    for (uint k = 0u; k < LOSS_PIXELS; ++k) {
        uint pixel = block + k * FIT_GROUP + gl_LocalInvocationID.x;
        bool inside = pixel < pixels;
        int at = int(view * pixels + min(pixel, pixels - 1u));
        vec4 p = channels(texelFetch(predicted, int(push.predicted_first) + at));
        vec4 t = channels(texelFetch(loss_targets, int(push.target_first) + at));
        float mask = FIT_MASKED ? texelFetch(loss_weights, int(push.target_first) + at).x : 1.0;
        float weight = inside ? mask : 0.0;
        sum.xy = sum.xy + terms(SILHOUETTE_LOSS, p.w, t.w, weight, push.silhouette_delta);
        if (COLOR_LOSS != LOSS_NONE) {
            sum.zw = sum.zw + terms(COLOR_LOSS, p.x, t.x, weight, push.color_delta);
            sum.zw = sum.zw + terms(COLOR_LOSS, p.y, t.y, weight, push.color_delta);
            sum.zw = sum.zw + terms(COLOR_LOSS, p.z, t.z, weight, push.color_delta);
        }
    }
    precise vec4 total = group_sum(sum);
    if (gl_LocalInvocationID.x == 0u) {
        loss_partials[push.first + view * gl_NumWorkGroups.x + gl_WorkGroupID.x] = total;
    }
}
