// The work items of backward: one for each triangle's pixel box, or one for each cell of a box larger than a cell. The first
// cell's item has the record's index. The others follow behind all records. Needs constants.glsl and arithmetic.glsl.

struct Item {
    // The index of its entry of `partials`, and that of the triangle's record.
    int index;
    int record_index;
    int view;
    // First column and row of its pixels, and the number of columns and rows: at most a cell.
    ivec2 first;
    ivec2 size;
};

// The number of cells of a box.
int cells_of(ivec4 box) {
    ivec2 count = (box.zw - box.xy) / ivec2(CELL_WIDTH, CELL_HEIGHT) + 1;
    return count.x * count.y;
}

// The item of one cell of a box.
Item item_of(int index, int record_index, int cell, int view, ivec4 box) {
    int columns = (box.z - box.x) / int(CELL_WIDTH) + 1;
    int row = quotient(cell, columns);
    ivec2 first = box.xy + ivec2(cell - row * columns, row) * ivec2(CELL_WIDTH, CELL_HEIGHT);
    return Item(index, record_index, view, first, min(box.zw - first + 1, ivec2(CELL_WIDTH, CELL_HEIGHT)));
}

// An item in four words. Columns and rows take 14 bits and views 18 (the plan ensures both), a cell's size 6 and 5.
uvec4 packed(Item i) {
    uvec2 first = uvec2(i.first);
    uvec2 more = uvec2(i.size - 1);
    return uvec4(first.x | more.x << 14 | more.y << 20, first.y | uint(i.view) << 14, uint(i.record_index), uint(i.index));
}

Item unpacked(uvec4 words) {
    Item i;
    i.first = ivec2(words.xy & 16383u);
    i.size = ivec2((words.xx >> uvec2(14u, 20u)) & uvec2(63u, 31u)) + 1;
    i.view = int(words.y >> 14);
    i.record_index = int(words.z);
    i.index = int(words.w);
    return i;
}
