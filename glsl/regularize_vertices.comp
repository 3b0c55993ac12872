#version 450
#extension GL_GOOGLE_include_directive : require
// Regularize vertices: the terms of the Laplacian and of the edge length regulariser at a vertex.
// One invocation a vertex. Reads `positions` and `neighbors`; writes `vertex_penalties`, two texels a vertex: the
// Laplacian's offset (p - mean of the neighbours) over their number and the offset's square; the weighted gradient of the
// edge lengths and their squared deviations, each edge counted at its lower vertex.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer positions;
// vertices + 1 offsets, then the neighbours of each vertex in ascending order.
layout(set = 0, binding = 1) uniform usamplerBuffer neighbors;
layout(set = 0, binding = 2, std430) writeonly buffer VertexPenalties { vec4 vertex_penalties[]; };

layout(constant_id = 0) const bool EDGES = false;

#include "common/fit.glsl"

layout(push_constant) uniform Push {
    uint vertices;
    // Wanted length of an edge.
    float target;
    // 2 × weight / edges.
    float edge_scale;
} push;

vec3 position_of(int i) {
    return vec3(
        texelFetch(positions, 3 * i).x, texelFetch(positions, 3 * i + 1).x, texelFetch(positions, 3 * i + 2).x);
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= int(push.vertices)) {
        return;
    }
    vec3 p = position_of(i);
    int first = int(texelFetch(neighbors, i).x);
    int end = int(texelFetch(neighbors, i + 1).x);
    float target = push.target;
    precise vec3 sum = vec3(0.0);
    precise vec3 edges = vec3(0.0);
    precise float edge_value = 0.0;
    for (int k = first; k < end; ++k) {
        int j = int(texelFetch(neighbors, k).x);
        vec3 q = position_of(j);
        sum = sum + q;
        if (EDGES) {
            precise vec3 edge = p - q;
            precise float size = length3(edge);
            precise float factor = size > 0.0 ? 1.0 - target / size : 0.0;
            precise float off = size - target;
            edges = edges + factor * edge;
            edge_value = edge_value + (j > i ? off * off : 0.0);
        }
    }
    precise float degree = float(end - first);
    precise float divisor = max(degree, 1.0);
    precise vec3 offset = end > first ? p - sum / divisor : vec3(0.0);
    precise vec3 share = offset / divisor;
    precise float square = dot3(offset, offset);
    precise vec3 edge_gradient = push.edge_scale * edges;
    vertex_penalties[2 * i] = vec4(share, square);
    vertex_penalties[2 * i + 1] = vec4(edge_gradient, edge_value);
}
