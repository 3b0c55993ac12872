#version 450
#extension GL_GOOGLE_include_directive : require
// Step totals: combines the workgroups' partial results, which are sums of dL/dcentre or largest second moments.
// One workgroup; lane l takes every 64th part from l on, and the lanes are combined pairwise. Reads `parts`; writes a row of
// `step_totals`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer parts;
layout(set = 0, binding = 1, std430) writeonly buffer StepTotals { vec4 step_totals[]; };

// Takes the largest, into row 1, instead of the sum, into row 0.
layout(constant_id = 0) const bool LARGEST = false;

#include "common/constants.glsl"
#include "common/fit_sum.glsl"

layout(push_constant) uniform Push {
    uint count;
} push;

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint count = push.count;
    precise vec4 value = vec4(0.0);
    for (uint i = lane; i < count; i += FIT_GROUP) {
        vec4 part = texelFetch(parts, int(i));
        value = LARGEST ? max(value, part) : value + part;
    }
    if (LARGEST) {
        lane_values[lane] = value;
        for (uint width = FIT_GROUP / 2u; width > 0u; width /= 2u) {
            barrier();
            if (lane < width) {
                lane_values[lane] = max(lane_values[lane], lane_values[lane + width]);
            }
        }
        value = lane_values[lane];
    } else {
        value = group_sum(value);
    }
    if (lane == 0u) {
        step_totals[LARGEST ? 1 : 0] = value;
    }
}
