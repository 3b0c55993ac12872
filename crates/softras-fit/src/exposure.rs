//! Gains by view and channel of photographs whose exposure or white balance differ.
//!
//! A point of the surface has one colour. So the logarithm of what a view shows of it is that of the colour and of the view's gain,
//! which are found by turns. What all gains have in common nobody can know: the mean of their logarithms is 0.

use crate::{
    points,
    seen::{Seen, normals},
    subject::Subject,
};
use glam::DVec3;
use softras::{Image, Mesh, Renderer, Result, Settings};

/// Vertices that are looked at, at most.
const POINTS: usize = 4000;
const ROUNDS: usize = 200;
/// A gain is told by at least so many points.
const FEWEST: usize = 20;
/// Values that say something: neither dark nor at their end.
const DARKEST: f64 = 0.01;
const BRIGHTEST: f64 = 0.98;
/// Gains are taken if one of them is at least this far from 1, by its logarithm, and what remains is at most this share.
const LEAST_GAIN: f64 = 0.05;
const MOST_LEFT: f64 = 0.8;

/// What a view shows of a point, by its logarithm.
struct Sight {
    point: usize,
    view: usize,
    log: DVec3,
}

/// Divides colours by the gains of their views where that makes them agree on a mesh near the object.
pub fn leveled(
    subject: &mut Subject,
    mesh: &Mesh,
    settings: &Settings,
    notes: &mut Vec<String>,
    renderer: &mut Renderer,
) -> Result<bool> {
    if subject.views.color.is_none() {
        return Ok(false);
    }
    let sights = sights(subject, mesh, settings, renderer)?;
    let count = subject.views.cameras.len();
    let (gains, before, after) = gains(&sights, count);
    let (low, high) = gains.iter().flat_map(|g| g.to_array()).fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
    if low.abs().max(high) < LEAST_GAIN || after > MOST_LEFT * before {
        return Ok(false);
    }
    let level = |image: &mut Image| {
        let pixels = image.height * image.width;
        for (pixel, i) in image.data.chunks_exact_mut(3).zip(0..) {
            let gain = (-gains[i / pixels]).exp();
            (0..3).for_each(|k| pixel[k] = (f64::from(pixel[k]) * gain[k]) as f32);
        }
    };
    let photographs = subject.photographs.as_mut().and_then(|views| views.color.as_mut());
    subject.views.color.as_mut().into_iter().chain(photographs).for_each(level);
    let [low, high] = [low, high].map(f64::exp);
    notes.push(format!("the pictures' exposures differ: colours are divided by gains of {low:.2} to {high:.2}"));
    Ok(true)
}

/// How much the colours of the views differ on a mesh: the mean, over points that several views see, of their standard deviation. `None`
/// where no point tells.
pub fn disagreement(
    subject: &Subject,
    mesh: &Mesh,
    settings: &Settings,
    renderer: &mut Renderer,
) -> Result<Option<f64>> {
    let sights = sights(subject, mesh, settings, renderer)?;
    let deviation = |sights: &[Sight]| {
        let (colors, count) = (sights.iter().map(|sight| sight.log.exp()), sights.len() as f64);
        let mean = colors.clone().sum::<DVec3>() / count;
        (colors.map(|color| (color - mean).length_squared()).sum::<f64>() / (count - 1.0)).sqrt()
    };
    let all: Vec<f64> = sights.chunk_by(|a, b| a.point == b.point).map(deviation).collect();
    Ok((all.len() >= FEWEST).then(|| all.iter().sum::<f64>() / all.len() as f64))
}

fn sights(subject: &Subject, mesh: &Mesh, settings: &Settings, renderer: &mut Renderer) -> Result<Vec<Sight>> {
    let seen = Seen::of(mesh, &subject.views, settings, renderer)?;
    let surface: Vec<(DVec3, DVec3)> = points(mesh).into_iter().zip(normals(mesh)).collect();
    let mut sights = Vec::new();
    for (point, (place, normal)) in surface.iter().step_by(surface.len().div_ceil(POINTS).max(1)).enumerate() {
        let log = |view: usize| {
            let (color, _) = seen.by(view, *place, *normal)?;
            let tells = color.min_element() > DARKEST && color.max_element() < BRIGHTEST;
            tells.then(|| Sight { point, view, log: color.map(f64::ln) })
        };
        let of_point: Vec<Sight> = (0..subject.views.cameras.len()).filter_map(log).collect();
        // One view alone always agrees with itself.
        if of_point.len() > 1 {
            sights.extend(of_point);
        }
    }
    Ok(sights)
}

/// The logarithms of the gains, and the median differences of the sights without and with them.
fn gains(sights: &[Sight], views: usize) -> (Vec<DVec3>, f64, f64) {
    let mut gains = vec![DVec3::ZERO; views];
    let mut by_view: Vec<Vec<&Sight>> = vec![Vec::new(); views];
    sights.iter().for_each(|sight| by_view[sight.view].push(sight));
    let colors = |gains: &[DVec3]| {
        let mut sums = vec![(DVec3::ZERO, 0.0); sights.last().map_or(0, |last| last.point + 1)];
        for sight in sights {
            let sum = &mut sums[sight.point];
            *sum = (sum.0 + sight.log - gains[sight.view], sum.1 + 1.0);
        }
        sums.into_iter().map(|(sum, count)| sum / f64::max(count, 1.0)).collect::<Vec<DVec3>>()
    };
    let off = |gains: &[DVec3]| {
        let colors = colors(gains);
        let one = |sight: &Sight| (sight.log - gains[sight.view] - colors[sight.point]).abs().element_sum();
        let mut all: Vec<f64> = sights.iter().map(one).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(0.0)
    };
    let before = off(&gains);
    for _ in 0..ROUNDS {
        let colors = colors(&gains);
        for (gain, sights) in gains.iter_mut().zip(&by_view).filter(|(_, sights)| sights.len() >= FEWEST) {
            let middle = |k: usize| {
                let mut all: Vec<f64> = sights.iter().map(|sight| sight.log[k] - colors[sight.point][k]).collect();
                let half = all.len() / 2;
                *all.select_nth_unstable_by(half, f64::total_cmp).1
            };
            *gain = DVec3::new(middle(0), middle(1), middle(2));
        }
        let mean = gains.iter().sum::<DVec3>() / views as f64;
        gains.iter_mut().for_each(|gain| *gain -= mean);
    }
    let after = off(&gains);
    (gains, before, after)
}
