// The running sums of one pixel over its fragments, and what forward saves of them for backward:
// I = Σ_j w_j C_j + w_b C_b (eq. 2), w_j = D_j exp(ζ_j/γ) / (Σ_k D_k exp(ζ_k/γ) + exp(ε/γ)) (eq. 3), A = 1 - Π_j (1 - D_j)
// (eq. 5). Needs constants.glsl, modes.glsl and frame.glsl.

// Kahan compensation: the rounding error so far of each of a pixel's sums, subtracted from the next term (Kahan, Further
// remarks on reducing truncation errors, 1965).
struct Excess {
    float silhouette;
    float sum;
    vec3 color;
    float depth;
    vec3 normal;
};

// The contribution of a word, which is WORD_BITS entries of a tile's list, to a pixel's silhouette: the factor Π(1 - D), and 1 -
// Π(1 - D), which keeps its own digits where D is small. The modes other than the product have their aggregate in `covered`.
struct Cover {
    float transmittance;
    float covered;
    // With LEAST_APART the least 1 - D of this word and of those before, and its D. The numbers above leave that factor out.
    float least;
    float most;
};

struct Pixel {
    // The aggregate of SILHOUETTE_MODE: the transmittance Π(1 - D) (eq. 5), Σ D, or 1 where any D > 1/2.
    float silhouette;
    // With LEAST_APART the least factor of the transmittance, which `silhouette` leaves out. ∂A/∂D' of a fragment is the
    // product of the other fragments' factors. If 1 - D is 0, it cannot be found from the product of all.
    float least;
    // The largest log2 weight log2 exp(ζ/γ) so far (eq. 3), as integer part and fraction. `sum`, which is the denominator of
    // eq. 3, and the images' sums below are relative to it.
    float exponent;
    float fraction;
    float sum;
    vec3 color;
    float depth;
    vec3 normal;
    // In the hard mode the record index of the nearest triangle.
    int nearest;
    Excess excess;
};

// A pixel without fragments. Unless the background is composite, its sums hold the background's weight exp(ε/γ) of eq. 3.
Pixel background_pixel() {
    Pixel p;
    p.silhouette = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 : 0.0;
    p.least = 1.0;
    bool entry = !COMPOSITE && COLOR_MODE == COLOR_SOFTMAX;
    p.exponent = entry ? frame.background_exponent : -3e38;
    p.fraction = entry ? frame.background_fraction : 0.0;
    p.sum = entry ? 1.0 : 0.0;
    p.color = entry ? vec3(frame.background_red, frame.background_green, frame.background_blue) : vec3(0.0);
    p.depth = 0.0;
    p.normal = vec3(0.0);
    p.nearest = 0;
    p.excess = Excess(0.0, 0.0, vec3(0.0), 0.0, vec3(0.0));
    return p;
}

// A word's entries have sums of their own, which are then added to the pixel's sums with compensation. So the error is that of
// 32 additions, however many layers there are.

// The sums of a word before its first entry: the pixel's reference, and zeros.
Pixel word_of(Pixel p) {
    Pixel word = p;
    word.sum = 0.0;
    word.color = vec3(0.0);
    word.depth = 0.0;
    word.normal = vec3(0.0);
    return word;
}

// Adds a word's sum to a total, `keep` times as large as before.
void add_word(float word, float keep, inout float total, inout float excess) {
    precise float term = word - excess * keep;
    precise float old = total * keep;
    precise float next = old + term;
    excess = (next - old) - term;
    total = next;
}

void add_word(vec3 word, float keep, inout vec3 total, inout vec3 excess) {
    precise vec3 term = word - excess * keep;
    precise vec3 old = total * keep;
    precise vec3 next = old + term;
    excess = (next - old) - term;
    total = next;
}

void add_word(vec4 word, float keep, inout vec4 total, inout vec4 excess) {
    precise vec4 term = word - excess * keep;
    precise vec4 old = total * keep;
    precise vec4 next = old + term;
    excess = (next - old) - term;
    total = next;
}

// Adds a word's sums of eq. 2 and 3. `keep` brings the pixel's sums to the word's reference, which is not less than theirs.
void add_word_shaded(Pixel word, float keep, inout Pixel p) {
    p.exponent = word.exponent;
    p.fraction = word.fraction;
    p.nearest = word.nearest;
    add_word(word.sum, keep, p.sum, p.excess.sum);
    if (WANT_COLOR) {
        add_word(word.color, keep, p.color, p.excess.color);
    }
    if (WANT_DEPTH) {
        add_word(word.depth, keep, p.depth, p.excess.depth);
    }
    if (WANT_NORMAL) {
        add_word(word.normal, keep, p.normal, p.excess.normal);
    }
}

// Adds a word to the silhouette (eq. 5). If its factor is above 1/2, the transmittance loses a difference, which keeps its digits
// beside 1. Else the factor is multiplied, so that a small transmittance keeps its digits.
void add_word_cover(Cover word, inout Pixel p) {
    if (SILHOUETTE_MODE == SILHOUETTE_PRODUCT) {
        float total = p.silhouette;
        float excess = p.excess.silhouette;
        add_word(-total * word.covered, 1.0, total, excess);
        bool slight = word.covered < 0.5;
        p.silhouette = slight ? total : p.silhouette * word.transmittance;
        p.excess.silhouette = slight ? excess : p.excess.silhouette * word.transmittance;
        p.least = LEAST_APART ? word.least : p.least;
    } else if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        add_word(word.covered, 1.0, p.silhouette, p.excess.silhouette);
    } else {
        p.silhouette = word.covered > 0.5 ? 1.0 : p.silhouette;
    }
}

// The aggregate of SILHOUETTE_MODE.
float aggregate_of(Pixel p) {
    return LEAST_APART ? p.silhouette * p.least : p.silhouette;
}

// The values that forward saves for backward: the log2 sum of weights, as integer part and fraction, the silhouette's aggregate,
// and with LEAST_APART its least factor. In the hard mode the record index stands in place of the sum. With the sum as the
// reference w_j = D_j exp2(log weight - reference) (eq. 3).
vec4 saved_of(Pixel p) {
    // The record index goes into two floats that hold it exactly.
    bool hard = COLOR_MODE == COLOR_HARD;
    vec2 reference = hard ? vec2(p.nearest >> 12, p.nearest & 4095) : vec2(p.exponent, p.fraction + log2(p.sum));
    reference = p.sum > 0.0 ? reference : (hard ? NO_NEAREST : NO_WEIGHTS);
    return vec4(reference, p.silhouette, p.least);
}

// The log2 sum of weights and the transmittance of a pixel. The least sum and the largest transmittance of a tile tell backward
// what to skip there: a triangle whose weights are all negligible beside the least sum, and the silhouette of a saturated tile.
// With LEAST_APART the transmittance leaves out its least factor: the gradient by the alpha of the fragment with this factor is
// the product of the others.
vec2 bounds_of_pixel(Pixel p) {
    float log_sum = p.sum > 0.0 ? p.exponent + (p.fraction + log2(p.sum)) : -3e38;
    // The hard mode and the silhouette alone have no weights.
    bool known = SHADED && COLOR_MODE == COLOR_SOFTMAX;
    return vec2(known ? log_sum : -3e38, SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? p.silhouette : 1.0);
}
