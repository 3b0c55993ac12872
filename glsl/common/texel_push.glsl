// The numbers of one texture of a host: the push constants of place_texels.comp and place_texel_words.comp. Needs nothing.

layout(push_constant) uniform Push {
    uint width;
    uint height;
    // Its first texel in the frame's `texels`.
    uint first;
    // Decode sRGB.
    uint srgb;
} push;
