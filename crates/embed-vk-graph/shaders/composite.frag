// Draws softras' image as if it were geometry: its colour is blended, its depth is tested.
#version 450
#extension GL_EXT_samplerless_texture_functions : require
layout(binding = 0) uniform texture2D image;
layout(binding = 1) uniform texture2D depth;
layout(location = 0) out vec4 color;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    color = texelFetch(image, texel, 0);
    gl_FragDepth = texelFetch(depth, texel, 0).r;
}
