// The tiles that have a list in memory, one workgroup each. Tiles with a list elsewhere (walked_tile.glsl) have an entry
// without a length here, because pixel_grad.comp goes through the same entries.
// Needs forward.comp or forward_soft.comp.

// Adds a list word by word. Front faces fill words of their own.
void gather_list(int from, int facing_end, int end, Lane lane, inout Pixel pixels[PIXELS]) {
    float log_count = log2(float(end - from));
    do {
        int stop = min(from + int(WORD_BITS), from < facing_end ? facing_end : end);
        from = gather_entries(from, stop, log_count, lane, pixels) ? end : stop;
    } while (from < end);
}

void main() {
    ivec4 item = ivec4(texelFetch(tile_items, int(frame.first + gl_WorkGroupID.x)));
    if (WALKS && item.w == 0) {
        return;
    }
    TileLocation tile = tile_location(item.x);
    Pixel pixels[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        pixels[i] = first_pixel();
    }
    gather_list(item.y, item.y + item.z, item.y + item.w, lane_at(lane_corner(tile)), pixels);
    write_tile(tile, item.x, pixels);
}
