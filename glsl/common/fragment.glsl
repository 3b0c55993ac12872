// A fragment is one (pixel, triangle) pair. Here: the barycentrics b̂ that it is sampled at, its depth, and the log weight ζ/γ of
// eq. 3.
// pair_gradient.glsl has the derivatives. Needs distance.glsl.

// clamp(b, 0, 1): b̂ before its division by the sum. The lower bound stands for 0. It keeps the sum positive if a triangle is
// so thin that rounding puts a pixel outside all three edges.
vec3 clipped_barycentrics(vec3 inverse_height, vec3 height) {
    vec3 b = height * inverse_height;
    return vec3(lesser(greater(b.x, 1e-20), 1.0), lesser(greater(b.y, 1e-20), 1.0), lesser(greater(b.z, 1e-20), 1.0));
}

// b̂ before its division by the sum, of a pixel with the signed distances `height`. Inside, b is clipped all the same: rounding
// may put a pixel of a thin triangle outside.
vec3 sampled_barycentrics(Triangle t, vec3 height, NearestPoint n) {
    vec3 b = clipped_barycentrics(t.inverse_height, height);
    if (SURFACE_POINT == SURFACE_POINT_NEAREST && DISTANCE != DISTANCE_HARD) {
        vec3 e = edge_barycentrics(n.on_one, n.on_two, n.t);
        b = vec3(n.outside ? e.x : b.x, n.outside ? e.y : b.y, n.outside ? e.z : b.z);
    }
    return b;
}

struct Depth {
    // z / z_0.
    float ratio;
    // log2 exp(ζ/γ), the log weight of eq. 3 without D, less the integer part of corner 0's (`exponent` of its record).
    float weight;
};

// The depth z of 1/z = Σ b̂_k / z_k, relative to corner 0, and the log weight ζ/γ of eq. 3, which is linear in z. In an
// orthographic view z = Σ b̂_k z_k. triangle.comp has the depth_record `c.depth`. `b` is b̂ before its division by `sum`.
Depth depth_at(Corner c, vec3 b, float sum) {
    vec4 record = c.depth;
    float excess = b.y * record.x + b.z * record.y;
    if (is_parallel(record.z)) {
        float depth = b.x + b.y * (1.0 - record.x) + b.z * (1.0 - record.y);
        return Depth(depth / sum, first_depth(c) * (excess / sum) + record.w);
    }
    // Σ b̂_k z_0/z_k has the same terms as the perspective-correct shares. So the shares add up to 1 however far a corner is.
    float inverse = b.x + b.y * (1.0 + record.x) + b.z * (1.0 + record.y);
    // The official code lets corners lie behind the camera's plane, where nothing is visible.
    inverse = OFFICIAL ? greater(inverse, 1e-12 * sum) : inverse;
    return Depth(sum / inverse, first_depth(c) * (excess / inverse) + record.w);
}

// The factors of the corners' shares with perspective correction: z / z_k = (z / z_0) (z_0 / z_k). An orthographic view needs none.
vec3 correction_of(Corner c, Depth depth) {
    return (is_parallel(c.depth.z) ? 1.0 : depth.ratio) * nearness(c);
}

// Whether a depth lies between near and far. A plane that no mesh of the frame crosses is not tested.
bool in_depth_range(float z) {
    bool inside = DEPTH_RANGE == DEPTH_RANGE_INSIDE || z <= frame.far_high;
    return inside && (DEPTH_RANGE != DEPTH_RANGE_OFFICIAL || z >= frame.near_high);
}

// Drops a fragment outside of the depth range: it then has D = 0 and the complement 1.
void drop_unless(bool kept, inout Fragment f) {
    f.probability = kept ? f.probability : 0.0;
    f.complement = kept ? f.complement : 1.0;
}

// The fragment with D' = α D in place of D. The form 1 - α D = (1 - D) + (1 - α) D does not cancel.
Fragment faded(Fragment f, float alpha) {
    f.complement += (1.0 - alpha) * f.probability;
    f.probability *= alpha;
    return f;
}

// The hard modes count a fragment from this opacity on.
const float SOLID_OPACITY = 0.5;
