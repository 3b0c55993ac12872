#version 450
#extension GL_GOOGLE_include_directive : require
// Bin, coarse: turns each bin's bitmap into its list of record indices in ascending order, and the tiles that each entry may
// touch into masks: 32 entries at a time give one word for each of the 64 tiles, a bit for each entry, and two last words
// that mark the back faces and the thin triangles.
// One workgroup a bin, views along y. First each lane compacts a run of the bitmap's words, so that the list keeps their
// order; then each takes blocks of 32 entries. The position of a list in memory comes from an atomic counter and may differ
// between runs; its content and order do not.
// Reads `bin_bits`, `boxes` and `geometry`; writes `bin_ranges`, `coarse_slots`, `coarse_words` and `status`.

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer bin_bits;
layout(set = 0, binding = 2) uniform isamplerBuffer boxes;
layout(set = 0, binding = 3) uniform samplerBuffer geometry;
layout(set = 0, binding = 4, std430) writeonly buffer BinRanges { uvec2 bin_ranges[]; };
layout(set = 0, binding = 5, std430) buffer CoarseSlots { uint coarse_slots[]; };
layout(set = 0, binding = 6, std430) writeonly buffer CoarseWords { uint coarse_words[]; };
layout(set = 0, binding = 7, std430) buffer Status { uint status[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"

shared uint counts[gl_WorkGroupSize.x];
shared uint list_start;

// The mask of tiles, in the row whose centre lies at `y` relative to the origin, that the triangle grown by the culling
// radius may touch: the interval of columns between the edges' half-planes. tile_mask prepares the first three arguments.
uint row_mask(vec3 at_first, vec3 per_row, vec3 inverse, float y, int first, int last) {
    // A thousandth of a tile covers rounding.
    vec3 t = (at_first + per_row * y) * inverse;
    int low = first;
    int high = last;
    for (int k = 0; k < 3; ++k) {
        int from = int(ceil(clamp(t[k] - 1e-3, -1.0, 9.0)));
        int to = int(floor(clamp(t[k] + 1e-3, -1.0, 9.0)));
        low = inverse[k] < 0.0 ? max(low, from) : low;
        high = inverse[k] < 0.0 ? high : min(high, to);
    }
    return low > high ? 0u : ((2u << uint(high)) - 1u) & ~((1u << uint(low)) - 1u);
}

// The mask of the tiles that an entry may touch, and whether the entry is a back face.
struct Mask {
    uvec2 tiles;
    bool away;
    // So thin that rounding could choose the wrong edge in nearest_edge (entry.glsl), or without area.
    bool thin;
};

// Whether the least of a triangle's heights is so small that rounding could change which of its edges is the nearest:
// rounding adds some 1e-7 of the distances within the culling radius, a hundredth of what is asked here.
bool is_thin(vec3 half_length, vec3 inverse_height) {
    float least = min(inverse_height.x, min(inverse_height.y, inverse_height.z));
    float most = max(inverse_height.x, max(inverse_height.y, inverse_height.z));
    float longest = 2.0 * max(half_length.x, max(half_length.y, half_length.z));
    float reach = longest + 2.0 * sqrt(frame.radius_squared);
    return !(least > 0.0 && most * reach < 1e5);
}

Mask tile_mask(int slot, ivec2 bin) {
    int at = slot * int(GEOMETRY_TEXELS);
    vec4 head = texelFetch(geometry, at);
    vec2 origin = head.xy;
    vec4 last_texel = texelFetch(geometry, at + 4);
    ivec4 box = texelFetch(boxes, slot);
    ivec2 tile = ivec2(TILE_WIDTH, TILE_HEIGHT);
    ivec2 first = max(box.xy / tile - bin * int(BIN_TILES), ivec2(0));
    ivec2 last = min(box.zw / tile - bin * int(BIN_TILES), ivec2(BIN_TILES - 1u));
    vec2 half_size = 0.5 * vec2(TILE_WIDTH - 1u, TILE_HEIGHT - 1u);
    vec2 centre = vec2(bin) * vec2(BIN_WIDTH, BIN_HEIGHT) + half_size - origin;
    vec3 at_first;
    vec3 per_row;
    vec3 inverse;
    vec2 normal[3];
    for (int k = 0; k < 3; ++k) {
        vec4 line = texelFetch(geometry, at + 1 + k);
        normal[k] = line.xy;
        float reach = sqrt(frame.radius_squared);
        if (DISTANCE == DISTANCE_BARYCENTRIC) {
            reach = frame.barycentric_radius / last_texel[k + 1];
        }
        reach = 1.001 * reach + 0.01 * frame.scale;
        // Only true edges bound: not the end lines of a triangle without area, whose inverse height is not positive, nor the
        // line of a point.
        bool bounds = last_texel[k + 1] > 0.0 && line.z < 1e14;
        float nx = abs(line.x) < 1e-9 * frame.scale ? (line.x < 0.0 ? -1e-9 : 1e-9) * frame.scale : line.x;
        float spread = abs(line.x) * half_size.x + abs(line.y) * half_size.y;
        at_first[k] = bounds ? line.x * centre.x + line.z + spread + reach : 1e30;
        per_row[k] = bounds ? line.y : 0.0;
        inverse[k] = -1.0 / (nx * float(TILE_WIDTH));
    }
    uvec2 mask = uvec2(0u);
    for (int row = 0; row < int(BIN_TILES); ++row) {
        float y = centre.y + float(row * int(TILE_HEIGHT));
        uint bits = row_mask(at_first, per_row, inverse, y, first.x, last.x);
        bits = row < first.y || row > last.y ? 0u : bits;
        mask[row / 4] |= bits << uint(8 * (row % 4));
    }
    // The edges' inner normals have the orientation of the corners.
    bool counterclockwise = normal[0].x * normal[1].y - normal[0].y * normal[1].x < 0.0;
    return Mask(mask, counterclockwise == CLOCKWISE_FRONT, is_thin(vec3(head.zw, last_texel.x), last_texel.yzw));
}

// One step of the transposition of a 32×32 bit matrix (Warren, Hacker's Delight, 7-3): swaps blocks of `width` bits.
void swap_blocks(inout uint a[WORD_BITS], int width, uint mask) {
    for (int i = 0; i < int(WORD_BITS) / 2; ++i) {
        int k = ((i & ~(width - 1)) << 1) | (i & (width - 1));
        uint t = ((a[k] >> uint(width)) ^ a[k + width]) & mask;
        a[k + width] ^= t;
        a[k] ^= t << uint(width);
    }
}

// Bit j of word i becomes bit i of word j.
void transpose(inout uint a[WORD_BITS]) {
    swap_blocks(a, 16, 0x0000ffffu);
    swap_blocks(a, 8, 0x00ff00ffu);
    swap_blocks(a, 4, 0x0f0f0f0fu);
    swap_blocks(a, 2, 0x33333333u);
    swap_blocks(a, 1, 0x55555555u);
}

// The words of a block: masks of entries from masks of tiles, by transposing the bits.
void write_words(uint first, uint last, ivec2 bin) {
    uint low[WORD_BITS];
    uint high[WORD_BITS];
    uint away = 0u;
    uint thin = 0u;
    for (uint i = 0u; i < WORD_BITS; ++i) {
        // Past the last entry the last one is repeated and masked out.
        Mask mask = tile_mask(int(coarse_slots[min(first + i, last)]), bin);
        mask.tiles = first + i > last ? uvec2(0u) : mask.tiles;
        low[i] = mask.tiles.x;
        high[i] = mask.tiles.y;
        away |= PARTED && mask.away ? 1u << i : 0u;
        thin |= SOFT && mask.thin ? 1u << i : 0u;
    }
    transpose(low);
    transpose(high);
    uint to = first / WORD_BITS * BLOCK_WORDS;
    for (uint i = 0u; i < WORD_BITS; ++i) {
        coarse_words[to + i] = low[i];
        coarse_words[to + WORD_BITS + i] = high[i];
    }
    coarse_words[to + 2u * WORD_BITS] = away;
    coarse_words[to + 2u * WORD_BITS + 1u] = thin;
}

void main() {
    int view = int(gl_WorkGroupID.y);
    int bin = int(gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationID.x);
    int lanes = int(gl_WorkGroupSize.x);
    Shape shape = shape_of(view);
    int words = shape.word_count;
    int base = shape.word_base + bin * words;
    int run = (words + lanes - 1) / lanes;
    int from = min(lane * run, words);
    int to = min(from + run, words);
    uint count = 0u;
    for (int w = from; w < to; ++w) {
        count += uint(bitCount(texelFetch(bin_bits, base + w).x));
    }
    counts[lane] = count;
    barrier();
    uint before = 0u;
    uint total = 0u;
    for (int l = 0; l < lanes; ++l) {
        before += l < lane ? counts[l] : 0u;
        total += counts[l];
    }
    uint padded = (total + WORD_BITS - 1u) / WORD_BITS * WORD_BITS;
    if (lane == 0) {
        list_start = total == 0u ? 0u : atomicAdd(status[STATUS_COARSE_NEEDED], padded);
    }
    barrier();
    uint start = list_start;
    bool fits = start + padded <= frame.coarse_capacity;
    if (lane == 0) {
        // A list that does not fit is left empty and the status says how much room it needs: the frame is then not valid.
        bin_ranges[shape.bin_base + bin] = uvec2(start, fits ? total : 0u);
    }
    if (!fits) {
        return;
    }
    uint next = start + before;
    for (int w = from; w < to; ++w) {
        uint word = texelFetch(bin_bits, base + w).x;
        while (word != 0u) {
            coarse_slots[next] = uint(shape.slot_base + w * int(WORD_BITS) + findLSB(word));
            word &= word - 1u;
            ++next;
        }
    }
    memoryBarrierBuffer();
    barrier();
    int bins_x = int(frame.bins_x);
    ivec2 where = ivec2(bin % bins_x, bin / bins_x);
    for (uint i = start + uint(lane) * WORD_BITS; i < start + total; i += uint(lanes) * WORD_BITS) {
        write_words(i, start + total - 1u, where);
    }
}
