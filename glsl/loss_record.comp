#version 450
#extension GL_GOOGLE_include_directive : require
// Loss record: computes the total loss of a step and decides whether the step is taken. It is not taken if a vertex of the
// frame was not finite, nor after a step that was not taken, until the host has removed the cause.
// One workgroup; lane l sums every 64th row from l on, and the lanes' sums are added pairwise. Reads `loss_sums`, the
// regularisers' values and the frame's status; writes `fit_state` and a row of `records`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer loss_sums;
layout(set = 0, binding = 1) uniform samplerBuffer loss_scales;
layout(set = 0, binding = 2) uniform samplerBuffer vertex_penalties;
layout(set = 0, binding = 3) uniform samplerBuffer flap_gradients;
layout(set = 0, binding = 4) uniform usamplerBuffer frame_status;
layout(set = 0, binding = 5, std430) buffer FitState { uint fit_state[]; };
layout(set = 0, binding = 6, std430) writeonly buffer Records { uint records[]; };

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/fit_sum.glsl"
#include "common/loss.glsl"

layout(push_constant) uniform Push {
    uint views;
    uint levels;
    // Rows of the regularisers' values; 0 without such a regulariser.
    uint vertices;
    uint flaps;
    float silhouette_weight;
    float color_weight;
    float laplacian_weight;
    float flatten_weight;
    float edge_weight;
    float normal_weight;
    // 1 / edges.
    float edge_share;
    // Row of `records` to write.
    uint row;
} push;

// A view's term of a loss from its sums: 1 - intersection / union, or the sum of differences.
precise float value_of(uint kind, vec2 sums, float scale) {
    precise float value = kind == LOSS_IOU ? 1.0 - sums.x / (sums.y + LOSS_IOU_EPSILON) : sums.x;
    value = value * scale;
    return value;
}

// The weighted sum of all losses and penalties.
precise float total_of(vec4 loss, vec4 penalty) {
    precise float total = push.silhouette_weight * loss.x;
    total = total + push.color_weight * loss.y;
    total = total + push.laplacian_weight * penalty.x;
    total = total + push.flatten_weight * penalty.y;
    total = total + push.edge_weight * penalty.z;
    total = total + push.normal_weight * penalty.w;
    return total;
}

// The values of a step, in the words of a record that come first.
void write_values(uint at, float total, vec4 loss, vec4 penalty) {
    records[at] = floatBitsToUint(total);
    records[at + 1u] = floatBitsToUint(loss.x);
    records[at + 2u] = floatBitsToUint(loss.y);
    records[at + RECORD_PENALTIES] = floatBitsToUint(penalty.x);
    records[at + RECORD_PENALTIES + 1u] = floatBitsToUint(penalty.y);
    records[at + RECORD_PENALTIES + 2u] = floatBitsToUint(penalty.z);
    records[at + RECORD_PENALTIES + 3u] = floatBitsToUint(penalty.w);
}

void main() {
    uint lane = gl_LocalInvocationID.x;
    precise vec4 penalties = vec4(0.0);
    uint vertices = push.vertices;
    for (uint i = lane; i < vertices; i += FIT_GROUP) {
        penalties.x = penalties.x + texelFetch(vertex_penalties, int(2u * i)).w;
        penalties.z = penalties.z + texelFetch(vertex_penalties, int(2u * i + 1u)).w;
    }
    uint flaps = push.flaps;
    for (uint i = lane; i < flaps; i += FIT_GROUP) {
        penalties.y = penalties.y + texelFetch(flap_gradients, int(4u * i)).w;
        penalties.w = penalties.w + texelFetch(flap_gradients, int(4u * i + 1u)).w;
    }
    precise vec4 losses = vec4(0.0);
    uint views = push.views;
    uint rows = views * push.levels;
    for (uint i = lane; i < rows; i += FIT_GROUP) {
        vec4 sums = texelFetch(loss_sums, int(i));
        vec4 scales = texelFetch(loss_scales, int(i / views));
        losses.x = losses.x + value_of(SILHOUETTE_LOSS, sums.xy, scales.x);
        losses.y = losses.y + value_of(COLOR_LOSS, sums.zw, scales.y);
    }
    precise vec4 penalty = group_sum(penalties);
    barrier();
    precise vec4 loss = group_sum(losses);
    if (lane != 0u) {
        return;
    }
    penalty.z = penalty.z * push.edge_share;
    precise float total = total_of(loss, penalty);
    bool valid = texelFetch(frame_status, int(STATUS_NOT_FINITE)).x == 0u;
    uint halted = fit_state[FIT_HALTED] | (valid ? 0u : HALT_FRAME);
    bool apply = halted == 0u;
    float least = uintBitsToFloat(fit_state[FIT_LEAST]);
    bool better = apply && total < least;
    fit_state[FIT_HALTED] = halted;
    fit_state[FIT_APPLY] = apply ? 1u : 0u;
    fit_state[FIT_BETTER] = better ? 1u : 0u;
    fit_state[FIT_LEAST] = floatBitsToUint(better ? total : least);
    uint at = push.row * RECORD_WORDS;
    write_values(at, total, loss, penalty);
    records[at + RECORD_HALTED] = halted;
    for (uint i = 0u; i < STATUS_WORDS; ++i) {
        records[at + RECORD_STATUS + i] = texelFetch(frame_status, int(i)).x;
    }
}
