#version 450
#extension GL_GOOGLE_include_directive : require
// Vertex normal gradient, with smooth shading only: sums dL/dlight and dL/dnormal of all corners at a vertex, in the order of
// the adjacency, and carries them through light and normalisation to the sum of area vectors (smooth_normal in vertex.comp).
// One invocation a vertex of a view, views along y. Reads `corner_lights` and the mesh. Writes `area_gradients`, which is
// dL/d(sum of area vectors) for vertex_grad.comp, and `light_records`, which is (dL/dlight, normal) for reduce.comp.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer positions;
layout(set = 0, binding = 2) uniform usamplerBuffer indices;
layout(set = 0, binding = 3) uniform usamplerBuffer adjacency;
layout(set = 0, binding = 4) uniform samplerBuffer lights;
layout(set = 0, binding = 5) uniform samplerBuffer corner_lights;
layout(set = 0, binding = 6, std430) writeonly buffer AreaGradients { vec4 area_gradients[]; };
layout(set = 0, binding = 7, std430) writeonly buffer LightRecords { vec4 light_records[]; };
layout(set = 0, binding = 8) uniform samplerBuffer vertex_normals;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"
#include "common/light.glsl"
#include "common/given_normal.glsl"

void main() {
    int view = int(gl_WorkGroupID.y);
    int vertex = int(gl_GlobalInvocationID.x);
    Shape shape = shape_of(view);
    if (vertex >= shape.vertex_count) {
        return;
    }
    vec3 area = vec3(0.0);
    vec3 by_light = vec3(0.0);
    vec3 by_normal = vec3(0.0);
    int at = shape.adjacency_base + vertex;
    int end = int(texelFetch(adjacency, at + 1).x);
    for (int i = int(texelFetch(adjacency, at).x); i < end; ++i) {
        int corner = int(texelFetch(adjacency, i).x);
        int triangle = corner >> 2;
        int light_at = 2 * (3 * (shape.record_base + triangle) + (corner & 3));
        bool live = triangle < shape.triangle_count;
        area += live ? area_vector(shape, triangle_vertices(shape, triangle)) : vec3(0.0);
        by_light += live ? texelFetch(corner_lights, light_at).rgb : vec3(0.0);
        by_normal += live ? texelFetch(corner_lights, light_at + 1).xyz : vec3(0.0);
    }
    vec3 given = given_normal(shape, vertex);
    // A normal of the mesh's own does not depend on the positions.
    area = is_given(given) ? vec3(0.0) : area;
    vec3 normal = is_given(given) ? given : unit_or_zero(area);
    float size = length(area);
    // n = a / |a|: dL/da = (I - n nᵀ) dL/dn / |a|.
    vec3 by_unit = by_normal + (LIT ? light_gradient(normal, by_light) : vec3(0.0));
    // If the square of an area vector leaves the range of a float, the vector has no gradient.
    vec3 by_area = size > 1e-30 && size < 1e30 ? (by_unit - normal * dot(normal, by_unit)) / size : vec3(0.0);
    int to = shape.screen_base + vertex;
    area_gradients[to] = vec4(by_area, 0.0);
    if (GRAD_LIGHTS) {
        light_records[2 * to] = vec4(by_light, 0.0);
        light_records[2 * to + 1] = vec4(normal, 0.0);
    }
}
