#version 450
#extension GL_GOOGLE_include_directive : require
// Triangle gradient: what backward summed for a triangle's pieces, by its three corners: through near clipping and the
// projection to world space, through light to the corners' colours and the face's normal; and its share of what the view
// as a whole is differentiated by.
// One invocation a triangle, views along y. Reads `partials`, `vertices` and the mesh; writes `corner_gradients` (three world-space
// positions, three colours, two texels of coordinates), `corner_lights` (light and normal of every corner, smooth),
// `light_records` (light and normal of the face, flat) and `view_sums` (twist, projection, sigma, gamma).

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer view_cameras;
layout(set = 0, binding = 2) uniform samplerBuffer positions;
layout(set = 0, binding = 3) uniform usamplerBuffer indices;
layout(set = 0, binding = 4) uniform samplerBuffer vertex_shading;
layout(set = 0, binding = 5) uniform samplerBuffer lights;
layout(set = 0, binding = 6) uniform samplerBuffer colors;
layout(set = 0, binding = 7) uniform samplerBuffer uvs;
layout(set = 0, binding = 8) uniform usamplerBuffer uv_indices;
layout(set = 0, binding = 9) uniform isamplerBuffer boxes;
layout(set = 0, binding = 10) uniform usamplerBuffer cell_ranges;
layout(set = 0, binding = 11) uniform samplerBuffer partials;
layout(set = 0, binding = 12) uniform samplerBuffer vertices;
layout(set = 0, binding = 13, std430) writeonly buffer CornerGradients { vec4 corner_gradients[]; };
layout(set = 0, binding = 14, std430) writeonly buffer CornerLights { vec4 corner_lights[]; };
layout(set = 0, binding = 15, std430) writeonly buffer LightRecords { vec4 light_records[]; };
layout(set = 0, binding = 16, std430) writeonly buffer ViewSums { vec4 view_sums[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"
#include "common/df64.glsl"
#include "common/light.glsl"
#include "common/partial.glsl"
#include "common/project_gradient.glsl"

// What the corners of the uncut triangle are, and what L is by them.
struct Corners {
    vec3 point[3];
    // How far behind the near plane each is, as forward decided by.
    vec3 beyond_near;
    mat3 base;
    mat3 light;
    mat3x2 coordinate;
    mat3 normal;
    vec3 by_point[3];
    mat3 by_color;
    mat3x2 by_coordinate;
    mat3 by_normal;
    vec3 twist_shift;
    vec3 twist_turn;
    vec4 by_projection;
    vec2 scalars;
};

Corners corners_of(Shape shape, View camera, int triangle, ivec3 v, vec3 face_normal) {
    Corners c;
    for (int k = 0; k < 3; ++k) {
        c.point[k] = view_point(camera, position_of(shape, v[k]));
        if (NEAR_CLIP) {
            vec2 z = texelFetch(vertices, int(VERTEX_TEXELS) * (shape.screen_base + v[k]) + 1).xy;
            c.beyond_near[k] = df_sub(z, vec2(frame.near_high, frame.near_low)).x;
        }
        int at = shape.color_base + (shape.uniform_color ? 0 : 3 * v[k]);
        c.base[k] = vec3(texelFetch(colors, at).x, texelFetch(colors, at + 1).x, texelFetch(colors, at + 2).x);
        c.light[k] = LIT ? light_on(face_normal) : vec3(1.0);
        c.normal[k] = face_normal;
        c.coordinate[k] = vec2(k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0);
        if (SMOOTH) {
            int shaded = int(VERTEX_SHADING_TEXELS) * (shape.screen_base + v[k]);
            c.light[k] = texelFetch(vertex_shading, shaded).rgb;
            c.normal[k] = texelFetch(vertex_shading, shaded + 1).xyz;
        }
        if (SAMPLING != SAMPLING_NONE && shape.uv_base >= 0) {
            int uv = shape.uv_base + 2 * int(texelFetch(uv_indices, shape.uv_index_base + 3 * triangle + k).x);
            c.coordinate[k] = vec2(texelFetch(uvs, uv).x, texelFetch(uvs, uv + 1).x);
        }
        c.by_point[k] = vec3(0.0);
    }
    c.by_color = mat3(0.0);
    c.by_coordinate = mat3x2(0.0);
    c.by_normal = mat3(0.0);
    c.twist_shift = vec3(0.0);
    c.twist_turn = vec3(0.0);
    c.by_projection = vec4(0.0);
    c.scalars = vec2(0.0);
    return c;
}

bool is_nothing(Partial p, int i) {
    vec3 sum = abs(p.color[i]) + abs(p.normal[i]) + vec3(abs(p.pixel[i]) + abs(p.coordinate[i]), abs(p.depth[i]));
    return sum == vec3(0.0);
}

// One corner of a piece: original corner k itself, or the point at share t on the way from corner k to corner l, where
// the near plane cuts that edge.
void add_corner(View camera, inout Corners c, Partial p, int i, int k, int l, float near) {
    // What no pixel depends on has no gradient, wherever it lies: on the camera's plane, say, where there is no projection.
    if (is_nothing(p, i)) {
        return;
    }
    float from = c.beyond_near[k];
    float to = c.beyond_near[l];
    float t = k == l ? 0.0 : from / (from - to);
    // 1 - t, which of an edge far longer than what is left of it has no digits as a difference.
    float rest = k == l ? 1.0 : -to / (from - to);
    vec3 point = rest * c.point[k] + t * c.point[l];
    // On the plane exactly, however long the edge.
    point.z = k == l ? point.z : near;
    vec4 by_projection;
    vec3 by_point = project_gradient(camera, point, p.pixel[i], p.depth[i], by_projection);
    c.by_projection += by_projection;
    c.by_point[k] += rest * by_point;
    c.by_point[l] += t * by_point;
    c.by_color[k] += rest * p.color[i];
    c.by_color[l] += t * p.color[i];
    c.by_coordinate[k] += rest * p.coordinate[i];
    c.by_coordinate[l] += t * p.coordinate[i];
    c.by_normal[k] += rest * p.normal[i];
    c.by_normal[l] += t * p.normal[i];
    if (k != l) {
        float by_t = dot(by_point, c.point[l] - c.point[k])
                   + dot(p.color[i], c.base[l] * c.light[l] - c.base[k] * c.light[k])
                   + dot(p.coordinate[i], c.coordinate[l] - c.coordinate[k])
                   + dot(p.normal[i], c.normal[l] - c.normal[k]);
        // The quotients first: squares of depths may leave a float.
        c.by_point[k].z += by_t * rest / (from - to);
        c.by_point[l].z += by_t * t / (from - to);
    }
}

// A triangle that no near plane cuts: its corners are its own.
void add_whole(View camera, Shape shape, int triangle, inout Corners c) {
    Partial p = partial_of(shape.slot_base + triangle);
    for (int k = 0; k < 3; ++k) {
        add_corner(camera, c, p, k, k, k, 0.0);
    }
    c.scalars = p.scalars;
}

// The pieces' corners in the order of triangle.comp's clipping.
void add_pieces(View camera, Shape shape, int triangle, inout Corners c) {
    float near = frame.near_high;
    ivec2 corner[4];
    int count = 0;
    for (int k = 0; k < 3; ++k) {
        int l = k == 2 ? 0 : k + 1;
        bool inside = c.beyond_near[k] >= 0.0;
        if (inside) {
            corner[count] = ivec2(k, k);
            ++count;
        }
        if (inside != (c.beyond_near[l] >= 0.0)) {
            corner[count] = ivec2(k, l);
            ++count;
        }
    }
    for (int piece = 0; piece < 2; ++piece) {
        if (count < 3 + piece) {
            break;
        }
        Partial p = partial_of(shape.slot_base + triangle + piece * shape.triangle_count);
        for (int i = 0; i < 3; ++i) {
            ivec2 which = corner[i == 0 ? 0 : i + piece];
            add_corner(camera, c, p, i, which.x, which.y, near);
        }
        c.scalars += p.scalars;
    }
}

// dL/d(unnormalised normal) from dL/d(unit normal).
vec3 by_area(vec3 area, vec3 by_normal) {
    // Of edges of size 1: less is a segment, whose normal is noise.
    float size = length(area);
    vec3 n = size > 1e-18 ? area / size : vec3(0.0);
    return size > 1e-18 ? (by_normal - n * dot(n, by_normal)) / size : vec3(0.0);
}

void main() {
    int view = int(gl_WorkGroupID.y);
    int triangle = int(gl_GlobalInvocationID.x);
    Shape shape = shape_of(view);
    if (triangle >= shape.triangle_count) {
        return;
    }
    ivec3 v = triangle_vertices(shape, triangle);
    vec3 edge1;
    vec3 edge2;
    float size;
    unit_edges(position_of(shape, v.x), position_of(shape, v.y), position_of(shape, v.z), edge1, edge2, size);
    vec3 area = cross(edge1, edge2);
    vec3 face_normal = unit_or_zero(area);
    View camera = view_record(view);
    Corners c = corners_of(shape, camera, triangle, v, face_normal);
    int slot = shape.slot_base + triangle;
    if (NEAR_CLIP) {
        add_pieces(camera, shape, triangle, c);
    } else {
        add_whole(camera, shape, triangle, c);
    }
    int to = slot * CORNER_STRIDE;
    vec3 by_world[3];
    vec3 by_light = vec3(0.0);
    for (int k = 0; k < 3; ++k) {
        by_world[k] = vec3(0.0);
        if (c.by_point[k] != vec3(0.0)) {
            c.twist_shift += c.by_point[k];
            c.twist_turn += cross(c.point[k], c.by_point[k]);
            by_world[k] = world_gradient(camera, position_of(shape, v[k]), c.by_point[k]);
        }
        by_light += c.by_color[k] * c.base[k];
    }
    if (!SMOOTH && (LIT || UP_NORMAL)) {
        vec3 by_normal = c.by_normal[0] + c.by_normal[1] + c.by_normal[2];
        if (LIT) {
            by_normal += light_gradient(face_normal, by_light);
        }
        // Of the edges as they are: the normal does not change with their size. A triangle so low that the quotient leaves a
        // float is a point.
        vec3 by_cross = length(area) * size > 1e-30 ? by_area(area, by_normal) / size : vec3(0.0);
        vec3 by_edge1 = cross(edge2, by_cross);
        vec3 by_edge2 = cross(by_cross, edge1);
        by_world[0] -= by_edge1 + by_edge2;
        by_world[1] += by_edge1;
        by_world[2] += by_edge2;
    }
    for (int k = 0; k < 3; ++k) {
        corner_gradients[to + k] = vec4(by_world[k], 0.0);
        if (GRAD_COLOR) {
            corner_gradients[to + 3 + k] = vec4(c.by_color[k] * c.light[k], 0.0);
        }
        if (SMOOTH) {
            int light_at = 2 * (3 * slot + k);
            corner_lights[light_at] = vec4(c.by_color[k] * c.base[k], 0.0);
            corner_lights[light_at + 1] = vec4(c.by_normal[k], 0.0);
        }
    }
    if (GRAD_COORDINATE) {
        corner_gradients[to + CORNER_STRIDE - 2] = vec4(c.by_coordinate[0], c.by_coordinate[1]);
        corner_gradients[to + CORNER_STRIDE - 1] = vec4(c.by_coordinate[2], 0.0, 0.0);
    }
    if (GRAD_LIGHTS && !SMOOTH) {
        light_records[2 * slot] = vec4(by_light, 0.0);
        light_records[2 * slot + 1] = vec4(face_normal, 0.0);
        if (NEAR_CLIP) {
            // All rows are summed, the second pieces' too.
            light_records[2 * (slot + shape.triangle_count)] = vec4(0.0);
            light_records[2 * (slot + shape.triangle_count) + 1] = vec4(0.0);
        }
    }
    if (GRAD_VIEW) {
        bool fixed_view = camera.kind == PROJECTION_SCREEN;
        view_sums[3 * slot] = fixed_view ? vec4(0.0) : vec4(c.twist_shift, c.twist_turn.x);
        view_sums[3 * slot + 1] = fixed_view ? vec4(0.0) : vec4(c.twist_turn.yz, c.by_projection.xy);
        view_sums[3 * slot + 2] = vec4(fixed_view ? vec2(0.0) : c.by_projection.zw, c.scalars);
    }
}
