//! A second surface beside a plain background, such as the cloth or the table that the object stands on: the border shows it, it
//! differs less from the background than the object does, and it may be as bright as the object's shadows.

use super::parts::parts;
use std::ops::Range;

/// The least share of the border that a surface takes.
const LEAST_SHARE: f64 = 0.01;
/// Histograms are smoothed over this many values to both sides.
const SMOOTH: usize = 4;
/// The valley between surface and object is at most this share of the histogram's height.
const SHALLOWEST: f64 = 0.5;
/// The valley begins where the smoothed histogram falls to this many times its least.
const DEEP: f64 = 1.3;
/// A square within the surface, whose side is this share of the picture's shorter side: at least `FILLED` of its pixels are the
/// surface's.
const SQUARE: f64 = 1.0 / 70.0;
const FILLED: f64 = 0.8;
/// A pixel that differs by less than this share of the surface's reach is glare of the object, or the background's own.
const GLARE: f64 = 1.0 / 3.0;

/// How far a second surface reaches from the background: up to the valley between its pixels and those of the object, which differ
/// more. The distances are those of the border and of the whole picture from the background, which reaches up to `ground`. `None`
/// where the border shows no second surface, or where no valley parts it from the object.
pub fn reach(border: &[f64], all: impl Iterator<Item = f64>, ground: f64) -> Option<u8> {
    let mut counts = vec![0.0; 256];
    all.for_each(|distance| counts[distance.min(255.0) as usize] += 1.0);
    let parting = parting(&counts);
    let seen = border.iter().filter(|distance| **distance > ground);
    let mut own: Vec<f64> = seen.clone().copied().filter(|distance| *distance < parting as f64).collect();
    let is_seen = own.len() as f64 >= LEAST_SHARE * border.len() as f64 && 2 * own.len() > seen.count();
    if !is_seen {
        return None;
    }
    own.sort_unstable_by(f64::total_cmp);
    let first = own[own.len() * 19 / 20] as usize + 1;
    let object = mean(&counts, parting..counts.len()) as usize;
    let smooth = |at: usize| {
        let near = at.saturating_sub(SMOOTH)..(at + SMOOTH + 1).min(counts.len());
        counts[near.clone()].iter().sum::<f64>() / near.len() as f64
    };
    let least = (first..object).map(smooth).fold(f64::INFINITY, f64::min);
    let most = (first..counts.len()).map(smooth).fold(0.0, f64::max);
    let valley = (first..object).find(|at| smooth(*at) <= DEEP * least)?;
    (least < SHALLOWEST * most).then_some(valley as u8)
}

/// Sets the distances to 0 that are the background's or the surface's. A pixel of the object's shadows differs no more than the surface
/// does. But the surface goes on to the border, and the shadow ends within the object.
pub fn cut(distances: &mut [u8], size: [usize; 2], ground: u8, reach: u8) {
    let [width, height] = size;
    let near = ((SQUARE * width.min(height) as f64) as usize / 2).max(1);
    let dim = Sums::of(size, |at| (ground + 1..=reach).contains(&distances[at]));
    let is_filled = |column: usize, row: usize| {
        let (count, area) = dim.around(column, row, near);
        count as f64 >= FILLED * area as f64
    };
    let (runs, all) = parts(size, false, is_filled);
    let mut surface = vec![false; width * height];
    for run in runs.iter().filter(|run| all[run.part].is_cut(size)) {
        surface[run.row * width..][run.columns.clone()].fill(true);
    }
    let surface = Sums::of(size, |at| surface[at]);
    let glare = ground.max((GLARE * f64::from(reach)) as u8);
    for (at, distance) in distances.iter_mut().enumerate() {
        let is_beside = || surface.around(at % width, at / width, near + 1).0 > 0;
        if *distance <= glare || *distance <= reach && is_beside() {
            *distance = 0;
        }
    }
    // A part that remains without a pixel of the object is a flare of the lens or the like.
    let (runs, all) = parts(size, true, |column, row| distances[row * width + column] > 0);
    let mut is_object = vec![false; all.len()];
    for run in &runs {
        is_object[run.part] |=
            distances[run.row * width..][run.columns.clone()].iter().any(|distance| *distance > reach);
    }
    for run in runs.iter().filter(|run| !is_object[run.part]) {
        distances[run.row * width..][run.columns.clone()].fill(0);
    }
}

/// How many pixels of a kind lie in a square, by a table of the sums over all rectangles that begin at the first pixel.
struct Sums {
    size: [usize; 2],
    table: Vec<u32>,
}

impl Sums {
    fn of(size: [usize; 2], is_in: impl Fn(usize) -> bool) -> Self {
        let [width, height] = size;
        let mut table = vec![0; (width + 1) * (height + 1)];
        for row in 0..height {
            let mut sum = 0;
            for column in 0..width {
                sum += u32::from(is_in(row * width + column));
                let at = (row + 1) * (width + 1) + column + 1;
                table[at] = table[at - width - 1] + sum;
            }
        }
        Self { size, table }
    }

    /// The pixels of the kind, and all, that are at most so far from a pixel along both sides.
    fn around(&self, column: usize, row: usize, near: usize) -> (u32, usize) {
        let [width, height] = self.size;
        let (left, right) = (column.saturating_sub(near), (column + near + 1).min(width));
        let (top, bottom) = (row.saturating_sub(near), (row + near + 1).min(height));
        let to = |column: usize, row: usize| self.table[row * (width + 1) + column];
        let count = to(right, bottom) + to(left, top) - to(right, top) - to(left, bottom);
        (count, (right - left) * (bottom - top))
    }
}

/// The mean of a part of a histogram.
fn mean(counts: &[f64], part: Range<usize>) -> f64 {
    let sum: f64 = counts[part.clone()].iter().sum();
    part.map(|at| at as f64 * counts[at]).sum::<f64>() / sum.max(1.0)
}

/// Where a histogram parts into the two classes with the greatest variance between them.
///
/// Source: Otsu, "A threshold selection method from gray-level histograms", 1979.
fn parting(counts: &[f64]) -> usize {
    let variance = |at: &usize| {
        let share = |part: Range<usize>| counts[part].iter().sum::<f64>();
        let apart = mean(counts, *at..counts.len()) - mean(counts, 0..*at);
        share(0..*at) * share(*at..counts.len()) * apart * apart
    };
    (1..counts.len()).max_by(|a, b| variance(a).total_cmp(&variance(b))).unwrap_or(0)
}
