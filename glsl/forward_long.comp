#version 450
#extension GL_GOOGLE_include_directive : require
// Forward, long: forward for the tiles whose lists are nowhere in memory: common/walked_tile.glsl. In frames of the soft model
// it draws those with a thin triangle.

#define WALKED
#include "common/forward.glsl"
const bool DRAWS_THIN = true;
#include "common/walked_tile.glsl"
