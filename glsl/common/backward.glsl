// Backward (eq. 4): for every triangle sums over the pixels of its box the derivative of the loss by its corners (pixels and
// depth), their colours, texture coordinates and normals, and by sigma and gamma. The lanes' sums are added in a fixed order
// without atomics, so that the bits are the same on every run.
// One workgroup an item of backward_cull's list (item.glsl), its lanes taking the pixels in turn. A small item, which is
// less work than reading its record and adding up the lanes, takes one lane alone.
// Reads the items, the records and `pixel_gradients`; writes `partials`, which triangle_grad.comp reads, and `texel_sums`.

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

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/fragment.glsl"
#include "common/sample.glsl"
#include "common/corner.glsl"
#include "common/shared_records.glsl"
#include "common/lanes.glsl"
#include "common/item.glsl"
#include "common/pair_gradient.glsl"

#if defined(LONG)
// As below, for the item at hand (backward_long.comp).
bool SHOWS;
#elif defined(OUTLINE)
// The items' triangles contribute to the silhouette only.
const bool SHOWS = false;
#else
const bool SHOWS = UP_SHADED;
#endif

// Pixels that a lane takes at a time. Every step runs over all of them before the next step, so that their long chains of
// dependent operations overlap.
const int PAIRS = 2;

// Lanes that share an item, and the pixels that they take at a time.
#ifdef LONG
int WALKERS;
int STEP;
#else
const int WALKERS = SMALL ? 1 : int(gl_WorkGroupSize.x);
const int STEP = PAIRS * WALKERS;
#endif

// The pixels of an item, row by row.
struct Walk {
    // First column and row.
    ivec2 first;
    int count;
    int width;
    float inverse_width;
    // The view's first row and the row's length in `pixel_gradients`.
    int image;
    int image_width;
};

// One pixel of an item.
struct Pair {
    // Pixel position relative to the record's origin.
    vec2 q;
    // Index in `pixel_gradients`.
    int pixel;
    // False past the item's last pixel.
    bool taken;
};

Pair pair_at(Walk w, int index, vec2 origin) {
    int at = min(index, w.count - 1);
    int y = int((float(at) + 0.5) * w.inverse_width);
    ivec2 where = w.first + ivec2(at - y * w.width, y);
    return Pair(vec2(where) - origin, (w.image + where.y) * w.image_width + where.x, index < w.count);
}

// A fragment outside the depth range has D = 0 and the complement 1.
void leave_out(inout Fragment f, bool shaded) {
    f.probability = shaded ? f.probability : 0.0;
    f.complement = shaded ? f.complement : 1.0;
}

void add_pairs(int slot, Walk walk, int index, Triangle t, Ends ends, Corner c, float radius_squared, float scale,
               float inverse_score, inout Sums s) {
    Pair pairs[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        pairs[i] = pair_at(walk, index + i * WALKERS, t.origin);
    }
    const float LN2 = 0.69314718056;
    vec4 entry[PAIRS];
    vec4 weights[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        entry[i] = texelFetch(pixel_gradients, pairs[i].pixel * PIXEL_STRIDE);
        if (SHOWS) {
            weights[i] = texelFetch(pixel_gradients, pairs[i].pixel * PIXEL_STRIDE + 1);
        }
    }
    Place place[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        place[i] = place_at(t, pairs[i].q, radius_squared, scale);
        place[i].inside = place[i].inside && pairs[i].taken;
        place[i].kept = place[i].kept && pairs[i].taken;
    }
    Fragment f[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        f[i] = fragment_of(place[i]);
    }
    vec3 b[PAIRS];
    float sum[PAIRS];
    Depth depth[PAIRS];
    bool shaded[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        shaded[i] = place[i].kept;
        if (WANT_SHADING && (SHOWS || DEPTH_RANGE != DEPTH_RANGE_INSIDE)) {
            b[i] = clipped_barycentrics(t, f[i].height);
            sum[i] = b[i].x + b[i].y + b[i].z;
            depth[i] = depth_at(c.depth, b[i], sum[i]);
        }
        if (DEPTH_RANGE != DEPTH_RANGE_INSIDE) {
            float z = c.depth.z * inverse_score * depth[i].ratio;
            shaded[i] = shaded[i] && z <= frame.far_high;
            if (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL) {
                shaded[i] = shaded[i] && z >= frame.near_high;
            }
            // The official backward pass gives no gradient to a fragment that its colour leaves out.
            if (DEPTH_RANGE == DEPTH_RANGE_FAR || PAPER) {
                leave_out(f[i], shaded[i]);
            }
        }
    }
    // dL/dx through the silhouette (eq. 4: ∂A/∂x_j = (1 - A) D_j), x = ± d² / sigma of eq. 1; pixel_grad.comp made the
    // pixel's factor entry.a.
    float by_x[PAIRS];
    for (int i = 0; i < PAIRS; ++i) {
        by_x[i] = UP_ALPHA ? entry[i].a * f[i].probability : 0.0;
        if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
            by_x[i] *= f[i].complement;
        }
    }
    if (SHOWS) {
        float relative[PAIRS];
        float weight[PAIRS];
        for (int i = 0; i < PAIRS; ++i) {
            // Log2 weight relative to the pixel's sum, kept finite so that a weight of 0 gives a gradient of 0.
            relative[i] = between((c.whole - weights[i].x) + (depth[i].weight - weights[i].y), 1e30);
            // w_j of eq. 3. Only dropped fragments, with D = 0, exceed 2¹⁰⁰.
            weight[i] = (shaded[i] ? f[i].probability : 0.0) * exp2(lesser(relative[i], 100.0));
            if (COLOR_MODE == COLOR_HARD) {
                weight[i] = shaded[i] && vec2(slot >> 12, slot & 4095) == weights[i].xy ? 1.0 : 0.0;
            }
        }
        float inverse_sum[PAIRS];
        vec3 share[PAIRS];
        vec3 correction[PAIRS];
        vec3 mixed[PAIRS];
        for (int i = 0; i < PAIRS; ++i) {
            inverse_sum[i] = 1.0 / sum[i];
            share[i] = b[i] * inverse_sum[i];
            correction[i] = depth[i].ratio * nearness(c);
            mixed[i] = PERSPECTIVE_CORRECT ? share[i] * correction[i] : share[i];
        }
        float value[PAIRS];
        vec3 by_mixed[PAIRS];
        for (int i = 0; i < PAIRS; ++i) {
            value[i] = 0.0;
            by_mixed[i] = vec3(0.0);
            if (UP_COLOR) {
                by_mixed[i] = color_gradient(c, mixed[i], entry[i].rgb, weight[i], value[i], s);
            }
            if (UP_DEPTH) {
                value[i] += weights[i].w * (c.depth.z * inverse_score * depth[i].ratio);
            }
            if (UP_NORMAL) {
                vec3 up = texelFetch(pixel_gradients, pairs[i].pixel * PIXEL_STRIDE + 2).xyz;
                vec3 by_normal = up * c.normal;
                value[i] += dot(by_normal, mixed[i]);
                by_mixed[i] += by_normal;
                if (GRAD_NORMAL) {
                    s.normal[0] += up * (weight[i] * mixed[i].x);
                    s.normal[1] += up * (weight[i] * mixed[i].y);
                    s.normal[2] += up * (weight[i] * mixed[i].z);
                }
            }
        }
        for (int i = 0; i < PAIRS; ++i) {
            // ∂L/∂s_j = w_j (v_j - V) (eq. 4), s_j = log D_j + ζ_j/γ being the log weight of eq. 3, and ∂s_j/∂x_j = 1 - D_j.
            // The hard mode has no weights.
            float by_weight = COLOR_MODE == COLOR_SOFTMAX ? weight[i] * (value[i] - weights[i].z) : 0.0;
            by_x[i] += by_weight * f[i].complement;
            if (GRAD_SCALARS) {
                s.gamma += by_weight * relative[i];
            }
            if (GRAD_GEOMETRY) {
                float z = c.depth.z * inverse_score * depth[i].ratio;
                float by_z = (UP_DEPTH ? weight[i] * weights[i].w : 0.0) - by_weight * frame.score_high * LN2;
                if (PERSPECTIVE_CORRECT) {
                    // C = Σ b̂_k c_k z/z_k depends on z and on each z_k.
                    by_z += weight[i] * dot(by_mixed[i], mixed[i]) / z;
                    s.depth -= by_mixed[i] * mixed[i] * (weight[i] * depth[i].ratio / z) / nearness(c);
                }
                s.depth += share[i] * (by_z * depth[i].ratio * depth[i].ratio);
                if (!PAPER) {
                    // ∂z/∂b̂_k = -z²/z_k
                    vec3 by_share = PERSPECTIVE_CORRECT ? by_mixed[i] * correction[i] : by_mixed[i];
                    by_share = by_share * weight[i] - correction[i] * (by_z * z);
                    barycentric_gradient(t, ends, f[i].height, share[i], inverse_sum[i], by_share, s);
                }
            }
        }
    }
    for (int i = 0; i < PAIRS; ++i) {
        if (DISTANCE == DISTANCE_EUCLIDEAN && GRAD_GEOMETRY) {
            float signed_unit = place[i].inside ? 1.0 : -1.0;
            distance_gradient(t, ends, place[i], signed_unit * LN2 * by_x[i], s);
        } else if (DISTANCE == DISTANCE_BARYCENTRIC && GRAD_GEOMETRY) {
            barycentric_distance_gradient(t, f[i].height, by_x[i], s);
        }
        if (DISTANCE != DISTANCE_HARD && GRAD_SCALARS) {
            // x = log(D / (1 - D)); where D vanishes by_x does too.
            s.sigma += by_x[i] * log(max(f[i].probability, 1e-37) / max(f[i].complement, 1e-37));
        }
    }
}

Sums no_sums() {
    Sums s;
    s.corner[0] = s.corner[1] = s.corner[2] = vec2(0.0);
    s.turn = 0.0;
    s.depth = vec3(0.0);
    s.sigma = 0.0;
    s.gamma = 0.0;
    s.color = mat3(0.0);
    s.coordinate = mat3x2(0.0);
    s.normal = mat3(0.0);
    return s;
}

// For a triangle without area: the nearest point of a segment moves along it when the segment rotates, so that ∂t/∂p_b has a
// component across the segment, the distance over the squared length.
void add_turn(Triangle t, Ends ends, inout Sums s) {
    vec3 side = ends_of_segment(lessThan(t.inverse_height, vec3(0.0)));
    vec2 normal = ends.pick.x * t.line0.xy + ends.pick.y * t.line1.xy + ends.pick.z * t.line2.xy;
    float half_length = dot(ends.pick, t.half_length);
    vec2 turn = normal * (0.25 * s.turn / max(half_length * half_length, 1e-30));
    for (int k = 0; k < 3; ++k) {
        s.corner[k] += side[k] * turn;
    }
}

void put(bool writes, int at, vec4 value) {
    vec4 sum = WALKERS == 1 ? value : sum_of_lanes(value);
    if (writes) {
#ifdef LONG
        sum += partials[at];
#endif
        partials[at] = sum;
    }
}

void write_sums(Sums s, Corner c, bool writes, int item) {
    vec3 near = nearness(c);
    vec3 by_z = UP_SHADED ? s.depth * near * near : vec3(0.0);
    int at = item * PARTIAL_STRIDE;
    put(writes, at, vec4(s.corner[0], s.corner[1]));
    put(writes, at + 1, vec4(s.corner[2], by_z.xy));
    put(writes, at + 2, vec4(by_z.z, s.sigma, s.gamma, 0.0));
    if (GRAD_COLOR) {
        put(writes, at + PARTIAL_COLOR_AT, vec4(s.color[0], s.color[1].x));
        put(writes, at + PARTIAL_COLOR_AT + 1, vec4(s.color[1].yz, s.color[2].xy));
        put(writes, at + PARTIAL_COLOR_AT + 2, vec4(s.color[2].z, 0.0, 0.0, 0.0));
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
}

#ifndef LONG
// Index in `items` of this lane's item. A row holds its items from the front and its small items from the end, in reverse
// order. A lane past the last small item takes the last one again with `exists` false.
int place_of_item(out bool exists) {
    int first = int(frame.first);
    exists = true;
    if (!SMALL) {
        return first + int(gl_WorkGroupID.x);
    }
    int row = first / int(FORWARD_ROW);
    int list = int(SHOWS ? ITEMS_SHOWN : ITEMS_OUTLINE) + int(ITEMS_SMALL_NUMBER);
    int number = int(texelFetch(item_counts, row * int(ITEM_COUNT_WORDS) + list).x);
    int end = min(first + int(FORWARD_ROW), int(frame.slot_count + frame.cell_capacity));
    int mine = int(gl_GlobalInvocationID.x);
    exists = mine < number;
    return end - 1 - min(mine, number - 1);
}

void main() {
    int lane = SMALL ? 0 : int(gl_LocalInvocationID.x);
    bool exists;
    Item item = unpacked(texelFetch(items, place_of_item(exists)));
    int slot = item.slot;
    Walk walk = Walk(item.first, item.size.x * item.size.y, item.size.x, 1.0 / float(item.size.x),
                     item.view * int(frame.height), int(frame.width));
    Triangle t;
    Corner c;
    if (SMALL) {
        t = triangle_of(slot);
        if (WANT_SHADING) {
            c = corner_of(slot);
        }
    } else {
        Fetched own = fetch_record(slot);
        t = shared_triangle_of(own);
        if (WANT_SHADING) {
            c = shared_corner_of(own);
        }
    }
    Ends ends = ends_of(t);
    float radius_squared = frame.radius_squared;
    float scale = frame.scale;
    float inverse_score = 1.0 / frame.score_high;
    Sums s = no_sums();
    // No item is empty, so that the loop can test its condition at the end, where llvmpipe does not execute the body once
    // more. All lanes take the same number of turns, the largest: in Mesa 22.3 a lane that has left the loop still takes
    // branches of its body.
    int turns = (walk.count + STEP - 1) / STEP;
    turns = SMALL ? -int(least_of_lanes(vec2(-turns)).x) : turns;
    // A lane without an item starts past its last pixel.
    int index = exists ? lane : walk.count;
    do {
        add_pairs(slot, walk, index, t, ends, c, radius_squared, scale, inverse_score, s);
        index += STEP;
        --turns;
    } while (turns > 0);
    add_turn(t, ends, s);
    write_sums(s, c, exists && lane == 0, item.index);
}
#endif
