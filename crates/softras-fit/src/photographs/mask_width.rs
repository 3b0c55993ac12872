//! Masks that are wider than the object by some pixels in all views, as thresholds and dilation leave them.
//!
//! Outlines alone do not show it, since a larger object would have the same ones. Colours do: a point in front of the true surface has
//! another colour in each view.

use super::{exposure::disagreement, refine::settings, subject::Subject};
use crate::{
    signed_distance,
    solid::hull::{hull, views},
    work::{Stage, Work},
};
use softras::Result;
use softras_io::Views;

/// Views from which on a hull is near enough to the object.
const FEWEST: usize = 8;
/// The most pixels that masks are narrowed by, and the steps in which that is looked for.
const MOST: f64 = 6.0;
const STEPS: [f64; 2] = [0.5, 0.25];
/// Masks are narrowed if colours then differ by at most this share.
const MOST_LEFT: f64 = 0.8;
/// Samples of the hull for each pixel, so few that all samples around an outline tell how far from it they are, and the fewest and the
/// most of them along a side.
const SAMPLES: f64 = 0.6;
const LEAST: usize = 16;
const FINEST: usize = 112;

/// Tries several widths and takes the one whose hull makes the views' colours agree best. If they agree much better than before, it
/// narrows all masks by that width, with a note. Returns whether it did.
pub fn narrowed(subject: &mut Subject, work: &mut Work) -> Result<bool> {
    if subject.views.color.is_none() || subject.views.cameras.len() < FEWEST {
        return Ok(false);
    }
    work.begin(Stage::Masks, 0)?;
    let ((center, side), pixel) = (subject.cube(), subject.pixel);
    let Ok(pictures) = views(&subject.views, 1, &mut || work.goes_on()) else { return work.goes_on().map(|()| false) };
    let mut of_hull = |resolution: usize| hull(&pictures, center, side, resolution, 0.0, &mut || work.goes_on());
    let Ok(rough) = of_hull(LEAST) else { return work.goes_on().map(|()| false) };
    let extent = LEAST as f64 * rough.step / pixel;
    let samples = of_hull(((SAMPLES * extent) as usize).clamp(LEAST, FINEST))?;
    // The hull of narrower masks is where the samples are larger.
    let mut differ = |by: f64| -> Result<Option<f64>> {
        work.goes_on()?;
        let mut narrow = samples.clone();
        narrow.values.iter_mut().for_each(|x| *x -= (by * pixel) as f32);
        let Some(mesh) = narrow.mesh()? else { return Ok(None) };
        disagreement(&subject.views, &mesh, &settings(subject), work.renderer)
    };
    let Some(given) = differ(0.0)? else { return Ok(false) };
    let (mut best, mut by) = ((given, 0.0), 1.0);
    while by <= MOST
        && let Some(left) = differ(by)?
        && left < best.0
    {
        (best, by) = ((left, by), by + 1.0);
    }
    for step in STEPS {
        for by in [best.1 - step, best.1 + step].into_iter().filter(|by| *by > step) {
            best = differ(by)?.filter(|left| *left < best.0).map_or(best, |left| (left, by));
        }
    }
    let (left, by) = best;
    if by == 0.0 || left > MOST_LEFT * given {
        return Ok(false);
    }
    narrow(&mut subject.views, by)?;
    work.notes.push(format!(
        "the masks are wider than the object: narrowed by {by} pixels, the colours of the views differ by {left:.3} on their hull, before by \
         {given:.3}"
    ));
    work.goes_on().map(|()| true)
}

/// Takes `by` pixels off the masks' rims, and the colours there.
fn narrow(views: &mut Views, by: f64) -> Result<()> {
    let Some(silhouettes) = &mut views.silhouette else { return Ok(()) };
    let distances = signed_distance(silhouettes)?;
    let unit = 0.5 * silhouettes.height as f64;
    for (pixel, (value, distance)) in silhouettes.data.iter_mut().zip(&distances.data).enumerate() {
        let inside = (0.5 + f64::from(*distance) * unit - by).clamp(0.0, 1.0) as f32;
        if inside < *value {
            let color = views.color.as_mut().map(|color| &mut color.data[3 * pixel..3 * pixel + 3]);
            color.into_iter().flatten().for_each(|x| *x *= inside / *value);
            *value = inside;
        }
    }
    Ok(())
}
