// What a pixel has gathered.

struct Pixel {
    // Π(1 - D); or Σ D; or 1 where any D > 1/2, as SILHOUETTE_MODE says.
    float silhouette;
    // The largest log2 depth weight so far, as whole part and rest, and sums relative to it.
    float whole;
    float rest;
    float sum;
    vec3 color;
    float depth;
    vec3 normal;
    // The hard modes' nearest slot.
    int nearest;
};

Pixel background_pixel() {
    Pixel p;
    p.silhouette = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 : 0.0;
    bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
    p.whole = entry ? frame.background_whole : -3e38;
    p.rest = entry ? frame.background_rest : 0.0;
    p.sum = entry ? 1.0 : 0.0;
    p.color = entry ? vec3(frame.background_red, frame.background_green, frame.background_blue) : vec3(0.0);
    p.depth = 0.0;
    p.normal = vec3(0.0);
    p.nearest = 0;
    return p;
}

// What backward needs of a pixel: the log2 weight that the softmax is relative to (whole part and rest; of the hard mode
// the slot), its inverse sum, and the silhouette's aggregate.
vec4 kept_of(Pixel p) {
    // Of the hard mode the slot, in two floats that hold it exactly.
    bool hard = COLOR_MODE == COLOR_HARD;
    vec2 reference = hard ? vec2(p.nearest >> 12, p.nearest & 4095) : vec2(p.whole, p.rest);
    return vec4(reference, p.sum > 0.0 ? 1.0 / p.sum : 0.0, p.silhouette);
}

// What backward may leave out in this tile: a triangle whose every weight is far below the smallest sum shows in none of
// its pixels, and where next to nothing is seen through a tile no triangle moves its silhouette.
vec2 bounds_of(Pixel p) {
    float log_sum = p.sum > 0.0 ? p.whole + (p.rest + log2(p.sum)) : -3e38;
    // Of the hard mode, and without colour, nothing is known of weights.
    bool known = SHADED && COLOR_MODE == COLOR_SOFTMAX;
    return vec2(known ? log_sum : -3e38, SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? p.silhouette : 1.0);
}
