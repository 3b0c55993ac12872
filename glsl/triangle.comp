#version 450
#extension GL_GOOGLE_include_directive : require
// Triangle: clips each triangle at the near plane, makes the records of all that a (pixel, triangle) pair needs and the pixel
// box grown by the culling radius, and sets the triangle's bit in the bitmap of every bin that it may touch.
// One invocation a triangle, views along y. A triangle that crosses the near plane becomes one or two pieces. The first has the
// triangle's own record index, the second the index `triangle_count` later. So the order of records never depends on timing.
// Reads `vertices`, the mesh and the lights. Writes `geometry`, `shading`, `boxes`, `bin_bits` and `status`, and for backward
// `cell_ranges` and `cells`: the cells of a large box beyond its first. triangle_grad.comp has the derivatives.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer view_cameras;
layout(set = 0, binding = 2) uniform samplerBuffer positions;
layout(set = 0, binding = 3) uniform usamplerBuffer indices;
layout(set = 0, binding = 4) uniform samplerBuffer vertices;
layout(set = 0, binding = 5) uniform samplerBuffer vertex_shading;
layout(set = 0, binding = 6) uniform samplerBuffer lights;
layout(set = 0, binding = 7) uniform samplerBuffer colors;
layout(set = 0, binding = 8) uniform samplerBuffer uvs;
layout(set = 0, binding = 9) uniform usamplerBuffer uv_indices;
layout(set = 0, binding = 10) uniform usamplerBuffer triangle_textures;
layout(set = 0, binding = 11, std430) writeonly buffer Geometry { vec4 geometry[]; };
layout(set = 0, binding = 12, std430) writeonly buffer Shading { vec4 shading[]; };
layout(set = 0, binding = 13, std430) writeonly buffer Boxes { ivec4 boxes[]; };
layout(set = 0, binding = 14, std430) buffer BinBits { uint bin_bits[]; };
layout(set = 0, binding = 15, std430) buffer Status { uint status[]; };
layout(set = 0, binding = 16, std430) writeonly buffer CellRanges { uvec2 cell_ranges[]; };
layout(set = 0, binding = 17, std430) writeonly buffer Cells { uvec2 cells[]; };
layout(set = 0, binding = 18) uniform samplerBuffer features;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/position.glsl"
#include "common/df64.glsl"
#include "common/camera.glsl"
#include "common/light.glsl"
#include "common/edge.glsl"
#include "common/arithmetic.glsl"
#include "common/item.glsl"

// The corners of a triangle or of a piece: their pixels, their depths, and each corner as a mixture of the original three.
struct PieceCorners {
    vec2 column[3];
    vec2 row[3];
    vec2 z[3];
    vec3 mixture[3];
};

void skip_record(int record_index) {
    boxes[record_index] = ivec4(0, 0, -1, -1);
}

// Writes the shading record: the geometry's tail, the depths, and the corners' colours, texture coordinates, normals and features,
// mixed as the piece's corners are.
void write_shading(Shape shape, int triangle, int record_index, PieceCorners c, vec2 tail, vec4 depth, float exponent) {
    ivec3 v = triangle_vertices(shape, triangle);
    mat3 light = mat3(1.0);
    mat3 normal = mat3(0.0);
    light[0] = light[1] = light[2] = vec3(1.0);
    if (SMOOTH) {
        for (int k = 0; k < 3; ++k) {
            int at = int(VERTEX_SHADING_TEXELS) * (shape.screen_base + v[k]);
            light[k] = texelFetch(vertex_shading, at).rgb;
            normal[k] = texelFetch(vertex_shading, at + 1).xyz;
        }
    } else if (LIT || WANT_NORMAL) {
        vec3 n = unit_or_zero(normal_direction(shape, v));
        normal[0] = normal[1] = normal[2] = n;
        light[0] = light[1] = light[2] = light_on(n);
    }
    mat3 color;
    for (int k = 0; k < 3; ++k) {
        int at = shape.color_base + (shape.uniform_color ? 0 : 3 * v[k]);
        vec3 base = vec3(texelFetch(colors, at).x, texelFetch(colors, at + 1).x, texelFetch(colors, at + 2).x);
        color[k] = base * light[k];
    }
    vec3 c0 = color * c.mixture[0];
    vec3 c1 = color * c.mixture[1];
    vec3 c2 = color * c.mixture[2];
    int to = record_index * SHADING_STRIDE;
    shading[to] = vec4(tail, depth.w, c0.r);
    shading[to + 1] = vec4(depth.xyz, exponent);
    shading[to + 2] = vec4(c0.gb, c1.rg);
    shading[to + 3] = vec4(c1.b, c2);
    if (SAMPLING != SAMPLING_NONE) {
        // A surface is sampled by barycentrics, an image by UV.
        mat3x2 coordinate = mat3x2(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        if (shape.uv_base >= 0) {
            for (int k = 0; k < 3; ++k) {
                int index = int(texelFetch(uv_indices, shape.uv_index_base + 3 * triangle + k).x);
                int at = shape.uv_base + 2 * index;
                coordinate[k] = vec2(texelFetch(uvs, at).x, texelFetch(uvs, at + 1).x);
            }
        }
        int texture_index = shape.texture_base < 0
            ? -1 - shape.texture_base
            : int(texelFetch(triangle_textures, shape.texture_base + triangle).x);
        shading[to + 4] = vec4(coordinate * c.mixture[0], coordinate * c.mixture[1]);
        shading[to + 5] = vec4(coordinate * c.mixture[2], float(texture_index), float(triangle));
    }
    if (WANT_NORMAL) {
        vec3 n0 = normal * c.mixture[0];
        vec3 n1 = normal * c.mixture[1];
        vec3 n2 = normal * c.mixture[2];
        shading[to + SHADING_NORMAL_AT] = vec4(n0, 0.0);
        shading[to + SHADING_NORMAL_AT + 1] = vec4(n1, n2.x);
        shading[to + SHADING_NORMAL_AT + 2] = vec4(n2.yz, 0.0, 0.0);
    }
    for (int i = 0; i < FEATURES; ++i) {
        mat3x4 corners;
        for (int k = 0; k < 3; ++k) {
            corners[k] = texelFetch(features, (shape.vertex_base + v[k]) * FEATURE_ROOM + i);
        }
        for (int k = 0; k < 3; ++k) {
            shading[to + SHADING_FEATURES_AT + k * FEATURE_ROOM + i] = corners * c.mixture[k];
        }
    }
}

// These bounds keep finite whatever is computed from depth. Visible triangles stay far within them.
const float FARTHEST_WEIGHT = 1e30;
const float FARTHEST_RATIO = 1e18;
// 2⁻²⁴, half a unit in the last place of 1.
const float LEAST_NEARNESS = 5.9604645e-8;

// Depth relative to corner 0: (z0/z1 - 1, z0/z2 - 1, z0 in log2 weights, fraction of corner 0's log2 weight). The log weight is
// ζ/γ of eq. 3. Its integer part is apart in `exponent`, because the difference of two integers is exact for any gamma.
// In an orthographic view the record is (1 - z1/z0, 1 - z2/z0, -z0 in log2 weights, fraction): the sign tells them apart.
vec4 depth_record(PieceCorners c, bool parallel, out float exponent) {
    vec2 k = vec2(frame.score_high, frame.score_low);
    vec2 weight = df_mul(df_sub(vec2(frame.far_high, frame.far_low), c.z[0]), k);
    // If a corner is so far away that its weight overflows a float, its triangle is invisible.
    bool holds = abs(weight.x) < FARTHEST_WEIGHT;
    exponent = holds ? floor(weight.x + 0.5) : (c.z[0].x < 0.0 ? FARTHEST_WEIGHT : -FARTHEST_WEIGHT);
    float fraction = holds ? (weight.x - exponent) + weight.y : 0.0;
    float z0 = c.z[0].x == 0.0 ? 1e-20 : c.z[0].x;
    float z1 = c.z[1].x == 0.0 ? 1e-20 : c.z[1].x;
    float z2 = c.z[2].x == 0.0 ? 1e-20 : c.z[2].x;
    float weight_of_z0 = clamp(z0 * k.x, -FARTHEST_WEIGHT, FARTHEST_WEIGHT);
    if (parallel) {
        vec2 share = vec2(df_sub(c.z[0], c.z[1]).x, df_sub(c.z[0], c.z[2]).x) / z0;
        return vec4(clamp(share, -FARTHEST_RATIO, FARTHEST_RATIO), -weight_of_z0, fraction);
    }
    vec2 excess = vec2(df_sub(c.z[0], c.z[1]).x / z1, df_sub(c.z[0], c.z[2]).x / z2);
    excess = clamp(excess, -FARTHEST_RATIO, FARTHEST_RATIO);
    // A GPU's quotient may be off by some units in its last place, and then lie beyond -1, behind the camera.
    vec2 nearest = max(excess, vec2(LEAST_NEARNESS - 1.0));
    excess = mix(excess, nearest, lessThan(vec2(0.0), sign(z0) * vec2(z1, z2)));
    // Backward divides by z0 / zk, so it must not be 0.
    excess = mix(excess, vec2(LEAST_NEARNESS - 1.0), lessThan(abs(1.0 + excess), vec2(LEAST_NEARNESS)));
    return vec4(excess, weight_of_z0, fraction);
}

// Writes the cells of a box beyond its first, which has the record's index. Backward processes a box cell by cell. An atomic
// counter places the cells in `cells`, but backward sums them in their order within the triangle. If a record's cells have no
// room, its range is empty, and backward_long finds them again.
void write_cells(int record_index, ivec4 box) {
    ivec2 size = box.zw - box.xy + 1;
    uint more = uint(cells_of(box)) - 1u;
    // backward_cull.comp takes further cells for large boxes.
    if (more > 0u || uint(size.x * size.y) > LARGE_BOX) {
        atomicOr(status[STATUS_LARGE_BOXES], 1u);
    }
    // A box gets cells where their product with all records fits 32 bits, as the sum then does: no division, which runs lane by lane.
    uint beyond;
    uint sum;
    umulExtended(more, frame.record_count, beyond, sum);
    bool lists = more != 0u && beyond == 0u;
    uint start = lists ? atomicAdd(status[STATUS_CELLS_NEEDED], more) : 0u;
    bool fits = lists && more <= frame.cell_capacity && start <= frame.cell_capacity - more;
    cell_ranges[record_index] = uvec2(start, fits ? more : 0u);
    uint end = lists ? min(start + more, frame.cell_capacity) : start;
    for (uint i = start; i < end; ++i) {
        cells[i] = uvec2(fits ? uint(record_index) : NO_RECORD, i - start + 1u);
    }
}

// Sets the triangle's bit in every bin that the triangle grown by the culling radius may touch.
void mark_bins(Shape shape, int record_in_view, ivec4 box, Edges e) {
    ivec4 bins = box / ivec4(BIN_WIDTH, BIN_HEIGHT, BIN_WIDTH, BIN_HEIGHT);
    vec2 half_size = 0.5 * vec2(BIN_WIDTH - 1u, BIN_HEIGHT - 1u);
    int word = shape.word_base + record_in_view / int(WORD_BITS);
    uint bit = 1u << (uint(record_in_view) % WORD_BITS);
    ivec2 at = bins.xy;
    // One loop takes all bins, and most boxes lie in one bin. It tests its condition at the end: llvmpipe executes the body
    // once more if it tests at the start.
    do {
        vec2 centre = vec2(at) * vec2(BIN_WIDTH, BIN_HEIGHT) + half_size;
        if (at.y <= bins.w && may_touch(e, centre - e.origin, half_size)) {
            atomicOr(bin_bits[word + (at.y * int(frame.bins_x) + at.x) * shape.word_count], bit);
        }
        bool ends_row = at.x == bins.z;
        at = ends_row ? ivec2(bins.x, at.y + 1) : ivec2(at.x + 1, at.y);
    } while (at.y <= bins.w);
}

// Makes the records and the box of a triangle or of a piece, or skips it.
void emit(int view, Shape shape, int triangle, int record_in_view, PieceCorners c) {
    int record_index = shape.record_base + record_in_view;
    Edges e = edges_of(c.column, c.row);
    bool front = e.degenerate || (e.orientation < 0.0) != CLOCKWISE_FRONT;
    bool hidden = FRONT_ONLY && !front;
    bool beyond = DEPTH_RANGE == DEPTH_RANGE_FAR && min(c.z[0].x, min(c.z[1].x, c.z[2].x)) > frame.far_high;
    bool shapeless = DISTANCE != DISTANCE_EUCLIDEAN && e.degenerate;
    ivec4 box = grown_box(e);
    if (!(e.finite && abs(c.z[0].x) + abs(c.z[1].x) + abs(c.z[2].x) < 1e30)) {
        atomicOr(status[STATUS_NOT_FINITE], 1u);
        box = ivec4(0, 0, -1, -1);
    }
    if ((hidden && !OFFICIAL) || beyond || shapeless || box.x > box.z || box.y > box.w) {
        skip_record(record_index);
        return;
    }
    boxes[record_index] = box;
    int to = record_index * GEOMETRY_STRIDE;
    geometry[to] = vec4(e.origin, e.orientation * e.half_length.x, e.half_length.y);
    geometry[to + 1] = e.line[0];
    geometry[to + 2] = e.line[1];
    geometry[to + 3] = e.line[2];
    vec2 tail = vec2(e.half_length.z, e.inverse_area);
    if (WANT_SHADING) {
        float exponent;
        vec4 depth = depth_record(c, has_parallel_rays(view), exponent);
        // With official parity a back face contributes to the silhouette, but has no weight in the colour.
        write_shading(shape, triangle, record_index, c, tail, depth, hidden ? -3e38 : exponent);
    } else {
        geometry[to + int(GEOMETRY_TEXELS)].xy = tail;
    }
    mark_bins(shape, record_in_view, box, e);
    if (SAVE) {
        write_cells(record_index, box);
    }
}

// Clips at z = near (Sutherland and Hodgman), corner 0 first. A fourth corner makes a second piece (0, 2, 3).
void emit_clipped(int view, Shape shape, int triangle, ivec3 v) {
    vec2 near = vec2(frame.near_high, frame.near_low);
    ViewPoint corner[3];
    vec2 depth[3];
    for (int k = 0; k < 3; ++k) {
        corner[k] = to_view(view, position_of(shape, v[k]));
        depth[k] = df_sub(corner[k].z, near);
    }
    ViewPoint polygon[4];
    vec3 mixture[4];
    int count = 0;
    for (int k = 0; k < 3; ++k) {
        int l = k == 2 ? 0 : k + 1;
        bool inside = depth[k].x >= 0.0;
        if (inside) {
            polygon[count] = corner[k];
            mixture[count] = vec3(k == 0, k == 1, k == 2);
            ++count;
        }
        if (inside != (depth[l].x >= 0.0)) {
            vec2 t = df_div(depth[k], df_sub(depth[k], depth[l]));
            polygon[count].x = df_add(corner[k].x, df_mul(t, df_sub(corner[l].x, corner[k].x)));
            polygon[count].y = df_add(corner[k].y, df_mul(t, df_sub(corner[l].y, corner[k].y)));
            polygon[count].z = near;
            mixture[count] = vec3(k == 0, k == 1, k == 2) * (1.0 - t.x) + vec3(l == 0, l == 1, l == 2) * t.x;
            ++count;
        }
    }
    for (int piece = 0; piece < 2; ++piece) {
        int record_in_view = triangle + piece * shape.triangle_count;
        if (count < 3 + piece) {
            skip_record(shape.record_base + record_in_view);
            continue;
        }
        PieceCorners c;
        for (int k = 0; k < 3; ++k) {
            int i = k == 0 ? 0 : k + piece;
            to_pixels(view, polygon[i], c.column[k], c.row[k]);
            c.z[k] = polygon[i].z;
            c.mixture[k] = mixture[i];
        }
        emit(view, shape, triangle, record_in_view, c);
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
    PieceCorners c;
    int nearer = 0;
    for (int k = 0; k < 3; ++k) {
        int at = int(VERTEX_TEXELS) * (shape.screen_base + v[k]);
        vec4 pixel = texelFetch(vertices, at);
        c.column[k] = pixel.xy;
        c.row[k] = pixel.zw;
        c.z[k] = texelFetch(vertices, at + 1).xy;
        c.mixture[k] = vec3(k == 0, k == 1, k == 2);
        nearer += df_sub(c.z[k], vec2(frame.near_high, frame.near_low)).x < 0.0 ? 1 : 0;
    }
    if (nearer == 0 || OFFICIAL) {
        emit(view, shape, triangle, triangle, c);
        if (NEAR_CLIP) {
            skip_record(shape.record_base + shape.triangle_count + triangle);
        }
    } else if (NEAR_CLIP && nearer < 3) {
        emit_clipped(view, shape, triangle, v);
    } else {
        skip_record(shape.record_base + triangle);
        if (NEAR_CLIP) {
            skip_record(shape.record_base + shape.triangle_count + triangle);
        }
    }
}
