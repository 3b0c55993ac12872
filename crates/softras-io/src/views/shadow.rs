//! Soft shadows on a bright plain background: they fall off without an edge, and have its hue.

use image::RgbaImage;

/// Pixels along a side of a cell, whose mean has little noise.
const CELL: usize = 4;
/// A cell that differs from the background by no more is one of it.
const SURE: f64 = 6.0;
/// The most by which a shadow's cell differs from the one beside it, and from the background's hue, of 255.
const STEP: f64 = 4.0;
/// The share of the background's light that the darkest soft shadow has, and the most of a bright spot.
const LIGHT: std::ops::RangeInclusive<f64> = 0.7..=1.03;

/// The light that falls on the background in cells of a picture.
pub struct Shade {
    columns: usize,
    /// The share of the background's own colour that each cell of it shows; `None` within the object.
    light: Vec<Option<f64>>,
}

impl Shade {
    /// Follows the shadows from the cells that are surely background, given the colours of the background along a row.
    pub fn new<F: Fn(usize) -> [f64; 3]>(picture: &RgbaImage, ground: impl Fn(usize) -> F) -> Self {
        let [columns, rows] = [picture.width(), picture.height()].map(|side| (side as usize).div_ceil(CELL));
        let mut cells = vec![([0.0; 3], [0.0; 3], 0.0); columns * rows];
        for (row, pixels) in picture.rows().enumerate() {
            let along = ground(row);
            for (column, pixel) in pixels.enumerate() {
                let (color, own, count) = &mut cells[row / CELL * columns + column / CELL];
                let ground = along(column);
                (0..3).for_each(|k| (color[k], own[k]) = (color[k] + f64::from(pixel.0[k]), own[k] + ground[k]));
                *count += 1.0;
            }
        }
        let cells: Vec<_> = cells.iter().map(|(color, own, n)| (color.map(|x| x / n), own.map(|x| x / n))).collect();
        let differ = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let light = |(color, own): &([f64; 3], [f64; 3])| dot(color, own) / dot(own, own).max(1.0);
        let has_hue = |cell: &([f64; 3], [f64; 3])| {
            let share = light(cell);
            LIGHT.contains(&share) && differ(&cell.0, &cell.1.map(|x| share * x)) <= STEP
        };
        let mut found: Vec<Option<f64>> =
            cells.iter().map(|cell| (differ(&cell.0, &cell.1) <= SURE).then(|| light(cell))).collect();
        let mut next: Vec<usize> = (0..cells.len()).filter(|&at| found[at].is_some()).collect();
        while let Some(at) = next.pop() {
            for beside in neighbors(at, columns, rows) {
                if found[beside].is_none() && differ(&cells[at].0, &cells[beside].0) <= STEP && has_hue(&cells[beside])
                {
                    found[beside] = Some(light(&cells[beside]));
                    next.push(beside);
                }
            }
        }
        // The outline may cross the cells beside the background.
        let rim = |at: usize| {
            let beside: Vec<f64> = neighbors(at, columns, rows).filter_map(|beside| found[beside]).collect();
            found[at].or((!beside.is_empty()).then(|| beside.iter().sum::<f64>() / beside.len() as f64))
        };
        Self { columns, light: (0..cells.len()).map(rim).collect() }
    }

    /// The share of the background's colour at a pixel; `None` within the object.
    pub fn light(&self, column: usize, row: usize) -> Option<f64> {
        self.light[row / CELL * self.columns + column / CELL]
    }
}

/// The cells that share a side with one.
fn neighbors(at: usize, columns: usize, rows: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (at / columns, at % columns);
    let left = (column > 0).then(|| at - 1);
    let right = (column + 1 < columns).then(|| at + 1);
    let above = (row > 0).then(|| at - columns);
    let below = (row + 1 < rows).then(|| at + columns);
    [left, right, above, below].into_iter().flatten()
}
