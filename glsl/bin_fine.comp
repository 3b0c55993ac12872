#version 450
#extension GL_GOOGLE_include_directive : require
// Bin, fine: a bin's words become one list of slots a tile, in the same ascending order; and of the tiles that have one, a
// list for forward to walk.
// One workgroup a bin, views along y, one lane a tile: each counts the bits of its words, then writes their slots.
// Reads `bin_ranges`, `coarse_slots` and `coarse_words`; writes `tile_slots`, `status`, `tile_items` (view, tile, and where
// its slots begin and how many there are) and its lengths as workgroups of indirect dispatches, `tile_counts`. The order of
// the items does not matter: every tile has its own pixels.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer bin_ranges;
layout(set = 0, binding = 2) uniform usamplerBuffer coarse_slots;
layout(set = 0, binding = 3) uniform usamplerBuffer coarse_words;
layout(set = 0, binding = 4, std430) writeonly buffer TileItems { uvec4 tile_items[]; };
layout(set = 0, binding = 5, std430) writeonly buffer TileSlots { uint tile_slots[]; };
layout(set = 0, binding = 6, std430) buffer Status { uint status[]; };
layout(set = 0, binding = 7, std430) buffer TileCounts { uint tile_counts[]; };

#include "common/constants.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"

void main() {
    int view = int(gl_WorkGroupID.y);
    int bin = int(gl_WorkGroupID.x);
    uint lane = gl_LocalInvocationID.x;
    Shape shape = shape_of(view);
    uvec2 range = texelFetch(bin_ranges, shape.bin_base + bin).xy;
    int first = int(range.x);
    int entries = int(range.y);
    // 64 words, one a tile, for every 32 entries.
    int words = 2 * first + int(lane);
    uint count = 0u;
    for (int i = 0; i < entries; i += int(WORD_BITS)) {
        count += uint(bitCount(texelFetch(coarse_words, words + 2 * i).x));
    }
    uint tile_x = uint(bin) % frame.bins_x * BIN_TILES + lane % BIN_TILES;
    uint tile_y = uint(bin) / frame.bins_x * BIN_TILES + lane / BIN_TILES;
    if (tile_x >= frame.tiles_x || tile_y >= frame.tiles_y) {
        return;
    }
    uint next = count == 0u ? 0u : atomicAdd(status[STATUS_LIST_NEEDED], count);
    bool fits = next + count <= frame.list_capacity;
    // Left out whole when it does not fit, as in bin_coarse.
    if (!fits || count == 0u) {
        return;
    }
    uint tile = tile_y * frame.tiles_x + tile_x;
    // Each row of FORWARD_ROW tiles has a list of its own, so that its length is a number of workgroups along one axis.
    uint row = (uint(view) * frame.tiles_x * frame.tiles_y + tile) / FORWARD_ROW;
    uint place = row * FORWARD_ROW + atomicAdd(tile_counts[row * TILE_COUNT_WORDS], 1u);
    tile_items[place] = uvec4(uint(view), tile, next, count);
    if (count > LONG_LIST) {
        atomicMax(status[STATUS_LONGEST_LIST], count);
    }
    for (int i = 0; i < entries; i += int(WORD_BITS)) {
        uint word = texelFetch(coarse_words, words + 2 * i).x;
        while (word != 0u) {
            tile_slots[next] = texelFetch(coarse_slots, first + i + findLSB(word)).x;
            word &= word - 1u;
            ++next;
        }
    }
}
