// Backward of one (pixel, triangle) pair (eq. 4): each function is the transpose of one function of fragment.glsl or
// sample.glsl and adds to a lane's sums. `by_X` is the derivative of the loss by X, X being the name that forward uses.
// Needs fragment.glsl, sample.glsl, corner.glsl, gradient_modes.glsl and the buffer `texel_sums`.

struct Sums {
    // dL/d(column, row) of each corner, in pixels.
    vec2 corner[3];
    // For a triangle without area: dL by the rotation of its segment.
    float turn;
    // Σ dL/dz (z/z_0)² b̂_k, which times (z_0/z_k)² is dL/dz_k.
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

// What all pairs of a triangle share beyond its record. ends_of computes it.
struct Ends {
    // The edge parameter t = start + slope · (distance along the edge from its midpoint), 0 and 1 at the edge's ends.
    vec3 start;
    vec3 slope;
    // For a triangle without area: 1 at the line of its segment, and the derivative of the barycentrics by the segment's
    // rotation. Zero for all others.
    vec3 pick;
    vec3 turn;
};

// For a triangle without area: -1 at the first corner of its segment, 1 at the second, 0 at the third. `flat_line` marks
// the lines across the segment's end points (flatten_to_segment in edge.glsl).
vec3 ends_of_segment(bvec3 flat_line) {
    if (!any(flat_line)) {
        return vec3(0.0);
    }
    return !flat_line.x ? vec3(0.0, -1.0, 1.0) : (!flat_line.y ? vec3(1.0, 0.0, -1.0) : vec3(-1.0, 1.0, 0.0));
}

// The end lines of a triangle without area stand for corners: there t is 0 or 1 throughout.
Ends ends_of(Triangle t) {
    Ends e;
    e.start = vec3(0.5);
    bvec3 flat_line = lessThan(t.inverse_height, vec3(0.0));
    // The lines of a triangle without area do not show its orientation; edge.glsl sets it positive.
    bool turned = t.line0.x * t.line1.y - t.line0.y * t.line1.x < 0.0 && !any(flat_line);
    float orientation = turned ? -1.0 : 1.0;
    for (int k = 0; k < 3; ++k) {
        int before = k == 0 ? 2 : k - 1;
        e.start[k] = flat_line[k] ? (flat_line[before] ? 1.0 : 0.0) : 0.5;
        e.slope[k] = t.half_length[k] > 0.0 ? 0.5 * orientation / t.half_length[k] : 0.0;
    }
    bool segment = any(flat_line);
    vec3 side = ends_of_segment(flat_line);
    for (int k = 0; k < 3; ++k) {
        e.pick[k] = segment && side[k] == 0.0 ? 1.0 : 0.0;
        e.turn[k] = side[k] == 0.0 ? 0.0 : side[k] / t.inverse_height[k];
    }
    return e;
}

// x clamped to ±limit.
float between(float x, float limit) {
    return lesser(greater(x, -limit), limit);
}

// Derivative of d² (eq. 1; place_at) by the corners: with the nearest boundary point q = Σ β_k p_k,
// ∂d²/∂p_k = 2 β_k (q - pixel). `by_squared` is dL/d(Place.squared), ±log(2) times dL/dx.
void distance_gradient(Triangle t, Ends ends, Place p, float by_squared, inout Sums s) {
    bool first = p.to_edge.x <= p.to_edge.y && p.to_edge.x <= p.to_edge.z;
    bool second = !first && p.to_edge.y <= p.to_edge.z;
    vec2 normal = first ? t.line0.xy : (second ? t.line1.xy : t.line2.xy);
    float height = first ? p.height.x : (second ? p.height.y : p.height.z);
    float along = first ? p.along.x : (second ? p.along.y : p.along.z);
    float half_length = first ? t.half_length.x : (second ? t.half_length.y : t.half_length.z);
    float start = first ? ends.start.x : (second ? ends.start.y : ends.start.z);
    float slope = first ? ends.slope.x : (second ? ends.slope.y : ends.slope.z);
    // The nearest point is `on` along the edge; the pixel lies `beyond` past it.
    float on = between(along, half_length);
    float beyond = along - on;
    float u = start + slope * on;
    float v = 1.0 - u;
    vec3 beta = first ? vec3(0.0, v, u) : (second ? vec3(u, 0.0, v) : vec3(v, u, 0.0));
    vec2 pull = -2.0 * by_squared * (height * normal + beyond * vec2(normal.y, -normal.x));
    s.corner[0] += beta.x * pull;
    s.corner[1] += beta.y * pull;
    s.corner[2] += beta.z * pull;
}

// Derivative of b̂ = clamp(b, 0, 1) / sum (clipped_barycentrics) by the corners: ∂b_k/∂p_m = -b_m ∇b_k. `share` is b̂ and
// `by_share` its dL; eq. 4 alone (PAPER) leaves this path out.
void barycentric_gradient(Triangle t, Ends ends, vec3 height, vec3 share, float inverse_sum, vec3 by_share,
                          inout Sums s) {
    vec3 b = height * t.inverse_height;
    vec3 by_clipped = (by_share - dot(by_share, share)) * inverse_sum;
    // A clamped b has derivative 0, however large it is.
    bool free0 = b.x > 0.0 && b.x < 1.0;
    bool free1 = b.y > 0.0 && b.y < 1.0;
    bool free2 = b.z > 0.0 && b.z < 1.0;
    vec3 by_b = by_clipped * t.inverse_height;
    by_b = vec3(free0 ? by_b.x : 0.0, free1 ? by_b.y : 0.0, free2 ? by_b.z : 0.0);
    vec2 h = by_b.x * t.line0.xy + by_b.y * t.line1.xy + by_b.z * t.line2.xy;
    s.corner[0] -= b.x * h;
    s.corner[1] -= b.y * h;
    s.corner[2] -= b.z * h;
    s.turn += dot(height, ends.pick) * dot(by_b, ends.turn);
}

// Adds to a texel's gradient in 64-bit fixed point (low word first): integer sums have the same bits in any order.
void add_texel(int texel, vec3 value) {
    for (int channel = 0; channel < 3; ++channel) {
        float scaled = abs(value[channel]) * frame.texel_scale;
        float upper = floor(scaled * (1.0 / 4294967296.0));
        uint high = uint(upper);
        uint low = uint(scaled - upper * 4294967296.0);
        if (value[channel] < 0.0) {
            low = ~low + 1u;
            high = ~high + (low == 0u ? 1u : 0u);
        }
        int at = 2 * (3 * texel + channel);
        uint old = atomicAdd(texel_sums[at], low);
        atomicAdd(texel_sums[at + 1], high + (old + low < old ? 1u : 0u));
    }
}

// Derivative of sample_texture by the texels: adds `by_sample` to those that the sample was made of.
void scatter_texels(int index, int triangle, mat3x2 coordinate, vec3 b, vec3 by_sample) {
    uvec4 entry = texelFetch(textures, index);
    if (entry.w == TEXTURE_SURFACE) {
        int resolution = int(entry.y);
        int cell = surface_cell(surface_barycentrics(coordinate, b), resolution);
        // The official backward pass gives gradients to a triangle's own cells only.
        if (cell < resolution * resolution) {
            add_texel(int(entry.x) + triangle * resolution * resolution + cell, by_sample);
        }
    } else {
        Footprint f = footprint_of(entry, coordinate * b);
        for (int i = 0; i < 4; ++i) {
            add_texel(f.texel[i], by_sample * f.weight[i]);
        }
    }
}

// Derivative of x = ± m² / sigma (eq. 1 with the barycentric distance; m the smallest barycentric coordinate) by the
// corners: ∂b_k/∂p_m = -b_m ∇b_k.
void barycentric_distance_gradient(Triangle t, vec3 height, float by_x, inout Sums s) {
    vec3 b = height * t.inverse_height;
    bool first = b.x <= b.y && b.x <= b.z;
    bool second = !first && b.y <= b.z;
    float least = first ? b.x : (second ? b.y : b.z);
    vec4 line = first ? t.line0 : (second ? t.line1 : t.line2);
    float inverse = first ? t.inverse_height.x : (second ? t.inverse_height.y : t.inverse_height.z);
    const float LN2 = 0.69314718056;
    // Without a gradient of x the factor is not evaluated: it may be infinite far from the triangle.
    vec2 pull = by_x == 0.0 ? vec2(0.0) : line.xy * (inverse * 2.0 * abs(least) * frame.barycentric_scale * LN2 * by_x);
    s.corner[0] -= b.x * pull;
    s.corner[1] -= b.y * pull;
    s.corner[2] -= b.z * pull;
}

// Derivative of the fragment's colour C = Σ b̂_k c_k (∂I/∂C_j = w_j in eq. 4) by corner colours, texture coordinates and
// texels. Returns dL/d`mixed` over the weight; `value` becomes dL/dI · C. `mixed` is b̂, perspective-corrected where asked;
// `weight` is w_j of eq. 3 and `by_color` is dL/dI.
vec3 color_gradient(Corner c, vec3 mixed, vec3 by_color, float weight, out float value, inout Sums s) {
    vec3 sampled = vec3(1.0);
    vec3 light = c.color * mixed;
    vec3 by_coordinate_mixed = vec3(0.0);
    if (SAMPLING != SAMPLING_NONE) {
        mat2x3 slope;
        sampled = sample_with_slope(c.texture_index, c.triangle, c.coordinate, mixed, slope);
        vec3 by_sample = by_color * light;
        vec2 by_coordinate = vec2(dot(by_sample, slope[0]), dot(by_sample, slope[1]));
        by_coordinate_mixed = by_coordinate * c.coordinate;
        if (GRAD_COORDINATE) {
            for (int k = 0; k < 3; ++k) {
                s.coordinate[k] += by_coordinate * (weight * mixed[k]);
            }
        }
        if ((GRADIENTS & GRADIENT_TEXEL) != 0u && weight > 0.0) {
            scatter_texels(c.texture_index, c.triangle, c.coordinate, mixed, by_sample * weight);
        }
    }
    vec3 by_light = by_color * sampled;
    value = dot(by_light, light);
    if (GRAD_COLOR) {
        s.color[0] += by_light * (weight * mixed.x);
        s.color[1] += by_light * (weight * mixed.y);
        s.color[2] += by_light * (weight * mixed.z);
    }
    return by_light * c.color + by_coordinate_mixed;
}

// z_0 / z_k of each corner; depth_record in triangle.comp keeps it from 0.
vec3 nearness(Corner c) {
    return vec3(1.0, 1.0 + c.depth.x, 1.0 + c.depth.y);
}
