// The numbers of a frame: one push constant block for every kernel of the rasterizer (`FramePush` in Rust). Needs nothing.

layout(push_constant) uniform Frame {
    uint width;
    uint height;
    // Tiles and bins of an image along each axis.
    uint tiles_x;
    uint tiles_y;
    uint bins_x;
    uint bins_y;
    // Capacity of the bins' lists and of the tiles' lists, in entries.
    uint coarse_capacity;
    uint list_capacity;
    // Factor of distances d in pixels that makes exp2(-d²) the exponential of eq. 1: sqrt(log2(e) / sigma) · 2 / height.
    float scale;
    // The culling radius: squared in units of 1 / scale pixels, and in pixels.
    float radius_squared;
    float radius_pixels;
    // Barycentric distance: log2(e) / sigma, and the radius in barycentric units.
    float barycentric_scale;
    float barycentric_radius;
    // The near and far planes as double floats.
    float near_high;
    float near_low;
    float far_high;
    float far_low;
    // log2(e) / ((far - near) gamma), a double float. It turns view depth into the log2 weight of eq. 3.
    float score_high;
    float score_low;
    // The background's log2 weight log2 exp(ε/γ) (eq. 3) as integer part and fraction.
    float background_exponent;
    float background_fraction;
    float background_red;
    float background_green;
    float background_blue;
    uint light_count;
    // Record indices of all views, and capacity for the cells beyond each record's first.
    uint record_count;
    uint cell_capacity;
    uint view_count;
    uint mesh_count;
    // For `reduce` the number of rows, unless they are a view's triangles. For `forward_soft_long`, `forward_long` and
    // `backward_long` the number of the turn: a tile or triangle may take several dispatches, each of which goes on where the
    // one before has ended.
    uint number;
    // For `reduce` the first entry of `totals` to write. For kernels that run over rows of a list, the first entry of a row.
    uint first;
    // Fixed-point units per unit of a texel's gradient.
    float texel_scale;
} frame;
