#version 450
#extension GL_GOOGLE_include_directive : require
// Forward on any Vulkan 1.1 device: common/forward.glsl.

#include "common/forward.glsl"
#include "common/listed_tile.glsl"
