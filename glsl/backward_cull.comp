#version 450
#extension GL_GOOGLE_include_directive : require
// Backward, cull: lists the items that the upstream gradients depend on. A triangle whose largest weight is negligible in every
// tile of its box is visible in no shaded image: it contributes to the silhouette only. If the silhouette is saturated too, the
// triangle's gradient is 0.
// One invocation an item. Reads `boxes`, `cells`, the records and `tile_bounds`. Writes:
// - the lists `shown_items` and `outline_items`, in any order: every item has its own entry of `partials`;
// - `item_counts`: the lengths of the lists, as workgroups of indirect dispatches;
// - `item_marks` (MARK_): whether an item is on a list and so has an entry of `partials`, and how many further items a record
//   has;
// - `long_records`: the records whose further cells found no room. backward_long adds these to the records' entries;
// - `status`: whether the frame is complete.
// If any vertex is not finite, both lists stay empty.

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
layout(set = 0, binding = 13, std430) writeonly buffer ItemMarks { uint item_marks[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/gradient_modes.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"
#include "common/arithmetic.glsl"
#include "common/item.glsl"
#include "common/hidden.glsl"
#include "common/relevance.glsl"

// The most pixels of a small item, which one lane processes alone: of an item that is visible in the shaded images, and of one
// that contributes to the silhouette only.
layout(constant_id = 24) const uint SMALL_SHOWN_PIXELS = 8u;
layout(constant_id = 32) const uint SMALL_OUTLINE_PIXELS = 64u;
// Lanes of a workgroup of small items.
layout(constant_id = 31) const uint SMALL_LANES = 8u;

// Makes room for an item on a list, and returns the index of its entry. Each row of FORWARD_ROW items has lists of its own, so
// that a length is a number of workgroups along one axis. Small items fill the row from its end, and each SMALL_LANES of them
// take one workgroup.
uint entry_on_list(uint index, uint list, bool small) {
    uint row = index / FORWARD_ROW;
    uint counts = row * ITEM_COUNT_WORDS + list;
    uint number = atomicAdd(item_counts[counts + (small ? ITEMS_SMALL_NUMBER : 0u)], 1u);
    if (small && number % SMALL_LANES == 0u) {
        atomicAdd(item_counts[counts + ITEMS_SMALL], 1u);
    }
    uint end = min((row + 1u) * FORWARD_ROW, frame.record_count + frame.cell_capacity);
    return small ? end - 1u - number : row * FORWARD_ROW + number;
}

// Puts an item on the list of what it contributes to. Returns its mark. `is_long` tells whether backward_long adds further
// cells to its entry of `partials`.
uint mark_of(uint index, uvec2 part, out bool is_long) {
    is_long = false;
    if (part.x == NO_RECORD) {
        return 0u;
    }
    int record_index = int(part.x);
    ivec4 box = texelFetch(boxes, record_index);
    if (box.x > box.z || box.y > box.w) {
        return 0u;
    }
    // view_of needs the records in the order of the views.
    Item item = item_of(int(index), record_index, int(part.y), view_of(record_index), box);
    bool is_record = index < frame.record_count;
    uint further = is_record ? texelFetch(cell_ranges, record_index).y : 0u;
    bool large = is_record && cells_of(box) > 1;
    is_long = large && further == 0u;
    if (is_long) {
        uint row = index / FORWARD_ROW;
        uint entry = atomicAdd(item_counts[row * ITEM_COUNT_WORDS + ITEMS_LONG], 1u);
        long_records[row * FORWARD_ROW + entry] = index;
    }
    Relevance relevance = relevance_of(item);
    // Further cells are never small, because backward_long has all lanes share them.
    uint most = relevance.shows ? SMALL_SHOWN_PIXELS : SMALL_OUTLINE_PIXELS;
    bool small = is_record && uint(item.size.x * item.size.y) <= most;
    bool listed = relevance.shows || relevance.outlines;
    if (listed) {
        uint entry = entry_on_list(index, relevance.shows ? ITEMS_SHOWN : ITEMS_OUTLINE, small);
        if (relevance.shows) {
            shown_items[entry] = packed(item);
        } else {
            outline_items[entry] = packed(item);
        }
    }
    return (listed || is_long ? MARK_SUMMED : 0u) | (large ? MARK_LARGE : 0u) | further << MARK_FURTHER_BIT;
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
    // If both lists are empty, every gradient is zero.
    uint mark = 0u;
    bool is_long = false;
    if (finite) {
        uvec2 part = index < records ? uvec2(index, 0u) : texelFetch(cells, int(index - records)).xy;
        mark = mark_of(index, part, is_long);
    }
    item_marks[index] = mark;
    // backward_long adds to this entry even if no list has the record itself. The condition is a number of passes: on a
    // software device a store that no lane makes takes as long as one of all lanes.
    int texels = is_long ? PARTIAL_STRIDE : 0;
    for (int i = 0; i < texels; ++i) {
        partials[int(index) * PARTIAL_STRIDE + i] = vec4(0.0);
    }
}
