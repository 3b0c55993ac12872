// The numbers of a frame, the same block for every stage.

layout(push_constant) uniform Frame {
    uint width;
    uint height;
    // Record slots, screen vertices and bins of all views together, for bounds.
    uint tiles_x;
    uint tiles_y;
    uint bins_x;
    uint bins_y;
    // Capacity of the bins' lists and of the tiles' lists, in entries.
    uint coarse_capacity;
    uint list_capacity;
    // Pixels to units in which exp2(-d²) is the sigmoid's term: sqrt(log2(e) / sigma) · 2 / height.
    float scale;
    // The culling radius in those units, squared, and in pixels.
    float radius_squared;
    float radius_pixels;
    // Barycentric distance: log2(e) / sigma, and the radius in barycentric units.
    float barycentric_scale;
    float barycentric_radius;
    float near_high;
    float near_low;
    float far_high;
    float far_low;
    // log2(e) / ((far - near) gamma): view depth to log2 weight.
    float score_high;
    float score_low;
    // The background's log2 weight as whole number and rest.
    float background_whole;
    float background_rest;
    float background_red;
    float background_green;
    float background_blue;
    uint light_count;
    // Record slots of all views, and room for cells beyond each slot's first.
    uint slot_count;
    uint cell_capacity;
    uint view_count;
    uint mesh_count;
    // Rows that `reduce` sums where they are not a view's triangles.
    uint reduce_rows;
    // First entry of `totals` that `reduce` writes; first place of the row of items that `background`,
    // `forward` and `backward` walk.
    uint first;
    // Fixed-point units of a texel's gradient.
    float texel_scale;
} frame;
