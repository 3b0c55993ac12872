#version 450
#extension GL_GOOGLE_include_directive : require
// Place, indices: copies the indices of a host's draws, of 16 or 32 bits each, into the packed `indices` that the other kernels
// read, once for each instance. It renumbers them to the placed vertices.
// One invocation a corner of a placed triangle (draws.glsl). Reads `draws` and the host's indices. Writes `target`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer draws;
layout(set = 0, binding = 1, std430) readonly buffer Indices { uint source[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Target { uint target[]; };

#include "common/draws.glsl"
#include "common/geometry_push.glsl"

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    int i = int(row * gl_WorkGroupSize.x + gl_LocalInvocationID.x);
    if (i >= int(push.count)) {
        return;
    }
    int triangle = i / 3;
    Draw draw = draw_of(draw_at(triangle, int(push.draws), 1, 0));
    int local = triangle - draw.placed_triangle;
    int instance = local / draw.triangles;
    uint from = uint(draw.first_index + 3 * (local - instance * draw.triangles) + i - 3 * triangle);
    uint index = push.select == 16u ? source[from >> 1] >> (16u * (from & 1u)) & 0xffffu : source[from];
    // Nobody has checked the host's indices: none may lead outside of its draw's vertices.
    index = min(index, uint(draw.vertices) - 1u);
    uint vertex = uint(draw.placed_vertex + instance * draw.vertices);
    target[3u * push.first + uint(i)] = push.base + vertex + index;
}
