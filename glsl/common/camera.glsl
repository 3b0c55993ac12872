// From world space to view space to pixels, in double floats. project_gradient.glsl has the derivatives.
// Needs constants.glsl, modes.glsl, df64.glsl and the buffer `view_cameras`.

// A point in view space, each coordinate a double float.
struct ViewPoint {
    vec2 x;
    vec2 y;
    vec2 z;
};

// A vertex this many pixels away is far outside any image. The bound keeps products finite.
const float FARTHEST_PIXEL = 1e12;

// One row of the view transform times (p, 1). The row's high and low parts lie in two texels.
vec2 view_row(int at, vec3 p) {
    vec4 high = texelFetch(view_cameras, at);
    vec4 low = texelFetch(view_cameras, at + 1);
    vec2 sum = df_add(df_mul(vec2(high.x, low.x), p.x), df_mul(vec2(high.y, low.y), p.y));
    return df_add(df_add(sum, df_mul(vec2(high.z, low.z), p.z)), vec2(high.w, low.w));
}

// A mesh's position in view space. PROJECTION_SCREEN's (x, y, z) stands for the point (x z, y z, z).
ViewPoint to_view(int view, vec3 p) {
    int at = view * int(CAMERA_TEXELS);
    ViewPoint v = ViewPoint(view_row(at, p), view_row(at + 2, p), view_row(at + 4, p));
    if (uint(texelFetch(view_cameras, at + 6).x) == PROJECTION_SCREEN) {
        v.x = df_mul(v.x, v.z);
        v.y = df_mul(v.y, v.z);
    }
    return v;
}

// Radial and tangential distortion of the official renderer's `projection`.
void distort(int at, inout vec2 x, inout vec2 y) {
    vec4 k = texelFetch(view_cameras, at + 9);
    float k3 = texelFetch(view_cameras, at + 10).x;
    vec2 xx = df_mul(x, x);
    vec2 yy = df_mul(y, y);
    vec2 xy = df_mul(x, y);
    vec2 r2 = df_add(xx, yy);
    vec2 radial = df_add(df_mul(df_add(df_mul(df_add(df_mul(r2, k3), vec2(k.y, 0.0)), r2), vec2(k.x, 0.0)), r2),
                         vec2(1.0, 0.0));
    vec2 dx = df_add(df_mul(xy, 2.0 * k.z), df_mul(df_add(r2, df_mul(xx, 2.0)), k.w));
    vec2 dy = df_add(df_mul(df_add(r2, df_mul(yy, 2.0)), k.z), df_mul(xy, 2.0 * k.w));
    x = df_add(df_mul(x, radial), dx);
    y = df_add(df_mul(y, radial), dy);
}

// Whether a view is orthographic.
bool has_parallel_rays(int view) {
    return PARALLEL && uint(texelFetch(view_cameras, view * int(CAMERA_TEXELS) + 6).x) == PROJECTION_ORTHOGRAPHIC;
}

// A double float clamped to ±FARTHEST_PIXEL.
vec2 bounded(vec2 a) {
    return abs(a.x) < FARTHEST_PIXEL ? a : vec2(clamp(a.x, -FARTHEST_PIXEL, FARTHEST_PIXEL), 0.0);
}

// Pixel coordinates (column, row), each a double float. The centre of pixel (r, c) is at (c, r).
void to_pixels(int view, ViewPoint v, out vec2 column, out vec2 row) {
    int at = view * int(CAMERA_TEXELS);
    vec4 a = texelFetch(view_cameras, at + 6);
    vec4 b = texelFetch(view_cameras, at + 7);
    vec4 c = texelFetch(view_cameras, at + 8);
    uint kind = uint(a.x);
    vec2 x = v.x;
    vec2 y = v.y;
    if (kind != PROJECTION_ORTHOGRAPHIC) {
        vec2 z = df_add(v.z, vec2(kind == PROJECTION_OFFICIAL ? 1e-5 : 0.0, 0.0));
        z.x = z.x == 0.0 ? 1e-30 : z.x;
        x = bounded(df_div(x, z));
        y = bounded(df_div(y, z));
    }
    if (DISTORTED && kind == PROJECTION_OFFICIAL) {
        distort(at, x, y);
    }
    column = bounded(df_add(df_mul(a.zw, x), b.zw));
    row = bounded(df_add(df_mul(b.xy, y), c.xy));
}
