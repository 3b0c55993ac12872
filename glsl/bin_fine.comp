#version 450
#extension GL_GOOGLE_include_directive : require
// Bin, fine: the masks of a bin's list become one list of slots a tile, in the same ascending order.
// One workgroup a bin, views along y, one lane a tile: every lane walks the bin's masks, first counting its bit, then,
// 32 masks at a time, writing the slots whose bit is set.
// Reads `bin_ranges`, `coarse_slots` and `coarse_masks`; writes `tile_ranges`, `tile_slots` and `status`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer bin_ranges;
layout(set = 0, binding = 2) uniform usamplerBuffer coarse_slots;
layout(set = 0, binding = 3) uniform usamplerBuffer coarse_masks;
layout(set = 0, binding = 4, std430) writeonly buffer TileRanges { uvec2 tile_ranges[]; };
layout(set = 0, binding = 5, std430) writeonly buffer TileSlots { uint tile_slots[]; };
layout(set = 0, binding = 6, std430) buffer Status { uint status[]; };

#include "common/constants.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"

// Bit i: whether the list's entry `at + i` touches tile `bit` of the half `high`.
uint word_of(int at, int left, bool high, uint bit) {
    uint word = 0u;
    for (int i = 0; i < int(WORD_BITS); ++i) {
        uvec2 mask = texelFetch(coarse_masks, at + i).xy;
        word |= (((high ? mask.y : mask.x) >> bit) & 1u) << uint(i);
    }
    return left >= int(WORD_BITS) ? word : word & ((1u << uint(left)) - 1u);
}

void main() {
    int view = int(gl_WorkGroupID.y);
    int bin = int(gl_WorkGroupID.x);
    uint lane = gl_LocalInvocationID.x;
    Shape shape = shape_of(view);
    uvec2 range = texelFetch(bin_ranges, shape.bin_base + bin).xy;
    int first = int(range.x);
    int entries = int(range.y);
    bool high = lane >= 32u;
    uint bit = lane & 31u;
    uint count = 0u;
    for (int i = 0; i < entries; i += int(WORD_BITS)) {
        count += uint(bitCount(word_of(first + i, entries - i, high, bit)));
    }
    uint tile_x = uint(bin) % frame.bins_x * BIN_TILES + lane % BIN_TILES;
    uint tile_y = uint(bin) / frame.bins_x * BIN_TILES + lane / BIN_TILES;
    if (tile_x >= frame.tiles_x || tile_y >= frame.tiles_y) {
        return;
    }
    uint next = count == 0u ? 0u : atomicAdd(status[STATUS_LIST_NEEDED], count);
    bool fits = next + count <= frame.list_capacity;
    uint tile = (uint(view) * frame.tiles_y + tile_y) * frame.tiles_x + tile_x;
    // Left out whole when it does not fit, as in bin_coarse.
    tile_ranges[tile] = uvec2(next, fits ? count : 0u);
    if (!fits || count == 0u) {
        return;
    }
    atomicMax(status[STATUS_LONGEST_LIST], count);
    for (int i = 0; i < entries; i += int(WORD_BITS)) {
        uint word = word_of(first + i, entries - i, high, bit);
        while (word != 0u) {
            tile_slots[next] = texelFetch(coarse_slots, first + i + findLSB(word)).x;
            word &= word - 1u;
            ++next;
        }
    }
}
