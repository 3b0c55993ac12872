#version 450
#extension GL_GOOGLE_include_directive : require
// Loss sum: adds the sums of a view's blocks of pixels.
// One workgroup a view; lane l sums every 64th block from l on, and the lanes' sums are added pairwise. Reads
// `loss_partials`; writes `loss_sums`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer loss_partials;
layout(set = 0, binding = 1, std430) writeonly buffer LossSums { vec4 loss_sums[]; };

#include "common/constants.glsl"
#include "common/fit_sum.glsl"

layout(push_constant) uniform Push {
    // First entry of `loss_partials` to read.
    uint first;
    // Blocks of a view.
    uint blocks;
    // First entry of `loss_sums` to write.
    uint to;
} push;

void main() {
    uint view = gl_WorkGroupID.x;
    uint blocks = push.blocks;
    uint first = push.first + view * blocks;
    precise vec4 sum = vec4(0.0);
    for (uint i = gl_LocalInvocationID.x; i < blocks; i += FIT_GROUP) {
        sum = sum + texelFetch(loss_partials, int(first + i));
    }
    precise vec4 total = group_sum(sum);
    if (gl_LocalInvocationID.x == 0u) {
        loss_sums[push.to + view] = total;
    }
}
