// A mesh's positions and triangles. Needs mesh.glsl and the buffers `positions` and `indices`.

vec3 position_of(Shape shape, int vertex) {
    int at = 3 * (shape.vertex_base + vertex);
    return vec3(texelFetch(positions, at).x, texelFetch(positions, at + 1).x, texelFetch(positions, at + 2).x);
}

ivec3 triangle_vertices(Shape shape, int triangle) {
    int at = 3 * (shape.triangle_base + triangle);
    return ivec3(texelFetch(indices, at).x, texelFetch(indices, at + 1).x, texelFetch(indices, at + 2).x);
}

// Two edges, divided by their largest component `size` so that their product neither overflows nor vanishes.
void unit_edges(vec3 p0, vec3 p1, vec3 p2, out vec3 edge1, out vec3 edge2, out float size) {
    edge1 = p1 - p0;
    edge2 = p2 - p0;
    vec3 largest = max(abs(edge1), abs(edge2));
    size = max(largest.x, max(largest.y, largest.z));
    float inverse = size > 1e-37 ? 1.0 / size : 0.0;
    edge1 *= inverse;
    edge2 *= inverse;
}

// The cross product of two edges. GLSL's cross may fuse a product with the difference and round only the other one. The edges of
// a triangle without area then have a product of some 1e-8, and the triangle has a normal.
vec3 edge_product(vec3 a, vec3 b) {
    precise vec3 product = a.yzx * b.zxy - a.zxy * b.yzx;
    return product;
}

// A vector of any length along the triangle's normal.
vec3 normal_direction(Shape shape, ivec3 v) {
    vec3 edge1;
    vec3 edge2;
    float size;
    unit_edges(position_of(shape, v.x), position_of(shape, v.y), position_of(shape, v.z), edge1, edge2, size);
    return edge_product(edge1, edge2);
}

// The triangle's normal, as long as twice its area.
vec3 area_vector(Shape shape, ivec3 v) {
    vec3 p0 = position_of(shape, v.x);
    return edge_product(position_of(shape, v.y) - p0, position_of(shape, v.z) - p0);
}
