#version 450
// Peak: measures the rate of independent multiply-adds, the most floating point work that this device does through this
// driver. Each invocation advances twelve numbers, enough that none waits for its previous step. A pass of the loop is short
// because Mesa moves the steps of a number next to each other: a processor overlaps numbers only as far as it looks ahead.
// One invocation a result. Compiled by `glslangValidator -V --target-env vulkan1.1 peak.comp -o peak.spv`. Reads nothing; writes `results`, so that no compiler removes the work.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) writeonly buffer Results { float results[]; };
layout(push_constant) uniform Push {
    uint loops;
    float factor;
    float term;
} push;

#define STEP a0 = a0 * f + t; a1 = a1 * f + t; a2 = a2 * f + t; a3 = a3 * f + t; a4 = a4 * f + t; a5 = a5 * f + t; \
             a6 = a6 * f + t; a7 = a7 * f + t; a8 = a8 * f + t; a9 = a9 * f + t; a10 = a10 * f + t; a11 = a11 * f + t;

void main() {
    float f = push.factor;
    float t = push.term;
    float s = float(gl_GlobalInvocationID.x) * 1e-6;
    float a0 = s, a1 = s + 1.0, a2 = s + 2.0, a3 = s + 3.0, a4 = s + 4.0, a5 = s + 5.0;
    float a6 = s + 6.0, a7 = s + 7.0, a8 = s + 8.0, a9 = s + 9.0, a10 = s + 10.0, a11 = s + 11.0;
    uint loops = push.loops;
    for (uint i = 0u; i < loops; ++i) {
        STEP STEP STEP STEP
    }
    results[gl_GlobalInvocationID.x] = a0 + a1 + a2 + a3 + a4 + a5 + a6 + a7 + a8 + a9 + a10 + a11;
}
