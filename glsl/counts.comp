#version 450
#extension GL_GOOGLE_include_directive : require
// Counts: takes the number of triangles that a view draws from a count on the device, at most the planned number.
// One invocation a record, views along y. Reads `counts`, one word a mesh. Writes the number into `view_shapes`, and empties
// the boxes of the records that the frame will not write.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(set = 0, binding = 1, std430) buffer ViewShapes { uint view_shapes[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Boxes { ivec4 boxes[]; };

#include "common/constants.glsl"

layout(push_constant) uniform Push {
    // Words from one mesh's count to the next. 0 if all views see one mesh.
    uint stride;
    // Divisor of a count: 3 when it counts indices, 1 when it counts triangles.
    uint divisor;
    // Records of a triangle: 2 when the near plane may cut it.
    uint pieces;
} push;

void main() {
    uint view = gl_WorkGroupID.y;
    uint record = gl_GlobalInvocationID.x;
    // Words 3, 5 and 8 of a view's entry are triangle_count, record_base and record_count (mesh.glsl).
    uint at = 4u * SHAPE_TEXELS * view;
    uint records = view_shapes[at + 8u];
    uint live = min(counts[view * push.stride] / push.divisor, records / push.pieces);
    if (record == 0u) {
        view_shapes[at + 3u] = live;
    }
    if (record >= push.pieces * live && record < records) {
        boxes[view_shapes[at + 5u] + record] = ivec4(0, 0, -1, -1);
    }
}
