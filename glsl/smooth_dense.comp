#version 450
#extension GL_GOOGLE_include_directive : require
// Smooth, dense: multiplies the full inverse of I + λ L with a vector, for meshes so small that one such dispatch takes less
// time than the many of `smooth`.
// One invocation a vertex; the matrix is symmetric, so that neighbouring invocations read neighbouring entries. Reads
// `rough` and `inverse_entries`; writes `smoothed`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer rough;
layout(set = 0, binding = 1) uniform samplerBuffer inverse_entries;
layout(set = 0, binding = 2, std430) writeonly buffer Smoothed { vec4 smoothed[]; };

layout(push_constant) uniform Push {
    uint vertices;
} push;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    int vertices = int(push.vertices);
    if (i >= vertices) {
        return;
    }
    precise vec3 sum = vec3(0.0);
    for (int j = 0; j < vertices; ++j) {
        sum = sum + texelFetch(inverse_entries, j * vertices + i).x * texelFetch(rough, j).xyz;
    }
    smoothed[i] = vec4(sum, 0.0);
}
