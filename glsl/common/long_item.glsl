// Backward, long: backward for the cells beyond the first of those boxes whose cells found no room, with the same bits. Each
// cell is processed as backward_cull and backward would have processed its item, and its sum is added to the record's own
// entry of `partials` in the order in which triangle_grad adds the items of a record.
// One workgroup a record of `long_records`, after backward has processed the first cells. A box of more cells than a loop of
// the device can pixels takes several turns (frame.number).
// Reads `long_records` (as `items`), `boxes`, `tile_bounds` and what backward reads; adds to `partials` and `texel_sums`.
// Needs backward.comp with LONG.

layout(set = 0, binding = 9) uniform isamplerBuffer boxes;
layout(set = 0, binding = 10) uniform samplerBuffer tile_bounds;
layout(set = 0, binding = 11) uniform usamplerBuffer view_shapes;

#include "common/mesh.glsl"
#include "common/hidden.glsl"
#include "common/relevance.glsl"

void add_item(Item item, ItemTriangle triangle) {
    int lane = int(gl_LocalInvocationID.x);
    ItemPixels pixels = pixels_of(item, triangle.edges.origin);
    Sums s = no_sums();
    add_shared(triangle, pixels, s);
    if (GRAD_GEOMETRY) {
        corners_from_barycentrics(triangle.edges, pixels.first, s);
    }
    write_sums(s, triangle.corner, lane == 0, item.index);
}

void main() {
    int record_index = int(texelFetch(items, int(frame.first + gl_WorkGroupID.x)).x);
    ivec4 box = texelFetch(boxes, record_index);
    int view = view_of(record_index);
    ItemTriangle triangle = item_triangle_of(record_index);
    int first = 1 + int(frame.number * CELLS_PER_TURN);
    int end = min(first + int(CELLS_PER_TURN), cells_of(box));
    for (int cell = first; cell < end; ++cell) {
        Item item = item_of(record_index, record_index, cell, view, box);
        Relevance relevance = relevance_of(item);
        SHOWS = relevance.shows;
        if (relevance.shows || relevance.outlines) {
            add_item(item, triangle);
        }
    }
}
