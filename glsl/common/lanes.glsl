// Reductions over the lanes of a workgroup, in a fixed order. With SUBGROUP_RECORDS the workgroup is one subgroup of 4 to 64
// lanes, a power of two, and they use shuffles. Else they use shared memory. A workgroup of small items may have several
// subgroups: then least_of_lanes and bits_of_lanes reduce over each of them. Needs the local size.

#ifndef SUBGROUP_RECORDS
shared vec4 lane_values[gl_WorkGroupSize.x];
shared uint lane_bits[gl_WorkGroupSize.x];
#endif

#ifdef SUBGROUP_RECORDS
// With shuffles, each lane combines its value with that of the lane whose number differs in one bit, from the highest bit to
// the lowest. The number of lanes is a constant when the pipeline is compiled. So the loops unroll, and bits beyond it cost
// nothing.
const int MOST_LANE_BITS = 6;
bool is_lane_bit(int bit) {
    return (1u << bit) < min(gl_WorkGroupSize.x, gl_SubgroupSize);
}
#endif

// The sum over the lanes. Lane 0 has it.
vec4 sum_of_lanes(vec4 value) {
#ifdef SUBGROUP_RECORDS
    for (int bit = MOST_LANE_BITS - 1; bit >= 0; --bit) {
        if (is_lane_bit(bit)) {
            value += subgroupShuffleXor(value, 1u << bit);
        }
    }
    return value;
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

// The least over the lanes. All lanes have it.
vec2 least_of_lanes(vec2 value) {
#ifdef SUBGROUP_RECORDS
    for (int bit = MOST_LANE_BITS - 1; bit >= 0; --bit) {
        if (is_lane_bit(bit)) {
            value = min(value, subgroupShuffleXor(value, 1u << bit));
        }
    }
    return value;
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

// The bits that any lane has. All lanes have them.
uint bits_of_lanes(uint value) {
#ifdef SUBGROUP_RECORDS
    for (int bit = MOST_LANE_BITS - 1; bit >= 0; --bit) {
        if (is_lane_bit(bit)) {
            value |= subgroupShuffleXor(value, 1u << bit);
        }
    }
    return value;
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
