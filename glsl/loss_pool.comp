#version 450
#extension GL_GOOGLE_include_directive : require
// Loss pool: makes a coarser image, each pixel the mean of the up to factor² finer ones that it covers.
// One invocation a coarse pixel of any view. Reads the rendered image or the next finer level of `pyramid`; writes a level
// of `pyramid`, one float a pixel, or four with colours.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer finer;
layout(set = 0, binding = 1, std430) writeonly buffer Pyramid { float pyramid[]; };

// Images have colours (four channels); otherwise they are silhouettes of one channel.
layout(constant_id = 0) const bool FIT_COLOR = false;

#include "common/fit.glsl"

layout(push_constant) uniform Push {
    // First pixel and size of the finer images, then of the coarser ones.
    uint finer_first;
    uint finer_width;
    uint finer_height;
    uint first;
    uint width;
    uint height;
    uint factor;
    // Coarse pixels of all views.
    uint count;
} push;

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uint row = i / push.width;
    uint column = i - row * push.width;
    uint view = row / push.height;
    row -= view * push.height;
    uint finer_row = row * push.factor;
    uint finer_column = column * push.factor;
    uint rows = min(push.factor, push.finer_height - finer_row);
    uint columns = min(push.factor, push.finer_width - finer_column);
    precise float share = 1.0 / float(rows * columns);
    uint from = push.finer_first + (view * push.finer_height + finer_row) * push.finer_width + finer_column;
    precise vec4 sum = vec4(0.0);
    for (uint r = 0u; r < rows; ++r) {
        for (uint c = 0u; c < columns; ++c) {
            sum = sum + texelFetch(finer, int(from + r * push.finer_width + c)) * share;
        }
    }
    uint to = push.first + i;
    if (FIT_COLOR) {
        pyramid[4u * to] = sum.x;
        pyramid[4u * to + 1u] = sum.y;
        pyramid[4u * to + 2u] = sum.z;
        pyramid[4u * to + 3u] = sum.w;
    } else {
        pyramid[to] = sum.x;
    }
}
