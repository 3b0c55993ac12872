#version 450
#extension GL_GOOGLE_include_directive : require
#ifdef SUBGROUP_RECORDS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
// Backward (eq. 4). For every triangle it sums, over the pixels of the triangle's box, the derivative of the loss by the
// corners (pixels and depth), their colours, texture coordinates, normals and features, and by sigma and gamma. It adds the
// lanes' sums in a fixed order without atomics, so that the bits are the same on every run.
// One workgroup an item of backward_cull's list (item.glsl), whose lanes take the pixels in turn. A small item takes one lane
// alone (item_pixels.glsl).
// Reads the items, the records, `saved`, `pixel_gradients` and `silhouette_gradients`. Writes `partials`, which triangle_grad.comp
// reads, and `texel_sums`.
// Compiled three times: backward, for any Vulkan 1.1 device; backward_subgroup, for workgroups of one subgroup with shuffles;
// and backward_long, for the cells that found no room.
//
// backward_long gives the same bits as if they had found room. It processes each cell beyond a box's first as backward_cull and
// backward would have processed its item, and adds the sum to the record's own entry of `partials`, in the order in which
// triangle_grad.comp adds the items of a record. It runs after backward has processed the first cells, one workgroup a record
// of `long_records` (bound as `items`). A box of more cells than a loop of the device can walk takes several turns
// (frame.number).

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer items;
layout(set = 0, binding = 1) uniform samplerBuffer geometry;
layout(set = 0, binding = 2) uniform samplerBuffer shading;
layout(set = 0, binding = 3) uniform usamplerBuffer textures;
layout(set = 0, binding = 4) uniform samplerBuffer texels;
layout(set = 0, binding = 5) uniform samplerBuffer pixel_gradients;
#ifdef LONG
layout(set = 0, binding = 6, std430) buffer Partials { vec4 partials[]; };
#else
layout(set = 0, binding = 6, std430) writeonly buffer Partials { vec4 partials[]; };
#endif
layout(set = 0, binding = 7, std430) buffer TexelSums { uint texel_sums[]; };
layout(set = 0, binding = 8) uniform usamplerBuffer item_counts;
layout(set = 0, binding = 12) uniform samplerBuffer silhouette_gradients;
layout(set = 0, binding = 13) uniform samplerBuffer saved;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"

// Whether the triangles of the items contribute to the silhouette only.
layout(constant_id = 26) const bool OUTLINE = false;
// Whether they contribute to a shaded image.
#ifdef LONG
bool SHOWS;
#else
const bool SHOWS = uint(UP_SHADED) * uint(!OUTLINE) != 0u;
#endif

#include "common/frame.glsl"
#include "common/arithmetic.glsl"
#include "common/record.glsl"
#include "common/distance.glsl"
#include "common/fragment.glsl"
#include "common/sample.glsl"
#include "common/shared_records.glsl"
#include "common/lanes.glsl"
#include "common/item.glsl"
#include "common/item_pixels.glsl"
#include "common/pair.glsl"
#include "common/texel_gradient.glsl"
#include "common/feature_gradient.glsl"
#include "common/pair_gradient.glsl"

// Lanes that share an item.
const int ITEM_LANES = int(gl_WorkGroupSize.x);

// Pixels that a lane takes at a time. Every step runs over all of them before the next step, so that their long chains of
// dependent operations overlap: two at a time are 10 % faster than one. Four take 1.15 times as long as two, because the
// sixteen registers of AVX2 have no room for them. If the pixels need the silhouette alone there is room, and two take 1.03 to
// 1.14 times as long as four. In an item that the lanes share four are no faster: more lanes are left without a pixel at its
// end.
const int PAIRS = 2 + 2 * int(SMALL) * int(OUTLINE);
const int STEP = PAIRS * ITEM_LANES;

// Adds the gradients of a lane's fragments through eq. 2 and 3. It adds dL/dx to `by_x` and dL/dα to `by_alpha`.
void add_shading_gradients(ItemTriangle item, Pair pairs[PAIRS], PairDistance distances[PAIRS], PixelGradient g[PAIRS],
                           Fragment f[PAIRS], Surface surface[PAIRS], Opacity opacity[PAIRS], inout float by_x[PAIRS],
                           inout float by_t[PAIRS], inout float by_alpha[PAIRS], inout Sums s) {
    Weight weight[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        weight[i] = weight_of(item, g[i], f[i], surface[i], opacity[i].alpha);
    }
    Value value[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        value[i] = value_of(item, g[i], surface[i], weight[i].value, s);
    }
    float by_weight[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        by_weight[i] = weight_gradient(g[i], weight[i], value[i], s);
        // ∂s_j/∂x_j = 1 - D_j
        by_x[i] += by_weight[i] * f[i].complement;
    }
    if (OPACITY) {
        for (int i = 0; i < PAIRS; ++i) {
            by_alpha[i] += opacity_gradient(g[i], weight[i], value[i]);
            add_opacity(item, opacity[i], by_alpha[i], weight[i].value, value[i], s);
        }
    }
    if (GRAD_GEOMETRY) {
        for (int i = 0; i < PAIRS; ++i) {
            surface_gradient(item, pairs[i], distances[i].nearest, g[i], f[i], surface[i], value[i], weight[i].value,
                             by_weight[i], by_t[i], s);
        }
    }
}

// Adds the gradients of fragments that contribute to the silhouette only. Their opacity depends on the surface too.
void add_opacity_gradients(ItemTriangle item, Pair pairs[PAIRS], PairDistance distances[PAIRS], PixelGradient g[PAIRS],
                           Fragment f[PAIRS], Surface surface[PAIRS], Opacity opacity[PAIRS], float by_alpha[PAIRS],
                           inout float by_t[PAIRS], inout Sums s) {
    for (int i = 0; i < PAIRS; ++i) {
        Value value = value_from(item, surface[i]);
        add_opacity(item, opacity[i], by_alpha[i], 0.0, value, s);
        if (GRAD_GEOMETRY) {
            surface_gradient(item, pairs[i], distances[i].nearest, g[i], f[i], surface[i], value, 0.0, 0.0, by_t[i], s);
        }
    }
}

// Adds the gradients of a lane's next pixels.
void add_pairs(ItemTriangle item, Pair pairs[PAIRS], inout Sums s) {
    PixelGradient g[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        g[i] = pixel_gradient_at(pairs[i].entry);
    }
    PairDistance distances[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        distances[i] = distance_of_pair(item, pairs[i]);
        g[i] = received(g[i], distances[i].to_triangle.kept);
    }
    Fragment f[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        f[i] = fragment_of(distances[i].to_triangle);
    }
    Surface surface[PAIRS];
    if (has_surface()) {
        for (int i = 0; i < PAIRS; ++i) {
            surface[i] = surface_of(item, distances[i].nearest, f[i]);
        }
    }
    float by_x[PAIRS];
    float by_t[PAIRS];
    float by_alpha[PAIRS];
    Opacity opacity[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        by_x[i] = silhouette_by_x(g[i], f[i]);
        by_t[i] = 0.0;
        if (OPACITY) {
            opacity[i] = opacity_of(item, value_from(item, surface[i]).share);
            // dL/dα = D dL/dD', dL/dD = α dL/dD', and dD/dx = D (1 - D).
            by_alpha[i] = silhouette_by_faded(g[i], f[i], opacity[i].alpha) * f[i].probability;
            by_x[i] = by_alpha[i] * opacity[i].alpha * f[i].complement;
        }
    }
    if (SHOWS) {
        add_shading_gradients(item, pairs, distances, g, f, surface, opacity, by_x, by_t, by_alpha, s);
    } else if (OPACITY) {
        add_opacity_gradients(item, pairs, distances, g, f, surface, opacity, by_alpha, by_t, s);
    }
    for (int i = 0; i < PAIRS; ++i) {
        x_gradient(item, pairs[i], distances[i], f[i], by_x[i], by_t[i], s);
    }
}

// Writes the sum over the lanes to `partials`.
void put(bool writes, int at, vec4 value) {
    vec4 sum = SMALL ? value : sum_of_lanes(value);
    if (writes) {
#ifdef LONG
        sum += partials[at];
#endif
        partials[at] = sum;
    }
}

// Writes the sum over the lanes of three components, and of a fourth that only gradients by sigma and gamma have. On a software
// device each component that is written takes the same time.
void put(bool writes, int at, vec3 value, float scalar) {
    if (GRAD_SCALARS) {
        put(writes, at, vec4(value, scalar));
        return;
    }
    vec3 sum = SMALL ? value : sum_of_lanes(vec4(value, 0.0)).xyz;
    if (writes) {
#ifdef LONG
        sum += partials[at].xyz;
#endif
        partials[at].xyz = sum;
    }
}

void write_sums(Sums s, Corner c, bool writes, int item) {
    vec3 near = nearness(c);
    vec3 by_z = UP_SHADED || OPACITY ? s.depth * near * near : vec3(0.0);
    int at = item * PARTIAL_STRIDE;
    // One texel a corner: vertex_grad.comp reads no more of a corner.
    put(writes, at, vec3(s.corner[0], by_z.x), s.sigma);
    put(writes, at + 1, vec3(s.corner[1], by_z.y), s.gamma);
    put(writes, at + 2, vec3(s.corner[2], by_z.z), 0.0);
    if (GRAD_COLOR) {
        for (int k = 0; k < 3; ++k) {
            put(writes, at + PARTIAL_COLOR_AT + k, s.color[k], 0.0);
        }
    }
    if (GRAD_COORDINATE) {
        put(writes, at + PARTIAL_COORDINATE_AT, vec4(s.coordinate[0], s.coordinate[1]));
        put(writes, at + PARTIAL_COORDINATE_AT + 1, vec4(s.coordinate[2], 0.0, 0.0));
    }
    if (GRAD_NORMAL) {
        put(writes, at + PARTIAL_NORMAL_AT, vec4(s.normal[0], s.normal[1].x));
        put(writes, at + PARTIAL_NORMAL_AT + 1, vec4(s.normal[1].yz, s.normal[2].xy));
        put(writes, at + PARTIAL_NORMAL_AT + 2, vec4(s.normal[2].z, 0.0, 0.0, 0.0));
    }
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        put(writes, at + PARTIAL_FEATURES_AT + i, feature_sums[i]);
    }
}

// The triangle of an item. If the lanes share the item, they read it together.
ItemTriangle item_triangle_of(int record_index) {
    ItemTriangle t;
    if (SMALL) {
        t.edges = triangle_of(record_index);
        if (WANT_SHADING) {
            t.corner = corner_of(record_index);
        }
        for (int i = 0; i < 3 * UP_FEATURE_TEXELS; ++i) {
            corner_features[i] = texelFetch(shading, record_index * SHADING_STRIDE + SHADING_FEATURES_AT + i);
        }
    } else {
        Fetched own = fetch_record(record_index);
        t.edges = shared_triangle_of(own);
        if (WANT_SHADING) {
            t.corner = shared_corner_of(own);
        }
        for (int i = 0; i < 3 * UP_FEATURE_TEXELS; ++i) {
            corner_features[i] = shared_shading_texel(own, false, SHADING_FEATURES_AT + i);
        }
    }
    t.choice = edge_choice_of(t.edges, has_surface());
    t.record_index = record_index;
    t.radius_squared = frame.radius_squared;
    t.scale = frame.scale;
    t.z0 = first_depth(t.corner) / frame.score_high;
    t.weight_slope = -frame.score_high * LN2;
    return t;
}

ItemPixels pixels_of(Item item, vec2 origin) {
    int width = int(frame.width);
    int entry = (item.view * int(frame.height) + item.first.y) * width + item.first.x;
    return ItemPixels(item.size.x * item.size.y, float(item.size.x), 1.0 / float(item.size.x), vec2(item.first) - origin, entry,
                float(width));
}

// Adds the gradients of this lane's pixels of an item that the lanes share. The loop tests its condition at the end, since no
// item is empty: llvmpipe executes the body once more if it tests at the start. All lanes take the same number of turns.
void add_shared(ItemTriangle triangle, ItemPixels pixels, inout Sums s) {
    int turns = (pixels.count + STEP - 1) / STEP;
    int index = int(gl_LocalInvocationID.x);
    do {
        Pair pairs[PAIRS];
        for (int i = 0; i < PAIRS; ++i) {
            pairs[i] = pair_at(pixels, index + i * ITEM_LANES);
        }
        add_pairs(triangle, pairs, s);
        index += STEP;
        --turns;
    } while (turns > 0);
}

// Adds the gradients of a small item's pixels, if the lane has one. All lanes take as many turns as the lane with the most: in
// Mesa 22.3 a lane that has left the loop still takes branches of its body. With shuffles the lanes ask each other after each
// turn. Without shuffles that would take barriers, so each lane counts its turns before.
void add_alone(ItemTriangle triangle, ItemPixels pixels, ivec2 size, bool exists, inout Sums s) {
    ColumnBounds bounds = column_bounds_of(triangle.edges, pixels, size);
    RowPosition position = first_position(bounds, exists);
#ifdef SUBGROUP_RECORDS
    int turns = 0;
#else
    int turns = -int(least_of_lanes(vec2(-turns_of(position, bounds, PAIRS))).x);
#endif
    do {
        Pair pairs[PAIRS];
        for (int i = 0; i < PAIRS; ++i) {
            pairs[i] = pair_after(pixels, position, i);
        }
        add_pairs(triangle, pairs, s);
        position = advanced(position, bounds, PAIRS);
#ifdef SUBGROUP_RECORDS
        turns = int(bits_of_lanes(has_pixels(position, bounds) ? 1u : 0u));
#else
        --turns;
#endif
    } while (turns > 0);
}

#ifdef LONG
layout(set = 0, binding = 9) uniform isamplerBuffer boxes;
layout(set = 0, binding = 10) uniform samplerBuffer tile_bounds;
layout(set = 0, binding = 11) uniform usamplerBuffer view_shapes;

#include "common/mesh.glsl"
#include "common/hidden.glsl"
#include "common/relevance.glsl"

// Adds a further cell to the record's entry of `partials`.
void add_item(Item item, ItemTriangle triangle) {
    int lane = int(gl_LocalInvocationID.x);
    ItemPixels pixels = pixels_of(item, triangle.edges.origin);
    Sums s = no_sums();
    clear_feature_sums();
    add_shared(triangle, pixels, s);
    if (GRAD_GEOMETRY) {
        corners_from_barycentrics(triangle.edges, pixels.first, s);
    }
    write_sums(s, triangle.corner, lane == 0, item.index);
}

void main() {
    int record_index = int(texelFetch(items, int(frame.first + gl_WorkGroupID.x)).x);
    ivec4 box = texelFetch(boxes, record_index);
    int view = view_of(record_index);
    ItemTriangle triangle = item_triangle_of(record_index);
    int first = 1 + int(frame.number * CELLS_PER_TURN);
    int end = min(first + int(CELLS_PER_TURN), cells_of(box));
    for (int cell = first; cell < end; ++cell) {
        Item item = item_of(record_index, record_index, cell, view, box);
        Relevance relevance = relevance_of(item);
        SHOWS = relevance.shows;
        if (relevance.shows || relevance.outlines) {
            add_item(item, triangle);
        }
    }
}
#else
// The index in `items` of this lane's item. A row has its items at the front, and its small items at the end in reverse order.
// A lane past the last small item takes the last one again, with `exists` false.
int item_index(out bool exists) {
    int first = int(frame.first);
    exists = true;
    if (!SMALL) {
        return first + int(gl_WorkGroupID.x);
    }
    int row = first / int(FORWARD_ROW);
    int list = int(SHOWS ? ITEMS_SHOWN : ITEMS_OUTLINE) + int(ITEMS_SMALL_NUMBER);
    int number = int(texelFetch(item_counts, row * int(ITEM_COUNT_WORDS) + list).x);
    int end = min(first + int(FORWARD_ROW), int(frame.record_count + frame.cell_capacity));
    int own = int(gl_GlobalInvocationID.x);
    exists = own < number;
    return end - 1 - min(own, number - 1);
}

void main() {
    int lane = SMALL ? 0 : int(gl_LocalInvocationID.x);
    bool exists;
    Item item = unpacked(texelFetch(items, item_index(exists)));
    ItemTriangle triangle = item_triangle_of(item.record_index);
    ItemPixels pixels = pixels_of(item, triangle.edges.origin);
    Sums s = no_sums();
    clear_feature_sums();
    if (SMALL) {
        add_alone(triangle, pixels, item.size, exists, s);
    } else {
        add_shared(triangle, pixels, s);
    }
    if (GRAD_GEOMETRY) {
        corners_from_barycentrics(triangle.edges, pixels.first, s);
    }
    write_sums(s, triangle.corner, exists && lane == 0, item.index);
}
#endif
