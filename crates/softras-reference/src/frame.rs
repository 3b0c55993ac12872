//! Renders the reference's images, pixel by pixel.

use super::aggregate::{Pixel, aggregate, shares};
use super::candidates::{Candidates, pixel_centre};
use super::fragment::{Fragment, Knobs, coverage, fragment};
use super::geometry::{Location, locate};
use super::margin::Margin;
use super::parameters::{MeshSlots, Parameters, Values};
use super::setup::{Piece, pieces};
use super::texture::has_opacity;
use super::{GradientMode, ReferenceFrame, Truncation};
use rayon::prelude::*;
use softras::scene::{Camera, Mesh, Scene, Settings};

/// How a pixel finds its pieces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Every pixel visits every piece.
    BruteForce,
    /// Every pixel visits the pieces binned to its tile.
    Culled,
}

/// One view, ready for its pixels.
pub struct View<'a> {
    /// The mesh that the view shows.
    pub mesh: &'a Mesh,
    /// Where the mesh's inputs lie in the parameters.
    pub slots: &'a MeshSlots,
    /// All inputs.
    pub values: Values<'a>,
    /// The settings.
    pub knobs: Knobs<'a, f64>,
    /// The mesh's triangles, clipped and projected.
    pub pieces: Vec<Piece<f64>>,
    /// Which pieces each pixel visits.
    pub candidates: Candidates,
}

impl<'a> View<'a> {
    /// Transforms, clips and bins the mesh that `view` shows.
    pub fn new(
        scene: &'a Scene,
        cameras: &[Camera],
        settings: &'a Settings,
        truncation: Truncation,
        search: Search,
        parameters: &'a Parameters,
        view: usize,
    ) -> Self {
        let values = Values(parameters.values());
        let support = match truncation {
            Truncation::Tau => parameters.sigma() * settings.cutoff_of(scene, cameras),
            Truncation::None => f64::INFINITY,
        };
        let knobs = Knobs::load(settings, support, GradientMode::Exact, parameters, &values);
        let pieces = pieces(scene, cameras, settings, parameters, view, &values);
        let mesh = scene.mesh_of_view(view);
        let opaque = !has_opacity(scene.meshes[mesh].appearance());
        let candidates = match (search, truncation) {
            (Search::BruteForce, _) => Candidates::all(pieces.len()),
            (Search::Culled, Truncation::Tau) => Candidates::culled(settings, knobs.support, &pieces),
            (Search::Culled, Truncation::None) => Candidates::of_weight(&knobs, &pieces, opaque),
        };
        Self { mesh: &scene.meshes[mesh], slots: &parameters.layout().meshes[mesh], values, knobs, pieces, candidates }
    }

    /// A pixel's values and margin.
    fn pixel(&self, row: usize, column: usize) -> (Pixel<f64>, f64) {
        let knobs = &self.knobs;
        let centre = pixel_centre(knobs.settings, row, column);
        let mut margin = Margin::new();
        let mut fragments: Vec<Fragment<f64>> = Vec::new();
        let mut origins: Vec<(&Piece<f64>, Location<f64>)> = Vec::new();
        for &i in self.candidates.of(row, column) {
            let piece = &self.pieces[i as usize];
            let location = locate(&piece.screen(), centre, knobs.surface_point());
            margin.pair(knobs, piece, &location, centre);
            if coverage(knobs, piece, &location, centre).is_none() {
                continue;
            }
            margin.depth(knobs, piece, &location);
            if let Some(fragment) = fragment(knobs, self.mesh, self.slots, &self.values, piece, &location, centre) {
                fragments.push(fragment);
                origins.push((piece, location));
            }
        }
        let shares = shares(knobs, &fragments);
        for ((fragment, (piece, location)), &share) in fragments.iter().zip(&origins).zip(&shares.fragments) {
            margin.opacity(knobs, fragment);
            if let Some(point) = &fragment.surface {
                margin.seen(knobs, self.mesh.appearance(), piece, location, (fragment, point), share);
            }
        }
        (aggregate(knobs, &fragments, &shares, self.mesh.triangles().len()), margin.value())
    }
}

/// Renders all views at the given inputs.
pub fn frame(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    truncation: Truncation,
    search: Search,
    parameters: &Parameters,
) -> ReferenceFrame {
    let (batch, height, width) = (cameras.len(), settings.height as usize, settings.width as usize);
    let (color, silhouette, depth, normal, margin) = Default::default();
    let mut frame = ReferenceFrame { batch, height, width, color, silhouette, depth, normal, margin };
    for index in 0..batch {
        let view = View::new(scene, cameras, settings, truncation, search, parameters, index);
        let rows = (0..height).into_par_iter();
        let rows = rows.map(|row| (0..width).map(|column| view.pixel(row, column)).collect::<Vec<_>>());
        for (pixel, margin) in rows.collect::<Vec<_>>().into_iter().flatten() {
            frame.push(settings, &pixel, margin);
        }
    }
    frame
}

impl ReferenceFrame {
    fn push(&mut self, settings: &Settings, pixel: &Pixel<f64>, margin: f64) {
        let outputs = settings.outputs;
        if outputs.color {
            self.color.extend(pixel.color);
        }
        if outputs.silhouette {
            self.silhouette.push(pixel.silhouette);
        }
        if outputs.depth {
            self.depth.push(pixel.depth);
        }
        if outputs.normal {
            self.normal.extend(pixel.normal);
        }
        self.margin.push(margin);
    }
}
