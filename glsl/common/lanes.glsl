// Reductions over the lanes of a workgroup, in a fixed order: with shuffles where SUBGROUP_RECORDS is defined (a workgroup
// of eight is one subgroup), else through shared memory. Needs the local size.

#ifndef SUBGROUP_RECORDS
shared vec4 lane_values[gl_WorkGroupSize.x];
shared uint lane_bits[gl_WorkGroupSize.x];
#endif

// The sum over the lanes; lane 0 has it.
vec4 sum_of_lanes(vec4 value) {
#ifdef SUBGROUP_RECORDS
    value += subgroupShuffleXor(value, 4u);
    value += subgroupShuffleXor(value, 2u);
    return value + subgroupShuffleXor(value, 1u);
#else
    uint lane = gl_LocalInvocationID.x;
    barrier();
    lane_values[lane] = value;
    for (uint width = gl_WorkGroupSize.x / 2u; width > 0u; width /= 2u) {
        barrier();
        if (lane < width) {
            lane_values[lane] += lane_values[lane + width];
        }
    }
    return lane_values[0];
#endif
}

// The least over the lanes; all have it.
vec2 least_of_lanes(vec2 value) {
#ifdef SUBGROUP_RECORDS
    value = min(value, subgroupShuffleXor(value, 4u));
    value = min(value, subgroupShuffleXor(value, 2u));
    return min(value, subgroupShuffleXor(value, 1u));
#else
    uint lane = gl_LocalInvocationID.x;
    barrier();
    lane_values[lane].xy = value;
    barrier();
    for (uint i = 0u; i < gl_WorkGroupSize.x; ++i) {
        value = min(value, lane_values[i].xy);
    }
    return value;
#endif
}

// The bits that any lane has; all lanes have them.
uint bits_of_lanes(uint value) {
#ifdef SUBGROUP_RECORDS
    value |= subgroupShuffleXor(value, 4u);
    value |= subgroupShuffleXor(value, 2u);
    return value | subgroupShuffleXor(value, 1u);
#else
    barrier();
    lane_bits[gl_LocalInvocationID.x] = value;
    barrier();
    for (uint i = 0u; i < gl_WorkGroupSize.x; ++i) {
        value |= lane_bits[i];
    }
    return value;
#endif
}
