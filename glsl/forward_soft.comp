#version 450
#extension GL_GOOGLE_include_directive : require
#ifdef SUBGROUP_RECORDS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
// Forward of the soft model: eq. 1 with the Euclidean distance, the softmax of eq. 2 and 3, and the product of eq. 5. It
// gives the same as forward.comp, which knows every mode, in three quarters of its time:
// - One edge decides a pixel's distance (nearest_edge in entry.glsl), where forward.comp measures all three.
// - What the pixels of a row have in common of a signed distance is computed once, before the lanes share it.
// - Sums are relative to an integer log weight, so that bringing them to another is a shift of exponents.
// - Π(1 - D) over a word is a product of (1 + e) in the denominator: one quotient for 32 entries.
// - Entries are added two at a time, and the lanes hold the record indices of a word.
// A tile with a triangle so thin that rounding could choose the wrong edge is drawn by forward.comp (bin_fine.comp).
// One workgroup a tile of 8×4 pixels, each lane 32 / lanes of them.
// Reads `tile_items`, the tile's list and the records; writes the images and, for backward, `saved` (saved_of in pixel.glsl) and
// `tile_bounds`.
// Compiled three times, as forward.comp is: forward_soft, forward_soft_subgroup and forward_soft_long.

#include "common/forward_tile.glsl"
#include "common/entry.glsl"

// What a word's entries leave of a pixel: Π(1 + e) - 1 over all of them, and Σ d² over those that the pixel lies inside, so that
// their Π(1 - D) is exp2(-inside) / (1 + growth): with e = exp(-d²/σ), 1 - D is 1 / (1 + e) outside and e / (1 + e) inside.
struct Transmittance {
    float growth;
    float inside;
};

// Both are exact to their own last places: where the pixel lies inside of an entry, 1 - exp2(-inside) may cancel, but then
// the growth is near 1.
Cover cover_of(Transmittance w) {
    float left = exp2(-w.inside);
    float inverse = 1.0 / (1.0 + w.growth);
    return Cover(left * inverse, (w.growth + (1.0 - left)) * inverse, 1.0, 0.0);
}

// The factor of all weights in a pixel's sums while they are summed. Without it the products of small weights and clipped
// barycentrics would be denormal numbers, which cost a processor some hundred cycles each.
const float WEIGHT_UNIT = 1152921504606846976.0;
// The factor of the colours' sums, less than that of the weights: a million of the brightest colours (Mesh::BRIGHTEST) under the
// brightest lights stay finite.
const float COLOR_UNIT = 1048576.0;

// Eq. 5 over the entries of a word.
void add_transmittance(EntryDistance d[PIXELS], inout Transmittance w[PIXELS]) {
    for (int i = 0; i < PIXELS; ++i) {
        w[i].growth += w[i].growth * d[i].e + d[i].e;
        w[i].inside += d[i].inside ? d[i].squared : 0.0;
    }
}

// 2^x of an integer x of at most 0, by its bits; 0 below -126.
float power_of_two(float x) {
    return intBitsToFloat((int(greater(x, -127.0)) + 127) << 23);
}

// Adds D exp(ζ/γ) and its products with colour, depth and normal to the sums of eq. 2 and 3. They are relative to an integer
// log weight, at least the largest so far: a fragment above it brings them to its own first.
void add_weighted(EntryDistance d, vec3 b, float sum, Depth depth, Corner c, inout Pixel p) {
    float log_weight = depth.weight + c.exponent;
    bool nearer = d.kept && log_weight > p.exponent;
    float exponent = nearer ? ceil(log_weight) : p.exponent;
    float keep = power_of_two(p.exponent - exponent);
    p.exponent = exponent;
    // Only a dropped fragment, with D = 0, lies above the reference.
    float relative = lesser(depth.weight + (c.exponent - exponent), 1.0);
    float weight = (d.inside ? WEIGHT_UNIT : d.e * WEIGHT_UNIT) * exp2(relative);
    float weight_over_sum = weight / ((1.0 + d.e) * sum);
    // z / z_k = (z / z_0) (z_0 / z_k)
    vec3 correction = PERSPECTIVE_CORRECT ? depth.ratio * vec3(1.0, 1.0 + c.depth.x, 1.0 + c.depth.y) : vec3(1.0);
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
        p.depth = p.depth * keep + weight_over_sum * sum * depth.ratio * (c.depth.z / frame.score_high);
    }
    if (WANT_NORMAL) {
        p.normal = p.normal * keep + c.normal * mixed;
    }
}

// Every step runs over all pixels before the next, so that their long chains of dependent operations overlap.
void add_shading(Entry t, Corner c, EntryDistance d[PIXELS], inout Pixel pixels[PIXELS]) {
    vec3 b[PIXELS];
    float sum[PIXELS];
    Depth depth[PIXELS];
    c.color *= COLOR_UNIT / WEIGHT_UNIT;
    for (int i = 0; i < PIXELS; ++i) {
        b[i] = clipped_barycentrics(t.inverse_height, d[i].height);
        sum[i] = b[i].x + b[i].y + b[i].z;
        depth[i] = depth_at(c.depth, b[i], sum[i]);
    }
    for (int i = 0; i < PIXELS; ++i) {
        add_weighted(d[i], b[i], sum[i], depth[i], c, pixels[i]);
    }
}

// Adds an entry, the first or the second of a pair, to the pixels' sums; `shows` is a constant of the call: without it the
// entry contributes to the silhouette only.
void add_entry(Fetched own, Rows rows, bool is_second, bool live, bool shows, Lane lane, inout Transmittance w[PIXELS],
               inout Pixel pixels[PIXELS]) {
    Entry t;
    read_entry(own, rows, is_second, live, lane, t);
    EntryDistance d[PIXELS];
    measure(t, lane, d);
    if (WANT_SILHOUETTE) {
        add_transmittance(d, w);
    }
    if (shows && SHADED) {
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

// Adds the entries of a word's bits, two at a time: half as often do the sums move between registers and memory. The records
// are read two entries ahead. The loop tests its condition at the end, because llvmpipe executes the body once more when it
// tests at the start; without a bit it runs once and adds nothing.
void gather_word(int from, uint held[HELD], uint bits, bool shows, Lane lane, inout Pixel pixels[PIXELS]) {
    Transmittance w[PIXELS];
    Pixel words[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        w[i] = Transmittance(0.0, 0.0);
        words[i] = word_of(pixels[i]);
    }
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
        rows_of_first(one, any, both, lane, rows);
        add_entry(one, rows, false, any, shows, lane, w, words);
        rows_of_second(other, both, lane, rows);
        add_entry(other, rows, true, both, shows, lane, w, words);
    } while (bits != 0u);
    for (int i = 0; i < PIXELS; ++i) {
        if (WANT_SILHOUETTE) {
            add_word_cover(cover_of(w[i]), pixels[i]);
        }
        if (shows && SHADED) {
            add_word_shaded(words[i], power_of_two(pixels[i].exponent - words[i].exponent), pixels[i]);
        }
    }
}

// With its sums in units of WEIGHT_UNIT, and of COLOR_UNIT.
Pixel first_pixel() {
    Pixel p = background_pixel();
    float unit = WEIGHT_UNIT * exp2(p.fraction);
    p.fraction = 0.0;
    p.sum *= unit;
    p.color *= unit * (COLOR_UNIT / WEIGHT_UNIT);
    return p;
}

// The pixel with its sums in their true units.
Pixel finished(Pixel p) {
    p.sum /= WEIGHT_UNIT;
    p.color /= COLOR_UNIT;
    p.depth /= WEIGHT_UNIT;
    p.normal /= WEIGHT_UNIT;
    return p;
}

// Adds up to WORD_BITS entries, all of them front faces or all back faces; what is hidden among them depends on the entries
// before. `share` is log2 of the list's length: the share of one entry, so that all hidden entries together are negligible.
// Returns whether the entries after these can be left out.
bool gather_entries(int from, int stop, float log_count, Lane lane, inout Pixel pixels[PIXELS]) {
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
    gather_word(from, held, shown, true, lane, pixels);
    if (SHADED && WANT_SILHOUETTE) {
        gather_word(from, held, saturated ? 0u : all & ~shown, false, lane, pixels);
    }
    return !SHADED && saturated;
}

#ifdef WALKED
// In frames of the soft model it draws the tiles without a thin triangle.
const bool DRAWS_THIN = false;
#include "common/walked_tile.glsl"
#else
#include "common/listed_tile.glsl"
#endif
