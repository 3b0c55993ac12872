#version 450
#extension GL_GOOGLE_include_directive : require
// Store into a storage image of r32f: common/store.glsl.

#define STORE_FORMAT r32f
#define STORE_CHANNELS 1
#include "common/store.glsl"
