#version 450
#extension GL_GOOGLE_include_directive : require
// Colour step: one step of Adam (moments.glsl) on the vertices' colours, clamped to [0, 1]. If this step's loss is the least
// so far, it first saves the colours that had it.
// One invocation a vertex. Reads `colors`, `image_gradients`, `color_moments` and `fit_state`; writes `new_colors`,
// `new_color_moments` and `best_colors`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer colors;
layout(set = 0, binding = 1) uniform samplerBuffer image_gradients;
layout(set = 0, binding = 2) uniform samplerBuffer color_moments;
layout(set = 0, binding = 3) uniform usamplerBuffer fit_state;
layout(set = 0, binding = 4, std430) writeonly buffer NewColors { float new_colors[]; };
layout(set = 0, binding = 5, std430) writeonly buffer NewColorMoments { vec4 new_color_moments[]; };
layout(set = 0, binding = 6, std430) writeonly buffer BestColors { float best_colors[]; };

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/moments.glsl"

layout(push_constant) uniform Push {
    // Vertices.
    uint rows;
    float rate;
    // Of the first and second moment: the factors of the old value and of the gradient, and the bias correction.
    float first_decay;
    float first_share;
    float first_bias;
    float second_decay;
    float second_share;
    float second_bias;
    float epsilon;
} push;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= int(push.rows)) {
        return;
    }
    vec3 old = vec3(texelFetch(colors, 3 * i).x, texelFetch(colors, 3 * i + 1).x, texelFetch(colors, 3 * i + 2).x);
    if (texelFetch(fit_state, int(FIT_BETTER)).x != 0u) {
        best_colors[3 * i] = old.x;
        best_colors[3 * i + 1] = old.y;
        best_colors[3 * i + 2] = old.z;
    }
    if (texelFetch(fit_state, int(FIT_APPLY)).x == 0u) {
        return;
    }
    vec3 gradient = texelFetch(image_gradients, 2 * i + 1).xyz;
    Decay decay = Decay(push.first_decay, push.first_share, push.second_decay, push.second_share);
    precise vec3 mean = next_first(texelFetch(color_moments, 2 * i).xyz, gradient, decay);
    precise vec3 square = next_second(texelFetch(color_moments, 2 * i + 1).xyz, gradient, decay);
    precise vec3 moved = old - adam_step(mean, square, push.rate, push.first_bias, push.second_bias, push.epsilon);
    moved = min(max(moved, vec3(0.0)), vec3(1.0));
    new_color_moments[2 * i] = vec4(mean, 0.0);
    new_color_moments[2 * i + 1] = vec4(square, 0.0);
    new_colors[3 * i] = moved.x;
    new_colors[3 * i + 1] = moved.y;
    new_colors[3 * i + 2] = moved.z;
}
