#version 450
#extension GL_GOOGLE_include_directive : require
// Smooth: one step of Chebyshev's iteration for (I + λ L) x = b, with L the mesh's graph Laplacian (Golub and Varga 1961):
// x₁ = b / θ; x₊ = ω (x + (b - A x) / θ - x₋) + x₋. A fixed number of steps is a linear, symmetric map of b, and so a
// smoothing of its own even before it converges.
// One invocation a vertex. Reads b (`rough`) and the two last iterates; writes the next one over the older.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer rough;
layout(set = 0, binding = 1) uniform usamplerBuffer neighbors;
layout(set = 0, binding = 2) uniform samplerBuffer newer;
layout(set = 0, binding = 3) uniform samplerBuffer older;
layout(set = 0, binding = 4, std430) writeonly buffer Smoothed { vec4 smoothed[]; };

#include "common/fit.glsl"

layout(push_constant) uniform Push {
    uint vertices;
    // Iterates so far: 0 for the first step.
    uint iterates;
    float lambda;
    float omega;
    // 1 / θ.
    float relaxation;
} push;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= int(push.vertices)) {
        return;
    }
    float lambda = push.lambda;
    vec3 b = texelFetch(rough, i).xyz;
    precise vec3 x = vec3(0.0);
    precise vec3 before = vec3(0.0);
    precise vec3 sum = vec3(0.0);
    int first = int(texelFetch(neighbors, i).x);
    int end = push.iterates > 0u ? int(texelFetch(neighbors, i + 1).x) : first;
    for (int k = first; k < end; ++k) {
        sum = sum + texelFetch(newer, int(texelFetch(neighbors, k).x)).xyz;
    }
    x = push.iterates > 0u ? texelFetch(newer, i).xyz : vec3(0.0);
    before = push.iterates > 1u ? texelFetch(older, i).xyz : vec3(0.0);
    precise vec3 product = x + lambda * (float(end - first) * x - sum);
    precise vec3 next = x + push.relaxation * (b - product);
    next = next - before;
    next = push.omega * next;
    next = next + before;
    smoothed[i] = vec4(next, 0.0);
}
