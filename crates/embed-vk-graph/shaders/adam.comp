// Adam on positions and colours, with a pull of each position towards the mean of its neighbours.
// One invocation for each vertex: x, y, z, r, g, b. The result goes into another buffer, since neighbours are read.
#version 450
layout(local_size_x = 64) in;
layout(binding = 0) readonly buffer Vertices { float vertices[]; };
layout(binding = 1) readonly buffer Gradients { float gradients[]; };
layout(binding = 2) buffer Moments { vec2 moments[]; };
// Where each vertex's neighbours begin and end, then the neighbours of all.
layout(binding = 3) readonly buffer Neighbours { uint neighbours[]; };
layout(binding = 4) writeonly buffer Moved { float moved[]; };
// softras' status: 1 in `whole_word` where the frame had room for its lists and its gradients hold.
layout(binding = 5) readonly buffer Status { uint status[]; };
layout(push_constant) uniform Push {
    uint count;
    uint step;
    float smoothness;
    float rate_position;
    float rate_color;
    uint whole_word;
};

void main() {
    uint vertex = gl_GlobalInvocationID.x;
    if (vertex >= count) {
        return;
    }
    bool is_whole = status[whole_word] == 1;
    uint first = neighbours[vertex], end = neighbours[vertex + 1];
    for (uint axis = 0; axis < 6; axis++) {
        uint i = 6 * vertex + axis;
        float value = vertices[i], gradient = gradients[i];
        if (!is_whole) {
            moved[i] = value;
            continue;
        }
        if (axis < 3) {
            float sum = 0.0;
            for (uint k = first; k < end; k++) {
                sum += vertices[6 * neighbours[k] + axis];
            }
            gradient += smoothness * (value - sum / float(max(end - first, 1)));
        }
        vec2 moment = mix(vec2(gradient, gradient * gradient), moments[i], vec2(0.9, 0.99));
        moments[i] = moment;
        vec2 mean = moment / (1.0 - pow(vec2(0.9, 0.99), vec2(step)));
        float rate = axis < 3 ? rate_position : rate_color;
        value -= rate * mean.x / (sqrt(mean.y) + 1e-10);
        moved[i] = axis < 3 ? value : clamp(value, 0.0, 1.0);
    }
}
