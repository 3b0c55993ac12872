#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require
// Place, texels: copies a host's sampled image into the packed `texels` that the other kernels read, row by row from the top.
// The device decodes the image's format (bytes, sRGB) on the way. One invocation a texel. Reads `source`. Writes `target`: r,
// g, b, 0.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform texture2D source;
layout(set = 0, binding = 1, std430) writeonly buffer Target { vec4 target[]; };

#include "common/texel_push.glsl"

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint i = row * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.width * push.height) {
        return;
    }
    ivec2 at = ivec2(i % push.width, i / push.width);
    target[push.first + i] = vec4(texelFetch(source, at, 0).rgb, 0.0);
}
