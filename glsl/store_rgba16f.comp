#version 450
#extension GL_GOOGLE_include_directive : require
// Store into a storage image of format rgba16f: common/store.glsl, the body that the four store kernels share.

#define STORE_FORMAT rgba16f
#define STORE_CHANNELS 4
#include "common/store.glsl"
