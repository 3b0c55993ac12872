// Reading a triangle's records once for all lanes of a workgroup.
// Needs record.glsl with its buffers, and with SUBGROUP_RECORDS subgroup shuffles.

// With SUBGROUP_RECORDS the workgroup is one subgroup of 4 to 64 lanes. Each lane reads one texel of a record, or two if there
// are only four lanes, and shuffles pass the texels to all lanes. On a software device a fetch costs as many reads as there are
// lanes, even if all lanes fetch the same texel, and a shuffle from a known lane is one instruction. Fetching a triangle ahead
// hides the latency.
struct Fetched {
    int record_index;
#ifdef SUBGROUP_RECORDS
    vec4 geometry;
    vec4 shading;
    // The texels of shading after the first LANES. Without shading the geometry's tail.
    vec4 more;
#endif
};

#ifdef SUBGROUP_RECORDS
const int LANES = int(gl_WorkGroupSize.x);
// Whether a shading record has more texels than there are lanes, so that each lane reads a second one. If eight lanes read a
// record of nine texels, they fetch the ninth directly.
const bool SHADING_TWICE = LANES < SHADING_STRIDE;
// Whether the lanes suffice for the geometry, or for the shading, of two triangles. Then one fetch reads both, which saves 4 %
// of the time of forward_soft.comp for geometry and 6 % for shading.
const bool GEOMETRY_PAIRED = 2 * GEOMETRY_STRIDE <= LANES;
const bool SHADING_PAIRED = 2 * SHADING_STRIDE <= LANES;

// The texel that a lane fetches of one record, or of two records, where the texels of the first come first.
int own_texel(int record_index, int stride, int from) {
    return record_index * stride + min(int(gl_SubgroupInvocationID) + from, stride - 1);
}

int paired_texel(int first_index, int second_index, int stride) {
    int lane = int(gl_SubgroupInvocationID);
    return lane < stride ? first_index * stride + lane : second_index * stride + min(lane - stride, stride - 1);
}

// The texels of a record that one fetch has no room for. Those of shading are read only if `shaded`.
vec4 fetch_more(int record_index, bool shaded) {
    vec4 more = vec4(0.0);
    if (WANT_SHADING && SHADING_TWICE && shaded) {
        more = texelFetch(shading, own_texel(record_index, SHADING_STRIDE, LANES));
    } else if (!WANT_SHADING && LANES < GEOMETRY_STRIDE) {
        more = texelFetch(geometry, own_texel(record_index, GEOMETRY_STRIDE, LANES));
    }
    return more;
}

Fetched fetch_record(int record_index) {
    vec4 shaded = WANT_SHADING ? texelFetch(shading, own_texel(record_index, SHADING_STRIDE, 0)) : vec4(0.0);
    vec4 edges = texelFetch(geometry, own_texel(record_index, GEOMETRY_STRIDE, 0));
    return Fetched(record_index, edges, shaded, fetch_more(record_index, true));
}

// The records of two triangles. With GEOMETRY_PAIRED both have the same texels of geometry, with SHADING_PAIRED of shading.
void fetch_pair(int first_index, int second_index, bool shaded, out Fetched first, out Fetched second) {
    first.record_index = first_index;
    second.record_index = second_index;
    if (GEOMETRY_PAIRED) {
        first.geometry = texelFetch(geometry, paired_texel(first_index, second_index, GEOMETRY_STRIDE));
        second.geometry = first.geometry;
    } else {
        first.geometry = texelFetch(geometry, own_texel(first_index, GEOMETRY_STRIDE, 0));
        second.geometry = texelFetch(geometry, own_texel(second_index, GEOMETRY_STRIDE, 0));
    }
    if (WANT_SHADING && SHADING_PAIRED) {
        first.shading = texelFetch(shading, paired_texel(first_index, second_index, SHADING_STRIDE));
        second.shading = first.shading;
    } else if (WANT_SHADING) {
        first.shading = texelFetch(shading, own_texel(first_index, SHADING_STRIDE, 0));
        second.shading = texelFetch(shading, own_texel(second_index, SHADING_STRIDE, 0));
    }
    first.more = fetch_more(first_index, shaded);
    second.more = fetch_more(second_index, shaded);
}

// The lane with the first texel of geometry, or of shading, of the first or the second record of a pair.
uint geometry_lane(bool is_second) {
    return GEOMETRY_PAIRED && is_second ? uint(GEOMETRY_STRIDE) : 0u;
}

uint shading_lane(bool is_second) {
    return SHADING_PAIRED && is_second ? uint(SHADING_STRIDE) : 0u;
}

vec2 shared_tail_of(Fetched own, bool is_second) {
    if (WANT_SHADING) {
        return subgroupShuffle(own.shading.xy, shading_lane(is_second));
    }
    return LANES < GEOMETRY_STRIDE ? own.more.xy : subgroupShuffle(own.geometry.xy, geometry_lane(is_second) + GEOMETRY_TEXELS);
}

Triangle shared_triangle_of(Fetched own, bool is_second) {
    vec4 record[GEOMETRY_TEXELS];
    for (uint i = 0u; i < GEOMETRY_TEXELS; ++i) {
        record[i] = subgroupShuffle(own.geometry, geometry_lane(is_second) + i);
    }
    return triangle_from(record, shared_tail_of(own, is_second));
}

vec4 shared_shading_texel(Fetched own, bool is_second, int i) {
    if (i < LANES) {
        return subgroupShuffle(own.shading, shading_lane(is_second) + uint(i));
    }
    if (i < 2 * LANES) {
        return subgroupShuffle(own.more, uint(i - LANES));
    }
    return texelFetch(shading, own.record_index * SHADING_STRIDE + i);
}

Corner shared_corner_of(Fetched own, bool is_second) {
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_FEATURES_AT; ++i) {
        record[i] = shared_shading_texel(own, is_second, i);
    }
    return corner_from(record);
}
#else
Fetched fetch_record(int record_index) {
    return Fetched(record_index);
}

void fetch_pair(int first_index, int second_index, bool shaded, out Fetched first, out Fetched second) {
    first = Fetched(first_index);
    second = Fetched(second_index);
}

Triangle shared_triangle_of(Fetched own, bool is_second) {
    return triangle_of(own.record_index);
}

vec4 shared_shading_texel(Fetched own, bool is_second, int i) {
    return texelFetch(shading, own.record_index * SHADING_STRIDE + i);
}

Corner shared_corner_of(Fetched own, bool is_second) {
    return corner_of(own.record_index);
}
#endif

Triangle shared_triangle_of(Fetched own) {
    return shared_triangle_of(own, false);
}

Corner shared_corner_of(Fetched own) {
    return shared_corner_of(own, false);
}
