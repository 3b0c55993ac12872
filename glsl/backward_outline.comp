#version 450
#extension GL_GOOGLE_include_directive : require
// Backward of items that show in the silhouette alone, on any Vulkan 1.1 device.

#define OUTLINE
#include "common/backward.glsl"
