#version 450
#extension GL_GOOGLE_include_directive : require
// Background: the pixels of tiles without a list, as forward would leave them.
// One workgroup a tile of `tile_items` that is to be given the background, one invocation a pixel; writes the images and
// `saved`.

layout(local_size_x = 32) in;

layout(set = 0, binding = 0) uniform usamplerBuffer tile_items;
layout(set = 0, binding = 1, std430) writeonly buffer Color { vec4 color[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Silhouette { float silhouette[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Depths { float depths[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 5, std430) writeonly buffer Saved { vec4 saved[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/pixel.glsl"
#include "common/images.glsl"

void main() {
    int place = int(texelFetch(tile_items, int(frame.first + gl_WorkGroupID.x)).x);
    TilePlace tile = tile_place(place);
    int lane = int(gl_LocalInvocationID.x);
    ivec2 where = tile.corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
    if (where.x < int(frame.width) && where.y < int(frame.height)) {
        Pixel p = background_pixel();
        int at = place_of(tile.view, where);
        write_images(p, at, 1);
        if (SAVE) {
            saved[at] = kept_of(p);
        }
    }
}
