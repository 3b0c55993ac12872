#version 450
#extension GL_GOOGLE_include_directive : require
// Place, vertex gradient: for each vertex of a host's buffer it sums the gradients of the vertex's placed copies, draw by draw
// and instance by instance, each times the transpose of its transform. There are no atomics, so the bits are the same on every
// run.
// One invocation a vertex of the host. Reads `draws`, `vertex_gradients` and the transforms. Writes three floats a vertex to
// `target`, in the host's own stride; a vertex that no draw reads keeps what it has.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer draws;
layout(set = 0, binding = 1) uniform samplerBuffer vertex_gradients;
layout(set = 0, binding = 2, std430) readonly buffer Transforms { float transforms[]; };
layout(set = 0, binding = 3, std430) buffer Target { float target[]; };

layout(constant_id = 0) const bool TRANSFORMED = false;

#include "common/constants.glsl"
#include "common/draws.glsl"
#include "common/geometry_push.glsl"

// A row of a transform without its translation.
vec3 three_at(uint at) {
    return vec3(transforms[at], transforms[at + 1u], transforms[at + 2u]);
}

void main() {
    uint row = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    int i = int(row * gl_WorkGroupSize.x + gl_LocalInvocationID.x);
    if (i >= int(push.count)) {
        return;
    }
    // `base` is the first vertex that any draw reads.
    int vertex = int(push.base) + i;
    vec3 sum = vec3(0.0);
    bool drawn = false;
    for (int d = 0; d < int(push.draws); ++d) {
        Draw draw = draw_of(d);
        int local = vertex - draw.first_vertex;
        int instances = local >= 0 && local < draw.vertices ? draw.instances : 0;
        drawn = drawn || instances > 0;
        instances = push.target_use == TARGET_CLEAR ? 0 : instances;
        for (int k = 0; k < instances; ++k) {
            int from = int(push.first) + draw.placed_vertex + k * draw.vertices + local;
            vec3 g = texelFetch(vertex_gradients, 2 * from + int(push.select)).xyz;
            if (TRANSFORMED) {
                uint at = uint(draw.first_instance + k) * push.transform_stride + push.transform_offset;
                g = g.x * three_at(at) + g.y * three_at(at + 4u) + g.z * three_at(at + 8u);
            }
            sum += g;
        }
    }
    if (!drawn) {
        return;
    }
    uint to = uint(vertex) * push.stride + push.offset;
    if (push.target_use == TARGET_ADD) {
        sum += vec3(target[to], target[to + 1u], target[to + 2u]);
    }
    target[to] = sum.x;
    target[to + 1u] = sum.y;
    target[to + 2u] = sum.z;
}
