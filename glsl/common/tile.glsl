// Tiles and pixels of all views: where a tile lies, and the index of a pixel in the image buffers.
// Needs constants.glsl and frame.glsl.

struct TileLocation {
    int view;
    // First column and row of the tile.
    ivec2 corner;
};

// The quotient of natural numbers if it is less than 2^20, so that the division of floats errs by at most one. A software
// device divides integers lane by lane, which took a tenth of pixel_grad.comp.
int quotient(int number, int divisor) {
    int q = int(float(number) / float(divisor));
    int rest = number - q * divisor;
    return q + (rest < 0 ? -1 : rest >= divisor ? 1 : 0);
}

// The tile with a number among the tiles of all views, of which there are at most 2^18.
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
