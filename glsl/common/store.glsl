// Store: copies one view of an image from its buffer into a host's storage image, on request encoded as sRGB.
// One invocation a pixel, columns along x, rows along y. Reads `image_texels`; writes `target`.
// This body is an include because the four store_*.comp differ in nothing but STORE_FORMAT and STORE_CHANNELS: GLSL fixes a
// storage image's format when it is compiled.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform samplerBuffer image_texels;
layout(set = 0, binding = 1, STORE_FORMAT) uniform writeonly image2D target;

layout(push_constant) uniform Push {
    uint width;
    uint height;
    // First pixel of the view in the buffer.
    uint first;
    // The component that an image of one channel receives.
    uint component;
    // Not 0: encode colour as sRGB.
    uint srgb;
} push;

// The sRGB transfer function (IEC 61966-2-1).
vec3 encoded(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (at.x >= push.width || at.y >= push.height) {
        return;
    }
    vec4 texel = texelFetch(image_texels, int(push.first + at.y * push.width + at.x));
    if (STORE_CHANNELS == 1) {
        texel = vec4(texel[push.component], 0.0, 0.0, 0.0);
    } else if (push.srgb != 0u) {
        texel.rgb = encoded(texel.rgb);
    }
    imageStore(target, ivec2(at), texel);
}
