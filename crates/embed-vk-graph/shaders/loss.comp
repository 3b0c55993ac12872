// The mean over all pixels of the squared difference of colour and silhouette from the goal, and its gradient.
// One invocation for each pixel; each workgroup writes the sum of its pixels.
#version 450
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer Image { vec4 image[]; };
layout(binding = 1) readonly buffer Goal { vec4 goal[]; };
layout(binding = 2) writeonly buffer Upstream { vec4 upstream[]; };
layout(binding = 3) writeonly buffer Losses { float losses[]; };
layout(push_constant) uniform Push { uint pixels; };

shared float sums[64];

void main() {
    uint pixel = gl_GlobalInvocationID.x, lane = gl_LocalInvocationID.x;
    sums[lane] = 0.0;
    if (pixel < pixels) {
        vec4 difference = image[pixel] - goal[pixel];
        upstream[pixel] = 2.0 / float(pixels) * difference;
        sums[lane] = dot(difference, difference) / float(pixels);
    }
    barrier();
    for (uint half_of = 32; half_of > 0; half_of /= 2) {
        if (lane < half_of) {
            sums[lane] += sums[lane + half_of];
        }
        barrier();
    }
    if (lane == 0) {
        losses[gl_WorkGroupID.x] = sums[0];
    }
}
