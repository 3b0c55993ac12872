// The derivatives of one fragment by the features of its triangle's corners, and through them. The arrays lie beside struct Sums
// as in features.glsl.
// Needs pair.glsl and shared_records.glsl.

// Features of the item's corners, corner after corner, and the sums of dL by them.
vec4 corner_features[3 * FEATURE_ROOM];
vec4 feature_sums[3 * FEATURE_ROOM];

void clear_feature_sums() {
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        feature_sums[i] = vec4(0.0);
    }
}

// Adds the features' part of v_j, and of its product with the shares. Returns its derivatives by the shares.
vec3 features_by_share(PixelGradient g, vec3 share, vec3 weighted, inout float value, inout float by_all_shares) {
    vec3 by_share = vec3(0.0);
    for (int i = 0; i < UP_FEATURE_TEXELS; ++i) {
        vec4 by_features = texelFetch(pixel_gradients, g.entry * PIXEL_STRIDE + PIXEL_FEATURES_AT + i);
        by_features = mix(vec4(0.0), by_features, bvec4(g.received));
        mat3x4 corners = mat3x4(corner_features[i], corner_features[FEATURE_ROOM + i], corner_features[2 * FEATURE_ROOM + i]);
        // In forward's order of operations, as with colours.
        float own = dot(by_features, corners * share);
        value += own;
        by_all_shares += own;
        by_share += by_features * corners;
        for (int k = 0; k < 3 * int(GRAD_FEATURES); ++k) {
            feature_sums[k * FEATURE_ROOM + i] += by_features * weighted[k];
        }
    }
    return by_share;
}
