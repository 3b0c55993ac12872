//! Which pieces a pixel must look at: all of them, those whose grown box meets its tile, or those that can weigh there.

use super::fragment::Knobs;
use super::geometry::{doubled_area, locate};
use super::real::{Real, sub};
use super::setup::Piece;
use crate::scene::{Background, Distance, Faces, Settings};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels along a tile's side.
const TILE: usize = 8;

/// e^-38 < 1e-16: what weighs less than this beside another pair is nothing to an f64.
const NOTHING: f64 = 38.0;

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

    /// Without truncation, those that some pixel of the tile could notice: D may be above 1e-16, or the softmax weight
    /// that of the heaviest piece times 1e-16.
    ///
    /// The signed distance to a triangle changes by at most the way walked, so its value at the tile's centre bounds x
    /// over the tile, and the corners bound ζ. A piece is left out when its largest possible score
    /// log D + ζ / γ stays [`NOTHING`] below another's least.
    pub fn of_weight(knobs: &Knobs<'_, f64>, pieces: &[Piece<f64>]) -> Self {
        let settings = knobs.settings;
        if settings.distance != Distance::Euclidean {
            return Self::all(pieces.len());
        }
        let tiles = |size: u32| (size as usize).div_ceil(TILE);
        let (rows, columns) = (tiles(settings.height), tiles(settings.width));
        let background = match settings.background {
            Background::Weighted => knobs.background_score / knobs.gamma,
            Background::Composite => f64::NEG_INFINITY,
        };
        let scores: Vec<Scores> = pieces.iter().map(|piece| Scores::of(knobs, piece)).collect();
        let list = |tile: usize| {
            let first = pixel_centre(settings, tile / columns * TILE, tile % columns * TILE);
            let half = (TILE - 1) as f64 / f64::from(settings.height);
            let centre = [first[0] + half, first[1] - half];
            // To the tile's corners, and a little for rounding.
            let reach = half * std::f64::consts::SQRT_2 * (1.0 + 1e-9);
            let bounds: Vec<[f64; 3]> =
                pieces.iter().zip(&scores).map(|(piece, scores)| scores.over(knobs, piece, centre, reach)).collect();
            let least = bounds.iter().map(|b| b[1]).fold(background, f64::max);
            let counts = |b: &[f64; 3]| b[0] > -NOTHING || b[2] > least - NOTHING;
            (0u32..).zip(&bounds).filter(|(_, b)| counts(b)).map(|(i, _)| i).collect()
        };
        Self { tile: TILE, columns, lists: (0..rows * columns).into_par_iter().map(list).collect() }
    }

    /// The pieces for a pixel.
    pub fn of(&self, row: usize, column: usize) -> &[u32] {
        &self.lists[row / self.tile * self.columns + column / self.tile]
    }
}

/// The depth part of a piece's scores, ζ / γ, over all of it: least and largest.
struct Scores([f64; 2]);

impl Scores {
    fn of(knobs: &Knobs<'_, f64>, piece: &Piece<f64>) -> Self {
        let (near, far) = (knobs.settings.near, knobs.settings.far);
        let score = |z: f64| (far - z) / (far - near) / knobs.gamma;
        let z = piece.corners.map(|c| c.z);
        let (nearest, farthest) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
        // What may be left out of the softmax outweighs nothing: fragments outside the depth range, and the back faces
        // that only the official silhouette counts.
        let shown = piece.front || knobs.settings.faces == Faces::Both;
        let least = if shown && nearest >= near && farthest <= far { score(farthest) } else { f64::NEG_INFINITY };
        Self([least, score(nearest.max(near))])
    }

    /// Over the pixels within `reach` of `centre`: the largest log D, and the least and the largest log D + ζ / γ.
    fn over(&self, knobs: &Knobs<'_, f64>, piece: &Piece<f64>, centre: [f64; 2], reach: f64) -> [f64; 3] {
        let location = locate(&piece.screen(), centre);
        let outside = if location.inside { -location.distance2.sqrt() } else { location.distance2.sqrt() };
        let log_d = |d: f64| -(d * d.abs() / knobs.sigma).softplus();
        let (most, fewest) = (log_d(outside - reach), log_d(outside + reach));
        [most, fewest + self.0[0], most + self.0[1]]
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
