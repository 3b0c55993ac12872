// The running sums of one pixel over its fragments, and what forward saves of them for backward:
// I = Σ_j w_j C_j + w_b C_b (eq. 2), w_j = D_j exp(ζ_j/γ) / (Σ_k D_k exp(ζ_k/γ) + exp(ε/γ)) (eq. 3), A = 1 - Π_j (1 - D_j)
// (eq. 5). Needs constants.glsl, modes.glsl and frame.glsl.

struct Pixel {
    // The aggregate of SILHOUETTE_MODE: the transmittance Π(1 - D) (eq. 5), Σ D, or 1 where any D > 1/2.
    float silhouette;
    // The largest log2 weight log2 exp(ζ/γ) so far (eq. 3), as integer part and fraction. `sum`, the denominator of eq. 3,
    // and the images' sums that follow are relative to it.
    float exponent;
    float fraction;
    float sum;
    vec3 color;
    float depth;
    vec3 normal;
    // For the hard mode: the nearest triangle's record index.
    int nearest;
};

// A pixel without fragments: its sums hold the background's weight exp(ε/γ) of eq. 3, unless the background is composite.
Pixel background_pixel() {
    Pixel p;
    p.silhouette = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 : 0.0;
    bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
    p.exponent = entry ? frame.background_exponent : -3e38;
    p.fraction = entry ? frame.background_fraction : 0.0;
    p.sum = entry ? 1.0 : 0.0;
    p.color = entry ? vec3(frame.background_red, frame.background_green, frame.background_blue) : vec3(0.0);
    p.depth = 0.0;
    p.normal = vec3(0.0);
    p.nearest = 0;
    return p;
}

// What forward saves for backward: the log2 weight that the sums are relative to (integer part and fraction; for the hard
// mode the record index), the inverse of `sum`, and the silhouette's aggregate.
vec4 kept_of(Pixel p) {
    // The record index goes into two floats that hold it exactly.
    bool hard = COLOR_MODE == COLOR_HARD;
    vec2 reference = hard ? vec2(p.nearest >> 12, p.nearest & 4095) : vec2(p.exponent, p.fraction);
    return vec4(reference, p.sum > 0.0 ? 1.0 / p.sum : 0.0, p.silhouette);
}

// The log2 sum of weights and the transmittance of a pixel. Their least and largest value over a tile tell backward what it
// may skip there: a triangle whose weights are all negligible beside the smallest sum, and the silhouette of a saturated
// tile.
vec2 bounds_of(Pixel p) {
    float log_sum = p.sum > 0.0 ? p.exponent + (p.fraction + log2(p.sum)) : -3e38;
    // The hard mode and the silhouette alone have no weights.
    bool known = SHADED && COLOR_MODE == COLOR_SOFTMAX;
    return vec2(known ? log_sum : -3e38, SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? p.silhouette : 1.0);
}
