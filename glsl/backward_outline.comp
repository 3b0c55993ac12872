#version 450
#extension GL_GOOGLE_include_directive : require
// Backward for items that contribute to the silhouette only, on any Vulkan 1.1 device: common/backward.glsl.

#define OUTLINE
#include "common/backward.glsl"
