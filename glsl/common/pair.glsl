// The values that forward computed for a fragment, that is for a (pixel, triangle) pair. Backward computes them again, with one
// function for each step of eq. 1 to 3. pair_gradient.glsl has the derivatives.
// Needs fragment.glsl, item_pixels.glsl, gradient_modes.glsl, SHOWS and the buffers `saved`,
// `pixel_gradients` and `silhouette_gradients`.

// The constants of all pairs of an item. Push constants are copied: on a software device each read in a loop is a gather.
struct ItemTriangle {
    Triangle edges;
    Corner corner;
    EdgeChoice choice;
    int record_index;
    float radius_squared;
    float scale;
    // Depth of corner 0.
    float z0;
    // dL/dz over dL/ds, with the log weight s = ζ/γ of eq. 3: -1/((far - near) γ).
    float weight_slope;
};

// The values that forward and pixel_grad.comp computed for a pixel.
struct PixelGradient {
    // dL by the mixture Σ w C, by the depth and by the normal.
    vec3 by_color;
    float by_depth;
    vec3 by_normal;
    // The pixel's factor of dL/dx through the silhouette.
    float by_silhouette;
    // The pixel's log2 sum of weights, as integer part and fraction. In the hard mode the nearest record's index.
    vec2 log_sum;
    // The pixel's entry of `pixel_gradients`, and whether the fragment takes its gradient from there.
    int entry;
    bool received;
    // V = Σ w v of eq. 4.
    float mean;
    // With LEAST_APART the least 1 - D' of the pixel, which `by_silhouette` leaves out.
    float least;
};

PixelGradient pixel_gradient_at(int entry) {
    PixelGradient g;
    // On a software device a texel of one float takes a third of the instructions that one of four takes.
    g.by_silhouette = UP_ALPHA ? texelFetch(silhouette_gradients, entry).x : 0.0;
    vec4 shaded = SHOWS ? texelFetch(pixel_gradients, entry * PIXEL_STRIDE) : vec4(0.0);
    vec4 surface = SHOWS && PIXEL_FEATURES_AT > 1 ? texelFetch(pixel_gradients, entry * PIXEL_STRIDE + 1) : vec4(0.0);
    vec4 sums = LEAST_APART || SHOWS && !DEPTH_ALONE ? texelFetch(saved, entry) : shaded;
    g.log_sum = sums.xy;
    g.entry = entry;
    g.least = LEAST_APART ? sums.w : 1.0;
    g.by_color = shaded.rgb;
    g.by_normal = surface.xyz;
    g.by_depth = DEPTH_ALONE ? shaded.w : surface.w;
    g.mean = DEPTH_ALONE ? shaded.z : shaded.w;
    return g;
}

// Whether a fragment's gradient depends on its barycentrics. These need the signed distances to all three lines.
bool has_surface() {
    return WANT_SHADING && (SHOWS || DEPTH_RANGE != DEPTH_RANGE_INSIDE || OPACITY);
}

// d² of eq. 1, its sign and its nearest point.
struct PairDistance {
    SignedDistance to_triangle;
    // For the Euclidean distance, and where the triangle is sampled there.
    NearestPoint nearest;
};

PairDistance distance_of_pair(ItemTriangle item, Pair pair) {
    PairDistance d;
    Triangle t = item.edges;
    if (has_surface()) {
        d.to_triangle.height = heights_at(t, pair.q);
    }
    NearestPoint n = nearest_point(t, item.choice, d.to_triangle.height, pair.q);
    d.nearest = n;
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        d.to_triangle.squared = n.signed_distance * n.signed_distance + n.beyond * n.beyond;
        d.to_triangle.inside = n.signed_distance > item.choice.least_inside;
        d.to_triangle.kept = d.to_triangle.inside || d.to_triangle.squared < item.radius_squared;
    } else {
        d.to_triangle = signed_distance_at(t, pair.q, item.radius_squared, item.scale);
    }
    d.to_triangle.inside = d.to_triangle.inside && pair.exists;
    d.to_triangle.kept = d.to_triangle.kept && pair.exists;
    return d;
}

// A dropped fragment takes no gradient from its pixel: pixel_grad.comp may not have written that pixel's entry.
PixelGradient received(PixelGradient g, bool kept) {
    g.by_color = vec3(kept ? g.by_color.x : 0.0, kept ? g.by_color.y : 0.0, kept ? g.by_color.z : 0.0);
    g.by_normal = vec3(kept ? g.by_normal.x : 0.0, kept ? g.by_normal.y : 0.0, kept ? g.by_normal.z : 0.0);
    g.by_depth = kept ? g.by_depth : 0.0;
    g.by_silhouette = kept ? g.by_silhouette : 0.0;
    g.mean = kept ? g.mean : 0.0;
    g.least = kept ? g.least : 1.0;
    g.received = kept;
    return g;
}

// Barycentrics and depth of a fragment.
struct Surface {
    // b̂ times its sum.
    vec3 sampled;
    float inverse_sum;
    Depth depth;
    // Whether the fragment contributes to the shaded images.
    bool shaded;
};

// A fragment outside the depth range has D = 0 and the complement 1.
Surface surface_of(ItemTriangle item, NearestPoint nearest, inout Fragment f) {
    Surface s;
    s.sampled = sampled_barycentrics(item.edges, f.height, nearest);
    float sum = s.sampled.x + s.sampled.y + s.sampled.z;
    s.inverse_sum = 1.0 / sum;
    s.depth = depth_at(item.corner, s.sampled, sum);
    s.shaded = f.kept && in_depth_range(item.z0 * s.depth.ratio);
    // The official backward pass gives no gradient to a fragment that its colour leaves out.
    if (DEPTH_RANGE == DEPTH_RANGE_FAR || (DEPTH_RANGE == DEPTH_RANGE_OFFICIAL && PAPER)) {
        drop_unless(s.shaded, f);
    }
    return s;
}

struct Weight {
    // w_j of eq. 3, and w_j / α.
    float value;
    float by_alpha;
    // The log2 weight without D relative to the pixel's log2 sum.
    float relative;
};

Weight weight_of(ItemTriangle item, PixelGradient g, Fragment f, Surface s, float alpha) {
    Weight w;
    w.relative = (item.corner.exponent - g.log_sum.x) + (s.depth.weight - g.log_sum.y);
    // Only a dropped fragment, which has D = 0, exceeds 2¹⁰⁰.
    w.by_alpha = (s.shaded ? f.probability : 0.0) * exp2(lesser(w.relative, 100.0));
    w.value = OPACITY ? w.by_alpha * alpha : w.by_alpha;
    if (COLOR_MODE == COLOR_HARD) {
        bool nearest = vec2(item.record_index >> 12, item.record_index & 4095) == g.log_sum;
        w.value = s.shaded && nearest ? 1.0 : 0.0;
    }
    return w;
}
