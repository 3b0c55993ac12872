#version 450
#extension GL_GOOGLE_include_directive : require
// Reduce: sums rows in a fixed order. REDUCTION selects the rows: `view_sums` over each view's triangles, `light_records` for
// each light, or `pixel_sums` over all pixels.
// One workgroup a sum, along x: a view, a light (the ambient light first), or one. Lane l sums every 128th row from l on. Then
// the lanes' sums are added pairwise. Reads `rows`, the table to sum, and `lights`. Writes three texels of `totals` a sum.

layout(local_size_x = 128) in;

layout(set = 0, binding = 0) uniform usamplerBuffer view_shapes;
layout(set = 0, binding = 1) uniform samplerBuffer lights;
layout(set = 0, binding = 2) uniform samplerBuffer rows;
layout(set = 0, binding = 3, std430) writeonly buffer Totals { vec4 totals[]; };

layout(constant_id = 30) const uint REDUCTION = 0;

#include "common/constants.glsl"
#include "common/frame.glsl"
#include "common/mesh.glsl"

// As many lanes as every device allows. Mesa 22.3 ends a loop after 65535 passes, so they sum at most 8 million rows.
const int LANES = 128;

shared vec4 lane_sums[3 * LANES];

// One row of dL by a light's direction and colour (light_on in light.glsl). Light 0 is the ambient light. It has no direction.
void light_row(int row, int light, out vec4 by_direction, out vec4 by_color) {
    vec3 by_light = texelFetch(rows, 2 * row).rgb;
    vec3 normal = texelFetch(rows, 2 * row + 1).xyz;
    vec3 direction = texelFetch(lights, light == 0 ? 0 : 2 * light - 1).xyz;
    vec3 color = texelFetch(lights, light == 0 ? 0 : 2 * light).rgb;
    float cosine = dot(normal, direction);
    by_direction = light == 0 ? vec4(0.0) : vec4(cosine > 0.0 ? normal * dot(color, by_light) : vec3(0.0), 0.0);
    by_color = vec4(light == 0 ? by_light : by_light * max(cosine, 0.0), 0.0);
}

void main() {
    int group = int(gl_WorkGroupID.x);
    int lane = int(gl_LocalInvocationID.x);
    int first = 0;
    int count = int(frame.number);
    if (REDUCTION == REDUCTION_VIEWS) {
        Shape shape = shape_of(group);
        first = shape.record_base;
        count = shape.triangle_count;
    }
    vec4 a = vec4(0.0);
    vec4 b = vec4(0.0);
    vec4 c = vec4(0.0);
    for (int i = lane; i < count; i += LANES) {
        int row = first + i;
        if (REDUCTION == REDUCTION_LIGHTS) {
            vec4 by_direction;
            vec4 by_color;
            light_row(row, group, by_direction, by_color);
            a += by_direction;
            b += by_color;
        } else if (REDUCTION == REDUCTION_PIXELS) {
            a += texelFetch(rows, 2 * row);
            b += texelFetch(rows, 2 * row + 1);
        } else {
            a += texelFetch(rows, 3 * row);
            b += texelFetch(rows, 3 * row + 1);
            c += texelFetch(rows, 3 * row + 2);
        }
    }
    lane_sums[3 * lane] = a;
    lane_sums[3 * lane + 1] = b;
    lane_sums[3 * lane + 2] = c;
    for (int width = LANES / 2; width > 0; width /= 2) {
        barrier();
        if (lane < width) {
            for (int k = 0; k < 3; ++k) {
                lane_sums[3 * lane + k] += lane_sums[3 * (lane + width) + k];
            }
        }
    }
    if (lane == 0) {
        for (int k = 0; k < 3; ++k) {
            totals[3 * (group + int(frame.first)) + k] = lane_sums[k];
        }
    }
}
