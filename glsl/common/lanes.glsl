// Reductions over the lanes of a workgroup, in a fixed order: with shuffles where SUBGROUP_RECORDS is defined (the workgroup
// is one subgroup, of a power of two from 4 to 64 lanes), else through shared memory. A workgroup of small items may be several
// subgroups, over each of which least_of_lanes reduces. Needs the local size.

#ifndef SUBGROUP_RECORDS
shared vec4 lane_values[gl_WorkGroupSize.x];
shared uint lane_bits[gl_WorkGroupSize.x];
#endif

#ifdef SUBGROUP_RECORDS
// With shuffles, a lane's value is combined with that of the lane whose number differs in one bit, from the highest bit to
// the lowest. The number of lanes is a constant when the pipeline is compiled, so the loops unroll and bits beyond it cost
// nothing.
const int MOST_LANE_BITS = 6;
bool is_lane_bit(int bit) {
    return (1u << bit) < min(gl_WorkGroupSize.x, gl_SubgroupSize);
}
#endif

// The sum over the lanes; lane 0 has it.
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

// The least over the lanes; all have it.
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

// The bits that any lane has; all lanes have them.
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
