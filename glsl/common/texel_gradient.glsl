// Derivatives of sample_texture and sample_opacity (sample.glsl) by the texels.
// Needs sample.glsl and the buffer `texel_sums`.

// The sums of a texel: by r, g, b and, if textures have one, by alpha.
const int TEXEL_CHANNELS = OPACITY ? 4 : 3;

// Adds to one sum of a texel, in 64-bit fixed point with the low word first. Integer sums have the same bits in any order.
void add_channel(int texel, int channel, float value) {
    float scaled = abs(value) * frame.texel_scale;
    float upper = floor(scaled * (1.0 / 4294967296.0));
    uint high = uint(upper);
    uint low = uint(scaled - upper * 4294967296.0);
    if (value < 0.0) {
        low = ~low + 1u;
        high = ~high + (low == 0u ? 1u : 0u);
    }
    int at = 2 * (TEXEL_CHANNELS * texel + channel);
    uint old = atomicAdd(texel_sums[at], low);
    atomicAdd(texel_sums[at + 1], high + (old + low < old ? 1u : 0u));
}

// Adds to a texel's gradient.
void add_texel(int texel, vec3 value) {
    for (int channel = 0; channel < 3; ++channel) {
        add_channel(texel, channel, value[channel]);
    }
}

// The derivative of sample_texture by the texels: adds `by_sample` to the texels of the sample.
void scatter_texels(int index, int triangle, mat3x2 coordinate, vec3 b, vec3 by_sample) {
    uvec4 entry = texelFetch(textures, index);
    if (entry.w == TEXTURE_SURFACE) {
        int resolution = int(entry.y);
        int cell = surface_cell(surface_barycentrics(coordinate, b), resolution);
        // The official backward pass gives gradients to a triangle's own cells only.
        if (cell < resolution * resolution) {
            add_texel(int(entry.x) + triangle * resolution * resolution + cell, by_sample);
        }
    } else {
        Footprint f = footprint_of(entry, coordinate * b);
        for (int i = 0; i < 4; ++i) {
            add_texel(f.texel[i], by_sample * f.weight[i]);
        }
    }
}

// The derivative of sample_opacity by the texels' alpha.
void scatter_opacity(int index, mat3x2 coordinate, vec3 b, float by_alpha) {
    uvec4 entry = texelFetch(textures, index);
    if (entry.w != TEXTURE_SURFACE) {
        Footprint f = footprint_of(entry, coordinate * b);
        for (int i = 0; i < 4; ++i) {
            add_channel(f.texel[i], 3, by_alpha * f.weight[i]);
        }
    }
}
