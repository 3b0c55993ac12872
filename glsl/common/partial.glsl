// A record's gradient as backward leaves it in `partials`, summed over the cells of its box in their order.
// Needs constants.glsl, modes.glsl, gradient_modes.glsl, frame.glsl and the buffers `partials`, `item_marks` and `cell_ranges`.

struct Partial {
    // dL/d(column, row) and dL/dz of each corner.
    vec2 pixel[3];
    vec3 depth;
    // The sums of sigma and gamma (Sums in pair_gradient.glsl).
    vec2 scalars;
    // dL by each corner's colour, texture coordinates and normal, a column a corner.
    mat3 color;
    mat3x2 coordinate;
    mat3 normal;
};

// dL by the corners' features, summed as the members of Partial are. It lies beside the struct as in features.glsl.
vec4 partial_features[3 * FEATURE_ROOM];

// Adds one item's entry. write_sums in backward.comp has its layout.
void add_partial(int item, inout Partial p) {
    int at = item * PARTIAL_STRIDE;
    vec4 a = texelFetch(partials, at);
    vec4 b = texelFetch(partials, at + 1);
    vec4 c = texelFetch(partials, at + 2);
    p.pixel[0] += a.xy;
    p.pixel[1] += b.xy;
    p.pixel[2] += c.xy;
    p.depth += vec3(a.z, b.z, c.z);
    p.scalars += GRAD_SCALARS ? vec2(a.w, b.w) : vec2(0.0);
    if (GRAD_COLOR) {
        p.color += mat3(texelFetch(partials, at + PARTIAL_COLOR_AT).rgb, texelFetch(partials, at + PARTIAL_COLOR_AT + 1).rgb,
                        texelFetch(partials, at + PARTIAL_COLOR_AT + 2).rgb);
    }
    if (GRAD_COORDINATE) {
        vec4 d = texelFetch(partials, at + PARTIAL_COORDINATE_AT);
        p.coordinate += mat3x2(d.xy, d.zw, texelFetch(partials, at + PARTIAL_COORDINATE_AT + 1).xy);
    }
    if (GRAD_NORMAL) {
        vec4 d = texelFetch(partials, at + PARTIAL_NORMAL_AT);
        vec4 e = texelFetch(partials, at + PARTIAL_NORMAL_AT + 1);
        p.normal += mat3(d.xyz, vec3(d.w, e.xy), vec3(e.zw, texelFetch(partials, at + PARTIAL_NORMAL_AT + 2).x));
    }
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        partial_features[i] += texelFetch(partials, at + PARTIAL_FEATURES_AT + i);
    }
}

// The sum over a record's items that have an entry.
Partial partial_of(int record_index) {
    Partial p;
    p.pixel[0] = p.pixel[1] = p.pixel[2] = vec2(0.0);
    p.depth = vec3(0.0);
    p.scalars = vec2(0.0);
    p.color = mat3(0.0);
    p.coordinate = mat3x2(0.0);
    p.normal = mat3(0.0);
    for (int i = 0; i < 3 * GRAD_FEATURE_TEXELS; ++i) {
        partial_features[i] = vec4(0.0);
    }
    uint mark = texelFetch(item_marks, record_index).x;
    if ((mark & MARK_SUMMED) != 0u) {
        add_partial(record_index, p);
    }
    int first = int(frame.record_count + texelFetch(cell_ranges, record_index).x);
    int end = first + int(mark >> MARK_FURTHER_BIT);
    for (int item = first; item < end; ++item) {
        if (texelFetch(item_marks, item).x != 0u) {
            add_partial(item, p);
        }
    }
    return p;
}
