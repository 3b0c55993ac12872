#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_shuffle : require
// Forward of the soft model where a workgroup of eight is one subgroup and the device has shuffles: common/forward_soft.glsl.

#define SUBGROUP_RECORDS
#include "common/forward_soft.glsl"
#include "common/listed_tile.glsl"
