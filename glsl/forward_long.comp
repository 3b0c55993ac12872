#version 450
#extension GL_GOOGLE_include_directive : require
// Forward, long: forward for the tiles whose lists are nowhere in memory, with the same bits. It finds a list's entries again
// in the words of its bin or, where those had no room either, by testing the triangles of the bin's bitmap as bin_coarse
// does. Three walks over the bin count the entries, then add the front faces, then the back faces.
// One workgroup of 32 a tile, each lane one pixel and one of the 32 blocks or entries that are looked at together. Walks of
// more passes than a loop of the device can take go on in the next dispatch (frame.number) from `walk_state`.
// Reads `tile_items`, `bin_ranges`, `bin_bits`, `coarse_slots`, `coarse_words` and the records; writes as forward does.

#define WALKED
#include "common/forward.glsl"
#include "common/tile_mask.glsl"

layout(set = 0, binding = 2) uniform usamplerBuffer bin_ranges;
layout(set = 0, binding = 14) uniform usamplerBuffer bin_bits;
layout(set = 0, binding = 15) uniform usamplerBuffer coarse_slots;
layout(set = 0, binding = 16) uniform usamplerBuffer coarse_words;
layout(set = 0, binding = 17, std430) buffer WalkState { uint walk_state[]; };

// The words of a group's blocks: a bit for each entry, and for each back face.
shared uint block_entries[WORD_BITS];
shared uint block_aways[WORD_BITS];
// A bit for each lane that has something to say.
shared uint lanes_live;
shared uint lanes_away;

// What a walk is for.
const uint COUNT = 0u;
const uint FRONT = 1u;
const uint BACK = 2u;
const uint DONE = 3u;

// Where the entries of a tile are to be found.
struct Source {
    // Whether the bin has a list; otherwise there is its bitmap.
    bool listed;
    // First entry of the bin's list, or first record of the view, and the first word.
    int first;
    int words;
    int blocks;
    ivec2 bin;
    // The tile's number in the bin.
    int tile;
};

// Where a walk stands.
struct Walk {
    uint phase;
    // The next group of WORD_BITS blocks.
    int group;
    // Entries counted, and entries at hand.
    int count;
    int fill;
};

Source source_of(TilePlace place) {
    Shape shape = shape_of(place.view);
    ivec2 tile = place.corner / ivec2(TILE_WIDTH, TILE_HEIGHT);
    Source s;
    s.bin = tile / int(BIN_TILES);
    ivec2 inside = tile - s.bin * int(BIN_TILES);
    s.tile = inside.y * int(BIN_TILES) + inside.x;
    int bin = s.bin.y * int(frame.bins_x) + s.bin.x;
    uvec2 range = texelFetch(bin_ranges, shape.bin_base + bin).xy;
    s.listed = range.x != NO_LIST;
    s.first = s.listed ? int(range.x) : shape.slot_base;
    s.words = s.listed ? s.first / int(WORD_BITS) * int(BLOCK_WORDS) : shape.word_base + bin * shape.word_count;
    s.blocks = s.listed ? (int(range.y) + int(WORD_BITS) - 1) / int(WORD_BITS) : shape.word_count;
    return s;
}

// Every lane's bits in each of two masks, in all lanes.
uvec2 bits_of_workgroup(bool live, bool away) {
    uint lane = gl_LocalInvocationID.x;
    barrier();
    if (lane == 0u) {
        lanes_live = 0u;
        lanes_away = 0u;
    }
    barrier();
    atomicOr(lanes_live, live ? 1u << lane : 0u);
    atomicOr(lanes_away, away ? 1u << lane : 0u);
    barrier();
    return uvec2(lanes_live, lanes_away);
}

// Reads the words of a group of blocks, a lane each. Returns the mask of blocks that have entries or, without a list,
// candidates.
uint read_group(Source s, int group) {
    int lane = int(gl_LocalInvocationID.x);
    int block = group * int(WORD_BITS) + lane;
    int at = min(block, s.blocks - 1);
    uint word;
    uint away = 0u;
    if (s.listed) {
        word = texelFetch(coarse_words, s.words + at * int(BLOCK_WORDS) + s.tile).x;
        away = texelFetch(coarse_words, s.words + (at + 1) * int(BLOCK_WORDS) - 1).x;
    } else {
        word = texelFetch(bin_bits, s.words + at).x;
    }
    word = block < s.blocks ? word : 0u;
    block_entries[lane] = word;
    block_aways[lane] = away;
    return bits_of_workgroup(word != 0u, false).x;
}

// The masks of a block's entries and of the back faces among them. `first` is the record of a bitmap's block.
uvec2 masks_of_block(Source s, int block, int first) {
    uvec2 masks = uvec2(block_entries[block], block_aways[block]);
    if (!s.listed) {
        uint lane = gl_LocalInvocationID.x;
        bool candidate = (masks.x >> lane & 1u) != 0u;
        Reach reach = reach_of_record(candidate ? first + int(lane) : s.first, s.bin);
        uint row = row_mask(reach, s.tile / int(BIN_TILES));
        bool touches = candidate && (row >> uint(s.tile % int(BIN_TILES)) & 1u) != 0u;
        masks = bits_of_workgroup(touches, touches && PARTED && reach.away);
    }
    return masks;
}

// Counts the entries of the next group, or adds those of the walk's side to the entries at hand. Returns passes of loops.
uint take_group(Source s, inout Walk walk) {
    uint lane = gl_LocalInvocationID.x;
    uint live = read_group(s, walk.group);
    uint passes = WALK_GROUP_PASSES + uint(bitCount(live));
    while (live != 0u) {
        int block = findLSB(live);
        live &= live - 1u;
        int first = s.first + (walk.group * int(WORD_BITS) + block) * int(WORD_BITS);
        uvec2 masks = masks_of_block(s, block, first);
        if (walk.phase == COUNT) {
            walk.count += bitCount(masks.x);
        } else {
            uint taken = walk.phase == FRONT ? masks.x & ~masks.y : masks.x & masks.y;
            if ((taken >> lane & 1u) != 0u) {
                int index = first + int(lane);
                uint record_index = s.listed ? texelFetch(coarse_slots, index).x : uint(index);
                entries[walk.fill + bitCount(taken & ((1u << lane) - 1u))] = record_index;
            }
            walk.fill += bitCount(taken);
        }
    }
    barrier();
    return passes;
}

// Adds the entries at hand to the pixel word by word; a word that is not full waits for the next group unless this is the
// last. Returns passes of loops.
uint gather_entries_at_hand(bool is_last, Lane constant, inout Walk walk, inout Pixel pixels[PIXELS]) {
    float share = log2(float(walk.count));
    int lane = int(gl_LocalInvocationID.x);
    int from = 0;
    uint passes = 0u;
    while (walk.phase != DONE && from < walk.fill && (is_last || from + int(WORD_BITS) <= walk.fill)) {
        int stop = min(from + int(WORD_BITS), walk.fill);
        bool finished = gather_entries(from, stop, share, constant, pixels);
        walk.phase = finished ? DONE : walk.phase;
        from = stop;
        passes += WALK_LIST_PASSES;
    }
    uint waiting = entries[from + lane];
    barrier();
    entries[lane] = waiting;
    barrier();
    walk.fill -= from;
    return passes;
}

// The walk continues with the next group, or is followed by the next walk.
void advance(bool is_last, inout Walk walk) {
    walk.group = is_last ? 0 : walk.group + 1;
    // Without parted lists all entries are in front.
    uint next = walk.phase == FRONT && !PARTED ? DONE : walk.phase + 1u;
    walk.phase = is_last && walk.phase != DONE ? next : walk.phase;
}

// The word of an entry of `walk_state`.
uint state_at(int word) {
    return gl_WorkGroupID.x * WALK_STATE_WORDS + uint(word);
}

void save_state(Walk walk, Pixel p) {
    int lane = int(gl_LocalInvocationID.x);
    float values[11] = float[](p.silhouette, p.whole, p.rest, p.sum, p.color.r, p.color.g, p.color.b, p.depth, p.normal.x,
                               p.normal.y, p.normal.z);
    for (int i = 0; i < 11; ++i) {
        walk_state[state_at(i * 32 + lane)] = floatBitsToUint(values[i]);
    }
    walk_state[state_at(11 * 32 + lane)] = uint(p.nearest);
    walk_state[state_at(12 * 32 + lane)] = entries[lane];
    if (lane == 0) {
        walk_state[state_at(13 * 32)] = walk.phase;
        walk_state[state_at(13 * 32 + 1)] = uint(walk.group);
        walk_state[state_at(13 * 32 + 2)] = uint(walk.count);
        walk_state[state_at(13 * 32 + 3)] = uint(walk.fill);
    }
}

void load_state(out Walk walk, out Pixel p) {
    int lane = int(gl_LocalInvocationID.x);
    float values[11];
    for (int i = 0; i < 11; ++i) {
        values[i] = uintBitsToFloat(walk_state[state_at(i * 32 + lane)]);
    }
    p.silhouette = values[0];
    p.whole = values[1];
    p.rest = values[2];
    p.sum = values[3];
    p.color = vec3(values[4], values[5], values[6]);
    p.depth = values[7];
    p.normal = vec3(values[8], values[9], values[10]);
    p.nearest = int(walk_state[state_at(11 * 32 + lane)]);
    entries[lane] = walk_state[state_at(12 * 32 + lane)];
    walk.phase = walk_state[state_at(13 * 32)];
    walk.group = int(walk_state[state_at(13 * 32 + 1)]);
    walk.count = int(walk_state[state_at(13 * 32 + 2)]);
    walk.fill = int(walk_state[state_at(13 * 32 + 3)]);
}

void main() {
    bool resumes = frame.number != ONE_TURN;
    // Its tiles lie at the ends of the two halves of `tile_items`.
    uint end = frame.view_count * frame.tiles_x * frame.tiles_y * (resumes ? 2u : 1u);
    int number = int(texelFetch(tile_items, int(end - 1u - frame.first - gl_WorkGroupID.x)).x);
    TilePlace tile = tile_place(number);
    int lane = int(gl_LocalInvocationID.x);
    ivec2 mine = tile.corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
    Lane constant = Lane(vec2(mine), frame.radius_squared, frame.scale, 1.0 / frame.score_high);
    Source source = source_of(tile);
    int groups = (source.blocks + int(WORD_BITS) - 1) / int(WORD_BITS);
    Walk walk = Walk(COUNT, 0, 0, 0);
    Pixel pixels[PIXELS];
    pixels[0] = background_pixel();
    if (resumes && frame.number > 0u) {
        load_state(walk, pixels[0]);
        if (walk.phase == DONE) {
            return;
        }
    }
    barrier();
    // A group takes at most WALK_MOST_PASSES.
    uint budget = resumes ? LOOP_PASSES - WALK_MOST_PASSES : 0xffffffffu;
    uint passes = 0u;
    do {
        bool is_last = walk.group + 1 == groups;
        passes += take_group(source, walk);
        passes += gather_entries_at_hand(is_last, constant, walk, pixels);
        advance(is_last, walk);
    } while (walk.phase != DONE && passes < budget);
    if (resumes) {
        save_state(walk, pixels[0]);
    }
    if (walk.phase == DONE) {
        write_tile(tile, number, mine, pixels);
    }
}
