//! Which pieces of triangles a pixel visits: all, those whose support meets its tile, or those whose weight there
//! matters.

use super::fragment::Knobs;
use super::geometry::{doubled_area, locate};
use super::real::{Real, sub};
use super::setup::Piece;
use rayon::prelude::*;
use softras::scene::{Background, Distance, Faces, Settings};
use std::ops::Range;

/// Pixels along a tile's side.
const TILE: usize = 8;

/// e^-38 < 1e-16: a pair whose weight is smaller than another's by this factor does not change an f64 sum.
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
    /// Every pixel visits every piece.
    pub fn all(pieces: usize) -> Self {
        Self { tile: usize::MAX, columns: 1, lists: vec![(0..pieces as u32).collect()] }
    }

    /// The pieces whose support, grown by what [`super::margin`] looks at around it, meets the tile; `support` is the
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

    /// Without truncation, the pieces that can change a pixel of the tile: those whose D may be above 1e-16, or whose
    /// softmax weight may be above 1e-16 of the largest.
    ///
    /// The signed edge distance changes between two points by at most their distance, so its value at the tile's centre
    /// bounds D over the tile; the corners' depths bound ζ. A piece is left out when its largest possible log weight
    /// log D + ζ / γ is more than [`NOTHING`] below the smallest possible one of another piece; none where an opacity may be
    /// 0 (`opaque` is false).
    pub fn of_weight(knobs: &Knobs<'_, f64>, pieces: &[Piece<f64>], opaque: bool) -> Self {
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
        let scores: Vec<Scores> = pieces.iter().map(|piece| Scores::of(knobs, piece, opaque)).collect();
        let list = |tile: usize| {
            let first = pixel_centre(settings, tile / columns * TILE, tile % columns * TILE);
            let half = (TILE - 1) as f64 / f64::from(settings.height);
            let centre = [first[0] + half, first[1] - half];
            // Distance from the centre to the tile's corners, with a little more for rounding.
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

/// The least and the largest depth term ζ / γ of a piece's log weight.
struct Scores([f64; 2]);

impl Scores {
    fn of(knobs: &Knobs<'_, f64>, piece: &Piece<f64>, opaque: bool) -> Self {
        let (near, far) = (knobs.settings.near, knobs.settings.far);
        let score = |z: f64| (far - z) / (far - near) / knobs.gamma;
        let z = piece.corners.map(|c| c.z);
        let (nearest, farthest) = (z[0].min(z[1]).min(z[2]), z[0].max(z[1]).max(z[2]));
        // A piece with fragments that may not take part in the softmax (outside the depth range, transparent, or back faces
        // that only the official silhouette counts) must not exclude others, so its lower bound is -∞.
        let shown = opaque && (piece.front || knobs.settings.faces == Faces::Both);
        let least = if shown && nearest >= near && farthest <= far { score(farthest) } else { f64::NEG_INFINITY };
        Self([least, score(nearest.max(near))])
    }

    /// Over the pixels within `reach` of `centre`: the largest log D, and the least and the largest log D + ζ / γ.
    fn over(&self, knobs: &Knobs<'_, f64>, piece: &Piece<f64>, centre: [f64; 2], reach: f64) -> [f64; 3] {
        let location = locate(&piece.screen(), centre, knobs.surface_point());
        let outside = if location.inside { -location.distance2.sqrt() } else { location.distance2.sqrt() };
        let log_d = |d: f64| -(d * d.abs() / knobs.sigma).softplus();
        let (most, fewest) = (log_d(outside - reach), log_d(outside + reach));
        [most, fewest + self.0[0], most + self.0[1]]
    }
}

/// The box, as its lowest and highest corner, outside which pairs are dropped and do not affect a pixel's margin.
fn support_box(settings: &Settings, support: f64, corners: &[[f64; 2]; 3]) -> [[f64; 2]; 2] {
    // Twice the squared distance of the cut makes |d² / r² - 1| = 1.
    let reach = (2.0 * support).sqrt() * (1.0 + 1e-9);
    // In hard modes the margin is measured up to one pixel from the border.
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
