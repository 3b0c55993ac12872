#version 450
#extension GL_GOOGLE_include_directive : require
#ifdef SUBGROUP_RECORDS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
#endif
// Forward, in any mode. If forward_soft.comp serves the frame, this kernel draws only the tiles that have a triangle too thin
// for that kernel. Every pixel sums over its tile's list, in the list's order. The silhouette is a product of complements (eq.
// 5).
// Colour, depth and normal are a softmax by depth with a running maximum (eq. 2 and 3). An entry that is hidden in the whole
// tile contributes to the silhouette only. If the tile is saturated already, it is skipped.
// One workgroup a tile of 8×4 pixels, and 32 / lanes pixels a lane. background.comp writes the tiles without entries.
// Reads `tile_items`, the tile's list and the records. Writes the images and, for backward, `saved` (saved_of in pixel.glsl)
// and `tile_bounds`.
// Compiled three times: forward, for any Vulkan 1.1 device; forward_subgroup, for workgroups of one subgroup with shuffles; and
// forward_long, for tiles whose lists are not in memory (walked_tile.glsl).

// In frames that forward_soft.comp serves, forward_long draws the tiles with a thin triangle.
const bool DRAWS_THIN = true;
const float COLOR_UNIT = 1.0;
#include "common/forward_tile.glsl"

// Adds a fragment to the product of eq. 5, or to what SILHOUETTE_MODE has in its place.
void add_silhouette(inout Cover cover, Fragment f) {
    if (LEAST_APART) {
        // The larger of the two factors goes into the product.
        bool less = f.complement < cover.least;
        cover.covered += cover.transmittance * (less ? cover.most : f.probability);
        cover.transmittance *= less ? cover.least : f.complement;
        cover.least = less ? f.complement : cover.least;
        cover.most = less ? f.probability : cover.most;
    } else if (SILHOUETTE_MODE == SILHOUETTE_PRODUCT) {
        cover.covered += cover.transmittance * f.probability;
        cover.transmittance *= f.complement;
    } else if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        cover.covered += f.probability;
    } else {
        cover.covered = f.probability > 0.5 ? 1.0 : cover.covered;
    }
}

// A fragment's weight D exp(ζ/γ) (eq. 3) relative to the largest so far, and the factor that brings the sums before it to the
// same reference.
struct AddedWeight {
    float weight;
    float keep_old;
};

// Adds a fragment to the denominator of eq. 3. A log weight has an integer part (`exponent`) and a `fraction`. In the hard mode
// the fragment replaces the pixel if it is nearer and covers it.
AddedWeight add_weight(inout Pixel p, int record_index, Fragment f, Corner c, Depth depth, bool shaded, float scale) {
    float difference = (c.exponent - p.exponent) + (depth.weight - p.fraction);
    bool nearer = shaded && difference > 0.0;
    AddedWeight added;
    if (COLOR_MODE == COLOR_SOFTMAX) {
        float e = exp2(-abs(difference));
        added.keep_old = nearer ? e : 1.0;
        added.weight = (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL && !shaded ? 0.0 : f.probability) * (nearer ? 1.0 : e);
    } else {
        float lowest = min(f.height.x, min(f.height.y, f.height.z));
        nearer = nearer && lowest >= -HARD_EDGE_PIXELS * scale;
        added.keep_old = nearer ? 0.0 : 1.0;
        p.nearest = nearer ? record_index : p.nearest;
        added.weight = nearer ? 1.0 : 0.0;
    }
    p.exponent = nearer ? c.exponent : p.exponent;
    p.fraction = nearer ? depth.weight : p.fraction;
    p.sum = p.sum * added.keep_old + added.weight;
    return added;
}

// Adds a fragment's depth, normal, colour C_j and features to the sums of eq. 2. `i` is the number of the pixel.
void add_attributes(int i, inout Pixel p, AddedWeight s, Corner c, vec3 b, float inverse_sum, Depth depth) {
    if (WANT_DEPTH) {
        p.depth = p.depth * s.keep_old + s.weight * (first_depth(c) / frame.score_high) * depth.ratio;
    }
    vec3 mixed = b * (s.weight * inverse_sum);
    vec3 correction = PERSPECTIVE_CORRECT ? correction_of(c, depth) : vec3(1.0);
    mixed = PERSPECTIVE_CORRECT ? mixed * correction : mixed;
    if (WANT_NORMAL) {
        p.normal = p.normal * s.keep_old + c.normal * mixed;
    }
    if (WANT_COLOR) {
        vec3 color = c.color * mixed;
        if (SAMPLING != SAMPLING_NONE) {
            vec3 at = b * inverse_sum;
            at = PERSPECTIVE_CORRECT ? at * correction : at;
            color *= sample_texture(c.texture_index, c.triangle, c.coordinate, at);
        }
        p.color = p.color * s.keep_old + color;
    }
    add_features(i, mixed, s.keep_old);
}

// Whether a fragment contributes to the shaded images. A fragment beyond far does not contribute to the silhouette either. Only
// in the official code it does.
bool is_shaded(inout Fragment f, Corner c, Depth depth, float inverse_score) {
    bool shaded = f.kept && in_depth_range(first_depth(c) * inverse_score * depth.ratio);
    if (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL) {
        // Back faces contribute to the silhouette only. triangle.comp gave them no weight.
        shaded = shaded && (!FRONT_ONLY || c.exponent > -1e38);
    } else if (DEPTH_RANGE == DEPTH_RANGE_FAR) {
        drop_unless(shaded, f);
    }
    return shaded;
}

// The opacity of a fragment: `b` is b̂ before its division by `sum`.
float opacity_at(Corner c, vec3 b, float sum, Depth depth) {
    vec3 at = b / sum;
    at = PERSPECTIVE_CORRECT ? at * correction_of(c, depth) : at;
    vec2 slope;
    return sample_opacity(c.texture_index, c.coordinate, at, slope);
}

// A fragment as the silhouette takes it. The hard silhouette counts it whole or not at all.
Fragment faded_for_silhouette(Fragment f, float alpha) {
    return faded(f, SILHOUETTE_MODE == SILHOUETTE_HARD ? (alpha >= SOLID_OPACITY ? 1.0 : 0.0) : alpha);
}

Pixel first_pixel() {
    return background_pixel();
}

Pixel finished(Pixel p) {
    return p;
}

// The distances of a lane's pixels to a triangle (eq. 1). Unless `live`, all pairs are dropped.
void signed_distances_of(Fetched own, bool live, Triangle t, LaneConstants constants, out SignedDistance distances[PIXELS]) {
    for (int i = 0; i < PIXELS; ++i) {
        vec2 pixel = constants.first + vec2(step_of(i));
        distances[i] = signed_distance_at(t, pixel - t.origin, constants.radius_squared, constants.scale);
        if (DISTANCE == DISTANCE_BARYCENTRIC && OFFICIAL) {
            ivec4 box = texelFetch(boxes, own.record_index);
            distances[i].kept = distances[i].kept && ivec2(pixel) == clamp(ivec2(pixel), box.xy, box.zw);
        }
        distances[i].inside = distances[i].inside && live;
        distances[i].kept = distances[i].kept && live;
    }
}

// Adds a triangle to the silhouettes of a lane's pixels.
void gather_silhouette(Fetched own, bool live, LaneConstants constants, inout Cover covers[PIXELS]) {
    Triangle t = shared_triangle_of(own);
    SignedDistance distances[PIXELS];
    signed_distances_of(own, live, t, constants, distances);
    for (int i = 0; i < PIXELS; ++i) {
        add_silhouette(covers[i], fragment_of(distances[i]));
    }
}

// Adds a triangle to all of a lane's pixels. Every step runs over all pixels before the next step, so that their long chains of
// dependent operations overlap.
void gather(Fetched own, bool live, LaneConstants constants, inout Cover covers[PIXELS], inout Pixel pixels[PIXELS]) {
    Triangle t = shared_triangle_of(own);
    Corner c;
    if (WANT_SHADING) {
        c = shared_corner_of(own);
        read_features(own, false, COLOR_UNIT);
    }
    SignedDistance distances[PIXELS];
    signed_distances_of(own, live, t, constants, distances);
    Fragment fragments[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        fragments[i] = fragment_of(distances[i]);
    }
    vec3 b[PIXELS];
    float sum[PIXELS];
    Depth depth[PIXELS];
    if (WANT_SHADING) {
        EdgeChoice choice = edge_choice_of(t, true);
        for (int i = 0; i < PIXELS; ++i) {
            vec3 height = fragments[i].height;
            NearestPoint nearest = nearest_point(t, choice, height, constants.first + vec2(step_of(i)) - t.origin);
            b[i] = sampled_barycentrics(t, height, nearest);
            sum[i] = b[i].x + b[i].y + b[i].z;
            depth[i] = depth_at(c, b[i], sum[i]);
        }
    }
    bool shaded[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        shaded[i] = is_shaded(fragments[i], c, depth[i], constants.inverse_score);
        Fragment outlined = fragments[i];
        if (OPACITY) {
            float alpha = opacity_at(c, b[i], sum[i], depth[i]);
            outlined = faded_for_silhouette(fragments[i], alpha);
            fragments[i] = faded(fragments[i], alpha);
            // A fragment without weight must not become the reference of the sums.
            shaded[i] = shaded[i] && alpha >= (COLOR_MODE == COLOR_HARD ? SOLID_OPACITY : LEAST_OPACITY);
        }
        if (WANT_SILHOUETTE) {
            add_silhouette(covers[i], outlined);
        }
    }
    if (SHADED) {
        AddedWeight added[PIXELS];
        for (int i = 0; i < PIXELS; ++i) {
            added[i] = add_weight(pixels[i], own.record_index, fragments[i], c, depth[i], shaded[i], constants.scale);
        }
        for (int i = 0; i < PIXELS; ++i) {
            add_attributes(i, pixels[i], added[i], c, b[i], 1.0 / sum[i], depth[i]);
        }
    }
}

// The factor that brings a pixel's sums to the reference of the word that follows. In the hard mode a nearer fragment replaces
// the pixel.
float keep_of(Pixel p, Pixel word) {
    float softened = exp2((p.exponent - word.exponent) + (p.fraction - word.fraction));
    return COLOR_MODE == COLOR_SOFTMAX ? softened : (word.sum > 0.0 ? 0.0 : 1.0);
}

// The mask of the entries that are visible beside sums of at least `least`, among the next WORD_BITS from `from` on.
uint shown_of(int from, int end, float least) {
    uint shown = 0u;
    for (uint i = 0u; i < WORD_BITS; i += gl_WorkGroupSize.x) {
        uint bit = i + gl_LocalInvocationID.x;
        int at = min(from + int(bit), end - 1);
        shown |= is_hidden(largest_weight(entry_at(at)), least) ? 0u : 1u << bit;
    }
    return bits_of_lanes(shown);
}

// The record index of the lowest bit's entry, or of the first entry if there is no bit.
int lowest_record(int from, uint bits) {
    return entry_at(from + max(findLSB(bits), 0));
}

// Adds the entries of a word's bits. It reads one record ahead, because the records of a large mesh miss the cache. The loop
// tests its condition at the end: llvmpipe executes the body once more if it tests at the start. Without a bit the loop runs
// once and adds nothing. `shows` is a constant of the call: without it the entries contribute to the silhouette only.
void gather_word(int from, uint bits, bool shows, LaneConstants constants, inout Pixel pixels[PIXELS]) {
    Cover covers[PIXELS];
    Pixel words[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        covers[i] = Cover(1.0, 0.0, pixels[i].least, 1.0 - pixels[i].least);
        words[i] = word_of(pixels[i]);
    }
    clear_feature_words();
    bool live = bits != 0u;
    Fetched next = fetch_record(lowest_record(from, bits));
    do {
        Fetched own = next;
        bits &= bits - 1u;
        next = fetch_record(lowest_record(from, bits));
        if (shows) {
            gather(own, live, constants, covers, words);
        } else {
            gather_silhouette(own, live, constants, covers);
        }
    } while (bits != 0u);
    for (int i = 0; i < PIXELS; ++i) {
        if (WANT_SILHOUETTE) {
            add_word_cover(covers[i], pixels[i]);
        }
        if (shows && SHADED) {
            float keep = keep_of(pixels[i], words[i]);
            add_word_shaded(words[i], keep, pixels[i]);
            add_word_features(i, keep);
        }
    }
}

bool gather_entries(int from, int stop, float log_count, LaneConstants constants, inout Pixel pixels[PIXELS]) {
    uint all = 0xffffffffu >> uint(from + int(WORD_BITS) - stop);
    vec2 bounds = bounds_of_tile(pixels);
    bool saturated = !WANT_SILHOUETTE || bounds.y <= exp2(NEXT_TO_NOTHING);
    uint shown = all;
    // The silhouette depends on the depths if a triangle crosses the far plane, and on the texture coordinates if a texture has
    // alpha. Only `gather` computes these.
    if (PARTED && ((DEPTH_RANGE != DEPTH_RANGE_FAR && !OPACITY) || saturated)) {
        shown &= shown_of(from, stop, bounds.x - log_count);
    }
    gather_word(from, shown, true, constants, pixels);
    if (PARTED && WANT_SILHOUETTE) {
        gather_word(from, saturated ? 0u : all & ~shown, false, constants, pixels);
    }
    return !SHADED && saturated;
}
