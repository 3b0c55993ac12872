// The numbers of a host's geometry: one push constant block for all place kernels but those of texels. Needs nothing; what
// reads `target_use` needs constants.glsl.

layout(push_constant) uniform Push {
    // Elements. Each takes one invocation, or one workgroup.
    uint count;
    // Draws in the table.
    uint draws;
    // First vertex or triangle in the frame's array.
    uint first;
    // place_indices adds it to each index: the number of the mesh's vertices before the placed ones. place_vertex_grad: the
    // first vertex of the host that any draw reads.
    uint base;
    // Layout of the host's vertices, or of its gradients if the kernel writes these: words from one to the next, and before the
    // first.
    uint stride;
    uint offset;
    // Layout of the host's transforms, or of their gradients if the kernel writes these, in words likewise.
    uint transform_stride;
    uint transform_offset;
    // place_indices: bits of an index. place_uvs: 1 if the host's v grows downwards. place_vertex_grad: the texel of
    // `vertex_gradients` to read, 0 for positions and 1 for colours.
    uint select;
    // TARGET_: what the kernels of gradients do with their target.
    uint target_use;
} push;
