#version 450
#extension GL_GOOGLE_include_directive : require
// Place, texels from a buffer: copies a host's texels of four bytes each, linear or encoded as sRGB, into the packed `texels`
// that the other kernels read. One invocation a texel. Reads the host's words, with r in the lowest byte. Writes `target`: r,
// g, b, 0.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Source { uint source[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Target { vec4 target[]; };

#include "common/texel_push.glsl"

vec3 decoded(vec3 c) {
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), greaterThan(c, vec3(0.04045)));
}

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint i = row * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.width * push.height) {
        return;
    }
    vec3 c = unpackUnorm4x8(source[i]).rgb;
    target[push.first + i] = vec4(push.srgb != 0u ? decoded(c) : c, 0.0);
}
