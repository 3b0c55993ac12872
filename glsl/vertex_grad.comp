#version 450
#extension GL_GOOGLE_include_directive : require
// Vertex gradient: sums the gradients of all triangle corners at a vertex, over all views of its mesh, in the order of views
// and of the adjacency. There are no atomics, so the bits are the same on every run.
// One invocation a vertex, meshes along y. Reads `corner_gradients` and, with smooth shading, `area_gradients`; writes
// `vertex_gradients`: dL/dposition, then dL/dcolour.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer positions;
layout(set = 0, binding = 2) uniform usamplerBuffer indices;
layout(set = 0, binding = 3) uniform usamplerBuffer adjacency;
layout(set = 0, binding = 4) uniform samplerBuffer corner_gradients;
layout(set = 0, binding = 5) uniform samplerBuffer area_gradients;
layout(set = 0, binding = 6, std430) writeonly buffer VertexGradients { vec4 vertex_gradients[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"

// dL/d(position of a triangle's corner) through the smooth normals of its three vertices, each of which sums area vectors.
vec3 through_normals(Shape shape, int triangle, int corner) {
    ivec3 v = triangle_vertices(shape, triangle);
    vec3 by_area = texelFetch(area_gradients, shape.screen_base + v.x).xyz
                 + texelFetch(area_gradients, shape.screen_base + v.y).xyz
                 + texelFetch(area_gradients, shape.screen_base + v.z).xyz;
    // The area vector is the same cross product seen from each corner; its derivative by a corner is the cross product with
    // the opposite edge.
    int next = corner == 2 ? 0 : corner + 1;
    int last = next == 2 ? 0 : next + 1;
    vec3 opposite = position_of(shape, v[last]) - position_of(shape, v[next]);
    // The edges of a triangle without gradient need not be finite.
    return by_area == vec3(0.0) ? vec3(0.0) : cross(by_area, opposite);
}

void main() {
    int mesh = int(gl_WorkGroupID.y);
    int vertex = int(gl_GlobalInvocationID.x);
    // A single mesh is drawn in all views, each of several in its own view.
    int first = frame.mesh_count == 1u ? 0 : mesh;
    int last = frame.mesh_count == 1u ? int(frame.view_count) - 1 : mesh;
    if (vertex >= shape_of(first).vertex_count) {
        return;
    }
    vec3 position = vec3(0.0);
    vec3 color = vec3(0.0);
    // The loop tests its condition at the end, because llvmpipe executes the body once more when it tests at the start.
    int view = first;
    do {
        Shape shape = shape_of(view);
        int at = shape.adjacency_base + vertex;
        int end = int(texelFetch(adjacency, at + 1).x);
        for (int i = int(texelFetch(adjacency, at).x); i < end; ++i) {
            int corner = int(texelFetch(adjacency, i).x);
            int from = (shape.record_base + (corner >> 2)) * CORNER_STRIDE + (corner & 3);
            position += texelFetch(corner_gradients, from).xyz;
            if (GRAD_COLOR) {
                color += texelFetch(corner_gradients, from + 3).rgb;
            }
            if (SMOOTH) {
                bool live = corner >> 2 < shape.triangle_count;
                position += live ? through_normals(shape, corner >> 2, corner & 3) : vec3(0.0);
            }
        }
        ++view;
    } while (view <= last);
    int to = 2 * (shape_of(first).vertex_base + vertex);
    vertex_gradients[to] = vec4(position, 0.0);
    vertex_gradients[to + 1] = vec4(color, 0.0);
}
