#version 450
#extension GL_GOOGLE_include_directive : require
#ifdef SUBGROUP_RECORDS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
// Forward of the soft model: eq. 1 with the Euclidean distance (soft_distance in distance.glsl), the softmax of eq. 2 and 3,
// and the product of eq. 5. It gives the same as forward.comp, which knows every mode, in three quarters of the time:
// - It measures one edge for a pixel's distance, where forward.comp measures all three.
// - It computes once what a signed distance has in common in the pixels of a row, before the lanes share it.
// - Its sums are relative to an integer log weight, so that a shift of exponents brings them to another.
// - Π(1 - D) over a word is a product of (1 + e) in the denominator: one quotient for 32 entries.
// - It adds two entries at a time, and the lanes hold the record indices of a word.
// forward.comp draws the tiles again that have a triangle so thin that rounding could choose the wrong edge (bin_fine.comp).
// One workgroup a tile of 8×4 pixels, and 32 / lanes pixels a lane.
// Reads `tile_items`, the tile's list and the records. Writes the images and, for backward, `saved` (saved_of in pixel.glsl)
// and `tile_bounds`.
// Compiled three times, as forward.comp is: forward_soft, forward_soft_subgroup and forward_soft_long.

// forward_soft_long draws the tiles without a thin triangle.
const bool DRAWS_THIN = false;
// The factor of the sums of colours and features. It is less than that of the weights, so that a million of the brightest colours
// (Mesh::BRIGHTEST) under the brightest lights stay finite.
const float COLOR_UNIT = 1048576.0;
#include "common/forward_tile.glsl"

// The geometry of an entry of a tile's list. With x the column of a lane's pixel i less origin_x, its signed distance to each
// edge's line is x * normal_x + height[i], and its distance along the edge from the edge's midpoint is x * normal_y + along[i].
struct Entry {
    float origin_x;
    vec3 normal_x;
    vec3 normal_y;
    vec3 height[PIXELS];
    vec3 along[PIXELS];
    vec3 half_length;
    vec3 slopes;
    vec3 inverse_height;
};

// The part of a signed distance, and of the distance along the line, that the pixels of a row have in common. `line` is
// (n.x, n.y, c, g) of edge.glsl, and y is the row less the origin's.
vec2 row_part(vec4 line, float y) {
    return vec2(line.y * y + line.z, line.w - line.x * y);
}

// Every lane computes the parts of its own rows. An entry that is not live is far outside.
void read_entry_by_pixels(Fetched own, bool is_second, bool live, LaneConstants constants, out Entry t) {
    Triangle r = shared_triangle_of(own, is_second);
    r.line0.z = live ? r.line0.z : -1e18;
    t.origin_x = r.origin.x;
    for (int i = 0; i < PIXELS; ++i) {
        float y = constants.first.y - r.origin.y + float(step_of(i).y);
        vec2 a = row_part(r.line0, y);
        vec2 b = row_part(r.line1, y);
        vec2 c = row_part(r.line2, y);
        t.height[i] = vec3(a.x, b.x, c.x);
        t.along[i] = vec3(a.y, b.y, c.y);
    }
    t.normal_x = vec3(r.line0.x, r.line1.x, r.line2.x);
    t.normal_y = vec3(r.line0.y, r.line1.y, r.line2.y);
    t.half_length = r.half_length;
    t.slopes = slopes_of(r.half_length, r.orientation);
    t.inverse_height = r.inverse_height;
}

// If all lanes have the same rows, each lane computes the rows' parts of the one line that it holds. Then the lanes share them.
// With GEOMETRY_PAIRED this serves two records at once, which saves 2 % of this kernel's time.
struct Rows {
    vec2 part[PIXELS];
};

#ifdef SUBGROUP_RECORDS
// The lane holds a texel of one record. `head` is the lane with that record's first texel, and `live` tells whether it is live.
void rows_of(Fetched own, uint head, bool live, LaneConstants constants, out Rows rows) {
    vec4 texel = own.geometry;
    float y = constants.first.y - subgroupShuffle(texel.y, head);
    vec4 line = vec4(texel.xy, live ? texel.z : -1e18, texel.w);
    for (int i = 0; i < PIXELS; ++i) {
        rows.part[i] = row_part(line, y + float(step_of(i).y));
    }
}

void rows_of_first(Fetched first, bool first_live, bool second_live, LaneConstants constants, out Rows rows) {
    bool holds_second = GEOMETRY_PAIRED && gl_SubgroupInvocationID >= uint(GEOMETRY_STRIDE);
    rows_of(first, holds_second ? uint(GEOMETRY_STRIDE) : 0u, holds_second ? second_live : first_live, constants, rows);
}

void rows_of_second(Fetched second, bool live, LaneConstants constants, inout Rows rows) {
    if (!GEOMETRY_PAIRED) {
        rows_of(second, 0u, live, constants, rows);
    }
}

void read_entry_by_rows(Fetched own, Rows rows, bool is_second, out Entry t) {
    vec4 texel = own.geometry;
    uint head = geometry_lane(is_second);
    t.origin_x = subgroupShuffle(texel.x, head);
    for (uint k = 0u; k < 3u; ++k) {
        for (int i = 0; i < PIXELS; ++i) {
            t.height[i][k] = subgroupShuffle(rows.part[i].x, head + k + 1u);
            t.along[i][k] = subgroupShuffle(rows.part[i].y, head + k + 1u);
        }
        t.normal_x[k] = subgroupShuffle(texel.x, head + k + 1u);
        t.normal_y[k] = subgroupShuffle(texel.y, head + k + 1u);
    }
    vec2 tail = shared_tail_of(own, is_second);
    float signed_length = subgroupShuffle(texel.z, head);
    t.half_length = vec3(abs(signed_length), subgroupShuffle(texel.w, head), tail.x);
    t.slopes = slopes_of(t.half_length, orientation_of(signed_length));
    // A triangle without area has other inverse heights, but forward.comp draws its tiles again.
    t.inverse_height = t.half_length * tail.y;
}
#else
void rows_of_first(Fetched first, bool first_live, bool second_live, LaneConstants constants, out Rows rows) {
    rows.part[0] = vec2(0.0);
}

void rows_of_second(Fetched second, bool live, LaneConstants constants, inout Rows rows) {}
#endif

// The first or the second entry of a pair.
void read_entry(Fetched own, Rows rows, bool is_second, bool live, LaneConstants constants, out Entry t) {
#ifdef SUBGROUP_RECORDS
    if (LANES <= int(TILE_WIDTH)) {
        read_entry_by_rows(own, rows, is_second, t);
    } else {
        read_entry_by_pixels(own, is_second, live, constants, t);
    }
#else
    read_entry_by_pixels(own, is_second, live, constants, t);
#endif
}

void measure(Entry t, LaneConstants constants, out SoftDistance d[PIXELS]) {
    float x = constants.first.x - t.origin_x;
    vec3 across = t.normal_x * x;
    vec3 along = t.normal_y * x;
    for (int i = 0; i < PIXELS; ++i) {
        int column = step_of(i).x;
        if (LANES < int(TILE_WIDTH)) {
            across = t.normal_x * (x + float(column));
            along = t.normal_y * (x + float(column));
        }
        soft_distance(across + t.height[i], along + t.along[i], t.half_length, t.slopes, d[i]);
    }
    for (int i = 0; i < PIXELS; ++i) {
        d[i].kept = d[i].inside || d[i].squared < constants.radius_squared;
        float e = exp2(-d[i].squared);
        d[i].e = d[i].kept ? e : 0.0;
    }
}

// The transmittance Π(1 - D) of a word's entries, kept as 2^-inside / (1 + growth) so that neither factor underflows. With
// e = exp(-d²/σ), 1 - D is 1 / (1 + e) outside and e / (1 + e) inside.
struct Transmittance {
    // Π(1 + e) - 1 over all entries.
    float growth;
    // Σ d² log2(e) / σ over the entries that the pixel lies inside.
    float inside;
};

// Π(1 - D) and 1 - Π(1 - D), each exact to its last places. Where the pixel lies inside an entry, 1 - exp2(-inside) may cancel.
// But then the growth is near 1.
Cover cover_of(Transmittance w) {
    float left = exp2(-w.inside);
    float inverse = 1.0 / (1.0 + w.growth);
    return Cover(left * inverse, (w.growth + (1.0 - left)) * inverse, 1.0, 0.0);
}

// The factor of all weights in a pixel's sums. Without it the products of small weights and clipped barycentrics would be
// denormal numbers, each of which costs a processor some hundred cycles.
const float WEIGHT_UNIT = 1152921504606846976.0;

// Adds an entry to a word's product of eq. 5.
void add_transmittance(SoftDistance d[PIXELS], inout Transmittance w[PIXELS]) {
    for (int i = 0; i < PIXELS; ++i) {
        w[i].growth += w[i].growth * d[i].e + d[i].e;
        w[i].inside += d[i].inside ? d[i].squared : 0.0;
    }
}

// 2^x of an integer x of at most 0, made of its bits. Below -126 it is 0.
float power_of_two(float x) {
    return intBitsToFloat((int(greater(x, -127.0)) + 127) << 23);
}

// Adds D exp(ζ/γ) and its products with colour, depth, normal and features to the sums of eq. 2 and 3. The sums are relative to an
// integer log weight that is at least the largest so far. A fragment above it first brings them to its own.
void add_weighted(int i, SoftDistance d, vec3 b, float sum, Depth depth, Corner c, inout Pixel p) {
    float log_weight = depth.weight + c.exponent;
    bool nearer = d.kept && log_weight > p.exponent;
    float exponent = nearer ? ceil(log_weight) : p.exponent;
    float keep = power_of_two(p.exponent - exponent);
    p.exponent = exponent;
    // Only a dropped fragment, which has D = 0, lies above the reference.
    float relative = lesser(depth.weight + (c.exponent - exponent), 1.0);
    float weight = (d.inside ? WEIGHT_UNIT : d.e * WEIGHT_UNIT) * exp2(relative);
    float weight_over_sum = weight / ((1.0 + d.e) * sum);
    vec3 correction = PERSPECTIVE_CORRECT ? correction_of(c, depth) : vec3(1.0);
    vec3 mixed = PERSPECTIVE_CORRECT ? b * weight_over_sum * correction : b * weight_over_sum;
    p.sum = p.sum * keep + weight_over_sum * sum;
    if (WANT_COLOR) {
        vec3 shown = c.color * mixed;
        if (SAMPLING != SAMPLING_NONE) {
            vec3 at = PERSPECTIVE_CORRECT ? b / sum * correction : b / sum;
            shown *= sample_texture(c.texture_index, c.triangle, c.coordinate, at);
        }
        p.color = p.color * keep + shown;
    }
    if (WANT_DEPTH) {
        p.depth = p.depth * keep + weight_over_sum * sum * depth.ratio * (first_depth(c) / frame.score_high);
    }
    if (WANT_NORMAL) {
        p.normal = p.normal * keep + c.normal * mixed;
    }
    add_features(i, mixed, keep);
}

// b̂ before its division by the sum. A pixel inside has no b to clip.
vec3 soft_barycentrics(vec3 inverse_height, SoftDistance d) {
    if (SURFACE_POINT == SURFACE_POINT_CLIP) {
        return clipped_barycentrics(inverse_height, d.height);
    }
    vec3 b = d.height * inverse_height;
    vec3 e = edge_barycentrics(d.on_one, d.on_two, d.t);
    return vec3(d.inside ? b.x : e.x, d.inside ? b.y : e.y, d.inside ? b.z : e.z);
}

// Adds an entry to the shaded images' sums. Every step runs over all pixels before the next step, so that their long chains of
// dependent operations overlap.
void add_shading(Entry t, Corner c, SoftDistance d[PIXELS], inout Pixel pixels[PIXELS]) {
    vec3 b[PIXELS];
    float sum[PIXELS];
    Depth depth[PIXELS];
    c.color *= COLOR_UNIT / WEIGHT_UNIT;
    for (int i = 0; i < PIXELS; ++i) {
        b[i] = soft_barycentrics(t.inverse_height, d[i]);
        sum[i] = b[i].x + b[i].y + b[i].z;
        depth[i] = depth_at(c, b[i], sum[i]);
    }
    for (int i = 0; i < PIXELS; ++i) {
        add_weighted(i, d[i], b[i], sum[i], depth[i], c, pixels[i]);
    }
}

// Adds an entry, the first or the second of a pair, to the pixels' sums. `shows` is a constant of the call: without it the
// entry contributes to the silhouette only.
void add_entry(Fetched own, Rows rows, bool is_second, bool live, bool shows, LaneConstants constants,
               inout Transmittance w[PIXELS], inout Pixel pixels[PIXELS]) {
    Entry t;
    read_entry(own, rows, is_second, live, constants, t);
    SoftDistance d[PIXELS];
    measure(t, constants, d);
    if (WANT_SILHOUETTE) {
        add_transmittance(d, w);
    }
    if (shows && SHADED) {
        read_features(own, is_second, COLOR_UNIT / WEIGHT_UNIT);
        add_shading(t, shared_corner_of(own, is_second), d, pixels);
    }
}

// The record indices of a word's entries: lane l holds those of the bits l, l + LANES, ...
const int HELD = int(WORD_BITS) / LANES;

#ifdef SUBGROUP_RECORDS
// The record index of the lowest bit, or of the first entry if there is no bit.
int lowest_record(int from, uint held[HELD], uint bits) {
    int bit = max(findLSB(bits), 0);
    uint record_index = held[0];
    for (int i = 1; i < HELD; ++i) {
        record_index = bit / LANES == i ? held[i] : record_index;
    }
    return int(subgroupShuffle(record_index, uint(bit % LANES)));
}
#else
int lowest_record(int from, uint held[HELD], uint bits) {
    return entry_at(from + max(findLSB(bits), 0));
}
#endif

// Adds the entries of a word's bits, two at a time, so that the sums move between registers and memory half as often. It reads
// the records two entries ahead. The loop tests its condition at the end: llvmpipe executes the body once more if it tests at
// the start. Without a bit the loop runs once and adds nothing.
void gather_word(int from, uint held[HELD], uint bits, bool shows, LaneConstants constants, inout Pixel pixels[PIXELS]) {
    Transmittance w[PIXELS];
    Pixel words[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        w[i] = Transmittance(0.0, 0.0);
        words[i] = word_of(pixels[i]);
    }
    clear_feature_words();
    bool any = bits != 0u;
    Fetched first;
    Fetched second;
    int next = lowest_record(from, held, bits);
    fetch_pair(next, lowest_record(from, held, bits & (bits - 1u)), shows, first, second);
    do {
        Fetched one = first;
        Fetched other = second;
        bits &= bits - 1u;
        bool both = bits != 0u;
        bits &= bits - 1u;
        next = lowest_record(from, held, bits);
        fetch_pair(next, lowest_record(from, held, bits & (bits - 1u)), shows, first, second);
        Rows rows;
        rows_of_first(one, any, both, constants, rows);
        add_entry(one, rows, false, any, shows, constants, w, words);
        rows_of_second(other, both, constants, rows);
        add_entry(other, rows, true, both, shows, constants, w, words);
    } while (bits != 0u);
    for (int i = 0; i < PIXELS; ++i) {
        if (WANT_SILHOUETTE) {
            add_word_cover(cover_of(w[i]), pixels[i]);
        }
        if (shows && SHADED) {
            float keep = power_of_two(pixels[i].exponent - words[i].exponent);
            add_word_shaded(words[i], keep, pixels[i]);
            add_word_features(i, keep);
        }
    }
}

// Here a pixel has its sums in units of WEIGHT_UNIT, and its colour in units of COLOR_UNIT.
Pixel first_pixel() {
    Pixel p = background_pixel();
    float unit = WEIGHT_UNIT * exp2(p.fraction);
    p.fraction = 0.0;
    p.sum *= unit;
    p.color *= unit * (COLOR_UNIT / WEIGHT_UNIT);
    return p;
}

// The pixel with its sums in true units.
Pixel finished(Pixel p) {
    p.sum /= WEIGHT_UNIT;
    p.color /= COLOR_UNIT;
    p.depth /= WEIGHT_UNIT;
    p.normal /= WEIGHT_UNIT;
    return p;
}

bool gather_entries(int from, int stop, float log_count, LaneConstants constants, inout Pixel pixels[PIXELS]) {
    uint all = 0xffffffffu >> uint(from + int(WORD_BITS) - stop);
    vec2 bounds = bounds_of_tile(pixels);
    bool saturated = !WANT_SILHOUETTE || bounds.y <= exp2(NEXT_TO_NOTHING);
    uint held[HELD];
    uint shown = 0u;
    for (int i = 0; i < HELD; ++i) {
        int bit = i * LANES + int(gl_LocalInvocationID.x);
        held[i] = uint(entry_at(min(from + bit, stop - 1)));
        if (SHADED) {
            shown |= is_hidden(largest_weight(int(held[i])), bounds.x - log_count) ? 0u : 1u << uint(bit);
        }
    }
    shown = SHADED ? bits_of_lanes(shown) & all : all;
    gather_word(from, held, shown, true, constants, pixels);
    if (SHADED && WANT_SILHOUETTE) {
        gather_word(from, held, saturated ? 0u : all & ~shown, false, constants, pixels);
    }
    return !SHADED && saturated;
}
