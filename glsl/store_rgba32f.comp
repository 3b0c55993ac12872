#version 450
#extension GL_GOOGLE_include_directive : require
// Store into a storage image of rgba32f: common/store.glsl.

#define STORE_FORMAT rgba32f
#define STORE_CHANNELS 4
#include "common/store.glsl"
