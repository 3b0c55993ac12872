// One (pixel, triangle) pair: distance, probability, barycentrics and depth, as steps 1 to 4 of the image model.

// A triangle's record, in registers. See edge.glsl for the lines and triangle.comp for the depth.
struct Triangle {
    vec2 origin;
    vec4 line0;
    vec4 line1;
    vec4 line2;
    vec3 half_length;
    vec3 inverse_height;
};

Triangle triangle_from(vec4 record[GEOMETRY_TEXELS]) {
    vec4 head = record[0];
    vec4 tail = record[4];
    return Triangle(head.xy, record[1], record[2], record[3], vec3(head.zw, tail.x), tail.yzw);
}

Triangle triangle_of(int slot) {
    vec4 record[GEOMETRY_TEXELS];
    for (int i = 0; i < int(GEOMETRY_TEXELS); ++i) {
        record[i] = texelFetch(geometry, slot * int(GEOMETRY_TEXELS) + i);
    }
    return triangle_from(record);
}

// One instruction each, where min and max, which must mind NaN, are three on a software device.
float lesser(float a, float b) {
    return a < b ? a : b;
}

float greater(float a, float b) {
    return a > b ? a : b;
}

struct Fragment {
    // D, and its complement computed without cancellation.
    float probability;
    float complement;
    // Whether the pair takes part at all.
    bool kept;
    // Distances to the three edges' lines, positive inside.
    vec3 height;
};

// Squared distance to a segment: off its line, and beyond its ends along it.
float segment_distance(float along, float half_length, float height) {
    float beyond = greater(abs(along) - half_length, 0.0);
    return height * height + beyond * beyond;
}

// Pixels within this distance of an edge count as covered in the hard modes, so that rounding opens no holes.
const float HARD_EDGE_PIXELS = 1e-5;

// Where a pixel lies to a triangle: all of a fragment but its exponential.
struct Place {
    vec3 height;
    // Of the euclidean distance: how far along each edge from its midpoint, and the squared distance to each.
    vec3 along;
    vec3 to_edge;
    // Squared distance in units in which exp2 of its negative is the sigmoid's term; 0 with the hard distance.
    float squared;
    bool inside;
    bool kept;
};

Place place_at(Triangle t, vec2 q, float radius_squared, float scale) {
    Place p;
    p.height = vec3(t.line0.x * q.x + t.line0.y * q.y + t.line0.z, t.line1.x * q.x + t.line1.y * q.y + t.line1.z,
                    t.line2.x * q.x + t.line2.y * q.y + t.line2.z);
    float lowest = lesser(p.height.x, lesser(p.height.y, p.height.z));
    p.squared = 0.0;
    if (DISTANCE == DISTANCE_HARD) {
        p.inside = lowest >= -HARD_EDGE_PIXELS * scale;
        p.kept = p.inside;
        return p;
    }
    if (DISTANCE == DISTANCE_EUCLIDEAN) {
        p.along = vec3(t.line0.y * q.x - t.line0.x * q.y + t.line0.w, t.line1.y * q.x - t.line1.x * q.y + t.line1.w,
                       t.line2.y * q.x - t.line2.x * q.y + t.line2.w);
        p.to_edge = vec3(segment_distance(p.along.x, t.half_length.x, p.height.x),
                         segment_distance(p.along.y, t.half_length.y, p.height.y),
                         segment_distance(p.along.z, t.half_length.z, p.height.z));
        p.squared = lesser(p.to_edge.x, lesser(p.to_edge.y, p.to_edge.z));
        p.inside = lowest > 0.0;
    } else {
        vec3 b = p.height * t.inverse_height;
        float least = min(b.x, min(b.y, b.z));
        p.squared = least * least * frame.barycentric_scale;
        p.inside = least > 0.0;
    }
    p.kept = p.inside || p.squared < radius_squared;
    return p;
}

Fragment fragment_of(Place p) {
    Fragment f;
    f.height = p.height;
    f.kept = p.kept;
    if (DISTANCE == DISTANCE_HARD) {
        f.probability = f.kept ? 1.0 : 0.0;
        f.complement = 1.0 - f.probability;
        return f;
    }
    // exp2 of the negative distance serves both signs: sigmoid(x) = 1 / (1 + e), sigmoid(-x) = e / (1 + e).
    // Without a pair e is 0: D is 0 and its complement 1.
    float e = p.kept ? exp2(-p.squared) : 0.0;
    float major = 1.0 / (1.0 + e);
    float minor = e * major;
    f.probability = p.inside ? major : minor;
    f.complement = p.inside ? minor : major;
    return f;
}

Fragment fragment_at(Triangle t, vec2 q, float radius_squared, float scale) {
    return fragment_of(place_at(t, q, radius_squared, scale));
}

// Clipped barycentrics, not yet divided by their sum. The lower bound stands for 0 and keeps the sum above it for
// triangles so thin that rounding puts a pixel outside all three edges.
vec3 clipped_barycentrics(Triangle t, vec3 height) {
    vec3 b = height * t.inverse_height;
    return vec3(lesser(greater(b.x, 1e-20), 1.0), lesser(greater(b.y, 1e-20), 1.0), lesser(greater(b.z, 1e-20), 1.0));
}

struct Depth {
    // z over corner 0's z.
    float ratio;
    // log2 weight beyond the whole part of corner 0's.
    float weight;
};

// 1/z = Σ b̂/z_k, kept relative to corner 0. `record` is triangle.comp's depth record; b is not divided by its sum.
Depth depth_at(vec4 record, vec3 b, float sum) {
    float excess = b.y * record.x + b.z * record.y;
    // Σ b̂ z_0/z_k as the shares of a perspective mixture have it, so that these add up to 1 however far a corner is. Only
    // before the viewer's plane can it be less than the bound; nothing is seen there.
    float inverse = 1.0 / greater(b.x + b.y * (1.0 + record.x) + b.z * (1.0 + record.y), 1e-12 * sum);
    return Depth(sum * inverse, record.z * (excess * inverse) + record.w);
}
