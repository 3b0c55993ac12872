//! Where the official lookup of surface textures is decided by rounding.

use softras::scene::Settings;
use std::cmp::Ordering;

/// Calls `visit(triangle, pixel, b)` with the barycentrics b of each pixel in reach of each triangle's box.
fn visit_pairs(vertices: &[f32], settings: &Settings, mut visit: impl FnMut(usize, usize, [f64; 3])) {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let reach = (settings.sigma * settings.cutoff()).sqrt();
    let x = |column: usize| (2.0 * column as f64 + 1.0 - width as f64) / height as f64;
    let y = |row: usize| (height as f64 - 1.0 - 2.0 * row as f64) / height as f64;
    for (triangle, values) in vertices.chunks_exact(9).enumerate() {
        let p: [[f64; 2]; 3] = std::array::from_fn(|k| [values[3 * k], values[3 * k + 1]].map(f64::from));
        let near =
            |axis: usize, x: f64| p.iter().any(|p| p[axis] <= x + reach) && p.iter().any(|p| p[axis] >= x - reach);
        let doubled =
            |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let area = doubled(p[0], p[1], p[2]);
        for row in (0..height).filter(|&row| near(1, y(row))) {
            for column in (0..width).filter(|&column| near(0, x(column))) {
                let pixel = [x(column), y(row)];
                let b = [doubled(p[1], p[2], pixel), doubled(p[2], p[0], pixel), doubled(p[0], p[1], pixel)];
                visit(triangle, row * width + column, b.map(|b| b / area));
            }
        }
    }
}

/// Pixels where the official surface lookup is decided by rounding: a triangle within reach whose clipped b̂₂ is 0, so
/// that b̂₀ + b̂₁ = 1 lies exactly on a border of cells (and b̂₀ or b̂₁ = 1 indexes past its row).
pub fn undecided_cells(vertices: &[f32], settings: &Settings) -> Vec<bool> {
    let mut undecided = vec![false; (settings.width * settings.height) as usize];
    // Not above is also where a triangle without area gives NaN.
    visit_pairs(vertices, settings, |_, pixel, b| {
        undecided[pixel] |= b[2].partial_cmp(&1e-9) != Some(Ordering::Greater)
    });
    undecided
}

/// Triangles none of whose pixels has b̂₁ = 1, which the official lookup takes out of the triangle.
pub fn lookups_in_row(vertices: &[f32], settings: &Settings) -> Vec<bool> {
    let mut good = vec![true; vertices.len() / 9];
    visit_pairs(vertices, settings, |triangle, _, b| good[triangle] &= b[0] > 0.0 || b[2] > 0.0);
    good
}
