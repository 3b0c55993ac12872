// A triangle's gradient as backward leaves it, summed over the cells of its box in their order.

struct Partial {
    vec2 pixel[3];
    vec3 depth;
    vec2 scalars;
    mat3 color;
    mat3x2 coordinate;
    mat3 normal;
};

void add_partial(int item, inout Partial p) {
    int at = item * PARTIAL_STRIDE;
    vec4 a = texelFetch(partials, at);
    vec4 b = texelFetch(partials, at + 1);
    vec4 c = texelFetch(partials, at + 2);
    p.pixel[0] += a.xy;
    p.pixel[1] += a.zw;
    p.pixel[2] += b.xy;
    p.depth += vec3(b.zw, c.x);
    p.scalars += c.yz;
    if (GRAD_COLOR) {
        vec4 d = texelFetch(partials, at + PARTIAL_COLOR_AT);
        vec4 e = texelFetch(partials, at + PARTIAL_COLOR_AT + 1);
        p.color += mat3(d.xyz, vec3(d.w, e.xy), vec3(e.zw, texelFetch(partials, at + PARTIAL_COLOR_AT + 2).x));
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
}

Partial partial_of(int slot) {
    Partial p;
    p.pixel[0] = p.pixel[1] = p.pixel[2] = vec2(0.0);
    p.depth = vec3(0.0);
    p.scalars = vec2(0.0);
    p.color = mat3(0.0);
    p.coordinate = mat3x2(0.0);
    p.normal = mat3(0.0);
    ivec4 box = texelFetch(boxes, slot);
    if (box.x > box.z || box.y > box.w) {
        return p;
    }
    add_partial(slot, p);
    uvec2 more = texelFetch(cell_ranges, slot).xy;
    for (uint i = 0u; i < more.y; ++i) {
        add_partial(int(frame.slot_count + more.x + i), p);
    }
    return p;
}
