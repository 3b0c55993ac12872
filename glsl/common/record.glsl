// A triangle's two records, as triangle.comp writes them.
// The geometry record gives the signed distances of eq. 1 and the barycentrics. edge.glsl defines its members. The sign of
// half length 0 is the orientation. 16 of its 18 numbers fill GEOMETRY_TEXELS texels: the records of two triangles are eight
// texels, which eight lanes read at once (shared_records.glsl).
// The tail, (half length 2, inverse area), is the head of the shading record's first texel. Without shading it is a fifth
// texel.
// The shading record has the depth, colours, texture coordinates, normals and features of the corners.
// Needs constants.glsl, modes.glsl and the buffers `geometry` and `shading`.

struct Triangle {
    vec2 origin;
    vec4 line0;
    vec4 line1;
    vec4 line2;
    vec3 half_length;
    vec3 inverse_height;
    // 1 if the distance along the edges runs from each edge's first corner to its second, -1 if it runs back.
    float orientation;
};

// The inverse heights over the three edges. The height over an edge of half length s is A / s with the area A, so the inverse
// area serves all three. A triangle without area is a segment or a point (flatten_to_segment in edge.glsl). In place of the
// inverse area a segment has the inverse of its length, negated: only its longest edge has a length, and the other two lines
// are those through its ends. A point has 0, and the barycentrics of its first corner.
vec3 inverse_heights_of(vec3 half_length, float inverse_area) {
    vec3 of_area = half_length * inverse_area;
    vec3 of_segment = mix(vec3(inverse_area), vec3(0.0), greaterThan(half_length, vec3(0.0)));
    vec3 of_point = vec3(1e-15, 0.0, 0.0);
    return inverse_area > 0.0 ? of_area : (inverse_area < 0.0 ? of_segment : of_point);
}

float orientation_of(float half_length_0) {
    return half_length_0 < 0.0 ? -1.0 : 1.0;
}

Triangle triangle_from(vec4 record[GEOMETRY_TEXELS], vec2 tail) {
    vec3 half_length = vec3(abs(record[0].z), record[0].w, tail.x);
    return Triangle(record[0].xy, record[1], record[2], record[3], half_length, inverse_heights_of(half_length, tail.y),
                    orientation_of(record[0].z));
}

// Whether a triangle has no area, or its least height is so small that rounding could change which edge is the nearest
// (soft_distance in distance.glsl). Rounding adds some 1e-7 of the distances within the culling radius. This test asks for a
// hundred times as much.
bool is_thin(vec3 half_length, vec3 inverse_height) {
    float least = min(inverse_height.x, min(inverse_height.y, inverse_height.z));
    float most = max(inverse_height.x, max(inverse_height.y, inverse_height.z));
    float longest = 2.0 * max(half_length.x, max(half_length.y, half_length.z));
    precise float ratio = most * (longest + 2.0 * sqrt(frame.radius_squared));
    return !(least > 0.0 && ratio < 1e5);
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

// Texels of the longest shading record without its features. A frame uses SHADING_FEATURES_AT of them.
const int SHADING_MOST = int(SHADING_TEXELS + SHADING_COORDINATE_TEXELS + SHADING_NORMAL_TEXELS);

struct Corner {
    // The depth_record of triangle.comp, with z_0 in log2 weight negative in an orthographic view, and the integer part of corner
    // 0's log2 weight.
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

// Whether a depth_record is one of an orthographic view.
bool is_parallel(float weight_of_z0) {
    return PARALLEL && weight_of_z0 < 0.0;
}

// z_0 in log2 weight.
float first_depth(Corner c) {
    return PARALLEL ? abs(c.depth.z) : c.depth.z;
}

// z_0 / z_k of each corner in perspective, and 1 without; depth_record in triangle.comp keeps it from 0.
vec3 nearness(Corner c) {
    return is_parallel(c.depth.z) ? vec3(1.0) : vec3(1.0, 1.0 + c.depth.x, 1.0 + c.depth.y);
}

Corner corner_from(vec4 record[SHADING_MOST]) {
    Corner c;
    // The first two numbers of the record are the tail of the geometry record.
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
    for (int i = 0; i < SHADING_FEATURES_AT; ++i) {
        record[i] = texelFetch(shading, record_index * SHADING_STRIDE + i);
    }
    return corner_from(record);
}
