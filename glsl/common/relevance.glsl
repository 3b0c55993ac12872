// The images that an item contributes to, among those that have upstream gradients.
// Needs constants.glsl, modes.glsl, gradient_modes.glsl, frame.glsl, item.glsl, hidden.glsl and the buffer `tile_bounds`.

struct Relevance {
    // Whether it is visible in a shaded image, and whether it changes the silhouette.
    bool shows;
    bool outlines;
};

// The least log sum and the largest transmittance of the tiles that the item's pixels lie in.
vec2 bounds_of_item(Item item) {
    ivec2 tile = ivec2(TILE_WIDTH, TILE_HEIGHT);
    int stride = int(frame.tiles_x);
    ivec2 at = item.first / tile;
    ivec2 last = (item.first + item.size - 1) / tile;
    int across = last.x - at.x + 1;
    int row = (item.view * int(frame.tiles_y) + at.y) * stride + at.x;
    int count = across * (last.y - at.y + 1);
    int x = 0;
    vec2 bounds = vec2(3e38, 0.0);
    // One loop takes the tiles row by row.
    do {
        vec2 own = texelFetch(tile_bounds, row + x).xy;
        bool mine = count > 0;
        bounds = vec2(mine && own.x < bounds.x ? own.x : bounds.x, mine && own.y > bounds.y ? own.y : bounds.y);
        ++x;
        row = x == across ? row + stride : row;
        x = x == across ? 0 : x;
        --count;
    } while (count > 0);
    return bounds;
}

Relevance relevance_of(Item item) {
    Relevance r = Relevance(UP_SHADED, UP_ALPHA);
    if (COLOR_MODE == COLOR_SOFTMAX || !UP_SHADED) {
        vec2 bounds = bounds_of_item(item);
        r.shows = UP_SHADED && !is_hidden(largest_weight(item.record_index), bounds.x);
        r.outlines = UP_ALPHA && bounds.y > exp2(NEXT_TO_NOTHING);
    }
    return r;
}
