// The derivatives of camera.glsl: from pixels and depth back to view space, to the mesh's positions and to the projection's
// parameters. `by_X` is the derivative of the loss by X.
// Needs constants.glsl, modes.glsl and the buffer `view_cameras`.

// A view's entry of `view_cameras`, in single precision.
struct View {
    mat3 rotation;
    vec3 translation;
    // PROJECTION_ kind.
    uint kind;
    // Pixels per projected unit along x and y.
    vec2 scale;
    // First texel of the entry.
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

// A depth to divide by. Official parity does not clip at the near plane, so a visible triangle may have a corner on the
// camera's plane. So close to the plane the projection is clamped anyway.
float from_plane(float z) {
    return abs(z) < 1e-20 ? 1e-20 : z;
}

// to_view in single precision.
vec3 view_point(View v, vec3 p) {
    vec3 q = v.rotation * p + v.translation;
    return v.kind == PROJECTION_SCREEN ? vec3(q.xy * from_plane(q.z), from_plane(q.z)) : q;
}

// The derivative of `distort` by the undistorted x and y. `by` is dL by the distorted ones. It returns their values too.
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

// FARTHEST_PIXEL of camera.glsl, which clamps projected units to it too.
const float FARTHEST_SHOWN = 1e12;

// The derivative of to_pixels: dL/d(view-space point), and dL by the four numbers that map projected units to pixels (two
// scales, two offsets).
vec3 project_gradient(View v, vec3 p, vec2 by_pixel, float by_depth, out vec4 by_projection) {
    vec2 by = by_pixel * v.scale;
    bool flat_projection = v.kind == PROJECTION_ORTHOGRAPHIC;
    float z = flat_projection ? 1.0 : from_plane(p.z + (v.kind == PROJECTION_OFFICIAL ? 1e-5 : 0.0));
    vec2 q = p.xy / z;
    // A clamped projection has derivative 0.
    bvec2 clamped = greaterThanEqual(abs(q), vec2(FARTHEST_SHOWN));
    by = vec2(clamped.x ? 0.0 : by.x, clamped.y ? 0.0 : by.y);
    q = clamp(q, -FARTHEST_SHOWN, FARTHEST_SHOWN);
    vec2 distorted = q;
    if (DISTORTED && v.kind == PROJECTION_OFFICIAL) {
        by = distort_gradient(v, q, by, distorted);
    }
    by_projection = vec4(by_pixel * distorted, by_pixel);
    return vec3(by / z, by_depth - (flat_projection ? 0.0 : dot(by, q) / z));
}

// The derivative of view_point: dL/d(position in the mesh) from dL/d(view-space point). `p` is the position in the mesh.
vec3 world_gradient(View v, vec3 p, vec3 by_view) {
    // Screen vertices (x, y, z) stand for the point (x z, y z, z).
    return v.kind == PROJECTION_SCREEN
        ? vec3(by_view.xy * from_plane(p.z), by_view.z + dot(by_view.xy, p.xy))
        : by_view * v.rotation;
}
