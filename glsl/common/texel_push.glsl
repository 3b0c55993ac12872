// The numbers of one texture that is read from a host.

layout(push_constant) uniform Push {
    uint width;
    uint height;
    // Its first texel in the frame's `texels`.
    uint first;
    // Decode sRGB.
    uint srgb;
} push;
