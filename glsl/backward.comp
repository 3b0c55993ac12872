#version 450
#extension GL_GOOGLE_include_directive : require
// Backward on any Vulkan 1.1 device: common/backward.glsl.

#include "common/backward.glsl"
