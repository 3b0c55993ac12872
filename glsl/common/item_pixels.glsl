// The pixels of an item of backward. Lanes that share an item take its pixels by number (pair_at). A lane that has a small item
// alone takes them row by row, and of each row only those between the edges' half-planes grown by the culling radius. Every
// other fragment of the box is dropped, so the sums have the same bits. On spot at 256² a lane takes 0.82 of the box's pixels.
// Needs constants.glsl, modes.glsl, frame.glsl, arithmetic.glsl and record.glsl.

// The pixels of an item.
struct ItemPixels {
    int count;
    float width;
    float inverse_width;
    // Column and row of the first pixel relative to the record's origin.
    vec2 first;
    // Index of the first pixel in the images, and the width of these.
    int first_entry;
    float image_width;
};

// One pixel of an item.
struct Pair {
    // Column and row relative to the item's first pixel, and relative to the record's origin.
    vec2 local;
    vec2 q;
    // Index of the pixel in the images.
    int entry;
    // False past the item's last pixel.
    bool exists;
};

// An item has at most 32 rows, so that a float holds the distance in the images exactly.
Pair pair_of(ItemPixels p, vec2 local, bool exists) {
    return Pair(local, p.first + local, p.first_entry + int(local.y * p.image_width + local.x), exists);
}

Pair pair_at(ItemPixels p, int index) {
    int at = min(index, p.count - 1);
    float number = float(at);
    float row = floor((number + 0.5) * p.inverse_width);
    return pair_of(p, vec2(number - row * p.width, row), index < p.count);
}

// The first and the last column of a row between the edges' grown half-planes: their values in row 0, and the change per row.
// At most two of a triangle's edges bound the same side.
struct ColumnBounds {
    vec2 first;
    vec2 first_step;
    vec2 last;
    vec2 last_step;
    float last_column;
    float last_row;
};

// Where a lane stands. It takes the next `left` pixels of the row from `column` on, then those of the row below.
struct RowPosition {
    float row;
    float column;
    float left;
    // First column and number of pixels in the row below.
    vec2 below;
};

// An edge bounds the columns only if its normal has at least this component across them. The bound of a flatter edge loses
// digits.
const float STEEP = 0.01;

void bound_by(vec4 line, float inverse_height, ItemPixels pixels, inout ColumnBounds b) {
    float reach = DISTANCE == DISTANCE_BARYCENTRIC ? frame.barycentric_radius / inverse_height : sqrt(frame.radius_squared);
    // 0.1 % and a hundredth of a pixel cover rounding.
    reach = 1.001 * reach + 0.01 * frame.scale;
    float inverse = -1.0 / (abs(line.x) > STEEP * frame.scale ? line.x : frame.scale);
    vec2 column = vec2(line.x * pixels.first.x + line.y * pixels.first.y + line.z + reach, line.y) * inverse;
    // The end lines of a triangle without area bound nothing: their inverse height is not positive. Nor does a point's line.
    bool bounds = inverse_height > 0.0 && line.z < 1e14;
    bool low = bounds && line.x > STEEP * frame.scale;
    bool high = bounds && line.x < -STEEP * frame.scale;
    b.first = vec2(low ? column.x : b.first.x, low ? b.first.x : b.first.y);
    b.first_step = vec2(low ? column.y : b.first_step.x, low ? b.first_step.x : b.first_step.y);
    b.last = vec2(high ? column.x : b.last.x, high ? b.last.x : b.last.y);
    b.last_step = vec2(high ? column.y : b.last_step.x, high ? b.last_step.x : b.last_step.y);
}

ColumnBounds column_bounds_of(Triangle t, ItemPixels pixels, ivec2 size) {
    ColumnBounds b;
    b.last_column = float(size.x - 1);
    b.last_row = float(size.y - 1);
    b.first = vec2(0.0);
    b.last = vec2(b.last_column);
    b.first_step = b.last_step = vec2(0.0);
    bound_by(t.line0, t.inverse_height.x, pixels, b);
    bound_by(t.line1, t.inverse_height.y, pixels, b);
    bound_by(t.line2, t.inverse_height.z, pixels, b);
    return b;
}

// The first column of a row and the number of its pixels. A row past the last one has none.
vec2 span_of(ColumnBounds b, float row) {
    vec2 first = b.first + b.first_step * row;
    vec2 last = b.last + b.last_step * row;
    float from = ceil(greater(greater(first.x, first.y), 0.0));
    float to = floor(lesser(lesser(last.x, last.y), b.last_column));
    float count = greater(to - from + 1.0, 0.0);
    return vec2(from, row <= b.last_row ? count : 0.0);
}

// The first position of a lane. Without an item it is past the end.
RowPosition first_position(ColumnBounds b, bool exists) {
    vec2 own = span_of(b, 0.0);
    return RowPosition(exists ? 0.0 : b.last_row + 1.0, own.x, exists ? own.y : 0.0, exists ? span_of(b, 1.0) : vec2(0.0));
}

bool has_pixels(RowPosition p, ColumnBounds b) {
    return p.row < b.last_row || (p.row == b.last_row && p.left > 0.0);
}

// The pixel `i` places further on, within this row and the one below it.
Pair pair_after(ItemPixels pixels, RowPosition p, int i) {
    float over = float(i) - p.left;
    bool here = over < 0.0;
    bool exists = over < p.below.y;
    vec2 local = vec2(here ? p.column + float(i) : p.below.x + over, here ? p.row : p.row + 1.0);
    return pair_of(pixels, vec2(exists ? local.x : 0.0, exists ? local.y : 0.0), exists);
}

// The position after `count` pixels, or after fewer if this row and the one below it have no more.
RowPosition advanced(RowPosition p, ColumnBounds b, int count) {
    float over = float(count) - p.left;
    bool ends = over >= 0.0;
    RowPosition next;
    next.row = ends ? p.row + 1.0 : p.row;
    next.column = ends ? p.below.x + over : p.column + float(count);
    next.left = ends ? greater(p.below.y - over, 0.0) : p.left - float(count);
    next.below = span_of(b, next.row + 1.0);
    return next;
}

// How often a lane takes `count` pixels until none is left. It is at least once.
int turns_of(RowPosition p, ColumnBounds b, int count) {
    int turns = 0;
    do {
        p = advanced(p, b, count);
        ++turns;
    } while (has_pixels(p, b));
    return turns;
}
