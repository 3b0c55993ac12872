// A record that all lanes of a workgroup want.

// With SUBGROUP_RECORDS each lane of a subgroup of at least eight reads one texel of a record and all pass them round: on
// a software device a fetch is eight reads even where all lanes want the same texel, and a shuffle from a known lane one
// instruction. What is fetched a triangle ahead is there when it is wanted.
struct Fetched {
    int slot;
#ifdef SUBGROUP_RECORDS
    vec4 geometry;
    vec4 shading;
#endif
};

#ifdef SUBGROUP_RECORDS
Fetched fetch_record(int slot) {
    Fetched own;
    own.slot = slot;
    int lane = int(gl_SubgroupInvocationID);
    own.geometry = texelFetch(geometry, slot * int(GEOMETRY_TEXELS) + min(lane, int(GEOMETRY_TEXELS) - 1));
    if (WANT_SHADING) {
        own.shading = texelFetch(shading, slot * SHADING_STRIDE + min(lane, SHADING_STRIDE - 1));
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
        // Textures and normals together make a record of nine texels: the ninth is read by all.
        record[i] = i < 8 ? subgroupShuffle(own.shading, uint(i)) : texelFetch(shading, own.slot * SHADING_STRIDE + i);
    }
    return corner_from(record);
}
#else
Fetched fetch_record(int slot) {
    return Fetched(slot);
}

Triangle shared_triangle_of(Fetched own) {
    return triangle_of(own.slot);
}

Corner shared_corner_of(Fetched own) {
    return corner_of(own.slot);
}
#endif
