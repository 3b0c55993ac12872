//! Counts the (pixel, triangle) pairs of a frame, which every implementation of the model has to compute.

use super::candidates::pixel_centre;
use super::fragment::coverage;
use super::frame::{Search, View};
use super::geometry::locate;
use super::{Parameters, Truncation};
use rayon::prelude::*;
use softras::{
    Result,
    scene::{Camera, Scene, Settings},
};

/// The pairs of a frame; a triangle that the near plane cuts into two pieces counts as two.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pairs {
    /// Triangles, or pieces of triangles, of all views.
    pub pieces: u64,
    /// For every pixel, `[batch, height, width]`, the number of pieces that are not dropped: the pixel is inside or D ≥ τ (or, for
    /// hard distances, they cover its centre).
    pub needed: Vec<u32>,
    /// Pixels in the boxes that the pieces' supports fit in, cut to the image.
    pub boxed: u64,
}

impl Pairs {
    /// The pairs of all pixels.
    pub fn total(&self) -> u64 {
        self.needed.iter().map(|&n| u64::from(n)).sum()
    }
}

/// Counts a frame's pairs, in f64.
///
/// # Errors
/// As [`super::render`].
pub fn pairs(scene: &Scene, cameras: &[Camera], settings: &Settings) -> Result<Pairs> {
    super::validate(scene, cameras, settings)?;
    let parameters = Parameters::new(scene, cameras, settings);
    let mut counts = Pairs { pieces: 0, needed: Vec::new(), boxed: 0 };
    for index in 0..cameras.len() {
        let view = View::new(scene, cameras, settings, Truncation::Tau, Search::Culled, &parameters, index);
        counts.pieces += view.pieces.len() as u64;
        counts.boxed += view.pieces.iter().map(|piece| boxed(&view, &piece.screen())).sum::<u64>();
        let rows = (0..settings.height as usize).into_par_iter();
        let row =
            |row: usize| (0..settings.width as usize).map(|column| needed(&view, row, column)).collect::<Vec<_>>();
        counts.needed.extend(rows.map(row).collect::<Vec<_>>().into_iter().flatten());
    }
    Ok(counts)
}

fn needed(view: &View<'_>, row: usize, column: usize) -> u32 {
    let centre = pixel_centre(view.knobs.settings, row, column);
    let kept = |&&i: &&u32| {
        let piece = &view.pieces[i as usize];
        coverage(&view.knobs, piece, &locate(&piece.screen(), centre, view.knobs.surface_point()), centre).is_some()
    };
    view.candidates.of(row, column).iter().filter(kept).count() as u32
}

/// Pixels whose centres lie in a triangle's box grown by the culling radius.
fn boxed(view: &View<'_>, corners: &[[f64; 2]; 3]) -> u64 {
    let settings = view.knobs.settings;
    let radius = if settings.distance == softras::scene::Distance::Euclidean { view.knobs.support.sqrt() } else { 0.0 };
    let sizes = [f64::from(settings.width), f64::from(settings.height)];
    let sides = [0, 1].map(|axis| {
        let values = corners.map(|c| c[axis]);
        let low = values.into_iter().fold(f64::INFINITY, f64::min) - radius;
        let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max) + radius;
        // Column (or row, from below) c has its centre at (2 c + 1 - size) / height.
        let index = |at: f64| (at * sizes[1] + sizes[axis] - 1.0) / 2.0;
        let (first, last) = (index(low).ceil().max(0.0), index(high).floor().min(sizes[axis] - 1.0));
        (last - first + 1.0).max(0.0)
    });
    (sides[0] * sides[1]) as u64
}
