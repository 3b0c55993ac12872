// Ambient and directional light on a normal, with its derivative, and the unit vector along a normal.
// Needs frame.glsl and the buffer `lights`: the ambient colour, then the direction and the colour of each light.

// ambient + Σ color max(normal · direction, 0).
vec3 light_on(vec3 normal) {
    vec3 sum = texelFetch(lights, 0).rgb;
    uint count = frame.light_count;
    for (uint i = 0u; i < count; ++i) {
        vec3 direction = texelFetch(lights, int(1u + 2u * i)).xyz;
        vec3 color = texelFetch(lights, int(2u + 2u * i)).rgb;
        sum += color * max(dot(normal, direction), 0.0);
    }
    return sum;
}

// The derivative of light_on by the normal: dL/dnormal from dL/dlight.
vec3 light_gradient(vec3 normal, vec3 by_light) {
    vec3 sum = vec3(0.0);
    uint count = frame.light_count;
    for (uint i = 0u; i < count; ++i) {
        vec3 direction = texelFetch(lights, int(1u + 2u * i)).xyz;
        vec3 color = texelFetch(lights, int(2u + 2u * i)).rgb;
        sum += direction * (dot(normal, direction) > 0.0 ? dot(color, by_light) : 0.0);
    }
    return sum;
}

// The unit vector along v, or zero if v is zero or not finite. v is first brought near 1 by a power of two, and divided by its
// largest component, so that no square overflows or vanishes: a GPU takes the reciprocal of a number above 2^126 for 0.
vec3 unit_or_zero(vec3 v) {
    vec3 a = abs(v);
    bool is_finite = a.x + a.y + a.z < 3e38;
    float power = max(a.x, max(a.y, a.z)) > 1.0 ? 5.4210109e-20 : 1.8446744e19;
    v *= power;
    a *= power;
    float largest = max(a.x, max(a.y, a.z));
    bool has_direction = largest > 0.0 && is_finite;
    vec3 w = v / (has_direction ? largest : 1.0);
    float squared = dot(w, w);
    return has_direction ? w * inversesqrt(squared) : vec3(0.0);
}
