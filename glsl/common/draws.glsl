// A host's draws: which of its vertices, indices and instances make which of the frame's. Needs the buffer draws.

struct Draw {
    // First of the geometry's placed vertices, vertices of one instance, first in the host's buffer, first transform.
    int placed_vertex;
    int vertices;
    int first_vertex;
    int first_instance;
    // The same of triangles and indices.
    int placed_triangle;
    int triangles;
    int first_index;
    int instances;
};

Draw draw_of(int index) {
    ivec4 a = ivec4(texelFetch(draws, 2 * index));
    ivec4 b = ivec4(texelFetch(draws, 2 * index + 1));
    return Draw(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
}

// The last draw that begins at or before a placed vertex (part 0, component 0), a placed triangle (1, 0) or an
// instance (0, 3). Draws of nothing begin where the next one does, so that they are never the last.
int draw_at(int place, int count, int part, int component) {
    int low = 0;
    int high = count - 1;
    while (low < high) {
        int middle = (low + high + 1) / 2;
        bool after = int(texelFetch(draws, 2 * middle + part)[component]) <= place;
        low = after ? middle : low;
        high = after ? high : middle - 1;
    }
    return low;
}
