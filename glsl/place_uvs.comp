#version 450
#extension GL_GOOGLE_include_directive : require
// Place, UVs: copies the texture coordinates of the vertices of a host's draws into the packed `uvs` that the other kernels
// read, once for each instance. One invocation a placed vertex. Reads `draws` and the host's vertices. Writes `target`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer draws;
layout(set = 0, binding = 1, std430) readonly buffer Vertices { float source[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Target { float target[]; };

#include "common/draws.glsl"
#include "common/geometry_push.glsl"

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    int i = int(row * gl_WorkGroupSize.x + gl_LocalInvocationID.x);
    if (i >= int(push.count)) {
        return;
    }
    Draw draw = draw_of(draw_at(i, int(push.draws), 0, 0));
    int local = i - draw.placed_vertex;
    int instance = local / draw.vertices;
    uint from = uint(draw.first_vertex + local - instance * draw.vertices) * push.stride + push.offset;
    uint to = 2u * (push.first + uint(i));
    target[to] = source[from];
    // Here v grows upwards. `select` is 1 if the host's v grows downwards.
    target[to + 1u] = push.select == 1u ? 1.0 - source[from + 1u] : source[from + 1u];
}
