#version 450
#extension GL_GOOGLE_include_directive : require
// Image upstream: the derivative of the image losses (`slope` in loss.glsl) by every rendered value, through each resolution
// that the image is averaged to.
// One invocation a rendered pixel: columns along x, rows along y and views along z, since dividing integers is slow.
// Reads the rendered image, `pyramid`, targets, mask and `loss_sums`; writes `upstream_color` or `upstream_silhouette`.

layout(local_size_x = 64) in;

layout(set = 0, binding = 0) uniform samplerBuffer rendered;
layout(set = 0, binding = 1) uniform samplerBuffer pyramid;
layout(set = 0, binding = 2) uniform samplerBuffer loss_targets;
layout(set = 0, binding = 3) uniform samplerBuffer loss_weights;
layout(set = 0, binding = 4) uniform samplerBuffer loss_sums;
layout(set = 0, binding = 5) uniform samplerBuffer loss_scales;
layout(set = 0, binding = 6, std430) writeonly buffer Upstream { float upstream[]; };

#include "common/constants.glsl"
#include "common/fit.glsl"
#include "common/loss.glsl"

// The only level is the rendered image itself.
layout(constant_id = 4) const bool PLAIN = false;

layout(push_constant) uniform Push {
    uint width;
    uint height;
    uint views;
    // Rendered pixels per pixel of the target along each axis.
    uint samples;
    uint levels;
    float silhouette_delta;
    float color_delta;
} push;

void main() {
    uint width = push.width;
    uint height = push.height;
    uint views = push.views;
    uint column = gl_GlobalInvocationID.x;
    uint row = gl_WorkGroupID.y;
    uint view = gl_WorkGroupID.z;
    if (column >= width) {
        return;
    }
    uint i = (view * height + row) * width + column;
    uint factor = push.samples;
    uint pyramid_first = 0u;
    uint target_first = 0u;
    // ∂(a pixel of this level)/∂(the rendered pixel).
    precise float share = 1.0;
    precise vec4 sum = vec4(0.0);
    for (uint level = 0u; level < push.levels; ++level) {
        uint coarse_row = PLAIN ? row : row / factor;
        uint coarse_column = PLAIN ? column : column / factor;
        uint rows = min(factor, height - coarse_row * factor);
        uint columns = min(factor, width - coarse_column * factor);
        share = share * (1.0 / float(rows * columns));
        row = coarse_row;
        column = coarse_column;
        width = PLAIN ? width : (width + factor - 1u) / factor;
        height = PLAIN ? height : (height + factor - 1u) / factor;
        uint at = (view * height + row) * width + column;
        bool is_rendered = factor == 1u;
        int from = int(is_rendered ? at : pyramid_first + at);
        vec4 p = channels(is_rendered ? texelFetch(rendered, from) : texelFetch(pyramid, from));
        vec4 t = channels(texelFetch(loss_targets, int(target_first + at)));
        float weight = FIT_MASKED ? texelFetch(loss_weights, int(target_first + at)).x : 1.0;
        vec4 sums = texelFetch(loss_sums, int(level * views + view));
        vec4 scales = texelFetch(loss_scales, int(level));
        precise float scaled = weight * scales.z;
        sum.w = sum.w + share * slope(SILHOUETTE_LOSS, p.w, t.w, sums.xy, scaled, push.silhouette_delta);
        if (COLOR_LOSS != LOSS_NONE) {
            scaled = weight * scales.w;
            sum.x = sum.x + share * slope(COLOR_LOSS, p.x, t.x, sums.zw, scaled, push.color_delta);
            sum.y = sum.y + share * slope(COLOR_LOSS, p.y, t.y, sums.zw, scaled, push.color_delta);
            sum.z = sum.z + share * slope(COLOR_LOSS, p.z, t.z, sums.zw, scaled, push.color_delta);
        }
        pyramid_first += is_rendered ? 0u : width * height * views;
        target_first += width * height * views;
        factor = 2u;
    }
    if (FIT_COLOR) {
        upstream[4u * i] = sum.x;
        upstream[4u * i + 1u] = sum.y;
        upstream[4u * i + 2u] = sum.z;
        upstream[4u * i + 3u] = sum.w;
    } else {
        upstream[i] = sum.w;
    }
}
