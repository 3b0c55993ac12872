// What is left out since it is next to nothing.

// log2 of what is next to nothing: half a unit in the last place of an f32 near 1.
const float NEXT_TO_NOTHING = -24.0;

// The largest log2 weight that a pixel of the triangle may have.
float largest_weight(int slot) {
    return texelFetch(shading, slot * SHADING_STRIDE + 3).z;
}

// Whether what weighs at most `largest` counts for nothing beside a sum of at least `least`, both as log2.
bool is_hidden(float largest, float least) {
    // Room for the rounding of large logarithms.
    return largest + 1.0 + 1e-6 * abs(least) < least + NEXT_TO_NOTHING;
}
