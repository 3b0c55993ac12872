#version 450
#extension GL_GOOGLE_include_directive : require
// Forward of the soft model on any Vulkan 1.1 device: common/forward_soft.glsl.

#include "common/forward_soft.glsl"
#include "common/listed_tile.glsl"
