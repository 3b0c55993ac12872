// The three edges of a triangle on the image, from which d of eq. 1 is computed, the pixel box grown by the culling radius, and
// a conservative test against rectangles. Everything is relative to a whole-numbered pixel near the triangle. So a pixel's
// offset from it is exact, and rounding is relative to the triangle's size, not to the image's.
// Needs constants.glsl, modes.glsl, frame.glsl and df64.glsl.

struct Edges {
    // Whole-numbered pixel (column, row) that everything is relative to.
    vec2 origin;
    // Edge k lies opposite corner k, and its record is (n.x, n.y, c, g). n·q + c is the signed distance of the pixel q to the
    // edge's line, positive inside. n.y q.x - n.x q.y + g is the distance along the edge from its midpoint. Both are times
    // frame.scale.
    vec4 line[3];
    // Half the edge's length times frame.scale.
    vec3 half_length;
    // Barycentric coordinate k is the signed distance to edge k, times half_length[k], times this. A negative number or 0 has a
    // meaning of its own (inverse_heights_of in record.glsl).
    float inverse_area;
    // Corners relative to the origin, pixels.
    vec2 corner[3];
    // The sign of the area with rows downwards: negative is counter-clockwise as seen. Without area it is positive.
    float orientation;
    // No area: the record describes a segment or a point.
    bool degenerate;
    bool finite;
};

// The record of the line through a and b. `cross_ab` is their cross product, `along` their direction times frame.scale, and the
// sign `side` selects the inside. The distance of the origin is the cross product over the length: if an edge's ends lie far
// outside the image, only this form has a rounding error relative to the visible part.
vec4 line_record(vec2 a, vec2 b, vec2 along, float size_over_scale, float cross_ab, float side) {
    vec2 n = side * vec2(-along.y, along.x);
    vec2 middle = 0.5 * (a + b);
    float c = size_over_scale > 0.0 ? side * cross_ab / size_over_scale : -dot(n, a);
    float g = n.x * middle.y - n.y * middle.x;
    return vec4(n, c, g);
}

// The element of index k. If an index is not a constant, a software device keeps the whole array in memory and accesses it lane
// by lane, which took 40 % of the time of triangle.comp.
float element(vec3 v, int k) {
    return k == 2 ? v.z : (k == 1 ? v.y : v.x);
}

// Reduces a triangle without area to its longest edge. That edge keeps its record. The other two become the lines across the
// segment's ends, whose signed distances times the inverse heights are the barycentrics of the nearest point. No pixel has a
// positive distance to all three, so no pixel is inside.
void flatten_to_segment(inout Edges e, int longest, vec2 along, float size) {
    e.degenerate = true;
    vec2 across = vec2(-along.y, along.x);
    e.inverse_area = size > 0.0 ? -1.0 / (size * frame.scale) : 0.0;
    for (int k = 0; k < 3; ++k) {
        int next = k == 2 ? 0 : k + 1;
        int previous = k == 0 ? 2 : k - 1;
        // The line through an end belongs to the edge opposite the other end, and measures the other end's barycentric
        // coordinate.
        vec2 end = longest == next ? e.corner[previous] : e.corner[next];
        vec4 end_line = line_record(end, e.corner[k], across, 0.0, 0.0, longest == next ? 1.0 : -1.0);
        e.line[k] = longest == k ? e.line[k] : end_line;
        e.half_length[k] = longest == k ? 0.5 * size * frame.scale : 0.0;
    }
    if (size == 0.0) {
        // A point has the barycentrics of its first corner: this line has the same distance everywhere.
        e.line[0] = vec4(0.0, 0.0, 1e15, 0.0);
    }
}

// This bound keeps the inverse area, and its product with half lengths, within the range of a float.
const float LEAST_INVERSE_AREA = 1e-37;

Edges edges_of(vec2 column[3], vec2 row[3]) {
    Edges e;
    vec2 low = vec2(min(column[0].x, min(column[1].x, column[2].x)), min(row[0].x, min(row[1].x, row[2].x)));
    vec2 high = vec2(max(column[0].x, max(column[1].x, column[2].x)), max(row[0].x, max(row[1].x, row[2].x)));
    // Clamped to the image: if a triangle reaches far beyond it, the visible part must be exact.
    e.origin = floor(clamp(0.5 * (low + high), vec2(0.0), vec2(frame.width, frame.height)));
    vec2 x[3];
    vec2 y[3];
    for (int k = 0; k < 3; ++k) {
        x[k] = df_sub(column[k], vec2(e.origin.x, 0.0));
        y[k] = df_sub(row[k], vec2(e.origin.y, 0.0));
        e.corner[k] = vec2(x[k].x, y[k].x);
    }
    // Edge k's cross product p_a × p_b; their sum is twice the area.
    vec2 side[3];
    vec2 cross_ab[3];
    vec3 size;
    for (int k = 0; k < 3; ++k) {
        int a = k == 2 ? 0 : k + 1;
        int b = a == 2 ? 0 : a + 1;
        side[k] = vec2(df_sub(x[b], x[a]).x, df_sub(y[b], y[a]).x);
        cross_ab[k] = df_sub(df_mul(x[a], y[b]), df_mul(y[a], x[b]));
        float largest = max(abs(side[k].x), abs(side[k].y));
        vec2 ratio = side[k] / (largest > 0.0 ? largest : 1.0);
        size[k] = largest * sqrt(dot(ratio, ratio));
    }
    float area = df_add(df_add(cross_ab[0], cross_ab[1]), cross_ab[2]).x;
    e.finite = abs(area) < 1e30;
    int longest = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
    // A segment shorter than this, in pixels, is a point: quotients by its size would overflow a float.
    float most = element(size, longest);
    float extent = most > 1e-12 ? most : 0.0;
    e.degenerate = abs(area) <= 1e-10 * extent * extent || extent == 0.0;
    e.orientation = area < 0.0 && !e.degenerate ? -1.0 : 1.0;
    float half_square = 0.5 * frame.scale * frame.scale;
    for (int k = 0; k < 3; ++k) {
        int a = k == 2 ? 0 : k + 1;
        int b = a == 2 ? 0 : a + 1;
        // The line and the half length have this quotient in common. Its rounding cancels in their product, the barycentric
        // coordinate.
        float size_over_scale = size[k] / frame.scale;
        // An edge without length is a point. Any direction is right.
        vec2 along = size_over_scale > 0.0 ? side[k] / size_over_scale : vec2(frame.scale, 0.0);
        e.line[k] = line_record(e.corner[a], e.corner[b], along, size_over_scale, cross_ab[k].x, e.orientation);
        e.half_length[k] = size_over_scale * half_square;
    }
    e.inverse_area = clamp(1.0 / (max(abs(area), 1e-30) * half_square), LEAST_INVERSE_AREA, 1.0 / LEAST_INVERSE_AREA);
    if (e.degenerate) {
        vec2 longest_side = longest == 2 ? side[2] : (longest == 1 ? side[1] : side[0]);
        vec2 along = extent > 0.0 ? longest_side / extent * frame.scale : vec2(frame.scale, 0.0);
        flatten_to_segment(e, longest, along, extent);
    }
    return e;
}

// The culling radius in the units of edge k's line: how far outside of the line the triangle still has fragments.
float reach_of(Edges e, int k) {
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        return sqrt(frame.radius_squared);
    }
    return DISTANCE == DISTANCE_BARYCENTRIC ? frame.barycentric_radius / (e.half_length[k] * e.inverse_area) : 0.0;
}

// The pixels that may be within the culling radius: (first column, first row, last column, last row). Empty if last < first.
ivec4 grown_box(Edges e) {
    vec2 low = min(e.corner[0], min(e.corner[1], e.corner[2]));
    vec2 high = max(e.corner[0], max(e.corner[1], e.corner[2]));
    float grow = DISTANCE == DISTANCE_EUCLIDEAN ? frame.radius_pixels : 0.0;
    if (DISTANCE == DISTANCE_BARYCENTRIC) {
        // The triangle grows about its centroid: each corner moves by the radius times its distance from the others.
        float r = frame.barycentric_radius;
        vec2 sum = e.corner[0] + e.corner[1] + e.corner[2];
        for (int k = 0; k < 3; ++k) {
            vec2 grown = e.corner[k] * (1.0 + 3.0 * r) - sum * r;
            low = min(low, grown);
            high = max(high, grown);
        }
    }
    if (DISTANCE == DISTANCE_BARYCENTRIC && OFFICIAL) {
        // With any distance, the official code drops pixels outside the box grown by the Euclidean radius.
        vec2 radius = vec2(frame.radius_pixels);
        low = max(low, min(e.corner[0], min(e.corner[1], e.corner[2])) - radius);
        high = min(high, max(e.corner[0], max(e.corner[1], e.corner[2])) + radius);
    }
    // A hundredth of a pixel covers the rounding of these sums. signed_distance_at makes the exact test.
    vec2 margin = vec2(grow + 0.01);
    vec2 bound = vec2(frame.width, frame.height);
    vec2 first = clamp(ceil(e.origin + low - margin), vec2(0.0), bound);
    vec2 last = clamp(floor(e.origin + high + margin), vec2(-1.0), bound - 1.0);
    return ivec4(first, last);
}

// Whether any pixel of a rectangle may be within the triangle's culling radius. `centre` is relative to the origin.
bool may_touch(Edges e, vec2 centre, vec2 half_size) {
    bool touch = true;
    for (int k = 0; k < 3; ++k) {
        vec4 l = e.line[k];
        float nearest = l.x * centre.x + l.y * centre.y + l.z + abs(l.x) * half_size.x + abs(l.y) * half_size.y;
        // 0.1 % and a hundredth of a pixel cover rounding.
        touch = touch && nearest >= -1.001 * reach_of(e, k) - 0.01 * frame.scale;
    }
    // The end lines of a triangle without area are not edges.
    return touch || e.degenerate;
}
