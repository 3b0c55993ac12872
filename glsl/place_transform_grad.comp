#version 450
#extension GL_GOOGLE_include_directive : require
// Place, transform gradient: computes dL by the three rows of four numbers of an instance's transform. The gradient by row r is
// the sum, over the instance's vertices, of dL/dposition[r] times (x, y, z, 1).
// One workgroup an instance. Lane l sums every 128th vertex from l on. Then the lanes' sums are added pairwise, in a fixed
// order.
// Reads `draws`, the host's vertices and `vertex_gradients`. Writes twelve floats an instance to `target`.

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) uniform usamplerBuffer draws;
layout(set = 0, binding = 1) uniform samplerBuffer vertex_gradients;
layout(set = 0, binding = 2, std430) readonly buffer Vertices { float source[]; };
layout(set = 0, binding = 3, std430) buffer Target { float target[]; };

#include "common/constants.glsl"
#include "common/draws.glsl"
#include "common/geometry_push.glsl"

// Enough lanes that no loop takes more than 65535 passes, after which Mesa 22.3 ends it (reduce.comp).
const int LANES = 128;

shared vec4 lane_sums[3 * LANES];

void main() {
    int instance = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationID.x);
    if (instance >= int(push.count)) {
        return;
    }
    Draw draw = draw_of(draw_at(instance, int(push.draws), 0, 3));
    int placed = int(push.first) + draw.placed_vertex + (instance - draw.first_instance) * draw.vertices;
    vec4 rows[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    uint stride = push.stride;
    uint offset = push.offset;
    int vertices = push.target_use == TARGET_CLEAR ? 0 : draw.vertices;
    for (int v = lane; v < vertices; v += LANES) {
        vec3 g = texelFetch(vertex_gradients, 2 * (placed + v)).xyz;
        uint from = uint(draw.first_vertex + v) * stride + offset;
        vec4 p = vec4(source[from], source[from + 1u], source[from + 2u], 1.0);
        rows[0] += g.x * p;
        rows[1] += g.y * p;
        rows[2] += g.z * p;
    }
    for (int r = 0; r < 3; ++r) {
        lane_sums[3 * lane + r] = rows[r];
    }
    for (int width = LANES / 2; width > 0; width /= 2) {
        barrier();
        if (lane < width) {
            for (int r = 0; r < 3; ++r) {
                lane_sums[3 * lane + r] += lane_sums[3 * (lane + width) + r];
            }
        }
    }
    barrier();
    if (lane < 12) {
        uint to = uint(instance) * push.transform_stride + push.transform_offset + uint(lane);
        float before = push.target_use == TARGET_ADD ? target[to] : 0.0;
        target[to] = before + lane_sums[lane / 4][lane % 4];
    }
}
