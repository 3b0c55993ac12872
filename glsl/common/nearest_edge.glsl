// The distance of eq. 1 from one edge in place of three: which edge of a triangle is nearest to a pixel, and the nearest
// point on it.
//
// For a triangle with area the edge with the least signed edge distance (positive inside) holds the nearest boundary point.
// Inside, the distances to the lines are those to the edges. Outside, let d be the distance to the nearest point n of the
// triangle. No edge's line is passed by more than d, since n is not beyond it. If n is within an edge, that edge's line is
// passed by d. If n is a corner, it is the nearest point of both its edges; and the line of the third edge is passed by less
// than one of theirs. (With the corner at height H above the third edge, which reaches from s to s' along it, and the pixel
// at u along it and a beyond its line: n is nearest only if s u and s' u are at most -H (H + a). For the nearer end s the
// edge from n to it is then passed by (|u| H + |s| (H + a)) / √(H² + s²) ≥ √(H² + s²) (H + a) / |s| > a.)
//
// Measured on spot at 256²: -18 % of backward's time together with the sums of pair_gradient.glsl.
//
// Two edges are compared by the sign of a line function that is zero where both are equally near, the separator. At an acute
// corner it is the difference of the signed edge distances. At an obtuse corner, where this loses all digits as the edges
// become parallel, it is the distance past the corner along both edges, which is zero on the same line. For a triangle
// without area the separators are constants: its longest edge (flatten_to_segment in edge.glsl) is nearest to every pixel.
// Needs fragment.glsl.

// What the comparisons need of a triangle, computed once.
struct EdgeChoice {
    // Line functions (x, y, c): x column + y row + c is positive where edge 1 is nearer than edge 0, edge 2 nearer than
    // edge 1, edge 2 nearer than edge 0.
    vec3 one_over_zero;
    vec3 two_over_one;
    vec3 two_over_zero;
    // 0.5 / half length of each edge, negative where the distance along the edges runs from second to first corners.
    vec3 slope;
    // A pixel is inside if its signed edge distance exceeds this: 0, or the largest float for a triangle without area.
    float least_inside;
};

// The nearest boundary point of a pixel.
struct NearestPoint {
    // Whether it is on edge 1 or on edge 2; otherwise it is on edge 0.
    bool on_one;
    bool on_two;
    // The edge's unit normal times frame.scale, and the signed edge distance of the pixel.
    vec2 normal;
    float signed_distance;
    // How far the pixel is past the point along the edge; 0 unless the point is a corner.
    float beyond;
    // The point is (1 - t) times the edge's first corner plus t times its second: corners k + 1 and k + 2 of edge k.
    float t;
};

// The comparison of edge a with edge b, which follows it around the triangle: positive where b is nearer.
vec3 separator(vec4 a, float half_a, vec4 b, float half_b, float orientation) {
    bool obtuse = dot(a.xy, b.xy) > 0.0;
    vec3 past_corner = orientation * vec3(a.y + b.y, -(a.x + b.x), a.w + b.w) - vec3(0.0, 0.0, half_a - half_b);
    return obtuse ? past_corner : a.xyz - b.xyz;
}

// 1 or -1: whether the distance along the edges runs from each edge's first corner to its second, or back. It is the sign
// of the cross products of the edges; of two edges that are parallel but for rounding it is the order of their midpoints.
float orientation_of(Triangle t) {
    vec2 a = t.line0.xy;
    vec2 b = t.line1.xy;
    vec2 c = t.line2.xy;
    float turn = (a.x * b.y - a.y * b.x) + (b.x * c.y - b.y * c.x) + (c.x * a.y - c.y * a.x);
    float parallel = 0.9999 * dot(a, a);
    turn = dot(a, b) > parallel ? t.line0.w - t.line1.w : turn;
    turn = dot(b, c) > parallel ? t.line1.w - t.line2.w : turn;
    turn = dot(c, a) > parallel ? t.line2.w - t.line0.w : turn;
    return turn < 0.0 ? -1.0 : 1.0;
}

EdgeChoice edge_choice_of(Triangle t) {
    bvec3 end_line = lessThan(t.inverse_height, vec3(0.0));
    bool segment = any(end_line);
    // flatten_to_segment gives a point a line without a direction.
    bool point = t.line0.x == 0.0 && t.line0.y == 0.0;
    // The lines of a segment do not show its orientation; edge.glsl sets it positive.
    float orientation = segment ? 1.0 : orientation_of(t);
    EdgeChoice e;
    e.one_over_zero = separator(t.line0, t.half_length.x, t.line1, t.half_length.y, orientation);
    e.two_over_one = separator(t.line1, t.half_length.y, t.line2, t.half_length.z, orientation);
    e.two_over_zero = -separator(t.line2, t.half_length.z, t.line0, t.half_length.x, orientation);
    if (segment || point) {
        // A point is on any of its lines that has a direction, such as line 1.
        bool on_zero = segment && !end_line.x;
        bool on_two = segment && !end_line.z;
        e.one_over_zero = vec3(0.0, 0.0, on_zero ? -1.0 : 1.0);
        e.two_over_one = vec3(0.0, 0.0, on_two ? 1.0 : -1.0);
        e.two_over_zero = e.two_over_one;
    }
    e.slope = 0.5 * orientation / max(t.half_length, vec3(1e-30));
    e.least_inside = segment || point ? 3e38 : 0.0;
    return e;
}

// The brackets are those of row_part in entry.glsl: backward must find the very weights that forward has summed.
float line_at(vec3 line, vec2 q) {
    return line.x * q.x + (line.y * q.y + line.z);
}

// x clamped to ±limit.
float between(float x, float limit) {
    return lesser(greater(x, -limit), limit);
}

// The nearest boundary point of the pixel q.
NearestPoint nearest_point(Triangle t, EdgeChoice e, vec2 q) {
    bool one = line_at(e.one_over_zero, q) > 0.0;
    float two_over_one = line_at(e.two_over_one, q);
    float two_over_zero = line_at(e.two_over_zero, q);
    bool two = (one ? two_over_one : two_over_zero) > 0.0;
    NearestPoint n;
    n.on_one = one && !two;
    n.on_two = two;
    n.normal.x = two ? t.line2.x : (one ? t.line1.x : t.line0.x);
    n.normal.y = two ? t.line2.y : (one ? t.line1.y : t.line0.y);
    float offset = two ? t.line2.z : (one ? t.line1.z : t.line0.z);
    n.signed_distance = line_at(vec3(n.normal, offset), q);
    float middle = two ? t.line2.w : (one ? t.line1.w : t.line0.w);
    float half_length = two ? t.half_length.z : (one ? t.half_length.y : t.half_length.x);
    float slope = two ? e.slope.z : (one ? e.slope.y : e.slope.x);
    float along = n.normal.y * q.x - n.normal.x * q.y + middle;
    float on_edge = between(along, half_length);
    n.beyond = along - on_edge;
    n.t = 0.5 + slope * on_edge;
    return n;
}
