#version 450
#extension GL_GOOGLE_include_directive : require
// Background: writes the pixels of tiles without entries as forward would: A = 0 (eq. 5) and I = C_b (eq. 2 with w_b = 1).
// One workgroup a tile of the row of `tile_items` that begins at frame.first, one invocation a pixel.
// Reads `tile_items`. Writes the images and, for backward, `saved`.

layout(local_size_x = 32) in;

layout(set = 0, binding = 0) uniform usamplerBuffer tile_items;
layout(set = 0, binding = 1, std430) writeonly buffer Color { vec4 color[]; };
layout(set = 0, binding = 2, std430) writeonly buffer Silhouette { float silhouette[]; };
layout(set = 0, binding = 3, std430) writeonly buffer Depths { float depths[]; };
layout(set = 0, binding = 4, std430) writeonly buffer Normals { vec4 normals[]; };
layout(set = 0, binding = 5, std430) writeonly buffer Saved { vec4 saved[]; };
layout(set = 0, binding = 6, std430) writeonly buffer FeatureImage { vec4 feature_image[]; };

#include "common/constants.glsl"
#include "common/modes.glsl"
#include "common/frame.glsl"
#include "common/pixel.glsl"
#include "common/arithmetic.glsl"
#include "common/tile.glsl"
#include "common/images.glsl"

void main() {
    int number = int(texelFetch(tile_items, int(frame.first + gl_WorkGroupID.x)).x);
    TileLocation tile = tile_location(number);
    int lane = int(gl_LocalInvocationID.x);
    ivec2 pixel = tile.corner + ivec2(lane % int(TILE_WIDTH), lane / int(TILE_WIDTH));
    if (pixel.x < int(frame.width) && pixel.y < int(frame.height)) {
        Pixel p = background_pixel();
        int at = pixel_index(tile.view, pixel);
        write_images(p, at, 1);
        for (int i = 0; i < FEATURES; ++i) {
            feature_image[at * FEATURE_ROOM + i] = vec4(0.0);
        }
        if (SAVE) {
            saved[at] = saved_of(p);
        }
    }
}
