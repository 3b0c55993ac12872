// Tiles and pixels of all views: where a tile lies, and the index of a pixel in the image buffers.
// Needs constants.glsl, frame.glsl and arithmetic.glsl.

struct TileLocation {
    int view;
    // First column and row of the tile.
    ivec2 corner;
};

// The tile with this number among the tiles of all views. There are at most 2^18 views, so both quotients are exact.
TileLocation tile_location(int number) {
    int tiles = int(frame.tiles_x * frame.tiles_y);
    int view = quotient(number, tiles);
    int tile = number - view * tiles;
    int row = quotient(tile, int(frame.tiles_x));
    return TileLocation(view, ivec2(tile - row * int(frame.tiles_x), row) * ivec2(TILE_WIDTH, TILE_HEIGHT));
}

// Index of the pixel `where` (column, row) of a view in the image buffers.
int pixel_index(int view, ivec2 where) {
    return (view * int(frame.height) + where.y) * int(frame.width) + where.x;
}
