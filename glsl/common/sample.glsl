// Texture lookup: the colour c and the opacity α of a fragment, and their derivatives by the texture coordinates. An entry of
// `textures` is (first texel, width, height, kind). A surface's entry is (first texel, resolution, texels of all triangles,
// kind).
// Needs constants.glsl, modes.glsl and the buffers `textures` and `texels`.

// The cell of barycentrics b on a surface of resolution R. The official code numbers the R² cells so: a lower and an upper
// triangle of cells. It tests for the lower half by R b0 - x + R b1 - y <= 1. Here the test uses b2, which is exactly 0 beyond
// the edge opposite corner 2, where rounding disturbs that sum.
int surface_cell(vec3 b, int resolution) {
    vec3 scaled = b * float(resolution);
    ivec2 cell = ivec2(floor(scaled.xy));
    if (OFFICIAL && max(cell.x, cell.y) == resolution) {
        // The official lookup of a corner overruns its row into the first cell of the next row or triangle.
        return cell.y * resolution + cell.x;
    }
    cell = clamp(cell, ivec2(0), ivec2(resolution - 1));
    bool lower = scaled.z >= float(resolution - 1 - cell.x - cell.y);
    ivec2 c = lower ? cell : ivec2(resolution - 1) - cell;
    return c.y * resolution + c.x;
}

// The barycentrics in the original triangle, from those in a clipped piece. `coordinate` has the first two barycentrics of the
// piece's corners.
vec3 surface_barycentrics(mat3x2 coordinate, vec3 b) {
    vec3 third = vec3(1.0) - vec3(coordinate[0].x, coordinate[1].x, coordinate[2].x)
               - vec3(coordinate[0].y, coordinate[1].y, coordinate[2].y);
    // The lower bound of clipped_barycentrics stands for 0.
    vec3 exact = vec3(greaterThan(b, vec3(1e-19))) * b;
    return vec3(coordinate * exact, dot(max(third, vec3(0.0)), exact));
}

// Texel coordinates, repeated or clamped into the image.
ivec2 wrapped(ivec2 texel, ivec2 size, bool repeat) {
    ivec2 clamped = clamp(texel, ivec2(0), size - 1);
    ivec2 repeated = texel - size * ivec2(floor(vec2(texel) / vec2(size)));
    // The quotient's rounding can leave a repeated texel one period off.
    repeated += size * ivec2(lessThan(repeated, ivec2(0)));
    repeated -= size * ivec2(greaterThanEqual(repeated, size));
    return repeat ? repeated : clamped;
}

// The four texels around a point and their bilinear weights.
struct Footprint {
    ivec4 texel;
    vec4 weight;
};

// The footprint of texture coordinates uv, with v upwards. Texel centres lie at half-integers.
Footprint footprint_of(uvec4 entry, vec2 uv) {
    ivec2 size = ivec2(entry.yz);
    bool repeat = entry.w == TEXTURE_REPEAT;
    // Whole periods are dropped first, so that large UVs keep the precision of their fraction.
    vec2 folded = repeat ? uv - floor(uv) : uv;
    vec2 at = vec2(folded.x, 1.0 - folded.y) * vec2(size) - 0.5;
    at = clamp(at, vec2(-2.0), vec2(size) + 1.0);
    vec2 low = floor(at);
    vec2 t = at - low;
    ivec2 a = wrapped(ivec2(low), size, repeat);
    ivec2 b = wrapped(ivec2(low) + 1, size, repeat);
    int base = int(entry.x);
    ivec4 texel = base + ivec4(a.y * size.x + a.x, a.y * size.x + b.x, b.y * size.x + a.x, b.y * size.x + b.x);
    return Footprint(texel, vec4((1.0 - t.x) * (1.0 - t.y), t.x * (1.0 - t.y), (1.0 - t.x) * t.y, t.x * t.y));
}

// The texture's colour at a fragment. `coordinate` has the corners' texture coordinates, and `b` is b̂.
vec3 sample_texture(int index, int triangle, mat3x2 coordinate, vec3 b) {
    uvec4 entry = texelFetch(textures, index);
    vec3 color = vec3(1.0);
    if ((SAMPLING & SAMPLING_IMAGE) != 0u && entry.w != TEXTURE_SURFACE) {
        Footprint f = footprint_of(entry, coordinate * b);
        color = texelFetch(texels, f.texel.x).rgb * f.weight.x + texelFetch(texels, f.texel.y).rgb * f.weight.y
              + texelFetch(texels, f.texel.z).rgb * f.weight.z + texelFetch(texels, f.texel.w).rgb * f.weight.w;
    }
    if ((SAMPLING & SAMPLING_SURFACE) != 0u && entry.w == TEXTURE_SURFACE) {
        int resolution = int(entry.y);
        int cell = surface_cell(surface_barycentrics(coordinate, b), resolution);
        int texel = triangle * resolution * resolution + cell;
        int last = int(entry.z) - 1;
        color = texelFetch(texels, int(entry.x) + min(texel, last)).rgb;
        // Past the last triangle's cells the official lookup returns black.
        color = texel > last ? vec3(0.0) : color;
    }
    return color;
}

// An image's r, g, b and α between the four texels of a footprint, with the derivatives by u and v in `slope`.
vec4 image_with_slope(uvec4 entry, vec2 coordinate, out mat2x4 slope) {
    Footprint f = footprint_of(entry, coordinate);
    vec4 t0 = texelFetch(texels, f.texel.x);
    vec4 t1 = texelFetch(texels, f.texel.y);
    vec4 t2 = texelFetch(texels, f.texel.z);
    vec4 t3 = texelFetch(texels, f.texel.w);
    float tx = f.weight.y + f.weight.w;
    float ty = f.weight.z + f.weight.w;
    slope[0] = float(entry.y) * ((1.0 - ty) * (t1 - t0) + ty * (t3 - t2));
    slope[1] = -float(entry.z) * ((1.0 - tx) * (t2 - t0) + tx * (t3 - t1));
    return t0 * f.weight.x + t1 * f.weight.y + t2 * f.weight.z + t3 * f.weight.w;
}

// A smaller opacity counts as 0, so that no weight is a denormal number.
const float LEAST_OPACITY = 1e-30;

// The texture's opacity α at a fragment, with the derivatives by u and v in `slope`. Surface cells are opaque.
float sample_opacity(int index, mat3x2 coordinate, vec3 b, out vec2 slope) {
    slope = vec2(0.0);
    uvec4 entry = texelFetch(textures, index);
    if (entry.w == TEXTURE_SURFACE) {
        return 1.0;
    }
    mat2x4 slopes;
    // The weights' sum may exceed 1 by rounding.
    float alpha = min(image_with_slope(entry, coordinate * b, slopes).a, 1.0);
    slope = vec2(slopes[0].a, slopes[1].a);
    return alpha < LEAST_OPACITY ? 0.0 : alpha;
}

// sample_texture with the derivatives by u and v in `slope`, which are 0 for a surface's cells.
vec3 sample_with_slope(int index, int triangle, mat3x2 coordinate, vec3 b, out mat2x3 slope) {
    slope = mat2x3(0.0);
    uvec4 entry = texelFetch(textures, index);
    if ((SAMPLING & SAMPLING_IMAGE) == 0u || entry.w == TEXTURE_SURFACE) {
        return sample_texture(index, triangle, coordinate, b);
    }
    mat2x4 slopes;
    vec3 color = image_with_slope(entry, coordinate * b, slopes).rgb;
    slope = mat2x3(slopes);
    return color;
}
