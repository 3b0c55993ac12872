#version 450
#extension GL_GOOGLE_include_directive : require
// Vertex: projects each vertex of each view's mesh to pixel coordinates and view depth, in double floats. With smooth shading
// it also computes the vertex's normal and the light on it. The normal is the mesh's own, or the normalised sum of the
// triangles' area vectors.
// One invocation a vertex, views along y. Reads the mesh and the cameras. Writes `vertices` (column and row; depth) and
// `vertex_shading` (light, normal). project_gradient.glsl and vertex_normal_grad.comp have the derivatives.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer view_cameras;
layout(set = 0, binding = 2) uniform samplerBuffer positions;
layout(set = 0, binding = 3) uniform usamplerBuffer indices;
layout(set = 0, binding = 4) uniform usamplerBuffer adjacency;
layout(set = 0, binding = 5) uniform samplerBuffer lights;
layout(set = 0, binding = 6, std430) writeonly buffer Vertices { vec4 vertices[]; };
layout(set = 0, binding = 7, std430) writeonly buffer VertexShading { vec4 vertex_shading[]; };
layout(set = 0, binding = 8) uniform samplerBuffer vertex_normals;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"
#include "common/df64.glsl"
#include "common/camera.glsl"
#include "common/light.glsl"
#include "common/given_normal.glsl"

// The unit normal of a vertex. A mesh's `adjacency` has vertex_count + 1 offsets, then the triangle corners at each vertex. A
// corner is four times the triangle's number plus the corner's.
vec3 smooth_normal(Shape shape, int vertex) {
    int at = shape.adjacency_base + vertex;
    int end = int(texelFetch(adjacency, at + 1).x);
    vec3 sum = vec3(0.0);
    for (int i = int(texelFetch(adjacency, at).x); i < end; ++i) {
        int triangle = int(texelFetch(adjacency, i).x) >> 2;
        // The device may write a smaller triangle count than planned (counts.comp).
        sum += triangle < shape.triangle_count ? area_vector(shape, triangle_vertices(shape, triangle)) : vec3(0.0);
    }
    return unit_or_zero(sum);
}

void main() {
    int view = int(gl_WorkGroupID.y);
    int vertex = int(gl_GlobalInvocationID.x);
    Shape shape = shape_of(view);
    if (vertex >= shape.vertex_count) {
        return;
    }
    vec3 p = position_of(shape, vertex);
    ViewPoint v = to_view(view, p);
    vec2 column;
    vec2 row;
    to_pixels(view, v, column, row);
    int at = int(VERTEX_TEXELS) * (shape.screen_base + vertex);
    vertices[at] = vec4(column, row);
    // Only the components that are read are written: on a software device each component takes the same time.
    vertices[at + 1].xy = v.z;
    if (SMOOTH) {
        vec3 given = given_normal(shape, vertex);
        vec3 normal = is_given(given) ? given : smooth_normal(shape, vertex);
        int to = int(VERTEX_SHADING_TEXELS) * (shape.screen_base + vertex);
        vertex_shading[to].xyz = light_on(normal);
        vertex_shading[to + 1].xyz = normal;
    }
}
