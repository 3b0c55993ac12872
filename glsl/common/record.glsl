// A triangle's geometry record: what the signed edge distances of eq. 1 and the barycentrics are computed from. edge.glsl defines
// the members. Of its 18 numbers 16 fill GEOMETRY_TEXELS texels: the records of two triangles are eight texels, which eight lanes
// read at once (shared_records.glsl). The tail, (half length 2, inverse area), is the head of the first texel of the shading record,
// which a subgroup reads in the same way; without shading it is a fifth texel.
// Needs constants.glsl, modes.glsl and the buffers `geometry` and `shading`.

struct Triangle {
    vec2 origin;
    vec4 line0;
    vec4 line1;
    vec4 line2;
    vec3 half_length;
    vec3 inverse_height;
};

// The inverse heights over the three edges. The height over an edge of half length s is A / s with the area A, so that the inverse area
// serves all three. A segment, a triangle without area, has the inverse of its length, negative, in its place: its longest
// edge alone has a length, and the other two lines are those through its ends. A point has 0, and the barycentrics of its
// first corner (flatten_to_segment in edge.glsl).
vec3 inverse_heights_of(vec3 half_length, float inverse_area) {
    vec3 of_area = half_length * inverse_area;
    vec3 of_segment = mix(vec3(inverse_area), vec3(0.0), greaterThan(half_length, vec3(0.0)));
    vec3 of_point = vec3(1e-15, 0.0, 0.0);
    return inverse_area > 0.0 ? of_area : (inverse_area < 0.0 ? of_segment : of_point);
}

Triangle triangle_from(vec4 record[GEOMETRY_TEXELS], vec2 tail) {
    vec3 half_length = vec3(record[0].zw, tail.x);
    return Triangle(record[0].xy, record[1], record[2], record[3], half_length, inverse_heights_of(half_length, tail.y));
}

vec2 geometry_tail(int record_index) {
    return WANT_SHADING ? texelFetch(shading, record_index * SHADING_STRIDE).xy
                        : texelFetch(geometry, record_index * GEOMETRY_STRIDE + int(GEOMETRY_TEXELS)).xy;
}

Triangle triangle_of(int record_index) {
    vec4 record[GEOMETRY_TEXELS];
    for (int i = 0; i < int(GEOMETRY_TEXELS); ++i) {
        record[i] = texelFetch(geometry, record_index * GEOMETRY_STRIDE + i);
    }
    return triangle_from(record, geometry_tail(record_index));
}
