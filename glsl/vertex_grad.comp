#version 450
#extension GL_GOOGLE_include_directive : require
// Vertex gradient: sums the gradients of all triangle corners at a vertex, over all views of its mesh, in the order of the
// views and of the adjacency. There are no atomics, so the bits are the same on every run.
// One invocation a vertex, meshes along y. Reads `corner_gradients` and, with smooth shading, `area_gradients`. With PER_VERTEX
// it reads `partials` and carries their sum through the projection once a view, in place of three times a triangle. Writes
// `vertex_gradients`: dL/dposition, then dL/dcolour; and `feature_gradients`: dL/dfeatures.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer positions;
layout(set = 0, binding = 2) uniform usamplerBuffer indices;
layout(set = 0, binding = 3) uniform usamplerBuffer adjacency;
layout(set = 0, binding = 4) uniform samplerBuffer corner_gradients;
layout(set = 0, binding = 5) uniform samplerBuffer area_gradients;
layout(set = 0, binding = 6, std430) writeonly buffer VertexGradients { vec4 vertex_gradients[]; };
layout(set = 0, binding = 7) uniform samplerBuffer view_cameras;
layout(set = 0, binding = 8) uniform samplerBuffer partials;
layout(set = 0, binding = 9) uniform usamplerBuffer item_marks;
layout(set = 0, binding = 10) uniform usamplerBuffer cell_ranges;
layout(set = 0, binding = 11, std430) writeonly buffer FeatureGradients { vec4 feature_gradients[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"
#include "common/project_gradient.glsl"

void clear(out vec4 features[FEATURE_ROOM]) {
    for (int k = 0; k < GRAD_FEATURE_TEXELS; ++k) {
        features[k] = vec4(0.0);
    }
}

// dL/d(position of a triangle's corner) through the smooth normals of its three vertices, each of which sums area vectors.
vec3 through_normals(Shape shape, int triangle, int corner) {
    ivec3 v = triangle_vertices(shape, triangle);
    vec3 by_area = texelFetch(area_gradients, shape.screen_base + v.x).xyz
                 + texelFetch(area_gradients, shape.screen_base + v.y).xyz
                 + texelFetch(area_gradients, shape.screen_base + v.z).xyz;
    // The area vector is the same cross product from each corner. Its derivative by a corner is the cross product with the
    // opposite edge.
    int next = corner == 2 ? 0 : corner + 1;
    int last = next == 2 ? 0 : next + 1;
    vec3 opposite = position_of(shape, v[last]) - position_of(shape, v[next]);
    // The edges of a triangle without gradient need not be finite.
    return by_area == vec3(0.0) ? vec3(0.0) : cross(by_area, opposite);
}

// Adds the gradients by a vertex's corners in one view.
void add_corners(Shape shape, int vertex, inout vec3 position, inout vec3 color, inout vec4 features[FEATURE_ROOM]) {
    int at = shape.adjacency_base + vertex;
    int end = int(texelFetch(adjacency, at + 1).x);
    for (int i = int(texelFetch(adjacency, at).x); i < end; ++i) {
        int corner = int(texelFetch(adjacency, i).x);
        int record = (shape.record_base + (corner >> 2)) * CORNER_STRIDE;
        int from = record + (corner & 3);
        position += texelFetch(corner_gradients, from).xyz;
        if (GRAD_COLOR) {
            color += texelFetch(corner_gradients, from + 3).rgb;
        }
        int features_at = record + CORNER_FEATURES_AT + (corner & 3) * FEATURE_ROOM;
        for (int k = 0; k < GRAD_FEATURE_TEXELS; ++k) {
            features[k] += texelFetch(corner_gradients, features_at + k);
        }
        if (SMOOTH) {
            bool live = corner >> 2 < shape.triangle_count;
            position += live ? through_normals(shape, corner >> 2, corner & 3) : vec3(0.0);
        }
    }
}

// Adds dL/d(column, row, z), dL/dcolour and dL/dfeatures of a triangle's corner, as one item has them.
void add_part(int item, int corner, bool counts, inout vec3 by_screen, inout vec3 color, inout vec4 features[FEATURE_ROOM]) {
    int from = item * PARTIAL_STRIDE + corner;
    vec3 part = texelFetch(partials, from).xyz;
    by_screen += mix(vec3(0.0), part, bvec3(counts));
    if (GRAD_COLOR) {
        vec3 part_color = texelFetch(partials, from + PARTIAL_COLOR_AT).rgb;
        color += mix(vec3(0.0), part_color, bvec3(counts));
    }
    int features_at = item * PARTIAL_STRIDE + PARTIAL_FEATURES_AT + corner * FEATURE_ROOM;
    for (int k = 0; k < GRAD_FEATURE_TEXELS; ++k) {
        features[k] += mix(vec4(0.0), texelFetch(partials, features_at + k), bvec4(counts));
    }
}

// Adds the gradients of the triangles at a vertex whose boxes have several cells. It first adds up the cells of each triangle,
// as backward_long does for cells without room. One loop takes them all: a triangle's record, then its further cells.
void add_large(Shape shape, int next, int end, inout vec3 by_screen, inout vec3 color, inout vec4 features[FEATURE_ROOM]) {
    vec3 own = vec3(0.0);
    vec3 own_color = vec3(0.0);
    vec4 own_features[FEATURE_ROOM];
    clear(own_features);
    int further = 0;
    while (next < end) {
        int corner = int(texelFetch(adjacency, next).x);
        int record_index = corner >> 2 < shape.triangle_count ? shape.record_base + (corner >> 2) : -1;
        uint mark = record_index < 0 ? 0u : texelFetch(item_marks, max(record_index, 0)).x;
        int cell = int(frame.record_count + texelFetch(cell_ranges, max(record_index, 0)).x) + further - 1;
        int item = further == 0 ? max(record_index, 0) : cell;
        bool large = (mark & MARK_LARGE) != 0u;
        bool counts = large && (texelFetch(item_marks, item).x & MARK_SUMMED) != 0u;
        add_part(item, corner & 3, counts, own, own_color, own_features);
        bool ends = further == int(mark >> MARK_FURTHER_BIT);
        by_screen += mix(vec3(0.0), own, bvec3(ends));
        color += mix(vec3(0.0), own_color, bvec3(ends));
        own = mix(own, vec3(0.0), bvec3(ends));
        own_color = mix(own_color, vec3(0.0), bvec3(ends));
        for (int k = 0; k < GRAD_FEATURE_TEXELS; ++k) {
            features[k] += mix(vec4(0.0), own_features[k], bvec4(ends));
            own_features[k] = mix(own_features[k], vec4(0.0), bvec4(ends));
        }
        further = ends ? 0 : further + 1;
        next += ends ? 1 : 0;
    }
}

// Adds a vertex's gradients in one view with PER_VERTEX, from the sums of backward by the corners' pixels and depth.
void add_projected(int view, Shape shape, int vertex, inout vec3 position, inout vec3 color,
                   inout vec4 features[FEATURE_ROOM]) {
    int at = shape.adjacency_base + vertex;
    int first = int(texelFetch(adjacency, at).x);
    int end = int(texelFetch(adjacency, at + 1).x);
    vec3 by_screen = vec3(0.0);
    uint marks = 0u;
    for (int i = first; i < end; ++i) {
        int corner = int(texelFetch(adjacency, i).x);
        // The device may write a smaller triangle count than planned (counts.comp).
        bool live = corner >> 2 < shape.triangle_count;
        int record_index = live ? shape.record_base + (corner >> 2) : 0;
        uint mark = texelFetch(item_marks, record_index).x;
        mark = live ? mark : 0u;
        marks |= mark;
        bool counts = (mark & (MARK_SUMMED | MARK_LARGE)) == MARK_SUMMED;
        add_part(record_index, corner & 3, counts, by_screen, color, features);
    }
    // Most vertices have no large triangle, so large triangles have a loop of their own.
    add_large(shape, (marks & MARK_LARGE) != 0u ? first : end, end, by_screen, color, features);
    // Skip a vertex without gradient. It may lie on the camera's plane, where it has no projection.
    if (GRAD_GEOMETRY && by_screen != vec3(0.0)) {
        View camera = view_record(view);
        vec3 p = position_of(shape, vertex);
        vec4 by_projection;
        position += world_gradient(
            camera, p, project_gradient(camera, view_point(camera, p), by_screen.xy, by_screen.z, by_projection));
    }
}

void main() {
    int mesh = int(gl_WorkGroupID.y);
    int vertex = int(gl_GlobalInvocationID.x);
    // A single mesh is drawn in all views. Several meshes are drawn in one view each.
    int first = frame.mesh_count == 1u ? 0 : mesh;
    int last = frame.mesh_count == 1u ? int(frame.view_count) - 1 : mesh;
    if (vertex >= shape_of(first).vertex_count) {
        return;
    }
    vec3 position = vec3(0.0);
    vec3 color = vec3(0.0);
    vec4 features[FEATURE_ROOM];
    clear(features);
    // The loop tests its condition at the end: llvmpipe executes the body once more if it tests at the start.
    int view = first;
    do {
        Shape shape = shape_of(view);
        if (PER_VERTEX) {
            add_projected(view, shape, vertex, position, color, features);
        } else {
            add_corners(shape, vertex, position, color, features);
        }
        ++view;
    } while (view <= last);
    int to = shape_of(first).vertex_base + vertex;
    vertex_gradients[2 * to] = vec4(position, 0.0);
    vertex_gradients[2 * to + 1] = vec4(color, 0.0);
    for (int k = 0; k < GRAD_FEATURE_TEXELS; ++k) {
        feature_gradients[to * FEATURE_ROOM + k] = features[k];
    }
}
