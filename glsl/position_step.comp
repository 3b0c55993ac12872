#version 450
#extension GL_GOOGLE_include_directive : require
// Position step: moves the vertices by their changes, or to where the logit parameters put them. If this step's loss is the
// least so far, it first saves the positions that had it.
// One invocation a vertex. Reads `positions`, `changes` or `parameters` with `logit_template`, and `fit_state`; writes
// `new_positions`, `best_positions`, and in `fit_state` whether a vertex left the box or the ball that the frame was planned for.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer positions;
layout(set = 0, binding = 1) uniform samplerBuffer changes;
layout(set = 0, binding = 2) uniform samplerBuffer parameters;
layout(set = 0, binding = 3) uniform samplerBuffer logit_template;
layout(set = 0, binding = 4, std430) buffer FitState { uint fit_state[]; };
layout(set = 0, binding = 5, std430) writeonly buffer NewPositions { float new_positions[]; };
layout(set = 0, binding = 6, std430) writeonly buffer BestPositions { float best_positions[]; };

layout(constant_id = 0) const bool LOGIT = false;

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/logit.glsl"

layout(push_constant) uniform Push {
    uint vertices;
    // The box that the frame was planned for.
    float low_x;
    float low_y;
    float low_z;
    float high_x;
    float high_y;
    float high_z;
    // The ball that it was planned for: its centre and 1 over its radius, 0 where the box alone counts.
    float centre_x;
    float centre_y;
    float centre_z;
    float inverse_radius;
} push;

void main() {
    int i = int(gl_GlobalInvocationID.x);
    int vertices = int(push.vertices);
    if (i >= vertices) {
        return;
    }
    vec3 old = vec3(
        texelFetch(positions, 3 * i).x, texelFetch(positions, 3 * i + 1).x, texelFetch(positions, 3 * i + 2).x);
    bool apply = fit_state[FIT_APPLY] != 0u;
    precise vec3 moved = old;
    if (LOGIT) {
        vec3 shift = centre_shift(texelFetch(parameters, vertices).xyz);
        vec3 displacement = texelFetch(parameters, i).xyz;
        vec3 odds = texelFetch(logit_template, i).xyz;
        moved.x = logit_of(odds.x, displacement.x, shift.x).position;
        moved.y = logit_of(odds.y, displacement.y, shift.y).position;
        moved.z = logit_of(odds.z, displacement.z, shift.z).position;
    } else {
        moved = old - texelFetch(changes, i).xyz;
    }
    moved = apply ? moved : old;
    if (fit_state[FIT_BETTER] != 0u) {
        best_positions[3 * i] = old.x;
        best_positions[3 * i + 1] = old.y;
        best_positions[3 * i + 2] = old.z;
    }
    // False for NaN.
    bool inside = moved.x >= push.low_x && moved.y >= push.low_y && moved.z >= push.low_z
        && moved.x <= push.high_x && moved.y <= push.high_y && moved.z <= push.high_z;
    vec3 arm = (moved - vec3(push.centre_x, push.centre_y, push.centre_z)) * push.inverse_radius;
    inside = inside && dot(arm, arm) <= 1.0;
    if (!inside) {
        atomicOr(fit_state[FIT_HALTED], HALT_OUTSIDE);
    }
    new_positions[3 * i] = moved.x;
    new_positions[3 * i + 1] = moved.y;
    new_positions[3 * i + 2] = moved.z;
}
