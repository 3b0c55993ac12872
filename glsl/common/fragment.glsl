// One fragment, that is one (pixel, triangle) pair: distance and probability (eq. 1), clipped barycentrics and depth, the
// inputs of the colour weights (eq. 3). pair_gradient.glsl holds the derivatives.
// Needs constants.glsl, modes.glsl, frame.glsl, extremes.glsl and record.glsl.

struct Fragment {
    // D of eq. 1, and 1 - D computed without cancellation.
    float probability;
    float complement;
    // Whether the pixel lies inside the triangle or within the culling radius. Dropped pairs have D = 0.
    bool kept;
    // Signed edge distances: to the lines of the three edges, positive inside.
    vec3 height;
};

// Squared distance to a segment from the signed distance to its line (`height`) and the distance along it from its midpoint.
float segment_distance(float along, float half_length, float height) {
    float beyond = greater(abs(along) - half_length, 0.0);
    return height * height + beyond * beyond;
}

// Pixels within this distance of an edge count as covered in the hard modes, so that rounding opens no holes.
const float HARD_EDGE_PIXELS = 1e-5;

// The geometry of a pair: all of a fragment but its exponential.
struct SignedDistance {
    // Signed edge distances.
    vec3 height;
    // For the Euclidean distance: the distance along each edge from its midpoint, and the squared distance to each edge.
    vec3 along;
    vec3 to_edge;
    // |x| log2(e) with x = ± d² / sigma of eq. 1, so that exp2(-squared) = exp(-|x|); 0 with the hard distance.
    float squared;
    bool inside;
    bool kept;
};

// d² of eq. 1 and its sign. `q` is the pixel relative to the record's origin.
SignedDistance signed_distance_at(Triangle t, vec2 q, float radius_squared, float scale) {
    SignedDistance p;
    // The brackets are those of row_part in entry.glsl: backward must find the very weights that forward has summed.
    p.height = vec3(t.line0.x * q.x + (t.line0.y * q.y + t.line0.z), t.line1.x * q.x + (t.line1.y * q.y + t.line1.z),
                    t.line2.x * q.x + (t.line2.y * q.y + t.line2.z));
    float lowest = lesser(p.height.x, lesser(p.height.y, p.height.z));
    p.squared = 0.0;
    if (DISTANCE == DISTANCE_HARD) {
        p.inside = lowest >= -HARD_EDGE_PIXELS * scale;
        p.kept = p.inside;
        return p;
    }
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        p.along = vec3(t.line0.y * q.x + (t.line0.w - t.line0.x * q.y), t.line1.y * q.x + (t.line1.w - t.line1.x * q.y),
                       t.line2.y * q.x + (t.line2.w - t.line2.x * q.y));
        p.to_edge = vec3(segment_distance(p.along.x, t.half_length.x, p.height.x),
                         segment_distance(p.along.y, t.half_length.y, p.height.y),
                         segment_distance(p.along.z, t.half_length.z, p.height.z));
        p.squared = lesser(p.to_edge.x, lesser(p.to_edge.y, p.to_edge.z));
        p.inside = lowest > 0.0;
    } else {
        // d is the smallest barycentric coordinate.
        vec3 b = p.height * t.inverse_height;
        float least = min(b.x, min(b.y, b.z));
        p.squared = least * least * frame.barycentric_scale;
        p.inside = least > 0.0;
    }
    p.kept = p.inside || p.squared < radius_squared;
    return p;
}

// D = 1 / (1 + exp(-x)) (eq. 1).
Fragment fragment_of(SignedDistance p) {
    Fragment f;
    f.height = p.height;
    f.kept = p.kept;
    if (DISTANCE == DISTANCE_HARD) {
        f.probability = f.kept ? 1.0 : 0.0;
        f.complement = 1.0 - f.probability;
        return f;
    }
    // One exponential e = exp(-|x|) serves both signs: sigmoid(|x|) = 1 / (1 + e), sigmoid(-|x|) = e / (1 + e).
    // A dropped pair has e = 0, so that D is 0 and its complement 1.
    float e = p.kept ? exp2(-p.squared) : 0.0;
    float major = 1.0 / (1.0 + e);
    float minor = e * major;
    f.probability = p.inside ? major : minor;
    f.complement = p.inside ? minor : major;
    return f;
}

Fragment fragment_at(Triangle t, vec2 q, float radius_squared, float scale) {
    return fragment_of(signed_distance_at(t, q, radius_squared, scale));
}

// clamp(b, 0, 1): b̂ before its division by the sum. The lower bound stands for 0 and keeps the sum positive for triangles
// so thin that rounding puts a pixel outside all three edges.
vec3 clipped_barycentrics(vec3 inverse_height, vec3 height) {
    vec3 b = height * inverse_height;
    return vec3(lesser(greater(b.x, 1e-20), 1.0), lesser(greater(b.y, 1e-20), 1.0), lesser(greater(b.z, 1e-20), 1.0));
}

struct Depth {
    // z / z_0.
    float ratio;
    // log2 exp(ζ/γ), the log weight of eq. 3 without D, less the integer part of corner 0's (`exponent` of its record).
    float weight;
};

// 1/z = Σ b̂_k / z_k relative to corner 0, and the log weight ζ/γ of eq. 3, which is linear in z. `record` is the
// depth_record of triangle.comp: (z_0/z_1 - 1, z_0/z_2 - 1, z_0 in log2 weight, fraction of corner 0's log weight); `b` is
// b̂ before its division by `sum`.
Depth depth_at(vec4 record, vec3 b, float sum) {
    float excess = b.y * record.x + b.z * record.y;
    // Σ b̂_k z_0/z_k from the same terms as the perspective-correct shares, so that the shares add up to 1 however far a
    // corner is.
    float inverse = b.x + b.y * (1.0 + record.x) + b.z * (1.0 + record.y);
    // The official code lets corners lie behind the camera's plane, where nothing is visible.
    inverse = OFFICIAL ? greater(inverse, 1e-12 * sum) : inverse;
    return Depth(sum / inverse, record.z * (excess / inverse) + record.w);
}

// Whether a depth lies between the planes that the frame's meshes may cross.
bool in_depth_range(float z) {
    bool inside = DEPTH_RANGE == DEPTH_RANGE_INSIDE || z <= frame.far_high;
    return inside && (DEPTH_RANGE != DEPTH_RANGE_OFFICIAL || z >= frame.near_high);
}

// A fragment that is left out has D = 0 and the complement 1.
void drop_unless(bool kept, inout Fragment f) {
    f.probability = kept ? f.probability : 0.0;
    f.complement = kept ? f.complement : 1.0;
}

// The fragment with D' = α D in the place of D. 1 - α D = (1 - D) + (1 - α) D does not cancel.
Fragment faded(Fragment f, float alpha) {
    f.complement += (1.0 - alpha) * f.probability;
    f.probability *= alpha;
    return f;
}

// The hard modes count a fragment from this opacity on.
const float SOLID_OPACITY = 0.5;
