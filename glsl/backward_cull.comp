#version 450
#extension GL_GOOGLE_include_directive : require
// Backward, cull: selects the items that the upstream gradients depend on. A triangle whose largest weight is negligible in
// every tile of its box is visible in no shaded image and contributes to the silhouette only; where that is saturated too,
// its gradient is 0.
// One invocation an item. Reads `boxes`, `cells`, the records and `tile_bounds`; writes the lists `shown_items` and
// `outline_items`, their lengths as workgroups of indirect dispatches in `item_counts`, and zeros to the `partials` of items
// on neither list; of a frame with a vertex that is not finite all items are on neither. Writes to `status` whether the
// frame is complete. The order of the lists does not matter: every item has its own entry of `partials`. The records whose
// further cells found no room are listed in `long_records`, for backward_long.comp.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform isamplerBuffer boxes;
layout(set = 0, binding = 1) uniform usamplerBuffer cells;
layout(set = 0, binding = 2) uniform samplerBuffer shading;
layout(set = 0, binding = 3) uniform samplerBuffer tile_bounds;
layout(set = 0, binding = 4) uniform usamplerBuffer status;
layout(set = 0, binding = 5) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 6, std430) writeonly buffer ShownItems { uvec4 shown_items[]; };
layout(set = 0, binding = 7, std430) writeonly buffer OutlineItems { uvec4 outline_items[]; };
layout(set = 0, binding = 8, std430) buffer ItemCounts { uint item_counts[]; };
layout(set = 0, binding = 9, std430) writeonly buffer Partials { vec4 partials[]; };
layout(set = 0, binding = 10, std430) writeonly buffer Status { uint status_words[]; };
layout(set = 0, binding = 11) uniform usamplerBuffer cell_ranges;
layout(set = 0, binding = 12, std430) writeonly buffer LongRecords { uint long_records[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/item.glsl"
#include "common/hidden.glsl"
#include "common/relevance.glsl"

// Lanes of the workgroups that process small items.
layout(constant_id = 24) const uint LANES = 8u;

// Index of an item's entry on a list. Each row of FORWARD_ROW items has lists of its own, so that a length is a number of
// workgroups along one axis. Small items fill the row from its end, a workgroup for every LANES of them.
uint entry_on_list(uint index, uint list, bool small) {
    uint row = index / FORWARD_ROW;
    uint counts = row * ITEM_COUNT_WORDS + list;
    uint number = atomicAdd(item_counts[counts + (small ? ITEMS_SMALL_NUMBER : 0u)], 1u);
    if (small && number % LANES == 0u) {
        atomicAdd(item_counts[counts + ITEMS_SMALL], 1u);
    }
    uint end = min((row + 1u) * FORWARD_ROW, frame.record_count + frame.cell_capacity);
    return small ? end - 1u - number : row * FORWARD_ROW + number;
}

// Puts an item on the list of what it contributes to. Returns whether that is nothing.
bool is_left_out(uint index, uvec2 part) {
    if (part.x == NO_RECORD) {
        return false;
    }
    int record_index = int(part.x);
    ivec4 box = texelFetch(boxes, record_index);
    if (box.x > box.z || box.y > box.w) {
        return false;
    }
    // view_of relies on it that records lie in the order of the views.
    Item item = item_of(int(index), record_index, int(part.y), view_of(record_index), box);
    bool is_record = index < frame.record_count;
    if (is_record && texelFetch(cell_ranges, record_index).y == 0u && cells_of(box) > 1) {
        uint row = index / FORWARD_ROW;
        uint entry = atomicAdd(item_counts[row * ITEM_COUNT_WORDS + ITEMS_LONG], 1u);
        long_records[row * FORWARD_ROW + entry] = index;
    }
    Relevance relevance = relevance_of(item);
    // Further cells are never small, because backward_long has all lanes share them.
    uint most = relevance.shows ? SMALL_SHOWN_WORK : SMALL_OUTLINE_WORK;
    bool small = is_record && uint(item.size.x * item.size.y) * LANES <= most;
    bool listed = relevance.shows || relevance.outlines;
    if (listed) {
        uint entry = entry_on_list(index, relevance.shows ? ITEMS_SHOWN : ITEMS_OUTLINE, small);
        if (relevance.shows) {
            shown_items[entry] = packed(item);
        } else {
            outline_items[entry] = packed(item);
        }
    }
    return !listed;
}

void main() {
    uint index = gl_WorkGroupID.z * FORWARD_ROW * LINEAR_GROUP + gl_GlobalInvocationID.x;
    uint records = frame.record_count;
    uint extra = min(texelFetch(status, int(STATUS_CELLS_NEEDED)).x, frame.cell_capacity);
    if (index >= records + extra) {
        return;
    }
    bool finite = texelFetch(status, int(STATUS_NOT_FINITE)).x == 0u;
    if (index == 0u) {
        status_words[STATUS_WHOLE] = finite ? 1u : 0u;
    }
    // With all items on neither list every gradient is zero.
    bool left_out = true;
    if (finite) {
        uvec2 part = index < records ? uvec2(index, 0u) : texelFetch(cells, int(index - records)).xy;
        left_out = is_left_out(index, part);
    }
    // On a software device a store that no lane makes takes as long as one of all lanes, so that the lists and the zeros are
    // written in one place each.
    if (left_out) {
        for (int i = 0; i < PARTIAL_STRIDE; ++i) {
            partials[int(index) * PARTIAL_STRIDE + i] = vec4(0.0);
        }
    }
}
