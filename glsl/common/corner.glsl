// A triangle's shading record: depth, colours, texture coordinates and normals of its corners, as triangle.comp writes it.
// Needs constants.glsl, modes.glsl and the buffer `shading`.

// Texels of the longest shading record; SHADING_STRIDE of them are used.
const int SHADING_MOST = int(SHADING_TEXELS + SHADING_COORDINATE_TEXELS + SHADING_NORMAL_TEXELS);

struct Corner {
    // The depth_record of triangle.comp, and the integer part of corner 0's log2 weight.
    vec4 depth;
    float exponent;
    // A column a corner, as with all that follows.
    mat3 color;
    mat3x2 coordinate;
    // Entry of `textures`, and the triangle's number in its mesh.
    int texture_index;
    int triangle;
    mat3 normal;
};

Corner corner_from(vec4 record[SHADING_MOST]) {
    Corner c;
    // The first two numbers of the record are the geometry's (record.glsl).
    c.depth = vec4(record[1].xyz, record[0].z);
    c.exponent = record[1].w;
    c.color = mat3(vec3(record[0].w, record[2].xy), vec3(record[2].zw, record[3].x), record[3].yzw);
    if (SAMPLING != SAMPLING_NONE) {
        vec4 e = record[4];
        vec4 f = record[5];
        c.coordinate = mat3x2(e.xy, e.zw, f.xy);
        c.texture_index = int(f.z);
        c.triangle = int(f.w);
    }
    if (WANT_NORMAL) {
        vec4 e = record[SHADING_NORMAL_AT];
        vec4 f = record[SHADING_NORMAL_AT + 1];
        vec4 g = record[SHADING_NORMAL_AT + 2];
        c.normal = mat3(e.xyz, f.xyz, vec3(f.w, g.xy));
    }
    return c;
}

Corner corner_of(int record_index) {
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_STRIDE; ++i) {
        record[i] = texelFetch(shading, record_index * SHADING_STRIDE + i);
    }
    return corner_from(record);
}
