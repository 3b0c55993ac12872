#version 450
#extension GL_GOOGLE_include_directive : require
// Regularize flaps: the official flatten loss and the normal consistency loss over flaps, pairs of triangles that share an
// edge, with their gradients.
// One invocation a flap. Reads `positions` and `flaps`; writes `flap_gradients`, four texels a flap: the weighted gradients
// by the edge's two ends and the two opposite vertices. w of the first is the flatten loss, w of the second the normals'.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer positions;
// The edge's two vertices, then the two opposite ones; FLAP_ bits in the first.
layout(set = 0, binding = 1) uniform usamplerBuffer flaps;
layout(set = 0, binding = 2, std430) writeonly buffer FlapGradients { vec4 flap_gradients[]; };

layout(constant_id = 0) const bool FLATTEN = false;
layout(constant_id = 1) const bool NORMALS = false;

#include "common/constants.glsl"
#include "common/fit.glsl"

layout(push_constant) uniform Push {
    uint flaps;
    float flatten_weight;
    float normal_weight;
} push;

// Added to denominators and under roots, as in the official code.
const float EPSILON = 1e-6;
// A triangle whose area vector is shorter has no normal.
const float LEAST = 1e-18;

vec3 position_of(int i) {
    return vec3(
        texelFetch(positions, 3 * i).x, texelFetch(positions, 3 * i + 1).x, texelFetch(positions, 3 * i + 2).x);
}

// One triangle at the edge, from the edge's first vertex: `wing` goes to the opposite vertex, `across` is its part across
// the edge, and `size` the length of that part as `fit::regularizer::Flatten` computes it.
struct Side {
    float edge_square;
    float edge_length;
    float wing_length;
    float cosine;
    float sine;
    float foot;
    vec3 across;
    float size;
};

Side side_of(vec3 edge, vec3 wing) {
    precise float edge_square = dot3(edge, edge) + EPSILON;
    precise float edge_length = sqrt(edge_square);
    precise float wing_length = sqrt(dot3(wing, wing) + EPSILON);
    precise float along = dot3(edge, wing);
    precise float cosine = along / (edge_length * wing_length + EPSILON);
    precise float sine = sqrt(1.0 - cosine * cosine + EPSILON);
    precise float foot = along / edge_square;
    precise vec3 across = wing - foot * edge;
    precise float size = wing_length * sine;
    return Side(edge_square, edge_length, wing_length, cosine, sine, foot, across, size);
}

// Derivative of side_of: dL by edge and wing from dL by `across` and `size`.
void side_gradient(Side side, vec3 edge, vec3 wing, vec3 by_across, float by_size, out vec3 by_edge, out vec3 by_wing) {
    precise float by_foot = -dot3(by_across, edge);
    precise float by_cosine = -(by_size * side.wing_length * side.cosine / side.sine);
    precise float product = side.edge_length * side.wing_length + EPSILON;
    precise float by_product = -(by_cosine * side.cosine / product);
    precise float by_along = by_cosine / product + by_foot / side.edge_square;
    precise float by_edge_square =
        by_product * side.wing_length / (2.0 * side.edge_length) - by_foot * side.foot / side.edge_square;
    precise float by_wing_length = by_size * side.sine + by_product * side.edge_length;
    precise float edge_factor = 2.0 * by_edge_square;
    precise float wing_factor = by_wing_length / side.wing_length;
    precise vec3 edge_part = edge_factor * edge + by_along * wing;
    edge_part = edge_part - side.foot * by_across;
    precise vec3 wing_part = wing_factor * wing + by_along * edge;
    wing_part = wing_part + by_across;
    by_edge = edge_part;
    by_wing = wing_part;
}

void main() {
    int i = int(gl_GlobalInvocationID.x);
    if (i >= int(push.flaps)) {
        return;
    }
    uvec4 flap = texelFetch(flaps, i);
    vec3 origin = position_of(int(flap.x & FLAP_VERTEX));
    precise vec3 edge = position_of(int(flap.y)) - origin;
    precise vec3 wing0 = position_of(int(flap.z)) - origin;
    precise vec3 wing1 = position_of(int(flap.w)) - origin;
    precise vec3 by_edge = vec3(0.0);
    precise vec3 by_wing0 = vec3(0.0);
    precise vec3 by_wing1 = vec3(0.0);
    precise float flatten_value = 0.0;
    precise float normal_value = 0.0;
    if (FLATTEN) {
        Side one = side_of(edge, wing0);
        Side two = side_of(edge, wing1);
        precise float lengths = one.size * two.size + EPSILON;
        precise float cosine = dot3(one.across, two.across) / lengths;
        // The loss is (cos + 1)², 0 where the triangles lie in one plane.
        precise float rise = cosine + 1.0;
        bool counts = (flap.x & FLAP_OFFICIAL) != 0u;
        flatten_value = counts ? rise * rise : 0.0;
        precise float by_dot = counts ? 2.0 * push.flatten_weight * rise / lengths : 0.0;
        precise float by_lengths = -(by_dot * cosine);
        precise vec3 by_across0 = by_dot * two.across;
        precise vec3 by_across1 = by_dot * one.across;
        precise float by_size0 = by_lengths * two.size;
        precise float by_size1 = by_lengths * one.size;
        vec3 part;
        side_gradient(one, edge, wing0, by_across0, by_size0, part, by_wing0);
        by_edge = by_edge + part;
        side_gradient(two, edge, wing1, by_across1, by_size1, part, by_wing1);
        by_edge = by_edge + part;
    }
    if (NORMALS) {
        precise float sign0 = (flap.x & FLAP_FIRST_ALONG) != 0u ? 1.0 : -1.0;
        precise float sign1 = (flap.x & FLAP_SECOND_ALONG) != 0u ? 1.0 : -1.0;
        precise vec3 area0 = sign0 * cross3(edge, wing0);
        precise vec3 area1 = sign1 * cross3(edge, wing1);
        precise float size0 = length3(area0);
        precise float size1 = length3(area1);
        bool counts = size0 > LEAST && size1 > LEAST;
        precise vec3 n = area0 / (counts ? size0 : 1.0);
        precise vec3 m = area1 / (counts ? size1 : 1.0);
        precise float cosine = dot3(n, m);
        normal_value = counts ? 1.0 - cosine : 0.0;
        precise float weight = counts ? push.normal_weight : 0.0;
        // ∂n/∂(area vector) = (I - n nᵀ) / length.
        precise vec3 by_area0 = (weight * sign0) * ((n * cosine - m) / (counts ? size0 : 1.0));
        precise vec3 by_area1 = (weight * sign1) * ((m * cosine - n) / (counts ? size1 : 1.0));
        by_edge = by_edge + cross3(wing0, by_area0);
        by_edge = by_edge + cross3(wing1, by_area1);
        by_wing0 = by_wing0 + cross3(by_area0, edge);
        by_wing1 = by_wing1 + cross3(by_area1, edge);
    }
    precise vec3 by_origin = by_edge + by_wing0;
    by_origin = -(by_origin + by_wing1);
    flap_gradients[4 * i] = vec4(by_origin, flatten_value);
    flap_gradients[4 * i + 1] = vec4(by_edge, normal_value);
    flap_gradients[4 * i + 2] = vec4(by_wing0, 0.0);
    flap_gradients[4 * i + 3] = vec4(by_wing1, 0.0);
}
