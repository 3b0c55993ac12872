// Whether the frame that a backward pass follows is whole, so that its gradients may be used.
// Needs constants.glsl, frame.glsl, gradient_modes.glsl, whole.glsl and the texel buffer `status`.
bool frame_is_whole() {
    uvec3 needed = uvec3(texelFetch(status, int(STATUS_COARSE_NEEDED)).x, texelFetch(status, int(STATUS_LIST_NEEDED)).x,
                         texelFetch(status, int(STATUS_CELLS_NEEDED)).x);
    uvec3 room = uvec3(frame.coarse_capacity, frame.list_capacity, frame.cell_capacity);
    return is_whole(needed, room, texelFetch(status, int(STATUS_LONGEST_LIST)).x, LONGEST_LIST,
                    texelFetch(status, int(STATUS_NOT_FINITE)).x);
}
