// A tile's and a pixel's place in the images, and what it shows there.

struct TilePlace {
    int view;
    // Its first column and row.
    ivec2 corner;
};

// Of a tile's number among all views'.
TilePlace tile_place(int number) {
    int tiles = int(frame.tiles_x * frame.tiles_y);
    int view = number / tiles;
    int tile = number - view * tiles;
    int row = tile / int(frame.tiles_x);
    return TilePlace(view, ivec2(tile - row * int(frame.tiles_x), row) * ivec2(TILE_WIDTH, TILE_HEIGHT));
}

int place_of(int view, ivec2 where) {
    return (view * int(frame.height) + where.y) * int(frame.width) + where.x;
}

void write_images(Pixel p, int at, int triangle_count) {
    float alpha = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 - p.silhouette : p.silhouette;
    if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        // Along their seam the two pieces of a triangle that near cuts may add up to more than it.
        alpha = min(alpha / float(max(triangle_count, 1)), 1.0);
    }
    vec3 background = vec3(frame.background_red, frame.background_green, frame.background_blue);
    bool covered = p.sum > 0.0;
    float inverse = covered ? 1.0 / p.sum : 0.0;
    // The hard mode's depth and normal are those of a surface, not of a mixture.
    float blend = COMPOSITE && COLOR_MODE == COLOR_SOFTMAX ? alpha : 1.0;
    if (WANT_COLOR) {
        vec3 mixed = covered ? p.color * inverse : background;
        vec3 rgb = COMPOSITE ? (covered ? mixed * alpha + background * (1.0 - alpha) : background) : mixed;
        color[at] = vec4(rgb, (OUTPUTS & OUTPUT_SILHOUETTE) != 0u ? alpha : 1.0);
    } else if ((OUTPUTS & OUTPUT_SILHOUETTE) != 0u) {
        silhouette[at] = alpha;
    }
    if (WANT_DEPTH) {
        depths[at] = p.depth * inverse * blend;
    }
    if (WANT_NORMAL) {
        normals[at] = vec4(p.normal * (inverse * blend), 0.0);
    }
}
