// Eq. 1: how far a pixel is from a triangle, and the probability D with which the triangle covers it.
//
//     x = ±d² / σ,   D = 1 / (1 + exp(-x))                                                               (eq. 1)
//
// d is the distance from the pixel to the nearest point of the triangle's boundary. The sign is + inside and - outside.
// The kernels compute d in three ways:
// - signed_distance_at measures all three edges. forward.comp uses it, in every mode.
// - soft_distance measures the edge whose line has the least signed distance. forward_soft.comp uses it.
// - nearest_point compares the edges two by two, and finds the nearest point as well. The backward kernels use it, and
//   forward.comp to sample a triangle there.
//
// The last two measure one edge in place of three. They rest on a lemma. Let h_k be the pixel's signed distance to the line of
// edge k, positive inside. In a triangle with an area, the edge with the least h holds the nearest boundary point.
//
// Proof. Inside: the disc of radius min h around the pixel lies within all three half-planes and touches the edge with the
// least h. Outside: let b be the nearest point of the triangle, at the distance d. No h is less than -d, because no h is
// negative at b. If b lies within an edge, then that edge has h = -d, the least. If b is the corner between the edges i and
// j, then b is the nearest point of both, and either gives d. It remains to show that the third edge k does not win. Let h_i
// be the lesser of h_i and h_j: it is negative. With the edge lengths s and the area A, s_i h_i + s_j h_j + s_k h_k = 2A > 0.
// So h_k < h_i would need s_j h_j > (s_i + s_k) |h_i| > s_j |h_i|, by the triangle inequality. But h_j <= |h_i|: the
// direction from b to the pixel has an angle of at least 90° with both edges, since b is the nearest point.
//
// Rounding can break the lemma if the triangle's height is no more than the rounding of h. forward_soft.comp leaves such
// triangles to forward.comp (is_thin in tile_mask.glsl). nearest_point has other comparisons where the edges become parallel.
// Needs constants.glsl, modes.glsl, frame.glsl, arithmetic.glsl and record.glsl.

struct Fragment {
    // D of eq. 1, and 1 - D, which is computed without cancellation.
    float probability;
    float complement;
    // Whether the pixel lies inside the triangle or within the culling radius. Other pairs are dropped: they have D = 0.
    bool kept;
    // Signed distances to the lines of the three edges, positive inside.
    vec3 height;
};

// The value of a line function (x, y, c) at q. The sum has the order of row_part in forward_soft.comp: backward must find the
// very weights that forward has summed.
float line_at(vec3 line, vec2 q) {
    return line.x * q.x + (line.y * q.y + line.z);
}

// The signed distances of the pixel q to the lines of the three edges.
vec3 heights_at(Triangle t, vec2 q) {
    return vec3(line_at(t.line0.xyz, q), line_at(t.line1.xyz, q), line_at(t.line2.xyz, q));
}

// Squared distance to a segment, from the signed distance to its line (`height`) and the distance along it from its midpoint.
float segment_distance(float along, float half_length, float height) {
    float beyond = greater(abs(along) - half_length, 0.0);
    return height * height + beyond * beyond;
}

// In the hard modes a pixel this close to an edge counts as covered, so that rounding opens no holes.
const float HARD_EDGE_PIXELS = 1e-5;

// d of eq. 1 and its sign.
struct SignedDistance {
    // Signed distances to the lines of the three edges.
    vec3 height;
    // |x| log2(e) with x of eq. 1, so that exp2(-squared) = exp(-|x|). 0 with the hard distance.
    float squared;
    bool inside;
    bool kept;
};

// The distance in every mode. `q` is the pixel relative to the record's origin.
SignedDistance signed_distance_at(Triangle t, vec2 q, float radius_squared, float scale) {
    SignedDistance p;
    p.height = heights_at(t, q);
    float lowest = lesser(p.height.x, lesser(p.height.y, p.height.z));
    p.squared = 0.0;
    if (DISTANCE == DISTANCE_HARD) {
        p.inside = lowest >= -HARD_EDGE_PIXELS * scale;
        p.kept = p.inside;
        return p;
    }
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        vec3 along = vec3(t.line0.y * q.x + (t.line0.w - t.line0.x * q.y), t.line1.y * q.x + (t.line1.w - t.line1.x * q.y),
                          t.line2.y * q.x + (t.line2.w - t.line2.x * q.y));
        vec3 squared = vec3(segment_distance(along.x, t.half_length.x, p.height.x),
                            segment_distance(along.y, t.half_length.y, p.height.y),
                            segment_distance(along.z, t.half_length.z, p.height.z));
        p.squared = lesser(squared.x, lesser(squared.y, squared.z));
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
    // With e = 0 a dropped pair has D = 0 and the complement 1.
    float e = p.kept ? exp2(-p.squared) : 0.0;
    float major = 1.0 / (1.0 + e);
    float minor = e * major;
    f.probability = p.inside ? major : minor;
    f.complement = p.inside ? minor : major;
    return f;
}

// t of the point of edge k nearest to a pixel. The point at t is (1 - t) times the edge's first corner, k + 1, plus t times
// its second, k + 2. `along` is the pixel's distance along the edge from its midpoint, and `slope` is dt over this distance.
float edge_parameter(float along, float slope) {
    return lesser(greater(0.5 + slope * along, 0.0), 1.0);
}

// dt over the distance along each edge: 0.5 / half length, negative where the distance runs from second to first corners.
vec3 slopes_of(vec3 half_length, float orientation) {
    return 0.5 * orientation / half_length;
}

// The barycentric coordinates of an edge's point: on edge 1, on edge 2, or else on edge 0.
vec3 edge_barycentrics(bool on_one, bool on_two, float t) {
    float rest = 1.0 - t;
    return vec3(on_two ? rest : (on_one ? t : 0.0), on_two ? t : (on_one ? 0.0 : rest), on_two ? 0.0 : (on_one ? rest : t));
}

// The distance that forward_soft.comp computes.
struct SoftDistance {
    // Signed distances to the lines of the three edges.
    vec3 height;
    // d² log2(e) / σ of eq. 1.
    float squared;
    bool inside;
    // As in Fragment. A dropped pair has e = 0.
    bool kept;
    // e = exp(-d²/σ). D is 1 / (1 + e) inside and e / (1 + e) outside.
    float e;
    // The nearest boundary point, as in NearestPoint.
    bool on_one;
    bool on_two;
    float t;
};

// The distance of a pixel whose signed distances to the three lines, and distances along them, are `height` and `along`. The
// caller sets `kept` and `e`.
void soft_distance(vec3 height, vec3 along, vec3 half_length, vec3 slopes, out SoftDistance d) {
    bool second = height.y < height.x;
    float nearest = second ? height.y : height.x;
    float position = second ? along.y : along.x;
    float size = second ? half_length.y : half_length.x;
    float slope = second ? slopes.y : slopes.x;
    bool third = height.z < nearest;
    nearest = third ? height.z : nearest;
    position = third ? along.z : position;
    size = third ? half_length.z : size;
    slope = third ? slopes.z : slope;
    float beyond = greater(abs(position) - size, 0.0);
    d.height = height;
    d.squared = nearest * nearest + beyond * beyond;
    d.inside = nearest > 0.0;
    d.on_one = second && !third;
    d.on_two = third;
    d.t = edge_parameter(position, slope);
}

// nearest_point compares two edges by the sign of a line function, the separator. It is zero where both edges are equally near.
// At an acute corner it is the difference of the signed distances. At an obtuse corner this difference loses all digits as the
// edges become parallel. There the separator is the distance past the corner along both edges, which is zero on the same line.
// In a triangle without area the longest edge is nearest to every pixel (flatten_to_segment in edge.glsl), so the separators
// are constants. On spot at 256² these comparisons and the sums of pair_gradient.glsl take 18 % off the time of backward.
// EdgeChoice is what nearest_point needs of a triangle. It is computed once for all pixels.
struct EdgeChoice {
    // Line functions (x, y, c): x column + y row + c is positive where edge 1 is nearer than edge 0, edge 2 nearer than
    // edge 1, edge 2 nearer than edge 0.
    vec3 one_over_zero;
    vec3 two_over_one;
    vec3 two_over_zero;
    // slopes_of the triangle.
    vec3 slope;
    // A pixel whose signed distance exceeds this is inside. It is 0, or too large for any pixel if the triangle has no area.
    float least_inside;
    // Whether the nearest edge is that of the least signed distance, as in soft_distance. Then forward and backward sample the
    // triangle at the same points.
    bool by_height;
};

// The nearest boundary point of a pixel.
struct NearestPoint {
    // Whether it is on edge 1 or on edge 2. Else it is on edge 0.
    bool on_one;
    bool on_two;
    // The edge's unit normal times frame.scale, and the pixel's signed distance to the edge's line.
    vec2 normal;
    float signed_distance;
    // How far the pixel lies past the point along the edge. It is 0 unless the point is a corner.
    float beyond;
    // The point is (1 - t) times the edge's first corner plus t times its second: corners k + 1 and k + 2 of edge k.
    float t;
    // The edge's element of EdgeChoice::slope: dt over the distance along the edge.
    float slope;
    // Whether the pixel lies outside a triangle that has an area.
    bool outside;
};

// The comparison of edge a with edge b, which follows it around the triangle: positive where b is nearer.
vec3 separator(vec4 a, float half_a, vec4 b, float half_b, float orientation) {
    bool obtuse = dot(a.xy, b.xy) > 0.0;
    vec3 past_corner = orientation * vec3(a.y + b.y, -(a.x + b.x), a.w + b.w) - vec3(0.0, 0.0, half_a - half_b);
    return obtuse ? past_corner : a.xyz - b.xyz;
}

// `sampled` tells whether the triangle is sampled at its nearest points.
EdgeChoice edge_choice_of(Triangle t, bool sampled) {
    bvec3 end_line = lessThan(t.inverse_height, vec3(0.0));
    bool segment = any(end_line);
    // flatten_to_segment gives a point a line without a direction.
    bool point = t.line0.x == 0.0 && t.line0.y == 0.0;
    EdgeChoice e;
    e.one_over_zero = separator(t.line0, t.half_length.x, t.line1, t.half_length.y, t.orientation);
    e.two_over_one = separator(t.line1, t.half_length.y, t.line2, t.half_length.z, t.orientation);
    e.two_over_zero = -separator(t.line2, t.half_length.z, t.line0, t.half_length.x, t.orientation);
    if (segment || point) {
        // A point is on any of its lines that has a direction, such as line 1.
        bool on_zero = segment && !end_line.x;
        bool on_two = segment && !end_line.z;
        e.one_over_zero = vec3(0.0, 0.0, on_zero ? -1.0 : 1.0);
        e.two_over_one = vec3(0.0, 0.0, on_two ? 1.0 : -1.0);
        e.two_over_zero = e.two_over_one;
    }
    // The least half length keeps the square of the slope finite, in which backward multiplies a derivative of 0.
    e.slope = slopes_of(max(t.half_length, vec3(1e-18)), t.orientation);
    e.least_inside = segment || point ? 3e38 : 0.0;
    e.by_height = sampled && SURFACE_POINT == SURFACE_POINT_NEAREST && !is_thin(t.half_length, t.inverse_height);
    return e;
}

// The nearest boundary point of the pixel q. `height` has its signed distances to the three lines, if e.by_height needs them.
NearestPoint nearest_point(Triangle t, EdgeChoice e, vec3 height, vec2 q) {
    bool one = e.by_height ? height.y < height.x : line_at(e.one_over_zero, q) > 0.0;
    float two_over_one = line_at(e.two_over_one, q);
    float two_over_zero = line_at(e.two_over_zero, q);
    bool lower = height.z < (one ? height.y : height.x);
    bool two = e.by_height ? lower : (one ? two_over_one : two_over_zero) > 0.0;
    NearestPoint n;
    n.on_one = one && !two;
    n.on_two = two;
    n.normal.x = two ? t.line2.x : (one ? t.line1.x : t.line0.x);
    n.normal.y = two ? t.line2.y : (one ? t.line1.y : t.line0.y);
    float offset = two ? t.line2.z : (one ? t.line1.z : t.line0.z);
    n.signed_distance = line_at(vec3(n.normal, offset), q);
    float middle = two ? t.line2.w : (one ? t.line1.w : t.line0.w);
    float half_length = two ? t.half_length.z : (one ? t.half_length.y : t.half_length.x);
    n.slope = two ? e.slope.z : (one ? e.slope.y : e.slope.x);
    // To sample at the very points of forward, the sum has the order of row_part in forward_soft.comp.
    float along = SURFACE_POINT == SURFACE_POINT_NEAREST ? n.normal.y * q.x + (middle - n.normal.x * q.y)
                                                         : n.normal.y * q.x - n.normal.x * q.y + middle;
    float on_edge = between(along, half_length);
    n.beyond = along - on_edge;
    n.t = SURFACE_POINT == SURFACE_POINT_NEAREST ? edge_parameter(along, n.slope) : 0.5 + n.slope * on_edge;
    n.outside = e.least_inside == 0.0 && n.signed_distance <= 0.0;
    return n;
}
