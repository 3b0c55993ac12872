// The image values of a finished pixel (eq. 2 and 5).
// Needs constants.glsl, modes.glsl, frame.glsl, pixel.glsl and the image buffers.

// A = 1 - Π(1 - D) (eq. 5), or what SILHOUETTE_MODE has in its place.
float alpha_of(Pixel p, int triangle_count) {
    float alpha = SILHOUETTE_MODE == SILHOUETTE_PRODUCT ? 1.0 - aggregate_of(p) : p.silhouette;
    if (SILHOUETTE_MODE == SILHOUETTE_SUM) {
        // The near plane may cut a triangle in two pieces. Along their seam these may add up to more than the triangle.
        alpha = min(alpha / float(max(triangle_count, 1)), 1.0);
    }
    return alpha;
}

// Writes A, I = Σ w C + w_b C_b (eq. 2), and soft depth and normal, to index `at`. With the composite
// background I = A Σ w' C + (1 - A) C_b.
void write_images(Pixel p, int at, int triangle_count) {
    float alpha = alpha_of(p, triangle_count);
    vec3 background = vec3(frame.background_red, frame.background_green, frame.background_blue);
    bool covered = p.sum > 0.0;
    float inverse = covered ? 1.0 / p.sum : 0.0;
    // The hard mode's depth and normal belong to a surface and are not blended.
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
