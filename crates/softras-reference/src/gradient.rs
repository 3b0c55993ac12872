//! The reference's gradient: the code that renders its images, run over numbers that record their operations.
//!
//! Two stages keep the tapes short. First each pixel is recorded on a tape of its own whose leaves are the scalars of
//! the pieces that it visits, and their derivatives are summed over all pixels. Then the computation of the pieces from
//! the inputs is recorded once and propagated with those sums as seeds.

use super::aggregate::{Pixel, aggregate, shares};
use super::candidates::pixel_centre;
use super::fragment::{Knobs, coverage, fragment};
use super::frame::{Search, View};
use super::geometry::locate;
use super::parameters::{Leaves, Parameters, ReferenceGradients};
use super::setup::{Piece, pieces};
use super::tape::{self, Var};
use super::{GradientMode, Truncation, Upstream};
use rayon::prelude::*;
use softras::scene::{Camera, Outputs, Scene, Settings};

/// Rows are summed in this many groups, independent of the number of threads, so that every machine gets the same sums.
const BANDS: usize = 4;

/// The gradient of L = Σ upstream · image with respect to every input.
pub fn gradient(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    upstream: &Upstream,
    mode: GradientMode,
    parameters: &Parameters,
) -> ReferenceGradients {
    let settings = &Settings { outputs: upstream.outputs(), ..settings.clone() };
    let mut total = parameters.zeros_like();
    for index in 0..cameras.len() {
        let view = View::new(scene, cameras, settings, Truncation::Tau, Search::Culled, parameters, index);
        let from_pixels = pixel_stage(&view, upstream, mode, parameters, index);
        let (direct, to_pieces) = from_pixels.split_at(parameters.values().len());
        for (sum, value) in total.values_mut().iter_mut().zip(direct) {
            *sum += value;
        }
        setup_stage(scene, cameras, settings, parameters, index, to_pieces, total.values_mut());
    }
    total
}

/// ∂L by the inputs, followed by ∂L by the scalars of each piece, of one view; all others held fixed.
fn pixel_stage(
    view: &View<'_>,
    upstream: &Upstream,
    mode: GradientMode,
    parameters: &Parameters,
    index: usize,
) -> Vec<f64> {
    let (height, width) = (view.knobs.settings.height as usize, view.knobs.settings.width as usize);
    let size = parameters.values().len() + view.pieces.len() * Piece::<f64>::SCALARS;
    let bands = (0..BANDS).into_par_iter().map(|band| {
        let mut gradient = vec![0.0; size];
        for row in height * band / BANDS..height * (band + 1) / BANDS {
            for column in 0..width {
                let seed = upstream.pixel((index * height + row) * width + column);
                if !seed.is_zero() {
                    pixel(view, mode, parameters, [row, column], &seed, &mut gradient);
                }
            }
        }
        gradient
    });
    let mut sum = vec![0.0; size];
    for band in bands.collect::<Vec<_>>() {
        for (total, value) in sum.iter_mut().zip(band) {
            *total += value;
        }
    }
    sum
}

/// Records one pixel on the tape and adds its derivatives to `gradient`.
fn pixel(
    view: &View<'_>,
    mode: GradientMode,
    parameters: &Parameters,
    [row, column]: [usize; 2],
    seed: &Pixel<f64>,
    gradient: &mut [f64],
) {
    tape::clear();
    let source = Leaves(parameters.values());
    let knobs = Knobs::load(view.knobs.settings, view.knobs.support, mode, parameters, &source);
    let centre = pixel_centre(knobs.settings, row, column);
    let fragments = view.candidates.of(row, column).iter().filter_map(|&i| {
        let piece = &view.pieces[i as usize];
        // Dropped pairs need not be recorded.
        coverage(&view.knobs, piece, &locate(&piece.screen(), centre, view.knobs.surface_point()), centre)?;
        let start = parameters.values().len() + i as usize * Piece::<f64>::SCALARS;
        let piece = piece.map(|value, scalar| tape::leaf(value, start + scalar));
        let location = locate(&piece.screen(), centre, view.knobs.surface_point());
        fragment(&knobs, view.mesh, view.slots, &source, &piece, &location, centre)
    });
    let fragments: Vec<_> = fragments.collect();
    let values = aggregate(&knobs, &fragments, &shares(&knobs, &fragments), view.mesh.triangles().len());
    tape::propagate(values.scalars().into_iter().zip(seed.scalars()), gradient);
}

/// Records the computation of the pieces from the inputs and propagates the pieces' derivatives to the inputs.
fn setup_stage(
    scene: &Scene,
    cameras: &[Camera],
    settings: &Settings,
    parameters: &Parameters,
    index: usize,
    to_pieces: &[f64],
    gradient: &mut [f64],
) {
    tape::clear();
    let pieces: Vec<Piece<Var>> = pieces(scene, cameras, settings, parameters, index, &Leaves(parameters.values()));
    let scalars = pieces.iter().flat_map(|piece| piece.corners).flat_map(|corner| corner.scalars());
    tape::propagate(scalars.zip(to_pieces.iter().copied()), gradient);
}

impl Upstream {
    fn outputs(&self) -> Outputs {
        Outputs {
            color: self.d_color.is_some(),
            silhouette: self.d_silhouette.is_some(),
            depth: self.d_depth.is_some(),
            normal: self.d_normal.is_some(),
            features: false,
        }
    }

    /// The upstream gradient at a pixel, counted over the batch.
    fn pixel(&self, index: usize) -> Pixel<f64> {
        let one = |image: &Option<Vec<f64>>| image.as_ref().map_or(0.0, |image| image[index]);
        let three = |image: &Option<Vec<f64>>| {
            image.as_ref().map_or([0.0; 3], |image| std::array::from_fn(|k| image[3 * index + k]))
        };
        Pixel {
            color: three(&self.d_color),
            silhouette: one(&self.d_silhouette),
            depth: one(&self.d_depth),
            normal: three(&self.d_normal),
        }
    }
}
