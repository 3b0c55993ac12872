//! Frames in parts: several views, or one image in bands of rows, where the device or a limit of memory does not hold all at
//! once.

use softras::internals::in_parts;
use softras::{Camera, Error, Frame, Renderer, Result, Scene, Settings};
use std::ops::Range;

/// Renders one mesh from all cameras, as many at a time as can be.
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
    /// Every band but the last has a multiple of so many rows.
    pub unit: usize,
    /// Rows that are rendered above and below each band besides its own.
    pub margin: usize,
    /// The most units of a band.
    pub at_once: usize,
}

/// A band of an image.
pub struct Band<T> {
    /// What was rendered of the rows: those of the band and its margins.
    pub frame: T,
    /// The band's rows in the whole image.
    pub rows: Range<usize>,
    /// Rows of the frame above the band's own.
    pub above: usize,
}

/// Renders an image in bands from top to bottom: `render` is given the camera and the settings of each. `bands` keeps how large
/// they can be.
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
