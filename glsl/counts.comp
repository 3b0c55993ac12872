#version 450
#extension GL_GOOGLE_include_directive : require
// Counts: how many of its mesh's triangles a view draws, where only the device knows. One invocation a record slot, views
// along y. Reads `counts`, a word a mesh; writes the number, never more than was planned, into `view_shapes`, and
// empties the boxes of the slots that the frame will not write.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 1, std430) buffer ViewShapes { uint view_shapes[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Boxes { ivec4 boxes[]; };

#include "common/constants.glsl"

layout(push_constant) uniform Push {
    // Words from one mesh's count to the next; 0 where all views see one mesh.
    uint stride;
    // What a count is divided by: 3 where it is one of indices.
    uint divisor;
    // Slots of a triangle: 2 where the near plane may cut it.
    uint pieces;
} push;

void main() {
    uint view = gl_WorkGroupID.y;
    uint slot = gl_GlobalInvocationID.x;
    uint at = 4u * SHAPE_TEXELS * view;
    uint slots = view_shapes[at + 8u];
    uint live = min(counts[view * push.stride] / push.divisor, slots / push.pieces);
    if (slot == 0u) {
        view_shapes[at + 3u] = live;
    }
    if (slot >= push.pieces * live && slot < slots) {
        boxes[view_shapes[at + 5u] + slot] = ivec4(0, 0, -1, -1);
    }
}
