// The items of backward: one for every triangle's box, and where a box is larger than a cell one for every cell, the
// later ones behind the first items of all slots.

struct Item {
    // Its place in `partials`.
    int index;
    int slot;
    int view;
    // First column and row of its pixels, and how many of each: at most a cell.
    ivec2 first;
    ivec2 size;
};

// The pixels of one cell of a box.
Item item_of(int index, int slot, int cell, int view, ivec4 box) {
    int columns = (box.z - box.x) / int(CELL_WIDTH) + 1;
    // Exact for counts this small, and a software device divides integers one by one.
    int row = int((float(cell) + 0.5) / float(columns));
    ivec2 first = box.xy + ivec2(cell - row * columns, row) * ivec2(CELL_WIDTH, CELL_HEIGHT);
    return Item(index, slot, view, first, min(box.zw - first + 1, ivec2(CELL_WIDTH, CELL_HEIGHT)));
}

// An item in four words. Columns and rows take 14 bits, views 18 (the plan sees to both), a cell's size 6 and 5.
uvec4 packed(Item i) {
    uvec2 first = uvec2(i.first);
    uvec2 more = uvec2(i.size - 1);
    return uvec4(first.x | more.x << 14 | more.y << 20, first.y | uint(i.view) << 14, uint(i.slot), uint(i.index));
}

Item unpacked(uvec4 words) {
    Item i;
    i.first = ivec2(words.xy & 16383u);
    i.size = ivec2((words.xx >> uvec2(14u, 20u)) & uvec2(63u, 31u)) + 1;
    i.view = int(words.y >> 14);
    i.slot = int(words.z);
    i.index = int(words.w);
    return i;
}
