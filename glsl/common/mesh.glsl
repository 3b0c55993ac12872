// A view's mesh: where its vertices, triangles and colours lie in the shared buffers.
// Needs constants.glsl, frame.glsl and the buffer `view_shapes`.

struct Shape {
    // First vertex and triangle in `positions` and `indices`, and how many there are of each.
    int vertex_base;
    int vertex_count;
    int triangle_base;
    int triangle_count;
    // The first of this view's transformed vertices, records, bins and bitmap words.
    int screen_base;
    int record_base;
    int bin_base;
    int word_base;
    // Records (two a triangle where the near plane may cut it) and bitmap words of a bin.
    int record_count;
    int word_count;
    // First float of the mesh's colours, and whether the whole mesh has one colour.
    int color_base;
    bool uniform_color;
    // Whether `tile_marks` are valid. Then an empty tile that is marked holds the background already.
    bool marks_valid;
    // Texture coordinates: first float and first index, or -1 without them. The first of the triangles' texture numbers, or -1
    // less the one number for all triangles.
    int uv_base;
    int uv_index_base;
    int texture_base;
    // First offset of the vertices' adjacency.
    int adjacency_base;
};

Shape shape_of(int view) {
    int at = view * int(SHAPE_TEXELS);
    ivec4 a = ivec4(texelFetch(view_shapes, at));
    ivec4 b = ivec4(texelFetch(view_shapes, at + 1));
    ivec4 c = ivec4(texelFetch(view_shapes, at + 2));
    ivec4 d = ivec4(texelFetch(view_shapes, at + 3));
    return Shape(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w, c.x, c.y, c.z, (uint(c.w) & SHAPE_UNIFORM_COLOR) != 0u,
                 (uint(c.w) & SHAPE_MARKS_VALID) != 0u, d.x, d.y, d.z, d.w);
}

// The view that a record belongs to, by bisection: the views' records follow each other.
int view_of(int record_index) {
    int low = 0;
    int high = int(frame.view_count) - 1;
    while (low < high) {
        int middle = (low + high + 1) / 2;
        bool after = int(texelFetch(view_shapes, middle * int(SHAPE_TEXELS) + 1).y) <= record_index;
        low = after ? middle : low;
        high = after ? high : middle - 1;
    }
    return low;
}
