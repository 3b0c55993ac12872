#version 450
#extension GL_GOOGLE_include_directive : require
// Bin, fine: turns a bin's words into a list of record indices for each tile, in the same ascending order but with back faces
// last. One workgroup a bin, views along y, one lane a tile. Each lane counts the bits of its words, then writes their records.
// Every tile becomes an entry of `tile_items`, in any order, and `tile_counts` has the numbers of entries as workgroups of
// indirect dispatches:
// - A tile with entries is on the list of forward_soft or forward. Its entry is (the tile's number among all views', where its
//   list begins, the number of front faces, the number of entries).
// - If forward_soft serves the frame, a tile with a thin triangle is also on the list of forward.
// - If a tile's list has no room, or is longer than a loop of the device can walk, its entry has no length. The tile is also on
//   a list of forward_soft_long and forward_long: on one if it can be processed at once, else on the other.
// - A tile without entries is on the list of background, unless `tile_marks` say that it holds the background already.
// Reads `bin_ranges`, `coarse_records` and `coarse_words`. Writes `tile_items`, `tile_counts`, `tile_records`, `tile_marks`,
// `status` and, for empty tiles, `tile_bounds`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform usamplerBuffer bin_ranges;
layout(set = 0, binding = 2) uniform usamplerBuffer coarse_records;
layout(set = 0, binding = 3) uniform usamplerBuffer coarse_words;
layout(set = 0, binding = 4, std430) writeonly buffer TileItems { uvec4 tile_items[]; };
layout(set = 0, binding = 5, std430) writeonly buffer TileRecords { uint tile_records[]; };
layout(set = 0, binding = 6, std430) buffer Status { uint status[]; };
layout(set = 0, binding = 7, std430) buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 8, std430) buffer TileMarks { uint tile_marks[]; };
layout(set = 0, binding = 9, std430) writeonly buffer TileBounds { vec2 tile_bounds[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/pixel.glsl"
#include "common/arithmetic.glsl"

// `tile_items` has three parts, each with room for all tiles:
// - the tiles with entries;
// - the empty tiles, and at the end the tiles that take several turns;
// - in rows by the tiles' numbers: those that forward draws over forward_soft, and at a row's end those walked in one turn.
uint all_tiles() {
    return frame.view_count * frame.tiles_x * frame.tiles_y;
}

void add_filled(uvec4 item) {
    uint entry = atomicAdd(status[STATUS_FILLED_TILES], 1u);
    tile_items[entry] = item;
    atomicAdd(tile_counts[entry / FORWARD_ROW * TILE_COUNT_WORDS + TILES_FILLED], 1u);
}

void add_empty(uint tile) {
    uint entry = atomicAdd(status[STATUS_EMPTY_TILES], 1u);
    tile_items[all_tiles() + entry] = uvec4(tile, 0u, 0u, 0u);
    atomicAdd(tile_counts[entry / FORWARD_ROW * TILE_COUNT_WORDS + TILES_EMPTY], 1u);
}

void add_general(uvec4 item) {
    atomicAdd(status[STATUS_THIN_TILES], 1u);
    uint row = item.x / FORWARD_ROW;
    uint entry = atomicAdd(tile_counts[row * TILE_COUNT_WORDS + TILES_GENERAL], 1u);
    tile_items[2u * all_tiles() + row * FORWARD_ROW + entry] = item;
}

// Adds a tile whose list is not in memory. `blocks` is the number of blocks of the bin's list, or of words of its bitmap. At
// most `live` of them have entries, and the tile has at most `count` entries.
void add_walked(uint tile, uint blocks, uint live, uint count) {
    atomicAdd(status[STATUS_WALKED_TILES], 1u);
    if (!WALKS) {
        return;
    }
    uint passes = 3u * (WALK_GROUP_PASSES * (blocks / WORD_BITS + 1u) + live) + WALK_LIST_PASSES * (count / WORD_BITS + 2u);
    uint tiles = all_tiles();
    uvec4 item = uvec4(tile, 0u, 0u, 0u);
    if (passes <= LOOP_PASSES) {
        uint row = tile / FORWARD_ROW;
        uint entry = atomicAdd(tile_counts[row * TILE_COUNT_WORDS + TILES_WALKED], 1u);
        tile_items[2u * tiles + min((row + 1u) * FORWARD_ROW, tiles) - 1u - entry] = item;
    } else {
        uint entry = atomicAdd(status[STATUS_RESUMED_TILES], 1u);
        tile_items[2u * tiles - 1u - entry] = item;
        uint rows = (tiles + FORWARD_ROW - 1u) / FORWARD_ROW;
        atomicAdd(tile_counts[rows * TILE_COUNT_WORDS + 3u * (entry / RESUMED_ROW)], 1u);
    }
    add_filled(item);
}

// The tile of a lane among those of the bin. Eight lanes wait for the fullest of their tiles, so they take 2×4 tiles: with a
// row of eight, write_list takes 1.6 times the passes.
uint tile_of_lane() {
    uint lane = gl_LocalInvocationID.x;
    uint column = lane / 8u % 4u * 2u + lane % 2u;
    uint row = lane / 32u * 4u + lane / 2u % 4u;
    return row * BIN_TILES + column;
}

// The number of front faces and of all entries in a tile's words, and whether a thin triangle is among them.
uvec3 count_entries(uint tile, int words, int blocks) {
    uvec3 count = uvec3(0u);
    for (int i = 0; i < blocks; ++i) {
        int at = words + i * int(BLOCK_WORDS);
        uint word = texelFetch(coarse_words, at + int(tile)).x;
        uint away = PARTED ? texelFetch(coarse_words, at + int(BLOCK_WORDS) - 2).x : 0u;
        uint thin = SOFT ? texelFetch(coarse_words, at + int(BLOCK_WORDS) - 1).x : 0u;
        count.xy += uvec2(bitCount(word & ~away), bitCount(word));
        count.z |= word & thin;
    }
    return count;
}

// The words of a tile in four blocks that follow each other: the entries that are left, and the back faces.
struct Words {
    uvec4 entries;
    uvec4 away;
};

// The words from `block` on. Past the last block there are no entries.
Words words_of(uint tile, int words, int block, int blocks) {
    Words w;
    for (int i = 0; i < 4; ++i) {
        int at = words + min(block + i, blocks - 1) * int(BLOCK_WORDS);
        uint word = texelFetch(coarse_words, at + int(tile)).x;
        w.entries[i] = block + i < blocks ? word : 0u;
        w.away[i] = PARTED ? texelFetch(coarse_words, at + int(BLOCK_WORDS) - 2).x : 0u;
    }
    return w;
}

// Takes the first entry out of the words. Returns its number among their 128, or -1 if there is none.
int next_entry(inout Words w, out uint is_away) {
    bool past_x = w.entries.x == 0u;
    bool past_y = past_x && w.entries.y == 0u;
    bool past_z = past_y && w.entries.z == 0u;
    uint word = past_z ? w.entries.w : past_y ? w.entries.z : past_x ? w.entries.y : w.entries.x;
    uint away = past_z ? w.away.w : past_y ? w.away.z : past_x ? w.away.y : w.away.x;
    int passed = past_z ? 96 : past_y ? 64 : past_x ? 32 : 0;
    uint rest = word & (word - 1u);
    w.entries.w = past_z ? rest : w.entries.w;
    w.entries.z = past_y && !past_z ? rest : w.entries.z;
    w.entries.y = past_x && !past_y ? rest : w.entries.y;
    w.entries.x = past_x ? 0u : rest;
    int bit = findLSB(word);
    is_away = (away >> uint(bit & 31)) & 1u;
    return word == 0u ? -1 : passed + bit;
}

// Writes one tile's list: front faces from `next` on, back faces from `next_away` on. Returns whether it is complete: Mesa 22.3
// ends the loops of an invocation after 65535 passes in total. The inner loop takes one entry a pass. Its lanes wait for each
// other after four blocks. If they waited at every block, they would take 1.3 times the passes. If they never waited, every
// pass would fetch the words of a next block, and the kernel would take 1.1 to 1.2 times as long.
bool write_list(uint tile, uint next, uint next_away, uint end, int first, int words, int blocks) {
    uint facing_end = next_away;
    int block = 0;
    do {
        Words own = words_of(tile, words, block, blocks);
        int from = first + block * int(WORD_BITS);
        do {
            uint is_away;
            int entry = next_entry(own, is_away);
            if (entry >= 0) {
                tile_records[is_away == 0u ? next : next_away] = texelFetch(coarse_records, from + entry).x;
                next += 1u - is_away;
                next_away += is_away;
            }
        } while (own.entries != uvec4(0u));
        block += 4;
    } while (block < blocks);
    return next == facing_end && next_away == end;
}

void main() {
    int view = int(gl_WorkGroupID.y);
    uint index = gl_WorkGroupID.x;
    uint own = tile_of_lane();
    Shape shape = shape_of(view);
    uvec2 range = texelFetch(bin_ranges, shape.bin_base + int(index)).xy;
    bool listed = range.x != NO_LIST;
    int first = listed ? int(range.x) : 0;
    uint blocks = listed ? (range.y + WORD_BITS - 1u) / WORD_BITS : 0u;
    bool counted = blocks < LOOP_PASSES;
    int words = first / int(WORD_BITS) * int(BLOCK_WORDS);
    uvec3 found = count_entries(own, words, counted ? int(blocks) : 0);
    uint row = uint(quotient(int(index), int(frame.bins_x)));
    uvec2 bin = uvec2(index - row * frame.bins_x, row);
    uvec2 at = bin * BIN_TILES + uvec2(own % BIN_TILES, own / BIN_TILES);
    bool exists = at.x < frame.tiles_x && at.y < frame.tiles_y;
    uint count = exists ? found.y : 0u;
    // Forward goes through a list in less than LOOP_PASSES passes. No sum of all lengths exceeds 32 bits.
    uint beyond;
    uint sum;
    umulExtended(count, all_tiles(), beyond, sum);
    bool lists = count > 0u && count <= LOOP_PASSES / WALK_LIST_PASSES * WORD_BITS && beyond == 0u;
    uint next = lists ? atomicAdd(status[STATUS_LIST_NEEDED], count) : 0u;
    lists = lists && count <= frame.list_capacity && next <= frame.list_capacity - count;
    bool complete = write_list(own, next, next + found.x, next + count, first, words, lists ? int(blocks) : 0);
    if (!exists) {
        return;
    }
    uint tile = (uint(view) * frame.tiles_y + at.y) * frame.tiles_x + at.x;
    bool holds_background = shape.marks_valid && tile_marks[tile] == TILE_BACKGROUND;
    bool empty = listed && counted && count == 0u;
    tile_marks[tile] = empty ? TILE_BACKGROUND : 0u;
    if (lists && complete) {
        uvec4 item = uvec4(tile, next, found.x, count);
        add_filled(item);
        if (found.z != 0u) {
            add_general(item);
        }
    } else if (!empty) {
        blocks = listed ? blocks : uint(shape.word_count);
        add_walked(tile, blocks, min(blocks, range.y), listed && counted ? count : range.y);
    } else if (!holds_background) {
        add_empty(tile);
        if (SAVE) {
            tile_bounds[tile] = bounds_of_pixel(background_pixel());
        }
    }
}
