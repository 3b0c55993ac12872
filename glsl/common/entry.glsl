// One entry of a tile's list as forward_soft.comp adds it: its geometry for a lane's pixels, and their distances (eq. 1).
// Needs forward_tile.glsl.

// The values that all pairs of a lane share: on a software device a push constant read in a loop is a gather.
struct Lane {
    // The lane's first pixel.
    vec2 first;
    float radius_squared;
};

Lane lane_at(ivec2 first) {
    return Lane(vec2(first), frame.radius_squared);
}

// The geometry of an entry. The signed distance of a lane's pixel i to each edge's line is x * normal_x + height[i], and its
// distance along the edge from the edge's midpoint x * normal_y + along[i], with x its column less origin_x.
struct Entry {
    float origin_x;
    vec3 normal_x;
    vec3 normal_y;
    vec3 height[PIXELS];
    vec3 along[PIXELS];
    vec3 half_length;
    vec3 inverse_height;
};

// The part of a signed distance, and of the distance along the line, that a row has in common. `line` is (n.x, n.y, c, g) of
// edge.glsl, y the row less the origin's.
vec2 row_part(vec4 line, float y) {
    return vec2(line.y * y + line.z, line.w - line.x * y);
}

// Every lane computes the parts of its own rows. An entry that is not live is far outside.
void read_entry_by_pixels(Fetched own, bool is_second, bool live, Lane lane, out Entry t) {
    Triangle r = shared_triangle_of(own, is_second);
    r.line0.z = live ? r.line0.z : -1e18;
    t.origin_x = r.origin.x;
    for (int i = 0; i < PIXELS; ++i) {
        float y = lane.first.y - r.origin.y + float(step_of(i).y);
        vec2 a = row_part(r.line0, y);
        vec2 b = row_part(r.line1, y);
        vec2 c = row_part(r.line2, y);
        t.height[i] = vec3(a.x, b.x, c.x);
        t.along[i] = vec3(a.y, b.y, c.y);
    }
    t.normal_x = vec3(r.line0.x, r.line1.x, r.line2.x);
    t.normal_y = vec3(r.line0.y, r.line1.y, r.line2.y);
    t.half_length = r.half_length;
    t.inverse_height = r.inverse_height;
}

// Where all lanes have the same rows, each computes the rows' parts of the one line that it holds, before the lanes share them.
// In a pair of records (GEOMETRY_PAIRED) this serves both: 2 % of the time of forward_soft.comp.
struct Rows {
    vec2 part[PIXELS];
};

#ifdef SUBGROUP_RECORDS
// `head` is the lane with the first texel of the record that the lane holds a texel of, `live` whether that entry is.
void rows_of(Fetched own, uint head, bool live, Lane lane, out Rows rows) {
    vec4 texel = own.geometry;
    float y = lane.first.y - subgroupShuffle(texel.y, head);
    vec4 line = vec4(texel.xy, live ? texel.z : -1e18, texel.w);
    for (int i = 0; i < PIXELS; ++i) {
        rows.part[i] = row_part(line, y + float(step_of(i).y));
    }
}

void rows_of_first(Fetched first, bool first_live, bool second_live, Lane lane, out Rows rows) {
    bool holds_second = GEOMETRY_PAIRED && gl_SubgroupInvocationID >= uint(GEOMETRY_STRIDE);
    rows_of(first, holds_second ? uint(GEOMETRY_STRIDE) : 0u, holds_second ? second_live : first_live, lane, rows);
}

void rows_of_second(Fetched second, bool live, Lane lane, inout Rows rows) {
    if (!GEOMETRY_PAIRED) {
        rows_of(second, 0u, live, lane, rows);
    }
}

void read_entry_by_rows(Fetched own, Rows rows, bool is_second, out Entry t) {
    vec4 texel = own.geometry;
    uint head = geometry_lane(is_second);
    t.origin_x = subgroupShuffle(texel.x, head);
    for (uint k = 0u; k < 3u; ++k) {
        for (int i = 0; i < PIXELS; ++i) {
            t.height[i][k] = subgroupShuffle(rows.part[i].x, head + k + 1u);
            t.along[i][k] = subgroupShuffle(rows.part[i].y, head + k + 1u);
        }
        t.normal_x[k] = subgroupShuffle(texel.x, head + k + 1u);
        t.normal_y[k] = subgroupShuffle(texel.y, head + k + 1u);
    }
    vec2 tail = shared_tail_of(own, is_second);
    t.half_length = vec3(subgroupShuffle(texel.z, head), subgroupShuffle(texel.w, head), tail.x);
    // Tiles with a triangle without area are not drawn here.
    t.inverse_height = t.half_length * tail.y;
}
#else
void rows_of_first(Fetched first, bool first_live, bool second_live, Lane lane, out Rows rows) {
    rows.part[0] = vec2(0.0);
}

void rows_of_second(Fetched second, bool live, Lane lane, inout Rows rows) {}
#endif

// The first or the second entry of a pair.
void read_entry(Fetched own, Rows rows, bool is_second, bool live, Lane lane, out Entry t) {
#ifdef SUBGROUP_RECORDS
    if (LANES <= int(TILE_WIDTH)) {
        read_entry_by_rows(own, rows, is_second, t);
    } else {
        read_entry_by_pixels(own, is_second, live, lane, t);
    }
#else
    read_entry_by_pixels(own, is_second, live, lane, t);
#endif
}

// A pixel's distance to an entry.
struct EntryDistance {
    // Signed distances to the lines of the three edges.
    vec3 height;
    // d² log2(e) / σ of eq. 1.
    float squared;
    bool inside;
    // Whether the pixel lies inside or within the culling radius; if not, e is 0.
    bool kept;
    // exp(-d²/σ).
    float e;
};

// The edge with the least signed distance h decides the distance d of eq. 1 alone. Inside, the disc of radius min h about the
// pixel lies within all three half-planes and touches that edge. Outside, let b be the nearest point of the triangle. Every h
// is at least -d, since it is not negative in b. If b lies within an edge, that edge has h = -d, the least. If b is the
// corner between the edges i and j, both have it as their nearest point and either gives d. The third edge k does not win:
// let h_i < 0 be the less of h_i and h_j. With edge lengths s and the area A, s_i h_i + s_j h_j + s_k h_k = 2A, so that
// h_k < h_i would need s_j h_j > (s_i + s_k) |h_i| > s_j |h_i| by the triangle inequality. But where b is the nearest point
// the angle between the pixel's direction from b and either edge is at least a right one, so that h_j <= |h_i|.
// Rounding can break this for a triangle whose height is no more than the rounding of h (is_thin in tile_mask.glsl).
void nearest_edge(vec3 height, vec3 along, vec3 half_length, out EntryDistance d) {
    bool second = height.y < height.x;
    float nearest = second ? height.y : height.x;
    float position = second ? along.y : along.x;
    float size = second ? half_length.y : half_length.x;
    bool third = height.z < nearest;
    nearest = third ? height.z : nearest;
    position = third ? along.z : position;
    size = third ? half_length.z : size;
    float beyond = greater(abs(position) - size, 0.0);
    d.height = height;
    d.squared = nearest * nearest + beyond * beyond;
    d.inside = nearest > 0.0;
}

void measure(Entry t, Lane lane, out EntryDistance d[PIXELS]) {
    float x = lane.first.x - t.origin_x;
    vec3 across = t.normal_x * x;
    vec3 along = t.normal_y * x;
    for (int i = 0; i < PIXELS; ++i) {
        int column = step_of(i).x;
        if (LANES < int(TILE_WIDTH)) {
            across = t.normal_x * (x + float(column));
            along = t.normal_y * (x + float(column));
        }
        nearest_edge(across + t.height[i], along + t.along[i], t.half_length, d[i]);
    }
    for (int i = 0; i < PIXELS; ++i) {
        d[i].kept = d[i].inside || d[i].squared < lane.radius_squared;
        float e = exp2(-d[i].squared);
        d[i].e = d[i].kept ? e : 0.0;
    }
}
