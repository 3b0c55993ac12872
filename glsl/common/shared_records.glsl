// Reading a triangle's records once for all lanes of a workgroup.
// Needs fragment.glsl and corner.glsl with their buffers; with SUBGROUP_RECORDS subgroup shuffles.

// With SUBGROUP_RECORDS the workgroup is one subgroup of 4 to 64 lanes. Each lane reads one texel of a record, or two where
// there are only four lanes, and shuffles pass the texels to all: on a software device a fetch costs as many reads as there
// are lanes even when all lanes fetch the same texel, and a shuffle from a known lane is one instruction. Fetching a triangle
// ahead hides the latency.
struct Fetched {
    // Record index.
    int record_index;
#ifdef SUBGROUP_RECORDS
    vec4 geometry;
    vec4 shading;
    // The texels after the first `LANES`.
    vec4 more_geometry;
    vec4 more_shading;
#endif
};

#ifdef SUBGROUP_RECORDS
const int LANES = int(gl_WorkGroupSize.x);
// Whether the lanes are fewer than a record's texels, so that each reads a second one. Of a shading record of nine texels
// eight lanes read the ninth directly.
const bool TWICE = LANES < int(GEOMETRY_TEXELS);

// The shading record is read only where `shaded`.
Fetched fetch_record(int record_index, bool shaded) {
    Fetched own;
    own.record_index = record_index;
    int lane = int(gl_SubgroupInvocationID);
    int at = record_index * int(GEOMETRY_TEXELS);
    own.geometry = texelFetch(geometry, at + min(lane, int(GEOMETRY_TEXELS) - 1));
    if (TWICE) {
        own.more_geometry = texelFetch(geometry, at + min(lane + LANES, int(GEOMETRY_TEXELS) - 1));
    }
    if (shaded) {
        at = record_index * SHADING_STRIDE;
        own.shading = texelFetch(shading, at + min(lane, SHADING_STRIDE - 1));
        if (TWICE && SHADING_STRIDE > LANES) {
            own.more_shading = texelFetch(shading, at + min(lane + LANES, SHADING_STRIDE - 1));
        }
    }
    return own;
}

// Whether the lanes are enough for the shading records of two triangles, so that one fetch reads both: 6 % of the time of
// forward_soft.comp.
const bool SHADING_PAIRED = 2 * SHADING_STRIDE <= LANES;

// The records of two triangles. With SHADING_PAIRED both have the same texels of shading, first those of the first.
void fetch_pair(int first_index, int second_index, bool shaded, out Fetched first, out Fetched second) {
    first = fetch_record(first_index, shaded && !SHADING_PAIRED);
    second = fetch_record(second_index, shaded && !SHADING_PAIRED);
    if (SHADING_PAIRED && shaded) {
        int lane = int(gl_SubgroupInvocationID);
        int record_index = lane < SHADING_STRIDE ? first_index : second_index;
        int texel = min(lane < SHADING_STRIDE ? lane : lane - SHADING_STRIDE, SHADING_STRIDE - 1);
        first.shading = texelFetch(shading, record_index * SHADING_STRIDE + texel);
        second.shading = first.shading;
    }
}

Triangle shared_triangle_of(Fetched own) {
    vec4 record[GEOMETRY_TEXELS];
    for (int i = 0; i < int(GEOMETRY_TEXELS); ++i) {
        record[i] = i < LANES ? subgroupShuffle(own.geometry, uint(i)) : subgroupShuffle(own.more_geometry, uint(i - LANES));
    }
    return triangle_from(record);
}

Corner shared_corner_of(Fetched own) {
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_STRIDE; ++i) {
        if (i < LANES) {
            record[i] = subgroupShuffle(own.shading, uint(i));
        } else if (TWICE && i < 2 * LANES) {
            record[i] = subgroupShuffle(own.more_shading, uint(i - LANES));
        } else {
            record[i] = texelFetch(shading, own.record_index * SHADING_STRIDE + i);
        }
    }
    return corner_from(record);
}

// The same of a triangle that fetch_pair has read, the first or the second.
Corner paired_corner_of(Fetched own, bool is_second) {
    if (!SHADING_PAIRED) {
        return shared_corner_of(own);
    }
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_STRIDE; ++i) {
        record[i] = subgroupShuffle(own.shading, uint(is_second ? i + SHADING_STRIDE : i));
    }
    return corner_from(record);
}
#else
Fetched fetch_record(int record_index, bool shaded) {
    return Fetched(record_index);
}

void fetch_pair(int first_index, int second_index, bool shaded, out Fetched first, out Fetched second) {
    first = Fetched(first_index);
    second = Fetched(second_index);
}

Triangle shared_triangle_of(Fetched own) {
    return triangle_of(own.record_index);
}

Corner shared_corner_of(Fetched own) {
    return corner_of(own.record_index);
}

Corner paired_corner_of(Fetched own, bool is_second) {
    return corner_of(own.record_index);
}
#endif

Fetched fetch_record(int record_index) {
    return fetch_record(record_index, WANT_SHADING);
}
