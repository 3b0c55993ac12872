#version 450
#extension GL_GOOGLE_include_directive : require
// Store into a storage image of rgba8: common/store.glsl.

#define STORE_FORMAT rgba8
#define STORE_CHANNELS 4
#include "common/store.glsl"
