// Store: one view of an image out of its buffer into a host's storage image. One invocation a pixel.
// Reads `image_texels` as FORMAT's width says; writes `target`. STORE_FORMAT is the kernel's.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform samplerBuffer image_texels;
layout(set = 0, binding = 1, STORE_FORMAT) uniform writeonly image2D target;

layout(push_constant) uniform Push {
    uint width;
    uint height;
    // First pixel of the view.
    uint first;
    // The component that goes into an image of one channel.
    uint component;
    // Encode colour as sRGB does.
    uint srgb;
} push;

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
