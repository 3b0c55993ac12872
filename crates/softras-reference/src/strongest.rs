//! The triangles that count most in each pixel.

use super::aggregate::score;
use super::candidates::pixel_centre;
use super::fragment::fragment;
use super::frame::{Search, View};
use super::geometry::locate;
use super::setup::Piece;
use super::{Parameters, Truncation};
use rayon::prelude::*;
use softras::Result;
use softras::scene::{Camera, Outputs, Scene, Settings};

/// The numbers of the triangles with the largest weights D exp(ζ/γ) in each pixel, the largest first, `[batch, height, width, count]`;
/// `None` behind the last. Triangles that the near plane cuts are left out. Textures count as opaque, and of the settings the
/// aggregations and the background do not matter.
///
/// # Errors
/// As [`super::render`].
pub fn strongest(scene: &Scene, cameras: &[Camera], settings: &Settings, count: usize) -> Result<Vec<Option<u32>>> {
    super::validate(scene, cameras, settings)?;
    let settings = Settings { outputs: Outputs { depth: true, ..Outputs::NOTHING }, ..settings.clone() };
    let parameters = Parameters::new(scene, cameras, &settings);
    let mut found = Vec::new();
    for index in 0..cameras.len() {
        let view = View::new(scene, cameras, &settings, Truncation::Tau, Search::Culled, &parameters, index);
        let row = |row: usize| {
            let pixels = (0..settings.width as usize).map(|column| of_pixel(&view, row, column, count));
            pixels.flatten().collect::<Vec<_>>()
        };
        let rows: Vec<_> = (0..settings.height as usize).into_par_iter().map(row).collect();
        found.extend(rows.into_iter().flatten());
    }
    Ok(found)
}

/// Whether the near plane left a triangle whole: its corners are those of the mesh.
fn is_whole(piece: &Piece<f64>) -> bool {
    piece.corners.iter().all(|corner| corner.original.contains(&1.0))
}

fn of_pixel(view: &View<'_>, row: usize, column: usize, count: usize) -> Vec<Option<u32>> {
    let knobs = &view.knobs;
    let centre = pixel_centre(knobs.settings, row, column);
    let of_piece = |&i: &u32| {
        let piece = view.pieces.get(i as usize).filter(|piece| is_whole(piece))?;
        let location = locate(&piece.screen(), centre, knobs.surface_point());
        let fragment = fragment(knobs, view.mesh, view.slots, &view.values, piece, &location, centre)?;
        Some((score(knobs, &fragment)?, piece.triangle as u32))
    };
    let mut scores: Vec<(f64, u32)> = view.candidates.of(row, column).iter().filter_map(of_piece).collect();
    scores.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    (0..count).map(|k| scores.get(k).map(|(_, triangle)| *triangle)).collect()
}
