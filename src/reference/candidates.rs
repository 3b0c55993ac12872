//! Which pieces a pixel must look at: all of them, or those whose grown box meets its tile.

use super::geometry::doubled_area;
use super::real::sub;
use super::setup::Piece;
use crate::scene::{Distance, Settings};
use std::ops::Range;

/// Pixels along a tile's side.
const TILE: usize = 8;

/// Lists of pieces, in piece order, for square tiles of pixels.
#[derive(Debug)]
pub struct Candidates {
    tile: usize,
    columns: usize,
    lists: Vec<Vec<u32>>,
}

/// The screen position of a pixel's centre.
pub fn pixel_centre(settings: &Settings, row: usize, column: usize) -> [f64; 2] {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    [(2.0 * column as f64 + 1.0 - width) / height, (height - 1.0 - 2.0 * row as f64) / height]
}

impl Candidates {
    /// Every piece for every pixel.
    pub fn all(pieces: usize) -> Self {
        Self { tile: usize::MAX, columns: 1, lists: vec![(0..pieces as u32).collect()] }
    }

    /// Those whose support, with as much around it as a margin below 1 can see, meets the tile; `support` is the
    /// squared distance from which pairs are dropped.
    pub fn culled(settings: &Settings, support: f64, pieces: &[Piece<f64>]) -> Self {
        let tiles = |size: u32| (size as usize).div_ceil(TILE);
        let (rows, columns) = (tiles(settings.height), tiles(settings.width));
        let mut lists = vec![Vec::new(); rows * columns];
        for (i, piece) in pieces.iter().enumerate() {
            let [low, high] = support_box(settings, support, &piece.screen());
            let [tile_rows, tile_columns] = tile_ranges(settings, low, high);
            for row in tile_rows {
                for column in tile_columns.clone() {
                    lists[row * columns + column].push(i as u32);
                }
            }
        }
        Self { tile: TILE, columns, lists }
    }

    /// The pieces for a pixel.
    pub fn of(&self, row: usize, column: usize) -> &[u32] {
        &self.lists[row / self.tile * self.columns + column / self.tile]
    }
}

/// The box, lowest and highest corner, outside which a pair is dropped and adds nothing to a pixel's margin.
fn support_box(settings: &Settings, support: f64, corners: &[[f64; 2]; 3]) -> [[f64; 2]; 2] {
    // Twice the squared distance of the cut makes |d² / r² - 1| = 1.
    let reach = (2.0 * support).sqrt() * (1.0 + 1e-9);
    // Hard modes look a pixel far.
    let pixel = 2.0 / f64::from(settings.height);
    let growth = if settings.distance == Distance::Euclidean { reach.max(pixel) } else { pixel };
    let mut points = corners.to_vec();
    if settings.distance == Distance::Barycentric && doubled_area(corners).is_some() {
        // Where all b ≥ -reach: corner k moves by reach · ((pₖ - pᵢ) + (pₖ - pⱼ)).
        points.extend((0..3).map(|k| {
            let away = [sub(corners[k], corners[(k + 1) % 3]), sub(corners[k], corners[(k + 2) % 3])];
            std::array::from_fn(|axis| corners[k][axis] + reach * (away[0][axis] + away[1][axis]))
        }));
    }
    let fold = |start: f64, pick: fn(f64, f64) -> f64| {
        [0, 1].map(|axis| points.iter().fold(start, |bound, point: &[f64; 2]| pick(bound, point[axis])))
    };
    [fold(f64::INFINITY, f64::min).map(|x| x - growth), fold(f64::NEG_INFINITY, f64::max).map(|x| x + growth)]
}

/// Rows and columns of tiles with a pixel centre in the box.
fn tile_ranges(settings: &Settings, low: [f64; 2], high: [f64; 2]) -> [Range<usize>; 2] {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    let column = |x: f64| (x * height + width - 1.0) / 2.0;
    let row = |y: f64| (height - 1.0 - y * height) / 2.0;
    let tiles = |first: f64, last: f64, size: f64| {
        // A pixel of slack, against rounding.
        let (first, last) = ((first.floor() - 1.0).max(0.0), (last.ceil() + 1.0).min(size - 1.0));
        if first > last { 0..0 } else { first as usize / TILE..last as usize / TILE + 1 }
    };
    [tiles(row(high[1]), row(low[1]), height), tiles(column(low[0]), column(high[0]), width)]
}
