#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
// Backward of items that show in the silhouette alone, where a workgroup of eight is one subgroup and the device can shuffle.

#define SUBGROUP_RECORDS
#define OUTLINE
#include "common/backward.glsl"
