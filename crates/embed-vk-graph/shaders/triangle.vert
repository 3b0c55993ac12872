// The engine's own geometry: one triangle that cuts through the mesh.
#version 450
layout(push_constant) uniform Push { mat4 world_to_clip; };

const vec3 CORNERS[3] = vec3[](vec3(-0.1, -0.75, -0.9), vec3(0.1, -0.75, 0.9), vec3(0.0, 0.85, 0.0));

void main() {
    gl_Position = world_to_clip * vec4(CORNERS[gl_VertexIndex], 1.0);
}
