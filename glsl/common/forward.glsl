// Forward: every pixel gathers over its tile's triangles in ascending order: silhouette as a product of complements,
// colour, depth and normal as a softmax by depth with a running maximum.
// One workgroup a tile of 8×4 pixels that some triangle may touch, each lane 32 / lanes of them; the others' pixels are
// background already. Tiles are taken even ones first, since a driver that gives each core one contiguous half of the
// workgroups would else leave one idle.
// Reads `tile_items`, `tile_slots` and the records; writes the images, and for backward `saved`: the log2 weight
// that the softmax is relative to (whole part and rest; of the hard mode the slot), its inverse sum, and the
// transmittance; and `tile_bounds`: the smallest log2 sum of a tile's pixels and their largest transmittance.


layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer tile_items;
layout(set = 0, binding = 2) uniform usamplerBuffer tile_slots;
layout(set = 0, binding = 3) uniform samplerBuffer geometry;
layout(set = 0, binding = 4) uniform samplerBuffer shading;
layout(set = 0, binding = 5) uniform usamplerBuffer textures;
layout(set = 0, binding = 6) uniform samplerBuffer texels;
layout(set = 0, binding = 7, std430) writeonly buffer Color { vec4 color[]; };
layout(set = 0, binding = 8, std430) writeonly buffer Silhouette { float silhouette[]; };
layout(set = 0, binding = 9, std430) writeonly buffer Depths { float depths[]; };
layout(set = 0, binding = 10, std430) writeonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 11, std430) writeonly buffer Saved { vec4 saved[]; };
layout(set = 0, binding = 12, std430) writeonly buffer TileBounds { vec2 tile_bounds[]; };
layout(set = 0, binding = 13) uniform isamplerBuffer boxes;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/fragment.glsl"
#include "common/sample.glsl"
#include "common/corner.glsl"
#include "common/shared_records.glsl"
#include "common/lanes.glsl"

const int TILE_PIXELS = int(TILE_WIDTH * TILE_HEIGHT);
const int PIXELS = TILE_PIXELS / int(gl_WorkGroupSize.x);

struct Pixel {
    // Π(1 - D); or Σ D; or 1 where any D > 1/2, as SILHOUETTE_MODE says.
    float silhouette;
    // The largest log2 depth weight so far, as whole part and rest, and sums relative to it.
    float whole;
    float rest;
    float sum;
    vec3 color;
    float depth;
    vec3 normal;
    // The hard modes' nearest slot.
    int nearest;
};

Pixel background_pixel() {
    Pixel p;
    p.silhouette = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 : 0.0;
    bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
    p.whole = entry ? frame.background_whole : -3e38;
    p.rest = entry ? frame.background_rest : 0.0;
    p.sum = entry ? 1.0 : 0.0;
    p.color = entry ? vec3(frame.background_red, frame.background_green, frame.background_blue) : vec3(0.0);
    p.depth = 0.0;
    p.normal = vec3(0.0);
    p.nearest = 0;
    return p;
}

void add_silhouette(inout Pixel p, Fragment f) {
    if (SILHOUETTE_MODE == SILHOUETTE_PRODUCT) {
        p.silhouette *= f.complement;
    } else if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        p.silhouette += f.probability;
    } else {
        p.silhouette = f.probability > 0.5 ? 1.0 : p.silhouette;
    }
}

// What a fragment weighs in its pixel, relative to the largest weight so far, and what becomes of the sums before it.
struct Share {
    float weight;
    float keep_old;
};

// Moves the softmax on to one more fragment; in the hard mode that replaces the pixel when it is nearer and covers it.
Share add_weight(inout Pixel p, int slot, Fragment f, Corner c, Depth depth, bool kept, float scale) {
    float difference = (c.whole - p.whole) + (depth.weight - p.rest);
    bool nearer = kept && difference > 0.0;
    Share share;
    if (COLOR_MODE == COLOR_SOFTMAX) {
        float e = exp2(-abs(difference));
        share.keep_old = nearer ? e : 1.0;
        share.weight = (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL && !kept ? 0.0 : f.probability) * (nearer ? 1.0 : e);
    } else {
        float lowest = min(f.height.x, min(f.height.y, f.height.z));
        nearer = nearer && lowest >= -HARD_EDGE_PIXELS * scale;
        share.keep_old = nearer ? 0.0 : 1.0;
        p.nearest = nearer ? slot : p.nearest;
        share.weight = nearer ? 1.0 : 0.0;
    }
    p.whole = nearer ? c.whole : p.whole;
    p.rest = nearer ? depth.weight : p.rest;
    p.sum = p.sum * share.keep_old + share.weight;
    return share;
}

// Adds what a fragment shows.
void add_shaded(inout Pixel p, Share s, Corner c, vec3 b, float inverse_sum, Depth depth) {
    if (WANT_DEPTH) {
        p.depth = p.depth * s.keep_old + s.weight * (c.depth.z / frame.score_high) * depth.ratio;
    }
    vec3 share = b * (s.weight * inverse_sum);
    // Perspective-correct: z / z_k = (z / z_0) (z_0 / z_k).
    vec3 correction = PERSPECTIVE_CORRECT ? depth.ratio * vec3(1.0, 1.0 + c.depth.x, 1.0 + c.depth.y) : vec3(1.0);
    share = PERSPECTIVE_CORRECT ? share * correction : share;
    if (WANT_NORMAL) {
        p.normal = p.normal * s.keep_old + c.normal * share;
    }
    if (WANT_COLOR) {
        vec3 color = c.color * share;
        if (SAMPLING != SAMPLING_NONE) {
            vec3 at = b * inverse_sum;
            at = PERSPECTIVE_CORRECT ? at * correction : at;
            color *= sample_texture(c.texture_index, c.triangle, c.coordinate, at);
        }
        p.color = p.color * s.keep_old + color;
    }
}

// Whether a fragment takes part in the shaded images; beyond far it does not in the silhouette either.
bool judge_depth(inout Fragment f, Corner c, Depth depth, float inverse_score) {
    bool shaded = f.kept;
    if (DEPTH_RANGE != DEPTH_RANGE_INSIDE) {
        float z = c.depth.z * inverse_score * depth.ratio;
        shaded = shaded && z <= frame.far_high;
        if (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL) {
            shaded = shaded && z >= frame.near_high;
            // Back faces that only the silhouette counts: triangle.comp gave them no weight.
            shaded = shaded && (!FRONT_ONLY || c.whole > -1e38);
        } else {
            f.probability = shaded ? f.probability : 0.0;
            f.complement = shaded ? f.complement : 1.0;
        }
    }
    return shaded;
}

// Adds a triangle to all of a lane's pixels: step by step rather than pixel by pixel, so that the long chains of dependent
// operations of several pixels run side by side.
void gather(int slot, vec2 first, inout Pixel pixels[PIXELS], float radius_squared, float scale, float inverse_score) {
    Triangle t = shared_triangle_of(slot);
    Corner c;
    if (WANT_SHADING) {
        c = shared_corner_of(slot);
    }
    Place places[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        int index = i * int(gl_WorkGroupSize.x);
        vec2 q = first + vec2(index % int(TILE_WIDTH), index / int(TILE_WIDTH)) - t.origin;
        places[i] = place_at(t, q, radius_squared, scale);
        if (DISTANCE == DISTANCE_BARYCENTRIC && OFFICIAL) {
            ivec4 box = texelFetch(boxes, slot);
            ivec2 pixel = ivec2(q + t.origin);
            places[i].kept = places[i].kept && pixel == clamp(pixel, box.xy, box.zw);
        }
    }
    Fragment fragments[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        fragments[i] = fragment_of(places[i]);
    }
    vec3 b[PIXELS];
    float sum[PIXELS];
    Depth depth[PIXELS];
    if (WANT_SHADING) {
        for (int i = 0; i < PIXELS; ++i) {
            b[i] = clipped_barycentrics(t, fragments[i].height);
            sum[i] = b[i].x + b[i].y + b[i].z;
            depth[i] = depth_at(c.depth, b[i], sum[i]);
        }
    }
    bool shaded[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        shaded[i] = judge_depth(fragments[i], c, depth[i], inverse_score);
        if (WANT_SILHOUETTE) {
            add_silhouette(pixels[i], fragments[i]);
        }
    }
    if (SHADED) {
        Share shares[PIXELS];
        for (int i = 0; i < PIXELS; ++i) {
            shares[i] = add_weight(pixels[i], slot, fragments[i], c, depth[i], shaded[i], scale);
        }
        for (int i = 0; i < PIXELS; ++i) {
            add_shaded(pixels[i], shares[i], c, b[i], 1.0 / sum[i], depth[i]);
        }
    }
}

void write_pixel(Pixel p, int view, int triangle_count, ivec2 where) {
    int at = (view * int(frame.height) + where.y) * int(frame.width) + where.x;
    float alpha = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 - p.silhouette : p.silhouette;
    if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        alpha /= float(max(triangle_count, 1));
    }
    vec3 background = vec3(frame.background_red, frame.background_green, frame.background_blue);
    bool covered = p.sum > 0.0;
    float inverse = covered ? 1.0 / p.sum : 0.0;
    // The hard mode's depth and normal are those of a surface, not of a mixture.
    float blend = COMPOSITE && COLOR_MODE == COLOR_SOFTMAX ? alpha : 1.0;
    if (WANT_COLOR) {
        vec3 mixed = covered ? p.color * inverse : background;
        vec3 rgb = COMPOSITE ? (covered ? mixed * alpha + background * (1.0 - alpha) : background) : mixed;
        color[at] = vec4(rgb, (OUTPUTS & OUTPUT_SILHOUETTE) != 0u ? alpha : 1.0);
    } else if ((OUTPUTS & OUTPUT_SILHOUETTE) != 0u) {
        silhouette[at] = alpha;
    }
    if (WANT_DEPTH) {
        depths[at] = p.depth * inverse * blend;
    }
    if (WANT_NORMAL) {
        normals[at] = vec4(p.normal * (inverse * blend), 0.0);
    }
    if (SAVE) {
        // Of the hard mode backward needs the slot, in two floats that hold it exactly.
        bool hard = COLOR_MODE == COLOR_HARD;
        vec2 reference = hard ? vec2(p.nearest >> 12, p.nearest & 4095) : vec2(p.whole, p.rest);
        saved[at] = vec4(reference, inverse, p.silhouette);
    }
}

// What backward may leave out in this tile: a triangle whose every weight is far below the smallest sum shows in none of
// its pixels, and where next to nothing is seen through a tile no triangle moves its silhouette.
vec2 bounds_of(Pixel p) {
    float log_sum = p.sum > 0.0 ? p.whole + (p.rest + log2(p.sum)) : -3e38;
    // Of the hard mode, and without colour, nothing is known of weights.
    bool known = SHADED && COLOR_MODE == COLOR_SOFTMAX;
    return vec2(known ? log_sum : -3e38, SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? p.silhouette : 1.0);
}

void main() {
    uint order = gl_WorkGroupID.x;
    uint even = (gl_NumWorkGroups.x + 1u) / 2u;
    uvec4 item = texelFetch(tile_items, int(frame.first + (order < even ? 2u * order : 2u * (order - even) + 1u)));
    int view = int(item.x);
    uint tile = item.y;
    uvec2 range = item.zw;
    int lane = int(gl_LocalInvocationID.x);
    ivec2 corner = ivec2(tile % frame.tiles_x, tile / frame.tiles_x) * ivec2(TILE_WIDTH, TILE_HEIGHT);
    ivec2 mine = corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
    Pixel pixels[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        pixels[i] = background_pixel();
    }
    float radius_squared = frame.radius_squared;
    float scale = frame.scale;
    float inverse_score = 1.0 / frame.score_high;
    vec2 first = vec2(mine);
    int begin = int(range.x);
    int end = int(range.x + range.y);
    // One slot ahead, so that its fetch does not wait for the one before.
    int next = begin < end ? int(texelFetch(tile_slots, begin).x) : 0;
    for (int i = begin; i < end; ++i) {
        int slot = next;
        next = int(texelFetch(tile_slots, min(i + 1, end - 1)).x);
        gather(slot, first, pixels, radius_squared, scale, inverse_score);
    }
    int triangle_count = shape_of(view).triangle_count;
    vec2 bounds = vec2(3e38, 0.0);
    for (int i = 0; i < PIXELS; ++i) {
        int index = i * int(gl_WorkGroupSize.x);
        ivec2 where = mine + ivec2(index % int(TILE_WIDTH), index / int(TILE_WIDTH));
        if (where.x < int(frame.width) && where.y < int(frame.height)) {
            write_pixel(pixels[i], view, triangle_count, where);
            vec2 own = bounds_of(pixels[i]);
            bounds = vec2(min(bounds.x, own.x), max(bounds.y, own.y));
        }
    }
    if (SAVE) {
        // As one minimum.
        vec2 least = least_of_lanes(vec2(bounds.x, -bounds.y));
        if (lane == 0) {
            tile_bounds[uint(view) * frame.tiles_x * frame.tiles_y + tile] = vec2(least.x, -least.y);
        }
    }
}
