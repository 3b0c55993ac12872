// The derivative of camera.glsl: from pixels and depth back to view space and to the projection's parameters.

struct View {
    mat3 rotation;
    vec3 translation;
    uint kind;
    // Pixels per projected unit along x and y.
    vec2 scale;
    int at;
};

View view_record(int view) {
    int at = view * int(CAMERA_TEXELS);
    vec4 x = texelFetch(view_cameras, at);
    vec4 y = texelFetch(view_cameras, at + 2);
    vec4 z = texelFetch(view_cameras, at + 4);
    vec4 a = texelFetch(view_cameras, at + 6);
    vec4 b = texelFetch(view_cameras, at + 7);
    // Rows: rotation * p is the transform, p * rotation its transpose.
    mat3 rotation = transpose(mat3(x.xyz, y.xyz, z.xyz));
    return View(rotation, vec3(x.w, y.w, z.w), uint(a.x), vec2(a.z, b.x), at);
}

// The official parity cuts nothing at near, so that a corner on the camera's plane may show. There is no dividing by
// its depth; so near to the plane the projection is as far away as it gets.
float from_plane(float z) {
    return abs(z) < 1e-20 ? 1e-20 : z;
}

vec3 view_point(View v, vec3 p) {
    vec3 q = v.rotation * p + v.translation;
    return v.kind == PROJECTION_SCREEN ? vec3(q.xy * from_plane(q.z), from_plane(q.z)) : q;
}

// dL/d(undistorted x, y) from dL/d(distorted); `distorted` are their values.
vec2 distort_gradient(View v, vec2 q, vec2 by, out vec2 distorted) {
    vec4 k = texelFetch(view_cameras, v.at + 9);
    float k3 = texelFetch(view_cameras, v.at + 10).x;
    float r2 = dot(q, q);
    float radial = 1.0 + r2 * (k.x + r2 * (k.y + r2 * k3));
    float slope = k.x + r2 * (2.0 * k.y + 3.0 * k3 * r2);
    distorted = q * radial + vec2(2.0 * k.z * q.x * q.y + k.w * (r2 + 2.0 * q.x * q.x),
                                  k.z * (r2 + 2.0 * q.y * q.y) + 2.0 * k.w * q.x * q.y);
    vec2 from_radial = by * radial + 2.0 * q * slope * dot(by, q);
    vec2 tangential = vec2(by.x * (2.0 * k.z * q.y + 6.0 * k.w * q.x) + by.y * (2.0 * k.z * q.x + 2.0 * k.w * q.y),
                           by.x * (2.0 * k.z * q.x + 2.0 * k.w * q.y) + by.y * (6.0 * k.z * q.y + 2.0 * k.w * q.x));
    return from_radial + tangential;
}

// As camera.glsl's FARTHEST_PIXEL, to which it holds projected units too.
const float FARTHEST_SHOWN = 1e12;

// dL/d(view-space point), and dL by the four numbers that map projected units to pixels (two scales, two offsets).
vec3 project_gradient(View v, vec3 p, vec2 by_pixel, float by_depth, out vec4 by_projection) {
    vec2 by = by_pixel * v.scale;
    bool flat_projection = v.kind == PROJECTION_ORTHOGRAPHIC;
    float z = flat_projection ? 1.0 : from_plane(p.z + (v.kind == PROJECTION_OFFICIAL ? 1e-5 : 0.0));
    vec2 q = p.xy / z;
    // camera.glsl holds what is farther off where it is.
    bvec2 held = greaterThanEqual(abs(q), vec2(FARTHEST_SHOWN));
    by = vec2(held.x ? 0.0 : by.x, held.y ? 0.0 : by.y);
    q = clamp(q, -FARTHEST_SHOWN, FARTHEST_SHOWN);
    vec2 shown = q;
    if (DISTORTED && v.kind == PROJECTION_OFFICIAL) {
        by = distort_gradient(v, q, by, shown);
    }
    by_projection = vec4(by_pixel * shown, by_pixel);
    return vec3(by / z, by_depth - (flat_projection ? 0.0 : dot(by, q) / z));
}

// dL/d(what the mesh holds) from dL/d(view-space point); `p` is what it holds.
vec3 world_gradient(View v, vec3 p, vec3 by_view) {
    // Screen vertices (x, y, z) stand for the point (x z, y z, z).
    return v.kind == PROJECTION_SCREEN
        ? vec3(by_view.xy * from_plane(p.z), by_view.z + dot(by_view.xy, p.xy))
        : by_view * v.rotation;
}
