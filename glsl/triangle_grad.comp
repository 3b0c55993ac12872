#version 450
#extension GL_GOOGLE_include_directive : require
// Triangle gradient: carries backward's sums for a triangle's records to its three corners: through near clipping and the
// projection to world space (project_gradient.glsl), and through light to the corners' colours and the face's normal. It also
// computes the triangle's terms of the gradients by the whole view.
// One invocation a triangle, views along y. With PER_VERTEX vertex_grad.comp does without this kernel.
// Reads `partials`, `item_marks`, `vertices` and the mesh. Writes:
// - `corner_gradients`: by three world positions, three colours, the corners' features, and two texels of texture coordinates;
// - `corner_lights`: dL/dlight and dL/dnormal of every corner, with smooth shading;
// - `light_records`: dL/dlight and the normal of the face, with flat shading;
// - `view_sums`: by twist, projection, sigma and gamma.

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
layout(set = 0, binding = 9) uniform usamplerBuffer item_marks;
layout(set = 0, binding = 10) uniform usamplerBuffer cell_ranges;
layout(set = 0, binding = 11) uniform samplerBuffer partials;
layout(set = 0, binding = 12) uniform samplerBuffer vertices;
layout(set = 0, binding = 13, std430) writeonly buffer CornerGradients { vec4 corner_gradients[]; };
layout(set = 0, binding = 14, std430) writeonly buffer CornerLights { vec4 corner_lights[]; };
layout(set = 0, binding = 15, std430) writeonly buffer LightRecords { vec4 light_records[]; };
layout(set = 0, binding = 16, std430) writeonly buffer ViewSums { vec4 view_sums[]; };
layout(set = 0, binding = 17) uniform samplerBuffer features;

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

// The corners of the triangle before clipping, and the gradients by them.
struct TriangleGradient {
    // In view space.
    vec3 point[3];
    // z - near of each corner, with the precision that forward clips with.
    vec3 beyond_near;
    // Colour without light, light, texture coordinates and normal, a column a corner.
    mat3 base;
    mat3 light;
    mat3x2 coordinate;
    mat3 normal;
    vec3 by_point[3];
    mat3 by_color;
    mat3x2 by_coordinate;
    mat3 by_normal;
    // dL by a translation and a rotation of the view, by the projection (two scales, two offsets), and the sums of sigma and
    // gamma (Sums in pair_gradient.glsl).
    vec3 twist_shift;
    vec3 twist_turn;
    vec4 by_projection;
    vec2 scalars;
};

// dL by the features of the triangle's corners, beside struct TriangleGradient as in features.glsl.
vec4 by_corner_features[3 * FEATURE_ROOM];

TriangleGradient corners_of(Shape shape, View camera, int triangle, ivec3 v, vec3 face_normal) {
    TriangleGradient c;
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
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        by_corner_features[i] = vec4(0.0);
    }
    c.twist_shift = vec3(0.0);
    c.twist_turn = vec3(0.0);
    c.by_projection = vec4(0.0);
    c.scalars = vec2(0.0);
    return c;
}

// Whether all gradients by corner i of a record are 0.
bool is_zero(Partial p, int i) {
    vec3 sum = abs(p.color[i]) + abs(p.normal[i]) + vec3(abs(p.pixel[i]) + abs(p.coordinate[i]), abs(p.depth[i]));
    for (int j = 0; j < GRAD_FEATURE_TEXELS; ++j) {
        vec4 by_features = abs(partial_features[i * FEATURE_ROOM + j]);
        sum += by_features.xyz + by_features.w;
    }
    return sum == vec3(0.0);
}

// Adds dL by the features of corner i of a piece to the corners k and l that it mixes. Returns dL/dt.
float add_corner_features(Shape shape, ivec3 v, int i, int k, int l, float u, float t) {
    float by_t = 0.0;
    for (int j = 0; j < GRAD_FEATURE_TEXELS; ++j) {
        vec4 by_features = partial_features[i * FEATURE_ROOM + j];
        by_corner_features[k * FEATURE_ROOM + j] += u * by_features;
        by_corner_features[l * FEATURE_ROOM + j] += t * by_features;
        if (k != l) {
            vec4 from = texelFetch(features, (shape.vertex_base + v[k]) * FEATURE_ROOM + j);
            vec4 to = texelFetch(features, (shape.vertex_base + v[l]) * FEATURE_ROOM + j);
            by_t += dot(by_features, to - from);
        }
    }
    return by_t;
}

// Adds corner i of a piece. It is the original corner k if k = l. Else it is the point (1 - t) p_k + t p_l, where the near
// plane cuts the edge from corner k to corner l.
void add_corner(View camera, Shape shape, ivec3 v, inout TriangleGradient c, Partial p, int i, int k, int l, float near) {
    // Skip a corner without gradient. It may lie on the camera's plane, where it has no projection.
    if (is_zero(p, i)) {
        return;
    }
    float from = c.beyond_near[k];
    float to = c.beyond_near[l];
    float t = k == l ? 0.0 : from / (from - to);
    // 1 - t as a quotient. As a difference it has no digits if t is close to 1.
    float u = k == l ? 1.0 : -to / (from - to);
    vec3 point = u * c.point[k] + t * c.point[l];
    // Exactly on the plane, for edges of any length.
    point.z = k == l ? point.z : near;
    vec4 by_projection;
    vec3 by_point = project_gradient(camera, point, p.pixel[i], p.depth[i], by_projection);
    c.by_projection += by_projection;
    c.by_point[k] += u * by_point;
    c.by_point[l] += t * by_point;
    c.by_color[k] += u * p.color[i];
    c.by_color[l] += t * p.color[i];
    c.by_coordinate[k] += u * p.coordinate[i];
    c.by_coordinate[l] += t * p.coordinate[i];
    c.by_normal[k] += u * p.normal[i];
    c.by_normal[l] += t * p.normal[i];
    float by_t = add_corner_features(shape, v, i, k, l, u, t);
    if (k != l) {
        by_t += dot(by_point, c.point[l] - c.point[k])
                   + dot(p.color[i], c.base[l] * c.light[l] - c.base[k] * c.light[k])
                   + dot(p.coordinate[i], c.coordinate[l] - c.coordinate[k])
                   + dot(p.normal[i], c.normal[l] - c.normal[k]);
        // ∂t/∂z_k = (1 - t) / (z_k - z_l) and ∂t/∂z_l = t / (z_k - z_l), without squares of depths, which may overflow.
        c.by_point[k].z += by_t * u / (from - to);
        c.by_point[l].z += by_t * t / (from - to);
    }
}

// A triangle that is not clipped has one record, with its own corners.
void add_unclipped(View camera, Shape shape, int triangle, ivec3 v, inout TriangleGradient c) {
    Partial p = partial_of(shape.record_base + triangle);
    for (int k = 0; k < 3; ++k) {
        add_corner(camera, shape, v, c, p, k, k, k, 0.0);
    }
    c.scalars = p.scalars;
}

// The pieces of a clipped triangle. Their corners have the order of emit_clipped in triangle.comp.
void add_pieces(View camera, Shape shape, int triangle, ivec3 v, inout TriangleGradient c) {
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
        Partial p = partial_of(shape.record_base + triangle + piece * shape.triangle_count);
        for (int i = 0; i < 3; ++i) {
            ivec2 which = corner[i == 0 ? 0 : i + piece];
            add_corner(camera, shape, v, c, p, i, which.x, which.y, near);
        }
        c.scalars += p.scalars;
    }
}

// The derivative of the normalisation n = a / |a|: dL/da = (I - n nᵀ) dL/dn / |a|.
vec3 area_gradient(vec3 area, vec3 by_normal) {
    // `area` comes from edges of size 1. A shorter vector is a segment's, whose normal is noise.
    float size = length(area);
    vec3 n = size > 1e-18 ? area / size : vec3(0.0);
    return size > 1e-18 ? (by_normal - n * dot(n, by_normal)) / size : vec3(0.0);
}

// A triangle's edges divided by their largest component `size`, their cross product, and the unit normal.
struct Face {
    vec3 edge1;
    vec3 edge2;
    float size;
    vec3 area;
    vec3 normal;
};

Face face_of(Shape shape, ivec3 v) {
    Face f;
    unit_edges(position_of(shape, v.x), position_of(shape, v.y), position_of(shape, v.z), f.edge1, f.edge2, f.size);
    f.area = edge_product(f.edge1, f.edge2);
    f.normal = unit_or_zero(f.area);
    return f;
}

// Carries dL by the face's normal, through light and the normal image, to the corners' world positions (flat shading).
void add_face_normal(Face face, TriangleGradient c, vec3 by_light, inout vec3 by_world[3]) {
    vec3 by_normal = c.by_normal[0] + c.by_normal[1] + c.by_normal[2];
    if (LIT) {
        by_normal += light_gradient(face.normal, by_light);
    }
    // The normal does not depend on `size`. The division makes this the gradient by the true edges. If a triangle is so small
    // that the quotient would overflow, it counts as a point.
    vec3 by_cross = length(face.area) * face.size > 1e-30 ? area_gradient(face.area, by_normal) / face.size : vec3(0.0);
    // The edges of a triangle without gradient need not be finite.
    if (by_cross == vec3(0.0)) {
        return;
    }
    vec3 by_edge1 = cross(face.edge2, by_cross);
    vec3 by_edge2 = cross(by_cross, face.edge1);
    by_world[0] -= by_edge1 + by_edge2;
    by_world[1] += by_edge1;
    by_world[2] += by_edge2;
}

void write_corners(int record_index, TriangleGradient c, vec3 by_world[3]) {
    int to = record_index * CORNER_STRIDE;
    for (int k = 0; k < 3; ++k) {
        corner_gradients[to + k] = vec4(by_world[k], 0.0);
        if (GRAD_COLOR) {
            corner_gradients[to + 3 + k] = vec4(c.by_color[k] * c.light[k], 0.0);
        }
        if (SMOOTH) {
            int light_at = 2 * (3 * record_index + k);
            corner_lights[light_at].xyz = c.by_color[k] * c.base[k];
            corner_lights[light_at + 1].xyz = c.by_normal[k];
        }
    }
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        corner_gradients[to + CORNER_FEATURES_AT + i] = by_corner_features[i];
    }
    if (GRAD_COORDINATE) {
        corner_gradients[to + CORNER_STRIDE - 2] = vec4(c.by_coordinate[0], c.by_coordinate[1]);
        corner_gradients[to + CORNER_STRIDE - 1] = vec4(c.by_coordinate[2], 0.0, 0.0);
    }
}

void main() {
    int view = int(gl_WorkGroupID.y);
    int triangle = int(gl_GlobalInvocationID.x);
    Shape shape = shape_of(view);
    if (triangle >= shape.triangle_count) {
        return;
    }
    ivec3 v = triangle_vertices(shape, triangle);
    Face face = face_of(shape, v);
    View camera = view_record(view);
    TriangleGradient c = corners_of(shape, camera, triangle, v, face.normal);
    int record_index = shape.record_base + triangle;
    if (NEAR_CLIP) {
        add_pieces(camera, shape, triangle, v, c);
    } else {
        add_unclipped(camera, shape, triangle, v, c);
    }
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
        add_face_normal(face, c, by_light, by_world);
    }
    write_corners(record_index, c, by_world);
    if (GRAD_LIGHTS && !SMOOTH) {
        light_records[2 * record_index] = vec4(by_light, 0.0);
        light_records[2 * record_index + 1] = vec4(face.normal, 0.0);
        if (NEAR_CLIP) {
            // reduce.comp sums all rows, those of the second pieces too.
            light_records[2 * (record_index + shape.triangle_count)] = vec4(0.0);
            light_records[2 * (record_index + shape.triangle_count) + 1] = vec4(0.0);
        }
    }
    if (GRAD_VIEW) {
        bool fixed_view = camera.kind == PROJECTION_SCREEN;
        view_sums[3 * record_index] = fixed_view ? vec4(0.0) : vec4(c.twist_shift, c.twist_turn.x);
        view_sums[3 * record_index + 1] = fixed_view ? vec4(0.0) : vec4(c.twist_turn.yz, c.by_projection.xy);
        view_sums[3 * record_index + 2] = vec4(fixed_view ? vec2(0.0) : c.by_projection.zw, c.scalars);
    }
}
