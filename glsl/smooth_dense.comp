#version 450
#extension GL_GOOGLE_include_directive : require
// Smooth dense: the whole inverse of I + λ L times vectors, for meshes of so few vertices that one dispatch over all of it
// takes less than the many of `smooth`.
// One invocation a vertex; the matrix is symmetric, so neighbouring invocations read neighbouring entries.

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
