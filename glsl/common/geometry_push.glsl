// The numbers of a host's geometry: one push constant block for every place*.comp kernel. Needs nothing.

layout(push_constant) uniform Push {
    // Elements: invocations, or workgroups where a workgroup takes one element.
    uint count;
    // Draws in the table.
    uint draws;
    // First vertex or triangle in the frame's array.
    uint first;
    // Added to each index: the number of the mesh's vertices before the placed ones.
    uint base;
    // Layout of the host's vertices, or of its gradients where these are written: words from one to the next, and before
    // the first.
    uint stride;
    uint offset;
    // The same for transforms.
    uint transform_stride;
    uint transform_offset;
    // Bits of an index; or which texel of `vertex_gradients` is read: 0 for positions, 1 for colours.
    uint select;
} push;
