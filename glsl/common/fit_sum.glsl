// The sum over a workgroup of FIT_GROUP invocations, pairwise in one order. Needs constants.glsl.

shared vec4 lane_values[FIT_GROUP];

// Every invocation calls it; invocation 0 has the sum.
precise vec4 group_sum(vec4 value) {
    int lane = int(gl_LocalInvocationID.x);
    lane_values[lane] = value;
    for (int width = int(FIT_GROUP) / 2; width > 0; width /= 2) {
        barrier();
        if (lane < width) {
            precise vec4 sum = lane_values[lane] + lane_values[lane + width];
            lane_values[lane] = sum;
        }
    }
    return lane_values[lane];
}
