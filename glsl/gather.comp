#version 450
// Gather: a host's own vertex or index array into the packed one that the other kernels read. One invocation an element:
// a vertex's x, y, z out of records of `stride` words, or one index of 16 or 32 bits. Reads the host's buffer, writes
// `positions` or `indices` from element `first` on.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Source { uint source[]; };
layout(set = 0, binding = 1, std430) writeonly buffer Target { uint target[]; };

layout(push_constant) uniform Push {
    uint count;
    uint first;
    // Words of a vertex; 0 for indices.
    uint stride;
    // Words before the first element; for indices, what is added to each.
    uint offset;
    // Bits of an index.
    uint bits;
} push;

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint i = row * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (i >= push.count) {
        return;
    }
    uint to = push.first + i;
    if (push.stride > 0u) {
        uint from = push.offset + i * push.stride;
        target[3u * to] = source[from];
        target[3u * to + 1u] = source[from + 1u];
        target[3u * to + 2u] = source[from + 2u];
    } else if (push.bits == 16u) {
        target[to] = (source[i >> 1] >> (16u * (i & 1u)) & 0xffffu) + push.offset;
    } else {
        target[to] = source[i] + push.offset;
    }
}
