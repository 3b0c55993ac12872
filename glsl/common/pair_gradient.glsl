// The derivatives of one fragment (eq. 4). Each function is the transpose of one step of pair.glsl, distance.glsl or
// sample.glsl, and adds to a lane's sums. `by_X` is the derivative of the loss by X, where X is the name that forward uses.
// Needs pair.glsl, texel_gradient.glsl, feature_gradient.glsl and what these need.

struct Sums {
    // dL/d(column, row) of each corner, in pixels.
    vec2 corner[3];
    // dL by the barycentric coordinates b_k, and the same times the pixel's column and row in the item. ∂b_k/∂p_m = -b_m ∇b_k
    // is linear in the pixel, so corners_from_barycentrics applies it once to the sums.
    vec3 by_b;
    vec3 by_b_column;
    vec3 by_b_row;
    // Σ dL/dz (z/z_0)² b̂_k, which times (z_0/z_k)² is dL/dz_k. An orthographic view has neither square.
    vec3 depth;
    // Σ dL/dx x with x of eq. 1, and Σ dL/ds times the log2 weight relative to the pixel's, with s the log weight of eq. 3.
    // The host scales their totals by -1/sigma and -log(2)/gamma.
    float sigma;
    float gamma;
    // dL by the corners' colours, texture coordinates and normals, a column a corner.
    mat3 color;
    mat3x2 coordinate;
    mat3 normal;
};

Sums no_sums() {
    Sums s;
    s.corner[0] = s.corner[1] = s.corner[2] = vec2(0.0);
    s.by_b = s.by_b_column = s.by_b_row = vec3(0.0);
    s.depth = vec3(0.0);
    s.sigma = 0.0;
    s.gamma = 0.0;
    s.color = mat3(0.0);
    s.coordinate = mat3x2(0.0);
    s.normal = mat3(0.0);
    return s;
}

const float LN2 = 0.69314718056;

// Adds dL by the barycentric coordinates of a pixel.
void add_by_b(vec3 by_b, Pair pair, inout Sums s) {
    s.by_b += by_b;
    s.by_b_column += by_b * pair.local.x;
    s.by_b_row += by_b * pair.local.y;
}

// ∂A/∂x_j = (1 - A) D_j (eq. 4). pixel_grad.comp computed the pixel's factor.
float silhouette_by_x(PixelGradient g, Fragment f) {
    float by_x = UP_ALPHA ? g.by_silhouette * f.probability : 0.0;
    return SILHOUETTE_MODE == SILHOUETTE_SUM ? by_x * f.complement : by_x;
}

// The opacity of a fragment, with its derivatives by the texture coordinates.
struct Opacity {
    float alpha;
    vec2 slope;
};

Opacity opacity_of(ItemTriangle item, vec3 share) {
    Opacity o;
    o.alpha = sample_opacity(item.corner.texture_index, item.corner.coordinate, share, o.slope);
    return o;
}

// dL by D' = α D through the silhouette (eq. 5): ∂A/∂D'_j is the product of the other fragments' 1 - D'. If the fragment's own
// factor is the least, or differs from it by rounding only, `by_silhouette` leaves it out already.
float silhouette_by_faded(PixelGradient g, Fragment f, float alpha) {
    float own = faded(f, alpha).complement;
    return UP_ALPHA ? g.by_silhouette * (LEAST_APART && own > g.least ? g.least / own : 1.0) : 0.0;
}

// v_j = dL/dI · C_j + dL/dnormal · n_j + dL/ddepth z_j of a fragment, with features as with colours, and its derivatives by the
// corners' shares in the mixture.
// A share is b̂_k z/z_k with perspective correction, and b̂_k without.
struct Value {
    float value;
    vec3 share;
    // dv/dshare, and its product with the shares.
    vec3 by_share;
    float by_all_shares;
    // correction_of the fragment.
    vec3 correction;
};

// Adds w_j ∂C_j/∂c_k = w_j share_k (eq. 4: ∂I/∂C_j = w_j) times `by_light`: dL by the colour that a texture multiplies.
void add_light(vec3 by_light, vec3 weighted, inout Sums s) {
    if (GRAD_COLOR) {
        s.color[0] += by_light * weighted.x;
        s.color[1] += by_light * weighted.y;
        s.color[2] += by_light * weighted.z;
    }
}

// The colour's part of v_j. C_j is computed in forward's order of operations: where one fragment makes up nearly all of a
// pixel, v_j - V then cancels to 0, as it should.
void add_color(Corner c, vec3 by_color, float weight, vec3 weighted, inout Value v, inout Sums s) {
    vec3 light = c.color * v.share;
    if (SAMPLING == SAMPLING_NONE) {
        float value = dot(by_color, light);
        v.value += value;
        v.by_share += by_color * c.color;
        v.by_all_shares += value;
        add_light(by_color, weighted, s);
        return;
    }
    mat2x3 slope;
    vec3 sampled = sample_with_slope(c.texture_index, c.triangle, c.coordinate, v.share, slope);
    vec3 by_sample = by_color * light;
    vec2 by_coordinate = vec2(dot(by_sample, slope[0]), dot(by_sample, slope[1]));
    if (GRAD_COORDINATE) {
        for (int k = 0; k < 3; ++k) {
            s.coordinate[k] += by_coordinate * weighted[k];
        }
    }
    if ((GRADIENTS & GRADIENT_TEXEL) != 0u && weight > 0.0) {
        scatter_texels(c.texture_index, c.triangle, c.coordinate, v.share, by_sample * weight);
    }
    vec3 by_light = by_color * sampled;
    vec3 by_share = by_light * c.color + by_coordinate * c.coordinate;
    v.value += dot(by_light, light);
    v.by_share += by_share;
    v.by_all_shares += dot(by_share, v.share);
    add_light(by_light, weighted, s);
}

void add_normal(Corner c, vec3 by_normal, vec3 weighted, inout Value v, inout Sums s) {
    vec3 by_share = by_normal * c.normal;
    float value = dot(by_share, v.share);
    v.value += value;
    v.by_share += by_share;
    v.by_all_shares += value;
    if (GRAD_NORMAL) {
        s.normal[0] += by_normal * weighted.x;
        s.normal[1] += by_normal * weighted.y;
        s.normal[2] += by_normal * weighted.z;
    }
}

// The shares of a fragment, and a v_j of 0.
Value value_from(ItemTriangle item, Surface surface) {
    Value v;
    vec3 share = surface.sampled * surface.inverse_sum;
    v.correction = correction_of(item.corner, surface.depth);
    v.share = PERSPECTIVE_CORRECT ? share * v.correction : share;
    v.by_share = vec3(0.0);
    v.value = 0.0;
    v.by_all_shares = 0.0;
    return v;
}

// v_j of a fragment with the weight w_j; adds the derivatives by the corners' attributes.
Value value_of(ItemTriangle item, PixelGradient g, Surface surface, float weight, inout Sums s) {
    Corner c = item.corner;
    Value v = value_from(item, surface);
    vec3 weighted = v.share * weight;
    if (UP_COLOR) {
        add_color(c, g.by_color, weight, weighted, v, s);
    }
    if (UP_NORMAL) {
        add_normal(c, g.by_normal, weighted, v, s);
    }
    if (UP_FEATURES) {
        v.by_share += features_by_share(g, v.share, weighted, v.value, v.by_all_shares);
    }
    if (UP_DEPTH) {
        v.value += g.by_depth * (item.z0 * surface.depth.ratio);
    }
    return v;
}

// ∂L/∂s_j = w_j (v_j - V) (eq. 4) with the log weight s_j = log D_j + ζ_j/γ of eq. 3. The hard mode has no weights.
float weight_gradient(PixelGradient g, Weight w, Value v, inout Sums s) {
    float by_weight = COLOR_MODE == COLOR_SOFTMAX ? w.value * (v.value - g.mean) : 0.0;
    if (GRAD_SCALARS) {
        // The clamp makes the factor finite, so that a weight of 0 gives a gradient of 0.
        s.gamma += by_weight * between(w.relative, 1e30);
    }
    return by_weight;
}

// The largest factor of v_j - V in ∂L/∂α. The true factor w_j/α is at most 1/α. It would overflow for a fragment with α = 0 in
// front of all others.
const float STEEPEST = 256.0;

// ∂L/∂α_j through eq. 3: (w_j/α) (v_j - V). The hard mode has no weights.
float opacity_gradient(PixelGradient g, Weight w, Value v) {
    return COLOR_MODE == COLOR_SOFTMAX ? lesser(w.by_alpha, STEEPEST) * (v.value - g.mean) : 0.0;
}

// Carries dL/dα to the texels' alpha, the texture coordinates and the shares. Afterwards the derivatives by the shares are
// those of w_j v_j.
void add_opacity(ItemTriangle item, Opacity o, float by_alpha, float weight, inout Value v, inout Sums s) {
    Corner c = item.corner;
    vec2 by_coordinate = by_alpha * o.slope;
    if (GRAD_COORDINATE) {
        for (int k = 0; k < 3; ++k) {
            s.coordinate[k] += by_coordinate * v.share[k];
        }
    }
    if ((GRADIENTS & GRADIENT_TEXEL) != 0u && by_alpha != 0.0) {
        scatter_opacity(c.texture_index, c.coordinate, v.share, by_alpha);
    }
    vec3 by_share = by_coordinate * c.coordinate;
    v.by_share = v.by_share * weight + by_share;
    v.by_all_shares = v.by_all_shares * weight + dot(by_share, v.share);
}

// -1 at the first corner of the nearest edge, 1 at its second, 0 at the third.
vec3 edge_ends(NearestPoint n) {
    return vec3(n.on_two ? -1.0 : (n.on_one ? 1.0 : 0.0), n.on_two ? 1.0 : (n.on_one ? 0.0 : -1.0),
                n.on_two ? 0.0 : (n.on_one ? -1.0 : 1.0));
}

// dL by the corners' depths, and by the point that the triangle is sampled at, through the shares and through z. A fragment
// sampled inside, or at clamp(b, 0, 1) / sum, has the gradient by its barycentrics b. One sampled at the nearest boundary
// point has the gradient by that point's t. From 1/z = Σ b̂_k/z_k follow ∂z/∂z_k = b̂_k (z/z_k)² and ∂z/∂b̂_k = -z²/z_k. In an
// orthographic view ∂z/∂z_k = b̂_k and ∂z/∂b̂_k = z_k.
void surface_gradient(ItemTriangle item, Pair pair, NearestPoint nearest, PixelGradient g, Fragment f, Surface surface,
                      Value v, float weight, float by_weight, inout float by_t, inout Sums s) {
    Corner c = item.corner;
    float ratio = surface.depth.ratio;
    bool parallel = is_parallel(c.depth.z);
    // add_opacity has multiplied by the weight already.
    float mixed = OPACITY ? 1.0 : weight;
    float weighted = mixed * surface.inverse_sum;
    float by_z = by_weight * item.weight_slope;
    if (UP_DEPTH) {
        by_z += weight * g.by_depth;
    }
    if (PERSPECTIVE_CORRECT && !parallel) {
        // C = Σ b̂_k c_k z/z_k depends on z and on each z_k.
        float inverse_z = 1.0 / (item.z0 * ratio);
        by_z += mixed * v.by_all_shares * inverse_z;
        s.depth -= v.by_share * v.share * (mixed * ratio * inverse_z) / nearness(c);
    }
    float by_ratio = (parallel ? by_z : by_z * ratio * ratio) * surface.inverse_sum;
    s.depth += by_ratio * surface.sampled;
    if (!PAPER) {
        // z/z_k - 1 comes from the differences of z_0/z_k, which are small. z/z_k itself would lose all digits. In an
        // orthographic view the record has 1 - z_k/z_0 in place of z_0/z_k - 1.
        vec3 excess = vec3(0.0, c.depth.xy);
        float mean_excess = (surface.sampled.y * c.depth.x + surface.sampled.z * c.depth.y) * surface.inverse_sum;
        vec3 by_share = PERSPECTIVE_CORRECT ? v.by_share * v.correction : v.by_share;
        vec3 by_b = weighted * (by_share - v.by_all_shares) - by_ratio * item.z0 * (excess - mean_excess);
        if (SURFACE_POINT == SURFACE_POINT_NEAREST) {
            // A clamped t has derivative 0.
            by_t = nearest.outside && nearest.beyond == 0.0 ? dot(by_b, edge_ends(nearest)) : 0.0;
            by_b = nearest.outside ? vec3(0.0) : by_b;
        }
        // A clamped b has derivative 0, however large it is.
        vec3 b = f.height * item.edges.inverse_height;
        by_b = vec3(b.x == surface.sampled.x ? by_b.x : 0.0, b.y == surface.sampled.y ? by_b.y : 0.0,
                    b.z == surface.sampled.z ? by_b.z : 0.0);
        add_by_b(by_b, pair, s);
    }
}

// dL by the corners through d² of eq. 1, and through t of the nearest boundary point. That point is n = Σ β_k p_k, so ∂d²/∂p_k =
// 2 β_k (n - pixel). In the units of the record dL/dd² = ± log(2) dL/dx. When the edge's corners move along it, t changes by -β_k
// over the edge's length. When they move across it, the edge turns, and t changes by the pixel's distance over the squared
// length.
void distance_gradient(NearestPoint n, bool inside, float by_x, float by_t, inout Sums s) {
    float pull = inside ? -2.0 * LN2 * by_x : 2.0 * LN2 * by_x;
    float across = pull * n.signed_distance;
    float along = pull * n.beyond;
    if (SURFACE_POINT == SURFACE_POINT_NEAREST) {
        along -= by_t * n.slope;
    }
    vec2 force = vec2(across * n.normal.x + along * n.normal.y, across * n.normal.y - along * n.normal.x);
    vec3 share = edge_barycentrics(n.on_one, n.on_two, n.t);
    s.corner[0] += share.x * force;
    s.corner[1] += share.y * force;
    s.corner[2] += share.z * force;
    if (SURFACE_POINT == SURFACE_POINT_NEAREST) {
        vec2 turn = n.normal * (by_t * n.slope * n.slope * n.signed_distance);
        vec3 end = edge_ends(n);
        s.corner[0] += end.x * turn;
        s.corner[1] += end.y * turn;
        s.corner[2] += end.z * turn;
    }
}

// dL by the corners through the barycentric distance: in place of d, eq. 1 has the smallest barycentric coordinate.
void barycentric_distance_gradient(ItemTriangle item, Pair pair, Fragment f, float by_x, inout Sums s) {
    vec3 b = f.height * item.edges.inverse_height;
    bool first = b.x <= b.y && b.x <= b.z;
    bool second = !first && b.y <= b.z;
    float least = first ? b.x : (second ? b.y : b.z);
    // If dL/dx is 0, so is the product. Far from the triangle the other factor may be infinite.
    float by_least = by_x == 0.0 ? 0.0 : 2.0 * abs(least) * frame.barycentric_scale * LN2 * by_x;
    add_by_b(vec3(first ? by_least : 0.0, second ? by_least : 0.0, first || second ? 0.0 : by_least), pair, s);
}

// Carries dL/dx to the corners, through d², and to sigma, and dL/dt of the nearest boundary point to the corners.
void x_gradient(ItemTriangle item, Pair pair, PairDistance d, Fragment f, float by_x, float by_t, inout Sums s) {
    if (DISTANCE == DISTANCE_EUCLIDEAN && GRAD_GEOMETRY) {
        distance_gradient(d.nearest, d.to_triangle.inside, by_x, by_t, s);
    } else if (DISTANCE == DISTANCE_BARYCENTRIC && GRAD_GEOMETRY) {
        barycentric_distance_gradient(item, pair, f, by_x, s);
        if (SURFACE_POINT == SURFACE_POINT_NEAREST) {
            distance_gradient(d.nearest, true, 0.0, by_t, s);
        }
    }
    if (DISTANCE != DISTANCE_HARD && GRAD_SCALARS) {
        // x = log(D / (1 - D)). Where D is 0, by_x is 0 too.
        s.sigma += by_x * log(max(f.probability, 1e-37) / max(f.complement, 1e-37));
    }
}

// For a triangle without area: -1 at the first corner of its segment, 1 at the second, 0 at the third. For all others: zeros.
// `end_line` marks the lines across the segment's end points (flatten_to_segment in edge.glsl).
vec3 ends_of_segment(bvec3 end_line) {
    if (!any(end_line)) {
        return vec3(0.0);
    }
    return !end_line.x ? vec3(0.0, -1.0, 1.0) : (!end_line.y ? vec3(1.0, 0.0, -1.0) : vec3(-1.0, 1.0, 0.0));
}

// The line relative to the pixel q.
vec4 line_from(vec4 line, vec2 q) {
    return line + vec4(0.0, 0.0, line.x * q.x + line.y * q.y, line.y * q.x - line.x * q.y);
}

// Carries dL/db of all pairs to the corners: ∂b_k/∂p_m = -b_m ∇b_k. `first` is the item's first pixel.
void corners_from_barycentrics(Triangle t, vec2 first, inout Sums s) {
    mat3 lines = mat3(line_from(t.line0, first).xyz, line_from(t.line1, first).xyz, line_from(t.line2, first).xyz);
    // Column m: Σ dL/db times the signed distance to edge m, which is b_m over inverse_height m.
    mat3 by_b_height;
    for (int m = 0; m < 3; ++m) {
        by_b_height[m] = lines[m].x * s.by_b_column + lines[m].y * s.by_b_row + lines[m].z * s.by_b;
        vec3 sums = by_b_height[m] * t.inverse_height * t.inverse_height[m];
        s.corner[m] -= sums.x * t.line0.xy + sums.y * t.line1.xy + sums.z * t.line2.xy;
    }
    // For a triangle without area: when a segment turns, the nearest point moves along it. So ∂t/∂p has a component across the
    // segment: the distance over the squared length.
    bvec3 end_line = lessThan(t.inverse_height, vec3(0.0));
    vec3 side = ends_of_segment(end_line);
    vec3 by_b_distance = !end_line.x ? by_b_height[0] : (!end_line.y ? by_b_height[1] : by_b_height[2]);
    vec2 normal = !end_line.x ? t.line0.xy : (!end_line.y ? t.line1.xy : t.line2.xy);
    float half_length = !end_line.x ? t.half_length.x : (!end_line.y ? t.half_length.y : t.half_length.z);
    vec2 turn = normal * (0.25 * dot(by_b_distance, side) / max(half_length * half_length, 1e-30));
    for (int k = 0; k < 3; ++k) {
        s.corner[k] += side[k] * turn;
    }
}
