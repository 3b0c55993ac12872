#version 450
#extension GL_GOOGLE_include_directive : require
// Self test: shows that a device runs kernels of this kind, with texels in, a storage buffer of records out, and push and
// specialization constants. One invocation an element. Reads `texels` and `indices`. Writes records[i] =
// (scale · texels[indices[i]] + SELFTEST_OFFSET, indices[i], TAG, (FACTOR, offset), (i, count)) for i < count.

#include "common/constants.glsl"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const int TAG = 7;
layout(constant_id = 2) const bool ADD_OFFSET = true;
layout(constant_id = 3) const float FACTOR = 1.5;

struct Record {
    vec4 value;
    uint index;
    int tag;
    float parts[3];
    uvec2 pair;
};

layout(binding = 0) uniform samplerBuffer texels;
layout(binding = 1) uniform usamplerBuffer indices;
layout(std430, binding = 2) writeonly buffer Records { Record records[]; };
layout(push_constant) uniform Push {
    float scale;
    uint count;
    vec2 offset;
} push;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return;
    uint at = texelFetch(indices, int(i)).x;
    vec4 value = push.scale * texelFetch(texels, int(at));
    if (ADD_OFFSET) value += SELFTEST_OFFSET;
    Record record;
    record.value = value;
    record.index = at;
    record.tag = TAG;
    record.parts = float[3](FACTOR, push.offset.x, push.offset.y);
    record.pair = uvec2(i, push.count);
    records[i] = record;
}
