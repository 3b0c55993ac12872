// The items of backward: one for every triangle's box, and where a box is larger than a cell one for every cell, the
// later ones behind the first items of all slots.

// (slot, cell) of an item.
ivec2 slot_and_cell(int item) {
    int slots = int(frame.slot_count);
    return item < slots ? ivec2(item, 0) : ivec2(texelFetch(cells, item - slots).xy);
}

// First and last column and row of an item's pixels: the box, or one cell of it.
ivec4 item_pixels(ivec4 box, int cell) {
    int columns = (box.z - box.x) / int(CELL_WIDTH) + 1;
    ivec2 first = box.xy + ivec2(cell % columns, cell / columns) * ivec2(CELL_WIDTH, CELL_HEIGHT);
    return ivec4(first, min(box.zw, first + ivec2(CELL_WIDTH, CELL_HEIGHT) - 1));
}
