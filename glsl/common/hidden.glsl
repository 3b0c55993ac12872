// When a triangle weighs too little to change a pixel. Needs constants.glsl, modes.glsl and the buffer `shading`.

// log2 of the largest negligible quantity: half a unit in the last place of an f32 near 1.
const float NEXT_TO_NOTHING = -24.0;

// An upper bound of the triangle's log2 weight in any pixel, from its shading record.
float largest_weight(int record_index) {
    return texelFetch(shading, record_index * SHADING_STRIDE + 3).z;
}

// Whether a weight of at most `largest` is negligible beside a sum of weights of at least `least`, both as log2.
bool is_hidden(float largest, float least) {
    // The margin covers the rounding of large logarithms.
    return largest + 1.0 + 1e-6 * abs(least) < least + NEXT_TO_NOTHING;
}
