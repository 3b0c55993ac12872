// Which tiles of a bin a triangle grown by the culling radius may touch. The tile lists are made of these answers.
// Everything is `precise`, so that each kernel gets the same answer.
// Needs constants.glsl, modes.glsl, frame.glsl, arithmetic.glsl, record.glsl and the buffer `boxes`.

// A column past the last one.
const float COLUMNS_END = float(BIN_TILES) + 1.0;

// The inputs of the tests of a triangle against the rows of tiles in one bin.
struct Reach {
    // Each edge bounds the columns of the tiles that touch the grown triangle, from below or above: `first` or `last` in row
    // 0, and a step per row. On the side that it does not bound it has -1 or COLUMNS_END, and a step of 0.
    vec3 first;
    vec3 first_step;
    vec3 last;
    vec3 last_step;
    // First column and row, last column and row of the box.
    ivec4 tiles;
    // Whether it is a back face.
    bool away;
    bool thin;
};

Reach reach_of_record(int record_index, ivec2 bin) {
    Triangle t = triangle_of(record_index);
    vec4 lines[3] = vec4[](t.line0, t.line1, t.line2);
    ivec4 box = texelFetch(boxes, record_index);
    ivec2 tile = ivec2(TILE_WIDTH, TILE_HEIGHT);
    Reach r;
    r.tiles.xy = max(box.xy / tile - bin * int(BIN_TILES), ivec2(0));
    r.tiles.zw = min(box.zw / tile - bin * int(BIN_TILES), ivec2(BIN_TILES - 1u));
    vec2 half_size = 0.5 * vec2(TILE_WIDTH - 1u, TILE_HEIGHT - 1u);
    precise vec2 centre = vec2(bin) * vec2(BIN_WIDTH, BIN_HEIGHT) + half_size - t.origin;
    for (int k = 0; k < 3; ++k) {
        vec4 line = lines[k];
        precise float reach = sqrt(frame.radius_squared);
        if (DISTANCE == DISTANCE_BARYCENTRIC) {
            reach = frame.barycentric_radius / t.inverse_height[k];
        }
        reach = 1.001 * reach + 0.01 * frame.scale;
        // The end lines of a triangle without area bound nothing: their inverse height is not positive. Nor does a point's
        // line.
        bool bounds = t.inverse_height[k] > 0.0 && line.z < 1e14;
        float nx = abs(line.x) < 1e-9 * frame.scale ? (line.x < 0.0 ? -1e-9 : 1e-9) * frame.scale : line.x;
        precise float spread = abs(line.x) * half_size.x + abs(line.y) * half_size.y;
        // The margin by which the tile of column 0 and row 0 touches the grown triangle, in the units of the line.
        precise float margin = line.x * centre.x + line.y * centre.y + line.z + spread + reach;
        precise float inverse = -1.0 / (nx * float(TILE_WIDTH));
        precise float column = margin * inverse;
        precise float step = line.y * float(TILE_HEIGHT) * inverse;
        // A thousandth of a tile covers rounding.
        bool below = bounds && nx > 0.0;
        r.first[k] = below ? column - 1e-3 : -1.0;
        r.first_step[k] = below ? step : 0.0;
        bool above = bounds && nx < 0.0;
        r.last[k] = above ? column + 1e-3 : COLUMNS_END;
        r.last_step[k] = above ? step : 0.0;
    }
    // The edges' inner normals have the orientation of the corners.
    precise float turn = t.line0.x * t.line1.y - t.line0.y * t.line1.x;
    r.away = (turn < 0.0) == CLOCKWISE_FRONT;
    r.thin = is_thin(t.half_length, t.inverse_height);
    return r;
}

// The mask of the tiles in a row: the interval of columns between the edges' half-planes.
uint row_mask(Reach r, int row) {
    precise vec3 first = r.first + r.first_step * float(row);
    precise vec3 last = r.last + r.last_step * float(row);
    float from = greater(greater(first.x, first.y), first.z);
    float to = lesser(lesser(last.x, last.y), last.z);
    int low = max(r.tiles.x, int(ceil(lesser(from, COLUMNS_END))));
    int high = min(r.tiles.z, int(floor(greater(to, -1.0))));
    bool touches = low <= high && row >= r.tiles.y && row <= r.tiles.w;
    return touches ? ((2u << uint(high)) - 1u) & ~((1u << uint(low)) - 1u) : 0u;
}
