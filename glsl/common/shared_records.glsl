// Reading a triangle's records once for all lanes of a workgroup.
// Needs fragment.glsl and corner.glsl with their buffers; with SUBGROUP_RECORDS subgroup shuffles.

// With SUBGROUP_RECORDS each lane of a subgroup of at least eight reads one texel of a record, and shuffles pass the texels
// to all: on a software device a fetch is eight reads even when all lanes fetch the same texel, and a shuffle from a known
// lane is one instruction. Fetching a triangle ahead hides the latency.
struct Fetched {
    // Record index.
    int slot;
#ifdef SUBGROUP_RECORDS
    vec4 geometry;
    vec4 shading;
#endif
};

#ifdef SUBGROUP_RECORDS
Fetched fetch_record(int record_index) {
    Fetched own;
    own.slot = record_index;
    int lane = int(gl_SubgroupInvocationID);
    own.geometry = texelFetch(geometry, record_index * int(GEOMETRY_TEXELS) + min(lane, int(GEOMETRY_TEXELS) - 1));
    if (WANT_SHADING) {
        own.shading = texelFetch(shading, record_index * SHADING_STRIDE + min(lane, SHADING_STRIDE - 1));
    }
    return own;
}

Triangle shared_triangle_of(Fetched own) {
    vec4 record[GEOMETRY_TEXELS];
    for (uint i = 0u; i < GEOMETRY_TEXELS; ++i) {
        record[i] = subgroupShuffle(own.geometry, i);
    }
    return triangle_from(record);
}

Corner shared_corner_of(Fetched own) {
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_STRIDE; ++i) {
        // With textures and normals a record has nine texels; every lane reads the ninth.
        record[i] = i < 8 ? subgroupShuffle(own.shading, uint(i)) : texelFetch(shading, own.slot * SHADING_STRIDE + i);
    }
    return corner_from(record);
}
#else
Fetched fetch_record(int record_index) {
    return Fetched(record_index);
}

Triangle shared_triangle_of(Fetched own) {
    return triangle_of(own.slot);
}

Corner shared_corner_of(Fetched own) {
    return corner_of(own.slot);
}
#endif
