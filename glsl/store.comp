#version 450
#extension GL_GOOGLE_include_directive : require
// Store: copies one view of an image from its buffer into a host's storage image. On request it takes the background's colour
// out, encodes the image as sRGB, or turns view depths into the values of the host's depth buffer.
// One invocation a pixel, columns along x, rows along y. Reads `image_texels`, and the pixel's silhouette from `alpha_texels`.
// Writes `target`.
// Compiled for each STORE_FORMAT, of STORE_CHANNELS: GLSL fixes the format of a storage image when it is compiled.

layout(local_size_x = 8, local_size_y = 8) in;

layout(set = 0, binding = 0) uniform samplerBuffer image_texels;
layout(set = 0, binding = 1) uniform samplerBuffer alpha_texels;
layout(set = 0, binding = 2, STORE_FORMAT) uniform writeonly image2D target;

#include "common/constants.glsl"

layout(push_constant) uniform Push {
    uint width;
    uint height;
    // First pixel of the view in the buffer.
    uint first;
    // The component that an image of one channel receives.
    uint component;
    // The component of `alpha_texels` that is the silhouette.
    uint alpha_component;
    // STORE_ bits.
    uint flags;
    // For a depth buffer: a constant, a factor of the view depth or of its inverse, the value of pixels that are not covered,
    // and the least silhouette of a covered pixel.
    float depth_constant;
    float depth_factor;
    float depth_clear;
    float least_alpha;
    float background_red;
    float background_green;
    float background_blue;
} push;

bool has(uint flag) {
    return (push.flags & flag) != 0u;
}

// The sRGB transfer function (IEC 61966-2-1).
vec3 encoded(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, greaterThan(c, vec3(0.0031308)));
}

// The colour of the triangles alone. With the composite background I = A mixture + (1 - A) background, else I is the mixture.
vec3 foreground(vec3 shown, float alpha) {
    vec3 drawn = shown;
    if (has(STORE_COMPOSITE)) {
        vec3 background = vec3(push.background_red, push.background_green, push.background_blue);
        vec3 blended = shown - (1.0 - alpha) * background;
        drawn = has(STORE_PREMULTIPLIED) ? blended : blended / alpha;
    } else if (has(STORE_PREMULTIPLIED)) {
        drawn = shown * alpha;
    }
    return alpha > 0.0 ? drawn : vec3(0.0);
}

// The value of the host's depth buffer. The composite background blends depth with 0, as colour with its own colour.
float buffer_depth(float blended, float alpha) {
    float z = has(STORE_COMPOSITE) ? blended / alpha : blended;
    float value = push.depth_constant + push.depth_factor * (has(STORE_PERSPECTIVE) ? 1.0 / z : z);
    return alpha > 0.0 && alpha >= push.least_alpha && z > 0.0 ? value : push.depth_clear;
}

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    if (at.x >= push.width || at.y >= push.height) {
        return;
    }
    int index = int(push.first + at.y * push.width + at.x);
    vec4 texel = texelFetch(image_texels, index);
    if (STORE_CHANNELS == 1) {
        float value = texel[push.component];
        if (has(STORE_DEPTH)) {
            value = buffer_depth(value, texelFetch(alpha_texels, index)[push.alpha_component]);
        }
        texel = vec4(value, 0.0, 0.0, 0.0);
    } else {
        if (has(STORE_PREMULTIPLIED) || has(STORE_STRAIGHT)) {
            texel.rgb = foreground(texel.rgb, texel.a);
        }
        if (has(STORE_SRGB)) {
            texel.rgb = encoded(texel.rgb);
        }
    }
    imageStore(target, ivec2(at), texel);
}
