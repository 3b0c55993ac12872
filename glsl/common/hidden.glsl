// Whether a triangle weighs too little to change a pixel. Needs constants.glsl, modes.glsl, arithmetic.glsl and the buffer
// `shading`.

// log2 of the largest negligible quantity: half a unit in the last place of an f32 near 1.
const float NEXT_TO_NOTHING = -24.0;

// An upper bound of the triangle's log2 weight (eq. 3) in any pixel, from its shading record: the weight of the nearest corner
// with D = 1. The fraction of corner 0's log weight lies in another texel, and is at most a half.
float largest_weight(int record_index) {
    vec4 record = texelFetch(shading, record_index * SHADING_STRIDE + 1);
    vec2 corners = record.z * record.xy / (1.0 + record.xy);
    if (PARALLEL && record.z < 0.0) {
        corners = -record.z * record.xy;
    }
    return record.w + 0.5 + greater(greater(corners.x, corners.y), 0.0);
}

// Whether a weight of at most `largest` is negligible beside a sum of weights of at least `least`, both as log2.
bool is_hidden(float largest, float least) {
    // The margin covers the rounding of large logarithms.
    return largest + 1.0 + 1e-6 * abs(least) < least + NEXT_TO_NOTHING;
}
