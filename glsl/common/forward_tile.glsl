// Common parts of the forward kernels: their buffers, the tile's list, and how they write a finished tile.
// With WALKED the list is not in memory. The lanes share the entries at hand: those found but not yet added (walked_tile.glsl).
// The file that includes this one defines first_pixel, finished, gather_entries and COLOR_UNIT, the factor of the sums of
// colours and features.

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer tile_items;
#ifndef WALKED
layout(set = 0, binding = 2) uniform usamplerBuffer tile_records;
#endif
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
layout(set = 0, binding = 18, std430) writeonly buffer FeatureImage { vec4 feature_image[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/arithmetic.glsl"
#include "common/record.glsl"
#include "common/distance.glsl"
#include "common/fragment.glsl"
#include "common/sample.glsl"
#include "common/shared_records.glsl"
#include "common/lanes.glsl"
#include "common/pixel.glsl"
#include "common/hidden.glsl"
#include "common/tile.glsl"
#include "common/images.glsl"

#ifdef WALKED
// The entries at hand of a list that is not in memory.
shared uint entries[WALK_WINDOW];
#endif

// The record index of an entry of the tile's list.
int entry_at(int at) {
#ifdef WALKED
    return int(entries[at]);
#else
    return int(texelFetch(tile_records, at).x);
#endif
}

#ifndef SUBGROUP_RECORDS
const int LANES = int(gl_WorkGroupSize.x);
#endif
const int TILE_PIXELS = int(TILE_WIDTH * TILE_HEIGHT);
const int PIXELS = TILE_PIXELS / LANES;

#include "common/features.glsl"

// Pixel i of a lane lies i * LANES pixels after its first, row by row.
ivec2 step_of(int i) {
    int index = i * LANES;
    return ivec2(index % int(TILE_WIDTH), index / int(TILE_WIDTH));
}

// The first pixel of this lane.
ivec2 lane_corner(TileLocation tile) {
    int lane = int(gl_LocalInvocationID.x);
    return tile.corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
}

// The constants of all pairs of a lane. Push constants are copied: on a software device each read in a loop is a gather.
struct LaneConstants {
    // The lane's first pixel.
    vec2 first;
    float radius_squared;
    float scale;
    float inverse_score;
};

LaneConstants lane_constants(ivec2 first) {
    return LaneConstants(vec2(first), frame.radius_squared, frame.scale, 1.0 / frame.score_high);
}

// A pixel before its first entry.
Pixel first_pixel();
// The pixel with its sums as images.glsl expects them.
Pixel finished(Pixel p);
// Adds up to WORD_BITS entries, which are all front faces or all back faces. The entries before them decide which of them are
// hidden. `log_count` is log2 of the list's length: all hidden entries together must be negligible. Returns whether the entries
// after these can be left out.
bool gather_entries(int from, int stop, float log_count, LaneConstants constants, inout Pixel pixels[PIXELS]);

// The least log sum and the largest transmittance of all lanes' pixels (bounds_of_pixel). Pixels beyond the image's border
// count too. They can only make the tile skip less.
vec2 bounds_of_tile(Pixel pixels[PIXELS]) {
    // The largest transmittance is found as the minimum of its negative.
    vec2 least = vec2(3e38);
    for (int i = 0; i < PIXELS; ++i) {
        vec2 own = bounds_of_pixel(finished(pixels[i]));
        least = vec2(lesser(least.x, own.x), lesser(least.y, -own.y));
    }
    least = least_of_lanes(least);
    return vec2(least.x, -least.y);
}

// Writes the finished pixel i of this lane: its images, and what backward needs.
void write_pixel(TileLocation tile, int i, Pixel p, int triangle_count) {
    ivec2 where = lane_corner(tile) + step_of(i);
    if (where.x < int(frame.width) && where.y < int(frame.height)) {
        int to = pixel_index(tile.view, where);
        write_images(p, to, triangle_count);
        write_features(i, p, to, triangle_count);
        if (SAVE) {
            saved[to] = saved_of(p);
        }
    }
}

void write_bounds(int number, vec2 bounds) {
    if (SAVE && gl_LocalInvocationID.x == 0u) {
        tile_bounds[number] = bounds;
    }
}

void write_tile(TileLocation tile, int number, Pixel pixels[PIXELS]) {
    int triangle_count = shape_of(tile.view).triangle_count;
    for (int i = 0; i < PIXELS; ++i) {
        write_pixel(tile, i, finished(pixels[i]), triangle_count);
    }
    if (SAVE) {
        write_bounds(number, bounds_of_tile(pixels));
    }
}

#ifdef WALKED
#include "common/walked_tile.glsl"
#else
// Adds a list that is in memory, word by word. Front faces fill words of their own.
void gather_list(int from, int facing_end, int end, LaneConstants constants, inout Pixel pixels[PIXELS]) {
    float log_count = log2(float(end - from));
    do {
        int stop = min(from + int(WORD_BITS), from < facing_end ? facing_end : end);
        from = gather_entries(from, stop, log_count, constants, pixels) ? end : stop;
    } while (from < end);
}

void main() {
    ivec4 item = ivec4(texelFetch(tile_items, int(frame.first + gl_WorkGroupID.x)));
    // A tile whose list is not in memory has an entry of length 0, because pixel_grad.comp reads the same entries.
    if (WALKS && item.w == 0) {
        return;
    }
    TileLocation tile = tile_location(item.x);
    Pixel pixels[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        pixels[i] = first_pixel();
    }
    clear_features();
    gather_list(item.y, item.y + item.z, item.y + item.w, lane_constants(lane_corner(tile)), pixels);
    write_tile(tile, item.x, pixels);
}
#endif
