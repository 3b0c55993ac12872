// Backward: every triangle gathers, over the pixels of its box, the derivative of the loss by its corners (pixels and
// depth), corner colours, texture coordinates and normals, and by sigma and gamma. No atomics, so the same bits always.
// One workgroup an item, one item a triangle, its lanes taking the box's pixels in turn; a box larger than a cell has an
// item for every cell, the later ones behind the first items of all slots (`cells`). The lanes' sums are added in a fixed
// order.
// Reads the records, `boxes`, `cells` and `pixel_gradients`; writes `partials`. See triangle_grad.comp for what follows.

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform isamplerBuffer boxes;
layout(set = 0, binding = 2) uniform usamplerBuffer cells;
layout(set = 0, binding = 3) uniform samplerBuffer geometry;
layout(set = 0, binding = 4) uniform samplerBuffer shading;
layout(set = 0, binding = 5) uniform usamplerBuffer textures;
layout(set = 0, binding = 6) uniform samplerBuffer texels;
layout(set = 0, binding = 7) uniform samplerBuffer pixel_gradients;
layout(set = 0, binding = 8, std430) writeonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 9, std430) buffer TexelSums { uint texel_sums[]; };
layout(set = 0, binding = 10) uniform usamplerBuffer status;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/fragment.glsl"
#include "common/sample.glsl"
#include "common/corner.glsl"
#include "common/shared_records.glsl"

#ifndef SUBGROUP_RECORDS
shared vec4 lane_sums[gl_WorkGroupSize.x];
#endif

struct Sums {
    // dL/d(column, row) of each corner, in pixels.
    vec2 corner[3];
    // Σ dL/dz (z/z_0)² b̂, which times (z_0/z_k)² is dL/dz_k.
    vec3 depth;
    // Σ dL/dx x and Σ dL/ds (log2 weight relative to the pixel's).
    float sigma;
    float gamma;
    mat3 color;
    mat3x2 coordinate;
    mat3 normal;
};

// What a triangle's pairs share beyond its record: where along each edge its second end lies.
struct Ends {
    vec3 start;
    vec3 slope;
};

// t = start + slope · (distance along the edge from its midpoint) runs from 0 at an edge's first corner to 1 at its
// second. The end lines of a segment without area are corners themselves: t is 0 or 1 throughout.
Ends ends_of(Triangle t) {
    Ends e;
    e.start = vec3(0.5);
    bvec3 flat_line = lessThan(t.inverse_height, vec3(0.0));
    // The lines of a segment do not tell; it has the positive one.
    bool turned = t.line0.x * t.line1.y - t.line0.y * t.line1.x < 0.0 && !any(flat_line);
    float orientation = turned ? -1.0 : 1.0;
    for (int k = 0; k < 3; ++k) {
        int before = k == 0 ? 2 : k - 1;
        e.start[k] = flat_line[k] ? (flat_line[before] ? 1.0 : 0.0) : 0.5;
        e.slope[k] = t.half_length[k] > 0.0 ? 0.5 * orientation / t.half_length[k] : 0.0;
    }
    return e;
}

// x clamped to ±limit.
float between(float x, float limit) {
    return lesser(greater(x, -limit), limit);
}

// d² by the corners: with the nearest boundary point Σ β_k p_k, ∂d²/∂p_k = 2 β_k (nearest point - pixel).
void distance_gradient(Triangle t, Ends ends, vec2 q, vec3 height, float by_squared, inout Sums s) {
    vec3 along = vec3(t.line0.y * q.x - t.line0.x * q.y + t.line0.w, t.line1.y * q.x - t.line1.x * q.y + t.line1.w,
                      t.line2.y * q.x - t.line2.x * q.y + t.line2.w);
    vec3 on = vec3(between(along.x, t.half_length.x), between(along.y, t.half_length.y),
                   between(along.z, t.half_length.z));
    vec3 beyond = along - on;
    vec3 squared = height * height + beyond * beyond;
    bool first = squared.x <= squared.y && squared.x <= squared.z;
    bool second = !first && squared.y <= squared.z;
    vec4 line = first ? t.line0 : (second ? t.line1 : t.line2);
    float h = first ? height.x : (second ? height.y : height.z);
    float o = first ? beyond.x : (second ? beyond.y : beyond.z);
    vec3 share = ends.start + ends.slope * on;
    float u = first ? share.x : (second ? share.y : share.z);
    float v = 1.0 - u;
    vec3 beta = first ? vec3(0.0, v, u) : (second ? vec3(u, 0.0, v) : vec3(v, u, 0.0));
    vec2 pull = -2.0 * by_squared * (h * line.xy + o * vec2(line.y, -line.x));
    s.corner[0] += beta.x * pull;
    s.corner[1] += beta.y * pull;
    s.corner[2] += beta.z * pull;
}

// From b̂ = clamp(b) / sum and b's dependence on the corners: ∂b_k/∂p_m = -b_m ∇b_k.
void barycentric_gradient(Triangle t, vec3 height, vec3 share, float inverse_sum, vec3 by_share, inout Sums s) {
    vec3 b = height * t.inverse_height;
    vec3 by_clipped = (by_share - dot(by_share, share)) * inverse_sum;
    // Where b is clamped nothing moves, however large it has become.
    bool free0 = b.x > 0.0 && b.x < 1.0;
    bool free1 = b.y > 0.0 && b.y < 1.0;
    bool free2 = b.z > 0.0 && b.z < 1.0;
    vec3 by_b = by_clipped * t.inverse_height;
    by_b = vec3(free0 ? by_b.x : 0.0, free1 ? by_b.y : 0.0, free2 ? by_b.z : 0.0);
    vec2 h = by_b.x * t.line0.xy + by_b.y * t.line1.xy + by_b.z * t.line2.xy;
    s.corner[0] -= b.x * h;
    s.corner[1] -= b.y * h;
    s.corner[2] -= b.z * h;
    bvec3 flat_line = lessThan(t.inverse_height, vec3(0.0));
    if (any(flat_line)) {
        // The nearest point of a segment is where its normal meets it, which turns with it: ∂t/∂p_b has the distance
        // over the squared length across the segment too.
        vec4 line = !flat_line.x ? t.line0 : (!flat_line.y ? t.line1 : t.line2);
        float distance = !flat_line.x ? height.x : (!flat_line.y ? height.y : height.z);
        float half_length = !flat_line.x ? t.half_length.x : (!flat_line.y ? t.half_length.y : t.half_length.z);
        vec3 side = !flat_line.x ? vec3(0.0, -1.0, 1.0) : (!flat_line.y ? vec3(1.0, 0.0, -1.0) : vec3(-1.0, 1.0, 0.0));
        vec3 by = vec3(free0 ? by_clipped.x : 0.0, free1 ? by_clipped.y : 0.0, free2 ? by_clipped.z : 0.0);
        vec2 turn = line.xy * (0.25 * distance * dot(by, side) / max(half_length * half_length, 1e-30));
        s.corner[0] += side.x * turn;
        s.corner[1] += side.y * turn;
        s.corner[2] += side.z * turn;
    }
}

// Adds to a 64-bit fixed-point number, low word first: integers add to the same bits in any order.
void add_texel(int texel, vec3 value) {
    for (int channel = 0; channel < 3; ++channel) {
        float scaled = abs(value[channel]) * frame.texel_scale;
        float upper = floor(scaled * (1.0 / 4294967296.0));
        uint high = uint(upper);
        uint low = uint(scaled - upper * 4294967296.0);
        if (value[channel] < 0.0) {
            low = ~low + 1u;
            high = ~high + (low == 0u ? 1u : 0u);
        }
        int at = 2 * (3 * texel + channel);
        uint old = atomicAdd(texel_sums[at], low);
        atomicAdd(texel_sums[at + 1], high + (old + low < old ? 1u : 0u));
    }
}

// Gives dL/dsample to the texels that made the sample.
void scatter_texels(int index, int triangle, mat3x2 coordinate, vec3 b, vec3 by_sample) {
    uvec4 entry = texelFetch(textures, index);
    if (entry.w == TEXTURE_SURFACE) {
        int resolution = int(entry.y);
        int cell = surface_cell(surface_barycentrics(coordinate, b), resolution);
        // The official backward pass gives a triangle's own cells gradients, none else.
        if (cell < resolution * resolution) {
            add_texel(int(entry.x) + triangle * resolution * resolution + cell, by_sample);
        }
    } else {
        Footprint f = footprint_of(entry, coordinate * b);
        for (int i = 0; i < 4; ++i) {
            add_texel(f.texel[i], by_sample * f.weight[i]);
        }
    }
}

// Barycentric distance: x = ± m² / sigma with m the smallest barycentric, ∂b_k/∂p_m = -b_m ∇b_k.
void barycentric_distance_gradient(Triangle t, vec3 height, float by_x, inout Sums s) {
    vec3 b = height * t.inverse_height;
    bool first = b.x <= b.y && b.x <= b.z;
    bool second = !first && b.y <= b.z;
    float least = first ? b.x : (second ? b.y : b.z);
    vec4 line = first ? t.line0 : (second ? t.line1 : t.line2);
    float inverse = first ? t.inverse_height.x : (second ? t.inverse_height.y : t.inverse_height.z);
    const float LN2 = 0.69314718056;
    vec2 pull = line.xy * (inverse * 2.0 * abs(least) * frame.barycentric_scale * LN2 * by_x);
    s.corner[0] -= b.x * pull;
    s.corner[1] -= b.y * pull;
    s.corner[2] -= b.z * pull;
}

// The colour path of one pair: by corner colours, texture coordinates and texels. Returns dL/db̂ per corner and the
// fragment's G · C; `mixed` are b̂, perspective-corrected where asked.
vec3 color_gradient(Corner c, vec3 mixed, vec3 by_color, float weight, out float value, inout Sums s) {
    vec3 sampled = vec3(1.0);
    vec3 light = c.color * mixed;
    vec3 by_coordinate_mixed = vec3(0.0);
    if (SAMPLING != SAMPLING_NONE) {
        mat2x3 slope;
        sampled = sample_with_slope(c.texture_index, c.triangle, c.coordinate, mixed, slope);
        vec3 by_sample = by_color * light;
        vec2 by_coordinate = vec2(dot(by_sample, slope[0]), dot(by_sample, slope[1]));
        by_coordinate_mixed = by_coordinate * c.coordinate;
        if (GRAD_COORDINATE) {
            for (int k = 0; k < 3; ++k) {
                s.coordinate[k] += by_coordinate * (weight * mixed[k]);
            }
        }
        if ((GRADIENTS & GRADIENT_TEXEL) != 0u && weight > 0.0) {
            scatter_texels(c.texture_index, c.triangle, c.coordinate, mixed, by_sample * weight);
        }
    }
    vec3 by_light = by_color * sampled;
    value = dot(by_light, light);
    if (GRAD_COLOR) {
        s.color[0] += by_light * (weight * mixed.x);
        s.color[1] += by_light * (weight * mixed.y);
        s.color[2] += by_light * (weight * mixed.z);
    }
    return by_light * c.color + by_coordinate_mixed;
}

// z_0 / z_k of each corner.
vec3 nearness(Corner c) {
    return vec3(1.0, 1.0 + c.depth.x, 1.0 + c.depth.y);
}

void add_pair(int slot, Triangle t, Ends ends, Corner c, vec2 q, int pixel, float radius_squared, float scale,
              float inverse_score, inout Sums s) {
    vec4 entry = texelFetch(pixel_gradients, pixel * PIXEL_STRIDE);
    Fragment f = fragment_at(t, q, radius_squared, scale);
    vec3 b = vec3(0.0);
    float sum = 1.0;
    Depth depth = Depth(1.0, 0.0);
    bool shaded = f.kept;
    if (WANT_SHADING) {
        b = clipped_barycentrics(t, f.height);
        sum = b.x + b.y + b.z;
        depth = depth_at(c.depth, b, sum);
    }
    if (DEPTH_RANGE != DEPTH_RANGE_INSIDE) {
        float z = c.depth.z * inverse_score * depth.ratio;
        shaded = shaded && z <= frame.far_high;
        if (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL) {
            shaded = shaded && z >= frame.near_high;
        }
        // The official backward pass gives what its colour leaves out no gradient at all.
        if (DEPTH_RANGE == DEPTH_RANGE_FAR || PAPER) {
            f.probability = shaded ? f.probability : 0.0;
            f.complement = shaded ? f.complement : 1.0;
        }
    }
    // ∂A/∂x without its pixel's factor; x is the signed distance over sigma.
    float by_x = UP_ALPHA ? entry.a * f.probability : 0.0;
    if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        by_x *= f.complement;
    }
    if (UP_SHADED) {
        vec4 weights = texelFetch(pixel_gradients, pixel * PIXEL_STRIDE + 1);
        float relative = (c.whole - weights.x) + (depth.weight - weights.y);
        // Beyond 2¹⁰⁰ only what takes no part lies, with D = 0.
        float weight = (shaded ? f.probability : 0.0) * exp2(lesser(relative, 100.0));
        if (COLOR_MODE == COLOR_HARD) {
            weight = shaded && vec2(slot >> 12, slot & 4095) == weights.xy ? 1.0 : 0.0;
        }
        float inverse_sum = 1.0 / sum;
        vec3 share = b * inverse_sum;
        vec3 correction = depth.ratio * nearness(c);
        vec3 mixed = PERSPECTIVE_CORRECT ? share * correction : share;
        float value = 0.0;
        vec3 by_mixed = vec3(0.0);
        if (UP_COLOR) {
            by_mixed = color_gradient(c, mixed, entry.rgb, weight, value, s);
        }
        float z = c.depth.z * inverse_score * depth.ratio;
        if (UP_DEPTH) {
            value += weights.w * z;
        }
        if (UP_NORMAL) {
            vec3 up = texelFetch(pixel_gradients, pixel * PIXEL_STRIDE + 2).xyz;
            vec3 by_normal = up * c.normal;
            value += dot(by_normal, mixed);
            by_mixed += by_normal;
            if (GRAD_NORMAL) {
                s.normal[0] += up * (weight * mixed.x);
                s.normal[1] += up * (weight * mixed.y);
                s.normal[2] += up * (weight * mixed.z);
            }
        }
        // ∂L/∂s = w (v - V), s the logarithm of the weight.
        // The hard mode has no weight to change.
        float by_weight = COLOR_MODE == COLOR_SOFTMAX ? weight * (value - weights.z) : 0.0;
        by_x += by_weight * f.complement;
        if (GRAD_SCALARS) {
            s.gamma += by_weight * relative;
        }
        if (GRAD_GEOMETRY) {
            const float LN2 = 0.69314718056;
            float by_z = (UP_DEPTH ? weight * weights.w : 0.0) - by_weight * frame.score_high * LN2;
            if (PERSPECTIVE_CORRECT) {
                // Σ b̂ c z/z_k depends on z itself and on each z_k.
                by_z += weight * dot(by_mixed, mixed) / z;
                s.depth -= by_mixed * mixed * (weight * depth.ratio / z) / nearness(c);
            }
            s.depth += share * (by_z * depth.ratio * depth.ratio);
            if (!PAPER) {
                // ∂z/∂b̂_k = -z²/z_k
                vec3 by_share = PERSPECTIVE_CORRECT ? by_mixed * correction : by_mixed;
                barycentric_gradient(t, f.height, share, inverse_sum, by_share * weight - correction * (by_z * z), s);
            }
        }
    }
    if (DISTANCE == DISTANCE_HARD) {
        return;
    }
    float signed_unit = f.probability >= f.complement ? 1.0 : -1.0;
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        const float LN2 = 0.69314718056;
        if (GRAD_GEOMETRY) {
            distance_gradient(t, ends, q, f.height, signed_unit * LN2 * by_x, s);
        }
    } else if (GRAD_GEOMETRY) {
        barycentric_distance_gradient(t, f.height, by_x, s);
    }
    if (GRAD_SCALARS) {
        // x = log(D / (1 - D)); where D vanishes by_x does too.
        s.sigma += by_x * log(max(f.probability, 1e-37) / max(f.complement, 1e-37));
    }
}

// The pixels of an item: its triangle's box, or one cell of it.
ivec4 item_pixels(int slot, int cell) {
    ivec4 box = texelFetch(boxes, slot);
    int columns = (box.z - box.x) / int(CELL_WIDTH) + 1;
    ivec2 first = box.xy + ivec2(cell % columns, cell / columns) * ivec2(CELL_WIDTH, CELL_HEIGHT);
    return ivec4(first, min(box.zw, first + ivec2(CELL_WIDTH, CELL_HEIGHT) - 1));
}

Sums no_sums() {
    Sums s;
    s.corner[0] = s.corner[1] = s.corner[2] = vec2(0.0);
    s.depth = vec3(0.0);
    s.sigma = 0.0;
    s.gamma = 0.0;
    s.color = mat3(0.0);
    s.coordinate = mat3x2(0.0);
    s.normal = mat3(0.0);
    return s;
}

// Adds the lanes' values in a fixed order; lane 0 has the sum.
vec4 add_lanes(vec4 value) {
#ifdef SUBGROUP_RECORDS
    value += subgroupShuffleXor(value, 4u);
    value += subgroupShuffleXor(value, 2u);
    return value + subgroupShuffleXor(value, 1u);
#else
    uint lane = gl_LocalInvocationID.x;
    barrier();
    lane_sums[lane] = value;
    for (uint width = gl_WorkGroupSize.x / 2u; width > 0u; width /= 2u) {
        barrier();
        if (lane < width) {
            lane_sums[lane] += lane_sums[lane + width];
        }
    }
    return lane_sums[0];
#endif
}

void put(bool writes, int at, vec4 value) {
    vec4 sum = add_lanes(value);
    if (writes) {
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

void main() {
    uint group = gl_WorkGroupID.z * FORWARD_ROW + gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationID.x;
    uint item = group;
    uint slots = frame.slot_count;
    uint extra = min(texelFetch(status, int(STATUS_CELLS_NEEDED)).x, frame.cell_capacity);
    if (item >= slots + extra) {
        return;
    }
    // (slot, cell) of the items behind the slots' first ones.
    uvec2 entry = item < slots ? uvec2(item, 0u) : texelFetch(cells, int(item - slots)).xy;
    int slot = int(entry.x);
    ivec4 pixels = item_pixels(slot, int(entry.y));
    int width = pixels.z - pixels.x + 1;
    int count = width > 0 ? width * max(pixels.w - pixels.y + 1, 0) : 0;
    float inverse_width = 1.0 / float(max(width, 1));
    Triangle t = shared_triangle_of(slot);
    Ends ends = ends_of(t);
    Corner c;
    if (WANT_SHADING) {
        c = shared_corner_of(slot);
    }
    // Slots lie in the order of the views.
    int view = view_of(slot);
    int image = view * int(frame.height);
    int image_width = int(frame.width);
    float radius_squared = frame.radius_squared;
    float scale = frame.scale;
    float inverse_score = 1.0 / frame.score_high;
    Sums s = no_sums();
    for (int i = int(lane); i < count; i += int(gl_WorkGroupSize.x)) {
        int y = int((float(i) + 0.5) * inverse_width);
        ivec2 where = pixels.xy + ivec2(i - y * width, y);
        add_pair(slot, t, ends, c, vec2(where) - t.origin, (image + where.y) * image_width + where.x, radius_squared, scale,
                 inverse_score, s);
    }
    write_sums(s, c, lane == 0u, int(item));
}
