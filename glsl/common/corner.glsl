// A triangle's corner values as they lie in its shading record.
struct Corner {
    vec4 depth;
    float whole;
    mat3 color;
    mat3x2 coordinate;
    int texture_index;
    int triangle;
    mat3 normal;
};

Corner corner_of(int slot) {
    Corner c;
    int at = slot * SHADING_STRIDE;
    c.depth = texelFetch(shading, at);
    vec4 a = texelFetch(shading, at + 1);
    vec4 b = texelFetch(shading, at + 2);
    vec4 d = texelFetch(shading, at + 3);
    c.whole = a.w;
    c.color = mat3(a.rgb, b.rgb, vec3(b.w, d.xy));
    if (SAMPLING != SAMPLING_NONE) {
        vec4 e = texelFetch(shading, at + 4);
        vec4 f = texelFetch(shading, at + 5);
        c.coordinate = mat3x2(e.xy, e.zw, f.xy);
        c.texture_index = int(f.z);
        c.triangle = int(f.w);
    }
    if (WANT_NORMAL) {
        vec4 e = texelFetch(shading, at + SHADING_NORMAL_AT);
        vec4 f = texelFetch(shading, at + SHADING_NORMAL_AT + 1);
        vec4 g = texelFetch(shading, at + SHADING_NORMAL_AT + 2);
        c.normal = mat3(e.xyz, f.xyz, vec3(f.w, g.xy));
    }
    return c;
}
