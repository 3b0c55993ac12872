#version 450
#extension GL_GOOGLE_include_directive : require
// Place, vertices: copies the vertices of a host's draws into the packed `positions` that the other kernels read, once for each
// instance and moved by its transform. Without transforms it copies any three floats, such as colours.
// One invocation a placed vertex (draws.glsl). Reads `draws`, the host's vertices and transforms (three rows of four floats).
// Writes `target`. place_vertex_grad.comp and place_transform_grad.comp have the derivatives.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer draws;
layout(set = 0, binding = 1, std430) readonly buffer Vertices { float source[]; };
layout(set = 0, binding = 2, std430) readonly buffer Transforms { float transforms[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Target { float target[]; };

layout(constant_id = 0) const bool TRANSFORMED = false;

#include "common/draws.glsl"
#include "common/geometry_push.glsl"

// A row of a transform.
vec4 row_at(uint at) {
    return vec4(transforms[at], transforms[at + 1u], transforms[at + 2u], transforms[at + 3u]);
}

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
    vec3 p = vec3(source[from], source[from + 1u], source[from + 2u]);
    if (TRANSFORMED) {
        uint at = uint(draw.first_instance + instance) * push.transform_stride + push.transform_offset;
        p = vec3(dot(row_at(at), vec4(p, 1.0)), dot(row_at(at + 4u), vec4(p, 1.0)), dot(row_at(at + 8u), vec4(p, 1.0)));
    }
    uint to = 3u * (push.first + uint(i));
    target[to] = p.x;
    target[to + 1u] = p.y;
    target[to + 2u] = p.z;
}
