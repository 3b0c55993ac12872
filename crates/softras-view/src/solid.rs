//! Alpha that is 1 inside of surfaces.
//!
//! The model's silhouette 1 - Π(1 - D) is below 1 along the edges between triangles: D is ½ on both sides of an edge, which
//! leaves ¾. That draws the mesh's edges as faint lines through whatever lies behind a picture.

use softras::Image;

/// Inside of a surface the silhouette is at least ¾: a pixel's distance to the triangle beyond the nearest edge is at most
/// that to the edge, so that one triangle has at least D and the other 1 - D, and 1 - (1 - D) D ≥ ¾. Every further triangle
/// adds to it. Rounding, and what tau leaves out, take less than the difference to this.
const LEAST_INSIDE: f32 = 0.745;

/// The silhouette of one view with 1 where the pixel and its eight neighbours all have what a surface has inside. At the
/// outline of a closed surface the silhouette falls through ¾, so that the outermost pixels keep their soft values. Pixels
/// outside the image count as being like those at its border.
pub fn solid(silhouette: &Image) -> Vec<f32> {
    let (width, height, alpha) = (silhouette.width, silhouette.height, silhouette.view(0));
    let covered: Vec<bool> = alpha.iter().map(|a| *a >= LEAST_INSIDE).collect();
    // First along the rows, then along the columns.
    let in_row = |i: usize| {
        let (row, column) = (i / width, i % width);
        (column.saturating_sub(1)..=(column + 1).min(width - 1)).all(|c| covered[row * width + c])
    };
    let in_rows: Vec<bool> = (0..alpha.len()).map(in_row).collect();
    let is_inside = |i: usize| {
        let (row, column) = (i / width, i % width);
        (row.saturating_sub(1)..=(row + 1).min(height - 1)).all(|r| in_rows[r * width + column])
    };
    alpha.iter().enumerate().map(|(i, a)| if is_inside(i) { 1.0 } else { *a }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(rows: &[&[f32]]) -> Image {
        Image { batch: 1, height: rows.len(), width: rows[0].len(), channels: 1, data: rows.concat() }
    }

    #[test]
    fn only_pixels_whose_neighbours_are_all_covered_are_inside() {
        let before = image(&[
            &[0.9, 0.8, 0.8, 0.8, 0.2],
            &[0.9, 0.8, 0.75, 0.8, 0.2],
            &[0.9, 0.8, 0.8, 0.8, 0.2],
            &[0.9, 0.8, 0.8, 0.7, 0.2],
        ]);
        let after = image(&[
            &[1.0, 1.0, 1.0, 0.8, 0.2],
            &[1.0, 1.0, 1.0, 0.8, 0.2],
            &[1.0, 1.0, 0.8, 0.8, 0.2],
            &[1.0, 1.0, 0.8, 0.7, 0.2],
        ]);
        assert_eq!(solid(&before), after.data);
    }
}
