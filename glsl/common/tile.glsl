// Tiles and pixels of all views: where a tile lies, and the index of a pixel in the image buffers.
// Needs constants.glsl and frame.glsl.

struct TilePlace {
    int view;
    // First column and row of the tile.
    ivec2 corner;
};

// The tile with a number among the tiles of all views.
TilePlace tile_place(int number) {
    int tiles = int(frame.tiles_x * frame.tiles_y);
    int view = number / tiles;
    int tile = number - view * tiles;
    int row = tile / int(frame.tiles_x);
    return TilePlace(view, ivec2(tile - row * int(frame.tiles_x), row) * ivec2(TILE_WIDTH, TILE_HEIGHT));
}

// Index of the pixel `where` (column, row) of a view in the image buffers.
int place_of(int view, ivec2 where) {
    return (view * int(frame.height) + where.y) * int(frame.width) + where.x;
}
