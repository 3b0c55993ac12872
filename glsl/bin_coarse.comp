#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Bin, coarse: turns each bin's bitmap into a list of record indices in ascending order, and finds the tiles that each entry
// may touch. A block of 32 entries has one word for each of the bin's 64 tiles, with a bit for each entry that may touch the
// tile. Two last words mark the back faces and the thin triangles.
// One workgroup a bin, views along y. First each lane compacts a run of the bitmap's words, so that the list keeps their order.
// Then each lane takes blocks of 32 entries. An atomic counter places a list in memory: its place may differ between runs, its
// content and order do not.
// Reads `bin_bits`, `boxes` and the records. Writes `bin_ranges`, `coarse_records`, `coarse_words` and `status`.

layout(local_size_x_id = 0) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer bin_bits;
layout(set = 0, binding = 2) uniform isamplerBuffer boxes;
layout(set = 0, binding = 3) uniform samplerBuffer geometry;
layout(set = 0, binding = 4, std430) writeonly buffer BinRanges { uvec2 bin_ranges[]; };
layout(set = 0, binding = 5, std430) coherent buffer CoarseRecords { uint coarse_records[]; };
layout(set = 0, binding = 6, std430) writeonly buffer CoarseWords { uvec2 coarse_words[]; };
layout(set = 0, binding = 7, std430) buffer Status { uint status[]; };
layout(set = 0, binding = 8) uniform samplerBuffer shading;

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/arithmetic.glsl"
#include "common/record.glsl"
#include "common/tile_mask.glsl"

shared uint counts[gl_WorkGroupSize.x];
shared uint list_start;

// The tiles that an entry may touch, whether it is a back face, and whether it is thin.
struct Mask {
    uvec2 tiles;
    bool away;
    bool thin;
};

Mask tile_mask(int record_index, ivec2 bin) {
    Reach reach = reach_of_record(record_index, bin);
    uvec2 mask = uvec2(0u);
    for (int row = 0; row < int(BIN_TILES); ++row) {
        mask[row / 4] |= row_mask(reach, row) << uint(8 * (row % 4));
    }
    return Mask(mask, reach.away, reach.thin);
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

// Writes the words of a block: transposes masks of tiles into masks of entries. The two marked loops are not unrolled, so that
// Mesa 22.3 compiles this kernel in a fifth of the time, which halves a first frame (`cargo bench --bench cold`). Passes of
// loops that are not unrolled are limited (coarse_lanes in frame/plan), so the loop over rows in tile_mask stays unrolled.
void write_words(uint first, uint last, ivec2 bin) {
    uint low[WORD_BITS];
    uint high[WORD_BITS];
    uint away = 0u;
    uint thin = 0u;
    [[dont_unroll]] for (uint i = 0u; i < WORD_BITS; ++i) {
        // Past the end it repeats the last entry and masks it out.
        Mask mask = tile_mask(int(coarse_records[min(first + i, last)]), bin);
        mask.tiles = first + i > last ? uvec2(0u) : mask.tiles;
        low[i] = mask.tiles.x;
        high[i] = mask.tiles.y;
        away |= PARTED && mask.away ? 1u << i : 0u;
        thin |= SOFT && mask.thin ? 1u << i : 0u;
    }
    uint to = first / WORD_BITS * (BLOCK_WORDS / 2u);
    [[dont_unroll]] for (uint part = 0u; part < 2u * WORD_BITS; part += WORD_BITS) {
        uint words[WORD_BITS];
        for (uint i = 0u; i < WORD_BITS; ++i) {
            words[i] = part == 0u ? low[i] : high[i];
        }
        transpose(words);
        // A software device stores in a loop over lanes. With two words at a time this kernel takes 0.95 of its time.
        for (uint i = 0u; i < WORD_BITS; i += 2u) {
            coarse_words[to + (part + i) / 2u] = uvec2(words[i], words[i + 1u]);
        }
    }
    coarse_words[to + WORD_BITS] = uvec2(away, thin);
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
    // No list is so long that the sum of all could exceed 32 bits.
    uint beyond;
    uint sum;
    umulExtended(padded, frame.view_count * frame.bins_x * frame.bins_y, beyond, sum);
    bool lists = total != 0u && beyond == 0u;
    if (lane == 0) {
        list_start = lists ? atomicAdd(status[STATUS_COARSE_NEEDED], padded) : 0u;
    }
    barrier();
    uint start = list_start;
    lists = lists && padded <= frame.coarse_capacity && start <= frame.coarse_capacity - padded;
    if (lane == 0) {
        // A bin without room for its list has NO_LIST and the number of its entries. Its tiles then find them in the bitmap.
        bin_ranges[shape.bin_base + bin] = total == 0u ? uvec2(0u) : uvec2(lists ? start : NO_LIST, total);
    }
    if (!lists) {
        return;
    }
    uint next = start + before;
    for (int w = from; w < to; ++w) {
        uint word = texelFetch(bin_bits, base + w).x;
        while (word != 0u) {
            coarse_records[next] = uint(shape.record_base + w * int(WORD_BITS) + findLSB(word));
            word &= word - 1u;
            ++next;
        }
    }
    memoryBarrierBuffer();
    barrier();
    int row = quotient(bin, int(frame.bins_x));
    ivec2 where = ivec2(bin - row * int(frame.bins_x), row);
    for (uint i = start + uint(lane) * WORD_BITS; i < start + total; i += uint(lanes) * WORD_BITS) {
        write_words(i, start + total - 1u, where);
    }
}
