// A host's draws: which of its vertices, indices and instances make which vertices and triangles of the frame. The frame's
// copies are called "placed": every draw's vertices and triangles, once for each of its instances. Needs the buffer `draws`.

struct Draw {
    // First placed vertex; vertices of one instance; the first of them in the host's buffer; first transform.
    int placed_vertex;
    int vertices;
    int first_vertex;
    int first_instance;
    // First placed triangle; triangles of one instance; their first index in the host's buffer; number of instances.
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

// The draw that element `number` belongs to: the last of `count` draws that begins at or before it. `part` and `component`
// select the elements: (0, 0) are placed vertices, (1, 0) placed triangles, (0, 3) instances. An empty draw begins where the
// next one does, so it is never the last.
int draw_at(int number, int count, int part, int component) {
    int low = 0;
    int high = count - 1;
    while (low < high) {
        int middle = (low + high + 1) / 2;
        bool after = int(texelFetch(draws, 2 * middle + part)[component]) <= number;
        low = after ? middle : low;
        high = after ? high : middle - 1;
    }
    return low;
}
