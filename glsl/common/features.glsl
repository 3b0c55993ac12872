// The features of a lane's pixels: Σ w f of eq. 2 with features f in place of colours, before a background of zeros. Their sums
// lie beside struct Pixel, because GLSL copies no struct that has an array whose length is a specialization constant.
// Needs shared_records.glsl, images.glsl and the buffer `feature_image`.

// Features of the corners of the entry that is added, corner after corner.
vec4 corner_features[3 * FEATURE_ROOM];
// The sums of a pixel, of its word, and the sum's rounding error (Excess in pixel.glsl), FEATURE_ROOM of each pixel of a lane.
vec4 feature_sums[PIXELS * FEATURE_ROOM];
vec4 feature_words[PIXELS * FEATURE_ROOM];
vec4 feature_excess[PIXELS * FEATURE_ROOM];

void clear_features() {
    for (int i = 0; i < PIXELS * FEATURES; ++i) {
        feature_sums[i] = vec4(0.0);
        feature_excess[i] = vec4(0.0);
    }
}

void clear_feature_words() {
    for (int i = 0; i < PIXELS * FEATURES; ++i) {
        feature_words[i] = vec4(0.0);
    }
}

// Reads the corners' features in units of `unit`, for all lanes of the workgroup.
void read_features(Fetched own, bool is_second, float unit) {
    for (int i = 0; i < 3 * FEATURES; ++i) {
        corner_features[i] = shared_shading_texel(own, is_second, SHADING_FEATURES_AT + i) * unit;
    }
}

// Adds the features at a mixture of the corners to the word of pixel i, which is `keep` times as large as before.
void add_features(int i, vec3 mixture, float keep) {
    for (int k = 0; k < FEATURES; ++k) {
        mat3x4 corners = mat3x4(corner_features[k], corner_features[FEATURE_ROOM + k], corner_features[2 * FEATURE_ROOM + k]);
        feature_words[i * FEATURE_ROOM + k] = feature_words[i * FEATURE_ROOM + k] * keep + corners * mixture;
    }
}

// Adds the word of pixel i to its sums, as add_word_shaded does with the other images.
void add_word_features(int i, float keep) {
    for (int k = 0; k < FEATURES; ++k) {
        int at = i * FEATURE_ROOM + k;
        add_word(feature_words[at], keep, feature_sums[at], feature_excess[at]);
    }
}

// Writes the features of pixel i, whose sums are in units of COLOR_UNIT, to index `at`.
void write_features(int i, Pixel p, int at, int triangle_count) {
    float inverse = p.sum > 0.0 ? 1.0 / p.sum : 0.0;
    float blend = COMPOSITE ? alpha_of(p, triangle_count) : 1.0;
    for (int k = 0; k < FEATURES; ++k) {
        vec4 sum = feature_sums[i * FEATURE_ROOM + k] / COLOR_UNIT;
        feature_image[at * FEATURE_ROOM + k] = p.sum > 0.0 ? sum * inverse * blend : vec4(0.0);
    }
}
