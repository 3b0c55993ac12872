#version 450
#extension GL_GOOGLE_include_directive : require
// Backward, long: backward for the cells beyond the first of those boxes whose cells found no room, with the same bits. Each
// cell is processed as backward_cull and backward would have processed its item, and its sum is added to the record's own
// entry of `partials` in the order in which triangle_grad adds the items of a record.
// One workgroup a record of `long_records`, after backward has processed the first cells. A box of more cells than a loop of
// the device can walk takes several turns (frame.number).
// Reads `long_records` (as `items`), `boxes`, `tile_bounds`, the records and `pixel_gradients`; adds to `partials` and
// `texel_sums`.

#define LONG
#include "common/backward.glsl"

layout(set = 0, binding = 9) uniform isamplerBuffer boxes;
layout(set = 0, binding = 10) uniform samplerBuffer tile_bounds;
layout(set = 0, binding = 11) uniform usamplerBuffer view_shapes;

#include "common/mesh.glsl"
#include "common/hidden.glsl"
#include "common/relevance.glsl"

void add_item(Item item, Triangle t, Corner c, Ends ends) {
    int lane = int(gl_LocalInvocationID.x);
    WALKERS = is_small(item, gl_WorkGroupSize.x) ? 1 : int(gl_WorkGroupSize.x);
    STEP = PAIRS * WALKERS;
    Walk walk = Walk(item.first, item.size.x * item.size.y, item.size.x, 1.0 / float(item.size.x),
                     item.view * int(frame.height), int(frame.width));
    float radius_squared = frame.radius_squared;
    float scale = frame.scale;
    float inverse_score = 1.0 / frame.score_high;
    Sums s = no_sums();
    int turns = (walk.count + STEP - 1) / STEP;
    // A lane without a part of the item starts past its last pixel.
    int index = lane < WALKERS ? lane : walk.count;
    do {
        add_pairs(item.slot, walk, index, t, ends, c, radius_squared, scale, inverse_score, s);
        index += STEP;
        --turns;
    } while (turns > 0);
    add_turn(t, ends, s);
    write_sums(s, c, lane == 0, item.index);
}

void main() {
    int slot = int(texelFetch(items, int(frame.first + gl_WorkGroupID.x)).x);
    ivec4 box = texelFetch(boxes, slot);
    int view = view_of(slot);
    Triangle t = triangle_of(slot);
    Corner c;
    if (WANT_SHADING) {
        c = corner_of(slot);
    }
    Ends ends = ends_of(t);
    int first = 1 + int(frame.number * CELLS_PER_TURN);
    int end = min(first + int(CELLS_PER_TURN), cells_of(box));
    for (int cell = first; cell < end; ++cell) {
        Item item = item_of(slot, slot, cell, view, box);
        Relevance relevance = relevance_of(item);
        SHOWS = relevance.shows;
        if (relevance.shows || relevance.outlines) {
            add_item(item, t, c, ends);
        }
    }
}
