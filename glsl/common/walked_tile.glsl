// The tiles whose lists are not in memory, with the same bits as if they were. The kernel finds their entries again in the
// words of the tile's bin. If those had no room either, it tests the triangles of the bin's bitmap as bin_coarse.comp does. It
// walks over the bin three times: the first walk counts the entries, the second adds the front faces, the third the back faces.
// One workgroup of 32 lanes a tile. Each lane has one pixel, and one of the 32 blocks or entries that are looked at together.
// If a walk takes more loop passes than the device allows, the next dispatch (frame.number) goes on from `walk_state`.
// Needs forward_tile.glsl with WALKED, and DRAWS_THIN: whether this kernel draws the tiles with a thin triangle, or the others,
// in frames that forward_soft.comp serves.

#include "common/tile_mask.glsl"

layout(set = 0, binding = 2) uniform usamplerBuffer bin_ranges;
layout(set = 0, binding = 14) uniform usamplerBuffer bin_bits;
layout(set = 0, binding = 15) uniform usamplerBuffer coarse_records;
layout(set = 0, binding = 16) uniform usamplerBuffer coarse_words;
layout(set = 0, binding = 17, std430) buffer WalkState { uint walk_state[]; };

// The words of a group's blocks: a bit for each entry, for each back face, and for each thin triangle.
shared uint block_entries[WORD_BITS];
shared uint block_aways[WORD_BITS];
shared uint block_thins[WORD_BITS];
// The bits of bits_of_workgroup.
shared uint lanes_live;
shared uint lanes_away;
shared uint lanes_thin;

// The phases of the walks over a bin: count the entries, add the front faces, add the back faces, end.
const uint COUNT = 0u;
const uint FRONT = 1u;
const uint BACK = 2u;
const uint DONE = 3u;
// The tile is the other kernel's.
const uint NOT_OURS = 4u;

// Where to find the entries of a tile.
struct Source {
    // Whether the bin has a list. Else there is its bitmap.
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
    // Whether a thin triangle is among those counted.
    bool thin;
};

Source source_of(TileLocation location) {
    Shape shape = shape_of(location.view);
    ivec2 tile = location.corner / ivec2(TILE_WIDTH, TILE_HEIGHT);
    Source s;
    s.bin = tile / int(BIN_TILES);
    ivec2 inside = tile - s.bin * int(BIN_TILES);
    s.tile = inside.y * int(BIN_TILES) + inside.x;
    int bin = s.bin.y * int(frame.bins_x) + s.bin.x;
    uvec2 range = texelFetch(bin_ranges, shape.bin_base + bin).xy;
    s.listed = range.x != NO_LIST;
    s.first = s.listed ? int(range.x) : shape.record_base;
    s.words = s.listed ? s.first / int(WORD_BITS) * int(BLOCK_WORDS) : shape.word_base + bin * shape.word_count;
    s.blocks = s.listed ? (int(range.y) + int(WORD_BITS) - 1) / int(WORD_BITS) : shape.word_count;
    return s;
}

// The masks of a block's entries, of the back faces among them, and of the thin triangles.
struct Block {
    uint entries;
    uint away;
    uint thin;
};

// The masks of the lanes whose arguments are true. All lanes have them.
Block bits_of_workgroup(bool live, bool away, bool thin) {
    uint lane = gl_LocalInvocationID.x;
    barrier();
    if (lane == 0u) {
        lanes_live = 0u;
        lanes_away = 0u;
        lanes_thin = 0u;
    }
    barrier();
    atomicOr(lanes_live, live ? 1u << lane : 0u);
    atomicOr(lanes_away, away ? 1u << lane : 0u);
    atomicOr(lanes_thin, thin ? 1u << lane : 0u);
    barrier();
    return Block(lanes_live, lanes_away, lanes_thin);
}

// Reads the words of a group of blocks, one block a lane. Returns the mask of the blocks that have entries or, without a list,
// candidates.
uint read_group(Source s, int group) {
    int lane = int(gl_LocalInvocationID.x);
    int block = group * int(WORD_BITS) + lane;
    int at = min(block, s.blocks - 1);
    uint word;
    uint away = 0u;
    uint thin = 0u;
    if (s.listed) {
        int end = s.words + (at + 1) * int(BLOCK_WORDS);
        word = texelFetch(coarse_words, s.words + at * int(BLOCK_WORDS) + s.tile).x;
        away = texelFetch(coarse_words, end - 2).x;
        thin = texelFetch(coarse_words, end - 1).x;
    } else {
        word = texelFetch(bin_bits, s.words + at).x;
    }
    word = block < s.blocks ? word : 0u;
    block_entries[lane] = word;
    block_aways[lane] = away;
    block_thins[lane] = thin;
    return bits_of_workgroup(word != 0u, false, false).entries;
}

// The masks of a block of the group. Without a list its candidates are tested; `first` is the record of its first bit.
Block block_of(Source s, int block, int first) {
    Block own = Block(block_entries[block], block_aways[block], block_thins[block] & block_entries[block]);
    if (!s.listed) {
        uint lane = gl_LocalInvocationID.x;
        bool candidate = (own.entries >> lane & 1u) != 0u;
        Reach reach = reach_of_record(candidate ? first + int(lane) : s.first, s.bin);
        uint row = row_mask(reach, s.tile / int(BIN_TILES));
        bool touches = candidate && (row >> uint(s.tile % int(BIN_TILES)) & 1u) != 0u;
        own = bits_of_workgroup(touches, touches && PARTED && reach.away, touches && SOFT && reach.thin);
    }
    return own;
}

// Counts the next group's entries, or adds its front or back faces to the entries at hand. Returns the loop passes.
uint take_group(Source s, inout Walk walk) {
    uint lane = gl_LocalInvocationID.x;
    uint live = read_group(s, walk.group);
    uint passes = WALK_GROUP_PASSES + uint(bitCount(live));
    while (live != 0u) {
        int block = findLSB(live);
        live &= live - 1u;
        int first = s.first + (walk.group * int(WORD_BITS) + block) * int(WORD_BITS);
        Block own = block_of(s, block, first);
        if (walk.phase == COUNT) {
            walk.count += bitCount(own.entries);
            walk.thin = walk.thin || own.thin != 0u;
        } else {
            uint taken = walk.phase == FRONT ? own.entries & ~own.away : own.entries & own.away;
            if ((taken >> lane & 1u) != 0u) {
                int index = first + int(lane);
                uint record_index = s.listed ? texelFetch(coarse_records, index).x : uint(index);
                entries[walk.fill + bitCount(taken & ((1u << lane) - 1u))] = record_index;
            }
            walk.fill += bitCount(taken);
        }
    }
    barrier();
    return passes;
}

// Adds the entries at hand to the pixel, word by word. A word that is not full waits for the next group, unless this group is
// the last. Returns the loop passes.
uint gather_entries_at_hand(bool is_last, LaneConstants constants, inout Walk walk, inout Pixel pixels[PIXELS]) {
    float log_count = log2(float(walk.count));
    int lane = int(gl_LocalInvocationID.x);
    int from = 0;
    uint passes = 0u;
    while (walk.phase != DONE && from < walk.fill && (is_last || from + int(WORD_BITS) <= walk.fill)) {
        int stop = min(from + int(WORD_BITS), walk.fill);
        bool finished = gather_entries(from, stop, log_count, constants, pixels);
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

// Goes on with the next group, or with the next walk.
void advance(bool is_last, inout Walk walk) {
    walk.group = is_last ? 0 : walk.group + 1;
    bool ours = !SOFT || walk.thin == DRAWS_THIN;
    // Without parted lists all entries are in front.
    uint next = walk.phase == FRONT && !PARTED ? DONE : walk.phase + 1u;
    next = walk.phase == COUNT && !ours ? NOT_OURS : next;
    walk.phase = is_last && walk.phase != DONE ? next : walk.phase;
}

// An entry of `walk_state` has the floats of each pixel, then the nearest records, the entries at hand, the walk, with OPACITY
// the least factors, and the sums of features and their rounding errors.
const int STATE_FLOATS = 20;
const int STATE_NEAREST = 32 * STATE_FLOATS;
const int STATE_ENTRIES = STATE_NEAREST + 32;
const int STATE_WALK = STATE_ENTRIES + 32;
const int STATE_FEATURES = int(WALK_STATE_WORDS) + int(OPACITY) * int(WALK_OPACITY_WORDS);

// The index in `walk_state` of a word of this tile's entry.
uint state_at(int word) {
    uint words = uint(STATE_FEATURES) + uint(FEATURES) * WALK_FEATURE_WORDS;
    return gl_WorkGroupID.x * words + uint(word);
}

// The index in `walk_state` of a component of texel i of the features of this lane's pixel.
uint feature_at(int i, int component) {
    return state_at(STATE_FEATURES + (4 * i + component) * 32 + int(gl_LocalInvocationID.x));
}

void save_state(Walk walk, Pixel p) {
    int lane = int(gl_LocalInvocationID.x);
    Excess x = p.excess;
    float values[STATE_FLOATS] = float[](
        p.silhouette, p.exponent, p.fraction, p.sum, p.color.r, p.color.g, p.color.b, p.depth, p.normal.x, p.normal.y,
        p.normal.z, x.silhouette, x.sum, x.color.r, x.color.g, x.color.b, x.depth, x.normal.x, x.normal.y, x.normal.z);
    for (int i = 0; i < STATE_FLOATS; ++i) {
        walk_state[state_at(i * 32 + lane)] = floatBitsToUint(values[i]);
    }
    walk_state[state_at(STATE_NEAREST + lane)] = uint(p.nearest);
    walk_state[state_at(STATE_ENTRIES + lane)] = entries[lane];
    if (OPACITY) {
        walk_state[state_at(int(WALK_STATE_WORDS) + lane)] = floatBitsToUint(p.least);
    }
    for (int i = 0; i < FEATURES; ++i) {
        for (int k = 0; k < 4; ++k) {
            walk_state[feature_at(i, k)] = floatBitsToUint(feature_sums[i][k]);
            walk_state[feature_at(FEATURE_ROOM + i, k)] = floatBitsToUint(feature_excess[i][k]);
        }
    }
    if (lane == 0) {
        walk_state[state_at(STATE_WALK)] = walk.phase;
        walk_state[state_at(STATE_WALK + 1)] = uint(walk.group);
        walk_state[state_at(STATE_WALK + 2)] = uint(walk.count);
        walk_state[state_at(STATE_WALK + 3)] = uint(walk.fill);
        walk_state[state_at(STATE_WALK + 4)] = walk.thin ? 1u : 0u;
    }
}

void load_state(out Walk walk, out Pixel p) {
    int lane = int(gl_LocalInvocationID.x);
    float v[STATE_FLOATS];
    for (int i = 0; i < STATE_FLOATS; ++i) {
        v[i] = uintBitsToFloat(walk_state[state_at(i * 32 + lane)]);
    }
    p.silhouette = v[0];
    p.exponent = v[1];
    p.fraction = v[2];
    p.sum = v[3];
    p.color = vec3(v[4], v[5], v[6]);
    p.depth = v[7];
    p.normal = vec3(v[8], v[9], v[10]);
    p.excess = Excess(v[11], v[12], vec3(v[13], v[14], v[15]), v[16], vec3(v[17], v[18], v[19]));
    for (int i = 0; i < FEATURES; ++i) {
        for (int k = 0; k < 4; ++k) {
            feature_sums[i][k] = uintBitsToFloat(walk_state[feature_at(i, k)]);
            feature_excess[i][k] = uintBitsToFloat(walk_state[feature_at(FEATURE_ROOM + i, k)]);
        }
    }
    p.nearest = int(walk_state[state_at(STATE_NEAREST + lane)]);
    entries[lane] = walk_state[state_at(STATE_ENTRIES + lane)];
    p.least = OPACITY ? uintBitsToFloat(walk_state[state_at(int(WALK_STATE_WORDS) + lane)]) : 1.0;
    walk.phase = walk_state[state_at(STATE_WALK)];
    walk.group = int(walk_state[state_at(STATE_WALK + 1)]);
    walk.count = int(walk_state[state_at(STATE_WALK + 2)]);
    walk.fill = int(walk_state[state_at(STATE_WALK + 3)]);
    walk.thin = walk_state[state_at(STATE_WALK + 4)] != 0u;
}

// The number of the workgroup's tile. The tiles that are walked in one turn lie at the ends of the rows of the third part of
// `tile_items`. Those that take several turns lie at the end of the second part (bin_fine.comp).
int tile_number(bool resumes) {
    uint tiles = frame.view_count * frame.tiles_x * frame.tiles_y;
    uint end = resumes ? 2u * tiles - frame.first : 2u * tiles + min(frame.first + FORWARD_ROW, tiles);
    return int(texelFetch(tile_items, int(end - 1u - gl_WorkGroupID.x)).x);
}

void main() {
    bool resumes = frame.number != ONE_TURN;
    int number = tile_number(resumes);
    TileLocation tile = tile_location(number);
    LaneConstants constants = lane_constants(lane_corner(tile));
    Source source = source_of(tile);
    int groups = (source.blocks + int(WORD_BITS) - 1) / int(WORD_BITS);
    Walk walk = Walk(COUNT, 0, 0, 0, false);
    Pixel pixels[PIXELS];
    pixels[0] = first_pixel();
    clear_features();
    if (resumes && frame.number > 0u) {
        load_state(walk, pixels[0]);
        if (walk.phase >= DONE) {
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
        passes += gather_entries_at_hand(is_last, constants, walk, pixels);
        advance(is_last, walk);
    } while (walk.phase < DONE && passes < budget);
    if (resumes) {
        save_state(walk, pixels[0]);
    }
    if (walk.phase == DONE && walk.count == 0) {
        // background.comp and bin_fine.comp write the same for tiles that are known to be empty.
        write_pixel(tile, 0, background_pixel(), 1);
        write_bounds(number, bounds_of_pixel(background_pixel()));
    } else if (walk.phase == DONE) {
        write_tile(tile, number, pixels);
    }
}
