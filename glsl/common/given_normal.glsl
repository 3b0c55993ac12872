// The normals that meshes give their vertices. Needs mesh.glsl and the buffer `vertex_normals`.

// The vertex's given normal, a unit vector, or zero if the triangles decide.
vec3 given_normal(Shape shape, int vertex) {
    if (!GIVEN_NORMALS) {
        return vec3(0.0);
    }
    int at = 3 * (shape.vertex_base + vertex);
    return vec3(texelFetch(vertex_normals, at).x, texelFetch(vertex_normals, at + 1).x, texelFetch(vertex_normals, at + 2).x);
}

bool is_given(vec3 given) {
    return GIVEN_NORMALS && given != vec3(0.0);
}
