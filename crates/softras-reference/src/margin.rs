//! The margin of a pixel: how far its inputs are from the nearest discontinuity of the model.
//!
//! The image is continuous in its inputs except at a few jumps, where a kernel's rounding may select the other side.
//! The margin is the smallest over the pixel's pairs of
//! - |d² / r² - 1| outside a triangle, r the culling radius (barycentric distance: m² / (σ ln(1/τ - 1)) for d² / r²,
//!   under official parity the larger of that and e / r for a pixel e outside the triangle's box);
//! - |z / far - 1|, under official parity |z / near - 1| too, for the pairs that are not dropped;
//! - with a hard colour, silhouette or distance, the distance to the triangle's border in pixels;
//! - with a hard colour, (z₂ - z₁) / z₁ of the two nearest covering triangles;
//! - with a hard colour or silhouette, |α - ½| of the pairs that cover the pixel, where a texture has an alpha;
//! - with a surface texture, how far R·b̂ is from a border of cells, for fragments whose share of the colour is above
//!   1e-6;
//!
//! and at most 1. It does not cover jumps of whole triangles (turning a back face to the camera, crossing the near
//! plane, degenerating), nor kinks, where only the derivative jumps.

use super::fragment::{Fragment, Knobs, Surface, box_excess, depth, smallest};
use super::geometry::Location;
use super::real::blend;
use super::setup::Piece;
use softras::scene::{Appearance, ColorAggregation, Distance, Interpolation, Parity, SilhouetteAggregation};

/// A fragment with a smaller weight than this shows no jump of its texture.
const VISIBLE_SHARE: f64 = 1e-6;

/// The margin of one pixel, updated pair by pair.
#[derive(Clone, Copy, Debug)]
pub struct Margin {
    least: f64,
    /// Depths of the two nearest covering fragments.
    nearest: [f64; 2],
}

impl Margin {
    /// The margin of a pixel without pairs.
    pub fn new() -> Self {
        Self { least: 1.0, nearest: [f64::INFINITY; 2] }
    }

    fn limit(&mut self, distance: f64) {
        self.least = self.least.min(distance.abs());
    }

    /// Counts the edges of a pair, dropped or not.
    pub fn pair(&mut self, knobs: &Knobs<'_, f64>, piece: &Piece<f64>, location: &Location<f64>, pixel: [f64; 2]) {
        let settings = knobs.settings;
        match (settings.distance, location.barycentrics) {
            (Distance::Euclidean, _) if !location.inside => self.limit(location.distance2 / knobs.support - 1.0),
            (Distance::Barycentric, Some(b)) if !location.inside => {
                let cut = smallest(b).powi(2) / knobs.support;
                let boxed = box_excess(&piece.screen(), pixel) / knobs.support.sqrt();
                // Either test drops the pair, so the jump lies where the larger of the two crosses 1.
                self.limit(if settings.parity == Parity::Official { cut.max(boxed) } else { cut } - 1.0);
            }
            _ => {}
        }
        let hard = settings.distance == Distance::Hard
            || settings.color == ColorAggregation::Hard
            || settings.silhouette == SilhouetteAggregation::Hard;
        if hard && location.barycentrics.is_some() {
            self.limit(location.distance2.sqrt() * f64::from(settings.height) / 2.0);
        }
    }

    /// Counts the depth of a pair that was not dropped for its distance.
    pub fn depth(&mut self, knobs: &Knobs<'_, f64>, piece: &Piece<f64>, location: &Location<f64>) {
        let z = depth(piece, location.sampled);
        self.limit(z / knobs.settings.far - 1.0);
        if knobs.settings.parity == Parity::Official {
            self.limit(z / knobs.settings.near - 1.0);
        }
    }

    /// Counts the opacity of a fragment, seen or not.
    pub fn opacity(&mut self, knobs: &Knobs<'_, f64>, fragment: &Fragment<f64>) {
        let settings = knobs.settings;
        let is_hard = settings.color == ColorAggregation::Hard || settings.silhouette == SilhouetteAggregation::Hard;
        if let Some(alpha) = fragment.opacity.filter(|_| is_hard && fragment.inside) {
            self.limit(alpha - 0.5);
        }
    }

    /// Counts a fragment that is seen, with its share of the colour.
    pub fn seen(
        &mut self,
        knobs: &Knobs<'_, f64>,
        appearance: &Appearance,
        piece: &Piece<f64>,
        location: &Location<f64>,
        (fragment, point): (&Fragment<f64>, &Surface<f64>),
        share: f64,
    ) {
        if knobs.settings.color == ColorAggregation::Hard && location.inside && fragment.is_solid() {
            let [first, second] = self.nearest;
            self.nearest = if point.z < first { [point.z, first] } else { [first, second.min(point.z)] };
            if self.nearest[1].is_finite() {
                self.limit(self.nearest[1] / self.nearest[0] - 1.0);
            }
        }
        if let Appearance::Surface { resolution, .. } = appearance
            && share > VISIBLE_SHARE
        {
            let weights = match knobs.settings.interpolation {
                Interpolation::Affine => location.sampled,
                Interpolation::Perspective => {
                    std::array::from_fn(|k| location.sampled[k] * point.z / piece.corners[k].z)
                }
            };
            self.limit(cell_border(*resolution, blend(weights, piece.corners.map(|c| c.original))));
        }
    }

    /// The result.
    pub fn value(&self) -> f64 {
        self.least
    }
}

/// How far R·b is from a border between cells. The triangle's own edges are none: b̂ is clamped onto them exactly.
fn cell_border(resolution: u32, b: [f64; 3]) -> f64 {
    let size = f64::from(resolution);
    let to_line = |b: f64| (b * size - (b * size).round().clamp(1.0, size - 1.0)).abs();
    // Lines of constant b₀, b₁ and b₂ = 1 - b₀ - b₁, the diagonals.
    if resolution == 1 { 1.0 } else { b.into_iter().map(to_line).fold(1.0, f64::min) }
}
