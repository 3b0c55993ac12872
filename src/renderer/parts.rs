//! Frames in parts: several views, or one image in bands of rows, where the device or a limit of memory does not hold all at
//! once.

use crate::error::{Error, Result};
use crate::renderer::{Frame, Renderer};
use crate::scene::{Camera, Scene, Settings};
use std::ops::Range;

/// Makes `count` things in order, at most `at_once` of them at a time: `make` makes a range of them, and `take` takes what was
/// made. A range that is too large for the device is made in halves, and `at_once` is reduced for those that follow.
///
/// # Errors
/// The first of `make` that smaller parts do not avoid, or of `take`.
pub fn in_parts<T, E: From<Error>>(
    count: usize,
    at_once: &mut usize,
    mut make: impl FnMut(Range<usize>) -> Result<T>,
    mut take: impl FnMut(Range<usize>, T) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let mut done = 0;
    while done < count {
        let range = done..count.min(done.saturating_add((*at_once).max(1)));
        match make(range.clone()) {
            Ok(made) => {
                done = range.end;
                take(range, made)?;
            }
            Err(Error::Limit { .. } | Error::OutOfMemory { .. }) if range.len() > 1 => {
                *at_once = range.len().div_ceil(2)
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// Renders one mesh from all cameras, as many at a time as fit.
///
/// # Errors
/// As [`Renderer::render`], or of `take`, which takes the views' numbers and their frame.
pub fn in_batches(
    renderer: &mut Renderer,
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    take: impl FnMut(Range<usize>, Frame) -> Result<()>,
) -> Result<()> {
    let mut at_once = cameras.len();
    let render = |views: Range<usize>| renderer.render(scene, &cameras[views], settings);
    in_parts(cameras.len(), &mut at_once, render, take)
}

/// How an image is divided into bands.
#[derive(Clone, Copy, Debug)]
pub struct Bands {
    /// Every band but the last has a multiple of this many rows.
    pub unit: usize,
    /// Rows that are rendered above and below each band besides its own.
    pub margin: usize,
    /// The most units of a band.
    pub at_once: usize,
}

/// A band of an image.
#[derive(Clone, Debug)]
pub struct Band<T> {
    /// The rendered frame: the band's rows and its margins.
    pub frame: T,
    /// The band's rows in the whole image.
    pub rows: Range<usize>,
    /// Rows of the frame above the band's own.
    pub above: usize,
}

/// Renders an image in bands from top to bottom: `render` is given the camera and the settings of each. `bands.at_once`
/// is reduced when a band does not fit.
///
/// # Errors
/// As [`Settings::cropped`], or of `render` or `take`.
pub fn in_bands<T, E: From<Error>>(
    camera: &Camera,
    settings: &Settings,
    bands: &mut Bands,
    mut render: impl FnMut(&Camera, &Settings) -> Result<T>,
    mut take: impl FnMut(Band<T>) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let (height, Bands { unit, margin, .. }) = (settings.height as usize, *bands);
    let rows = |units: &Range<usize>| units.start * unit..height.min(units.end * unit);
    let band = |units: Range<usize>| {
        let rows = rows(&units);
        let (first, end) = (rows.start.saturating_sub(margin), height.min(rows.end + margin));
        let frame = if end - first == height {
            render(camera, settings)?
        } else {
            let rows = first as u32..end as u32;
            let (camera, settings) = settings.cropped(camera, 0..settings.width, rows)?;
            render(&camera, &settings)?
        };
        Ok(Band { frame, above: rows.start - first, rows })
    };
    in_parts(height.div_ceil(unit), &mut bands.at_once, band, |_, band| take(band))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn too_large() -> Error {
        Error::OutOfMemory { what: "it".into(), bytes: 1, fix: "less".into() }
    }

    #[test]
    fn parts_are_as_large_as_they_can_be_and_cover_everything() {
        for (count, holds) in [(0, 1), (1, 1), (10, 100), (10, 3), (11, 2), (64, 16)] {
            let (mut at_once, mut all, mut tries) = (usize::MAX, Vec::new(), 0);
            let make = |range: Range<usize>| {
                tries += 1;
                if range.len() > holds { Err(too_large()) } else { Ok(range.clone().collect::<Vec<_>>()) }
            };
            in_parts::<_, Error>(count, &mut at_once, make, |range, made| {
                assert!(made.len() == range.len() && 2 * made.len() >= holds.min(2) || range.end == count);
                all.extend(made);
                Ok(())
            })
            .unwrap();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
            assert!(tries <= 12 + 2 * count.div_ceil(holds), "{tries} tries for {count} by {holds}");
        }
    }

    #[test]
    fn what_smaller_parts_do_not_help_is_an_error() {
        let mut at_once = 8;
        let never = in_parts::<(), Error>(8, &mut at_once, |_| Err(too_large()), |_, _| Ok(()));
        assert!(matches!(never, Err(Error::OutOfMemory { .. })) && at_once == 1);
        let other = |_: Range<usize>| -> Result<()> { Err(Error::Scene { what: "no".into(), fix: "no".into() }) };
        let mut at_once = 8;
        assert!(matches!(in_parts::<_, Error>(8, &mut at_once, other, |_, _| Ok(())), Err(Error::Scene { .. })));
        assert_eq!(at_once, 8);
    }
}
