// The numbers of a host's geometry, the same block for every stage that reads or writes it.

layout(push_constant) uniform Push {
    // Invocations, or workgroups where one does one thing.
    uint count;
    // Draws in the table.
    uint draws;
    // First element of the frame's array: vertex or triangle.
    uint first;
    // Added to each index: the mesh's vertices before the geometry's.
    uint base;
    // Words from one vertex to the next, and before the first; of what is written where that is the host's.
    uint stride;
    uint offset;
    // The same of transforms.
    uint transform_stride;
    uint transform_offset;
    // Bits of an index, or the first texel of `vertex_gradients` that is read: 0 by positions, 1 by colours.
    uint select;
} push;
