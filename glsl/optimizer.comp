#version 450
#extension GL_GOOGLE_include_directive : require
// Optimizer: updates the moments of three parameters and computes their change, by gradient descent with momentum, Adam, or
// Adam with one step size for all parameters. That last method first runs with SQUARES, which updates the second moments
// alone and takes their maximum over each workgroup.
// One invocation a row of three parameters. Reads gradients and `moments`; writes `new_moments` (two texels a row), `steps`,
// with the logit parametrisation `new_parameters`, and with SQUARES `square_partials`. If `fit_state` says that the step is
// not taken, the change is 0 and the moments stay.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer gradients;
layout(set = 0, binding = 1) uniform samplerBuffer step_totals;
layout(set = 0, binding = 2) uniform usamplerBuffer fit_state;
layout(set = 0, binding = 3) uniform samplerBuffer moments;
layout(set = 0, binding = 4) uniform samplerBuffer parameters;
layout(set = 0, binding = 5, std430) writeonly buffer NewMoments { vec4 new_moments[]; };
layout(set = 0, binding = 6, std430) writeonly buffer Steps { vec4 steps[]; };
layout(set = 0, binding = 7, std430) writeonly buffer NewParameters { vec4 new_parameters[]; };
layout(set = 0, binding = 8, std430) writeonly buffer SquarePartials { vec4 square_partials[]; };

// METHOD_ kind.
layout(constant_id = 0) const uint METHOD = 0;
layout(constant_id = 1) const bool SQUARES = false;
layout(constant_id = 2) const bool LOGIT = false;

#include "common/constants.glsl"
#include "common/fit.glsl"

shared vec4 lane_values[FIT_GROUP];

#include "common/moments.glsl"

layout(push_constant) uniform Push {
    // Rows; with the logit parametrisation the last is the centre.
    uint rows;
    float rate;
    // First moment: decay and 1 - decay, or momentum and 1; bias correction, by which it is divided.
    float first_decay;
    float first_share;
    float first_bias;
    // The same for the second moment.
    float second_decay;
    float second_share;
    float second_bias;
    float epsilon;
} push;

void main() {
    int rows = int(push.rows);
    bool inside = int(gl_GlobalInvocationID.x) < rows;
    int i = min(int(gl_GlobalInvocationID.x), rows - 1);
    bool apply = texelFetch(fit_state, int(FIT_APPLY)).x != 0u;
    precise vec3 gradient = LOGIT && i == rows - 1 ? texelFetch(step_totals, 0).xyz : texelFetch(gradients, i).xyz;
    precise vec3 first = texelFetch(moments, 2 * i).xyz;
    precise vec3 second = texelFetch(moments, 2 * i + 1).xyz;
    Decay decay = Decay(push.first_decay, push.first_share, push.second_decay, push.second_share);
    if (SQUARES) {
        precise vec3 square = apply ? next_second(second, gradient, decay) : second;
        if (inside) {
            new_moments[2 * i + 1] = vec4(square, 0.0);
        }
        int lane = int(gl_LocalInvocationID.x);
        // An invocation beyond the rows repeats the last row, which another one may have overwritten.
        lane_values[lane] = vec4(inside ? max(max(square.x, square.y), square.z) : 0.0);
        for (int width = int(FIT_GROUP) / 2; width > 0; width /= 2) {
            barrier();
            if (lane < width) {
                lane_values[lane] = max(lane_values[lane], lane_values[lane + width]);
            }
        }
        if (lane == 0) {
            square_partials[gl_WorkGroupID.x] = lane_values[0];
        }
        return;
    }
    precise vec3 mean = next_first(first, gradient, decay);
    precise vec3 change = push.rate * mean;
    if (METHOD == METHOD_ADAM) {
        second = apply ? next_second(second, gradient, decay) : second;
        change = adam_step(mean, second, push.rate, push.first_bias, push.second_bias, push.epsilon);
    } else if (METHOD == METHOD_UNIFORM) {
        precise float root = sqrt(texelFetch(step_totals, 1).x / push.second_bias);
        precise float step_size = push.rate / push.first_bias / (root + push.epsilon);
        change = step_size * mean;
    }
    mean = apply ? mean : first;
    change = apply ? change : vec3(0.0);
    if (inside) {
        new_moments[2 * i] = vec4(mean, 0.0);
        if (METHOD == METHOD_ADAM) {
            new_moments[2 * i + 1] = vec4(second, 0.0);
        }
        steps[i] = vec4(change, 0.0);
        if (LOGIT) {
            precise vec3 moved = texelFetch(parameters, i).xyz - change;
            new_parameters[i] = vec4(moved, 0.0);
        }
    }
}
