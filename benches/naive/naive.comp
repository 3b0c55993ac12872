#version 450
// Naive: every pixel over every face, as the official kernel does it, through texel buffers: a baseline for benches.
// One invocation a pixel. Euclidean distance, softmax colour with a weighted or composite background, product silhouette.
// Reads `corners` and `colors`, three texels a face; writes `image`: RGB and silhouette.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer corners;
layout(set = 0, binding = 1) uniform samplerBuffer colors;
layout(set = 0, binding = 2, std430) writeonly buffer Image { vec4 image[]; };
layout(push_constant) uniform Push {
    uint width;
    uint height;
    uint faces;
    uint composite;
    float inverse_sigma;
    float inverse_gamma;
    float near;
    float far;
    float radius_squared;
    float epsilon;
} push;

float segment(vec2 a, vec2 b, vec2 p) {
    vec2 along = b - a;
    vec2 offset = p - a;
    float t = clamp(dot(offset, along) / max(dot(along, along), 1e-30), 0.0, 1.0);
    vec2 rest = offset - t * along;
    return dot(rest, rest);
}

float cross2(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}

void main() {
    uint pixel = gl_GlobalInvocationID.x;
    if (pixel >= push.width * push.height) {
        return;
    }
    uvec2 at = uvec2(pixel % push.width, pixel / push.width);
    vec2 p = vec2(2.0 * float(at.x) + 1.0 - float(push.width), float(push.height) - 1.0 - 2.0 * float(at.y)) / float(push.height);
    // Push constants read in a loop are slow on a software device.
    float inverse_sigma = push.inverse_sigma;
    float inverse_gamma = push.inverse_gamma;
    float radius_squared = push.radius_squared;
    float far = push.far;
    float inverse_range = 1.0 / (push.far - push.near);
    bool composite = push.composite != 0u;
    int faces = int(push.faces);
    float clear = 1.0;
    float highest = composite ? -1e30 : push.epsilon;
    float sum = composite ? 0.0 : 1.0;
    vec3 color = vec3(0.0);
    for (int face = 0; face < faces; ++face) {
        vec4 a = texelFetch(corners, 3 * face);
        vec4 b = texelFetch(corners, 3 * face + 1);
        vec4 c = texelFetch(corners, 3 * face + 2);
        float area = cross2(b.xy - a.xy, c.xy - a.xy);
        vec3 w = vec3(cross2(b.xy - p, c.xy - p), cross2(c.xy - p, a.xy - p), cross2(a.xy - p, b.xy - p)) / area;
        bool inside = min(w.x, min(w.y, w.z)) >= 0.0;
        float d = min(segment(a.xy, b.xy, p), min(segment(b.xy, c.xy, p), segment(c.xy, a.xy, p)));
        if (inside || d < radius_squared) {
            float x = (inside ? d : -d) * inverse_sigma;
            float probability = 1.0 / (1.0 + exp(-x));
            clear *= 1.0 - probability;
            w = clamp(w, 0.0, 1.0);
            w /= w.x + w.y + w.z;
            float z = 1.0 / dot(w, 1.0 / vec3(a.z, b.z, c.z));
            float score = (far - z) * inverse_range;
            float rescale = score > highest ? exp((highest - score) * inverse_gamma) : 1.0;
            highest = max(highest, score);
            float weight = probability * exp((score - highest) * inverse_gamma);
            vec3 shown = w.x * texelFetch(colors, 3 * face).rgb + w.y * texelFetch(colors, 3 * face + 1).rgb
                       + w.z * texelFetch(colors, 3 * face + 2).rgb;
            sum = sum * rescale + weight;
            color = color * rescale + weight * shown;
        }
    }
    float alpha = 1.0 - clear;
    vec3 mixed = sum > 0.0 ? color / sum : vec3(0.0);
    image[pixel] = vec4(composite ? mixed * alpha : mixed, alpha);
}
