#version 450
#extension GL_GOOGLE_include_directive : require
// Shape gradient: adds the gradients of the images and of the regularisers by a vertex's position in a fixed order, and with
// the logit parametrisation takes them to its parameters.
// One invocation a vertex. Reads `image_gradients`, `vertex_penalties` and `flap_gradients`; writes `shape_gradients` and,
// for the logit parametrisation, `centre_partials`, each workgroup's sum of dL/dcentre.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer image_gradients;
layout(set = 0, binding = 1) uniform samplerBuffer vertex_penalties;
layout(set = 0, binding = 2) uniform samplerBuffer flap_gradients;
layout(set = 0, binding = 3) uniform usamplerBuffer neighbors;
// vertices + 1 offsets, then for each vertex its texels of `flap_gradients`, in ascending order.
layout(set = 0, binding = 4) uniform usamplerBuffer flap_corners;
layout(set = 0, binding = 5) uniform samplerBuffer parameters;
layout(set = 0, binding = 6) uniform samplerBuffer logit_template;
layout(set = 0, binding = 7, std430) writeonly buffer ShapeGradients { vec4 shape_gradients[]; };
layout(set = 0, binding = 8, std430) writeonly buffer CentrePartials { vec4 centre_partials[]; };

layout(constant_id = 0) const bool LAPLACIAN = false;
layout(constant_id = 1) const bool EDGES = false;
layout(constant_id = 2) const bool FLAPS = false;
layout(constant_id = 3) const bool LOGIT = false;

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/fit_sum.glsl"
#include "common/logit.glsl"

layout(push_constant) uniform Push {
    uint vertices;
    // 2 × weight.
    float laplacian_scale;
} push;

// dL/d(position of vertex i).
precise vec3 position_gradient(int i) {
    precise vec3 sum = texelFetch(image_gradients, 2 * i).xyz;
    if (LAPLACIAN) {
        // The Laplacian's transpose: its own offset less the neighbours' shares (regularize_vertices.comp).
        int first = int(texelFetch(neighbors, i).x);
        int end = int(texelFetch(neighbors, i + 1).x);
        precise vec3 offset = texelFetch(vertex_penalties, 2 * i).xyz * float(end - first);
        for (int k = first; k < end; ++k) {
            offset = offset - texelFetch(vertex_penalties, 2 * int(texelFetch(neighbors, k).x)).xyz;
        }
        sum = sum + push.laplacian_scale * offset;
    }
    if (EDGES) {
        sum = sum + texelFetch(vertex_penalties, 2 * i + 1).xyz;
    }
    if (FLAPS) {
        int end = int(texelFetch(flap_corners, i + 1).x);
        for (int k = int(texelFetch(flap_corners, i).x); k < end; ++k) {
            sum = sum + texelFetch(flap_gradients, int(texelFetch(flap_corners, k).x)).xyz;
        }
    }
    return sum;
}

void main() {
    int vertices = int(push.vertices);
    bool inside = int(gl_GlobalInvocationID.x) < vertices;
    int i = min(int(gl_GlobalInvocationID.x), vertices - 1);
    precise vec3 gradient = position_gradient(i);
    if (LOGIT) {
        vec3 shift = centre_shift(texelFetch(parameters, vertices).xyz);
        vec3 displacement = texelFetch(parameters, i).xyz;
        vec3 odds = texelFetch(logit_template, i).xyz;
        precise vec3 by_centre = vec3(0.0);
        for (int k = 0; k < 3; ++k) {
            Logit at = logit_of(odds[k], displacement[k], shift[k]);
            // d tanh(c)/dc = 1 - tanh²(c).
            precise float slope = 1.0 - shift[k] * shift[k];
            by_centre[k] = gradient[k] * at.by_shift * slope;
            gradient[k] = gradient[k] * at.by_displacement;
        }
        precise vec4 sum = group_sum(vec4(inside ? by_centre : vec3(0.0), 0.0));
        if (gl_LocalInvocationID.x == 0u) {
            centre_partials[gl_WorkGroupID.x] = sum;
        }
    }
    if (inside) {
        shape_gradients[i] = vec4(gradient, 0.0);
    }
}
