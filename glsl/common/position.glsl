// A mesh's positions and triangles. Needs the buffers positions and indices.

vec3 position_of(Shape shape, int vertex) {
    int at = 3 * (shape.vertex_base + vertex);
    return vec3(texelFetch(positions, at).x, texelFetch(positions, at + 1).x, texelFetch(positions, at + 2).x);
}

ivec3 triangle_vertices(Shape shape, int triangle) {
    int at = 3 * (shape.triangle_base + triangle);
    return ivec3(texelFetch(indices, at).x, texelFetch(indices, at + 1).x, texelFetch(indices, at + 2).x);
}

// Twice the triangle's area along its normal.
vec3 area_vector(Shape shape, ivec3 v) {
    vec3 p0 = position_of(shape, v.x);
    return cross(position_of(shape, v.y) - p0, position_of(shape, v.z) - p0);
}
