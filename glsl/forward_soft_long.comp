#version 450
#extension GL_GOOGLE_include_directive : require
// Forward, soft and long: forward_soft for the tiles whose lists are nowhere in memory: common/walked_tile.glsl.

#define WALKED
#include "common/forward_soft.glsl"
const bool DRAWS_THIN = false;
#include "common/walked_tile.glsl"
