// A record that all lanes of a workgroup want.

// With SUBGROUP_RECORDS each lane of a subgroup of at least eight reads one texel of a record and all pass them round: on
// a software device a fetch is eight reads even where all lanes want the same texel, and a shuffle from a known lane one
// instruction.
#ifdef SUBGROUP_RECORDS
Triangle shared_triangle_of(int slot) {
    int mine = min(int(gl_SubgroupInvocationID), int(GEOMETRY_TEXELS) - 1);
    vec4 own = texelFetch(geometry, slot * int(GEOMETRY_TEXELS) + mine);
    vec4 record[GEOMETRY_TEXELS];
    for (uint i = 0u; i < GEOMETRY_TEXELS; ++i) {
        record[i] = subgroupShuffle(own, i);
    }
    return triangle_from(record);
}

Corner shared_corner_of(int slot) {
    // Textures and normals together make a record of nine texels: the ninth is read by all.
    int mine = min(int(gl_SubgroupInvocationID), SHADING_STRIDE - 1);
    vec4 own = texelFetch(shading, slot * SHADING_STRIDE + mine);
    vec4 record[SHADING_MOST];
    for (int i = 0; i < SHADING_STRIDE; ++i) {
        record[i] = i < 8 ? subgroupShuffle(own, uint(i)) : texelFetch(shading, slot * SHADING_STRIDE + i);
    }
    return corner_from(record);
}
#else
Triangle shared_triangle_of(int slot) {
    return triangle_of(slot);
}

Corner shared_corner_of(int slot) {
    return corner_of(slot);
}
#endif
