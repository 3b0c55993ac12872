//! Gains by view and channel of photographs whose exposure or white balance differ.
//!
//! A point of the surface has one colour. So the logarithm of the colour that a view shows there is the sum of those of the point's
//! colour and of the view's gain, which are found by turns. A common factor of all gains is unknowable: their logarithms' mean is 0.

use super::{
    seen::{Seen, normals},
    subject::Subject,
};
use crate::{on_all_cores, points, work::Work};
use glam::DVec3;
use rayon::prelude::*;
use softras::{Image, Mesh, Renderer, Result, Settings};
use softras_io::Views;

/// Vertices that are looked at, at most.
const POINTS: usize = 4000;
const ROUNDS: usize = 200;
/// The least number of points that a gain is estimated from.
const FEWEST: usize = 20;
/// A darker value is mostly noise, and a brighter one may be at its end.
const DARKEST: f64 = 0.01;
const BRIGHTEST: f64 = 0.98;
/// Gains are taken if one of them is at least this far from 1, by its logarithm, and what remains is at most this share.
const LEAST_GAIN: f64 = 0.05;
const MOST_LEFT: f64 = 0.8;

/// The colour that a view shows of a point, by its logarithm.
struct PointColor {
    point: usize,
    view: usize,
    log: DVec3,
}

/// Divides colours by the gains of their views where that makes them agree on a mesh near the object.
pub fn leveled(subject: &mut Subject, mesh: &Mesh, settings: &Settings, work: &mut Work) -> Result<()> {
    if subject.views.color.is_none() {
        return Ok(());
    }
    let sights = sights(&subject.views, mesh, settings, work.renderer)?;
    let count = subject.views.cameras.len();
    let channels = [0, 1, 2].map(|channel| gains(&sights, channel, count));
    let (before, after) = channels.iter().fold((0.0, 0.0), |sum, c| (sum.0 + c.1, sum.1 + c.2));
    let (low, high) = channels.iter().flat_map(|c| &c.0).fold((0.0f64, 0.0f64), |(l, h), x| (l.min(*x), h.max(*x)));
    if low.abs().max(high) < LEAST_GAIN || after > MOST_LEFT * before {
        return Ok(());
    }
    let level = |image: &mut Image| {
        let pixels = image.height * image.width;
        for (pixel, i) in image.data.chunks_exact_mut(3).zip(0..) {
            for (value, channel) in pixel.iter_mut().zip(&channels) {
                let (given, gain) = (f64::from(*value), channel.0[i / pixels]);
                // A value at its end is only a bound, except in the darkest views, beyond which no view knows more.
                let is_known = given < BRIGHTEST || gain < low + LEAST_GAIN;
                *value = (if is_known { given } else { -given } * (-gain).exp()) as f32;
            }
        }
    };
    subject.views.color.iter_mut().for_each(level);
    for (view, photograph) in subject.views.photographs.iter_mut().enumerate() {
        photograph.level([0, 1, 2].map(|k| {
            let gain = channels[k].0[view];
            [gain.exp(), if gain < low + LEAST_GAIN { f64::INFINITY } else { BRIGHTEST }]
        }));
    }
    let [low, high] = [low, high].map(f64::exp);
    work.notes.push(format!("the pictures' exposures differ: colours are divided by gains of {low:.2} to {high:.2}"));
    work.goes_on()
}

/// How much the colours of the views differ on a mesh: the mean, over points that several views see, of their standard deviation. `None`
/// where no point tells.
pub fn disagreement(views: &Views, mesh: &Mesh, settings: &Settings, renderer: &mut Renderer) -> Result<Option<f64>> {
    let mut sights = sights(views, mesh, settings, renderer)?;
    sights.retain(|sight| sight.log.max_element() < BRIGHTEST.ln());
    let deviation = |sights: &[PointColor]| {
        let (colors, count) = (sights.iter().map(|sight| sight.log.exp()), sights.len() as f64);
        let mean = colors.clone().sum::<DVec3>() / count;
        (colors.map(|color| (color - mean).length_squared()).sum::<f64>() / (count - 1.0)).sqrt()
    };
    let all: Vec<f64> =
        sights.chunk_by(|a, b| a.point == b.point).filter(|some| some.len() > 1).map(deviation).collect();
    Ok((all.len() >= FEWEST).then(|| all.iter().sum::<f64>() / all.len() as f64))
}

fn sights(views: &Views, mesh: &Mesh, settings: &Settings, renderer: &mut Renderer) -> Result<Vec<PointColor>> {
    let seen = Seen::of(mesh, views, settings, renderer)?;
    let surface: Vec<(DVec3, DVec3)> = points(mesh).into_iter().zip(normals(mesh)).collect();
    let some: Vec<_> = surface.iter().step_by(surface.len().div_ceil(POINTS).max(1)).collect();
    let of_point = |(point, (place, normal)): (usize, &&(DVec3, DVec3))| {
        let log = |view: usize| {
            let (color, _) = seen.by(view, *place, *normal)?;
            (color.min_element() > DARKEST).then(|| PointColor { point, view, log: color.map(f64::ln) })
        };
        (0..views.cameras.len()).filter_map(log).collect::<Vec<PointColor>>()
    };
    let sights: Vec<Vec<PointColor>> = on_all_cores(|| some.par_iter().enumerate().map(of_point).collect());
    // One view alone always agrees with itself.
    Ok(sights.into_iter().filter(|of_point| of_point.len() > 1).flatten().collect())
}

/// The logarithms of the gains of a channel, and the median differences of the sights without and with them.
///
/// A value at its end says only that the colour is at least so bright. So it counts only where gain and colour say that it is darker.
fn gains(sights: &[PointColor], channel: usize, views: usize) -> (Vec<f64>, f64, f64) {
    let points = sights.last().map_or(0, |last| last.point + 1);
    let log = |sight: &PointColor| sight.log[channel].min(BRIGHTEST.ln());
    let counts = |sight: &PointColor, gain: f64, color: f64| log(sight).min(gain + color) < BRIGHTEST.ln() - 1e-9;
    let colors = |gains: &[f64], before: &[f64]| -> Vec<f64> {
        // The sum and the number of the sights that count, and the brightest of all.
        let mut sums = vec![(0.0, 0.0, f64::NEG_INFINITY); points];
        for sight in sights {
            let (gain, sum) = (gains[sight.view], &mut sums[sight.point]);
            let value = log(sight) - gain;
            let counted = if counts(sight, gain, before[sight.point]) { 1.0 } else { 0.0 };
            *sum = (sum.0 + counted * value, sum.1 + counted, value.max(sum.2));
        }
        sums.into_iter().map(|(sum, count, most)| if count > 0.0 { sum / count } else { most }).collect()
    };
    let mut by_view: Vec<Vec<&PointColor>> = vec![Vec::new(); views];
    sights.iter().for_each(|sight| by_view[sight.view].push(sight));
    // The residuals of the sights of a view that count.
    let left = |view: usize, gain: f64, colors: &[f64]| -> Vec<f64> {
        let counting = by_view[view].iter().filter(|sight| counts(sight, gain, colors[sight.point]));
        counting.map(|sight| log(sight) - gain - colors[sight.point]).collect()
    };
    let off = |gains: &[f64], colors: &[f64]| {
        median((0..views).flat_map(|view| left(view, gains[view], colors)).map(f64::abs).collect())
    };
    let mut gains = vec![0.0; views];
    let mut found = colors(&gains, &vec![f64::NEG_INFINITY; points]);
    let before = off(&gains, &found);
    for _ in 0..ROUNDS {
        for (view, gain) in gains.iter_mut().enumerate() {
            let left = left(view, *gain, &found);
            *gain += if left.len() >= FEWEST { median(left) } else { 0.0 };
        }
        let mean = gains.iter().sum::<f64>() / views as f64;
        gains.iter_mut().for_each(|gain| *gain -= mean);
        found = colors(&gains, &found);
    }
    let after = off(&gains, &found);
    (gains, before, after)
}

/// 0 of no values.
fn median(mut values: Vec<f64>) -> f64 {
    let half = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(half, f64::total_cmp).1 }
}
