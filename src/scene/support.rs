//! Where the support of a triangle ends.

use super::{Background, Camera, ColorAggregation, Projection, Scene, Settings};
use crate::error::{Error, Result};

/// What τ promises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Support {
    /// A pair outside its triangle with D < τ is dropped, as by SoftRas and PyTorch3D: d² ≥ σ ln(1/τ - 1). Dropping n
    /// pairs changes the silhouette by at most n τ. Colour it may change altogether: a dropped triangle that is nearer
    /// than all others would have won the softmax, however small its D.
    #[default]
    Probability,
    /// The same for every image: the radius grows to d² ≥ σ (ln(1/τ - 1) + Δζ/γ), Δζ the most by which a depth score of
    /// this frame exceeds what else its pixel may show. Dropping n pairs changes no image by more than n τ of its range
    /// (1 for colours and backgrounds in [0, 1], `far` for depth, 2 for normals). Exact and slower; see
    /// [`Settings::cutoff_of`] for how far it reaches.
    Guaranteed,
}

impl Settings {
    /// The culling radius squared in units of σ, for what these cameras see: d² ≥ σ · cutoff is dropped.
    ///
    /// [`Support::Probability`]: c(τ) = ln(1/τ - 1) = [`Settings::cutoff`]. [`Support::Guaranteed`], where an image is
    /// mixed by depth (softmax; hard images and silhouettes are within τ already):
    ///
    /// - [`Background::Weighted`]: c(τ) + Δζ/γ with Δζ = max(0, ζ of the nearest vertex - ε). The background is always
    ///   there, so a dropped pair weighs w ≤ D exp((ζ - ε)/γ), which is below τ.
    /// - [`Background::Composite`]: c(τ/2) + Δζ/γ with Δζ the difference of the depth scores of the nearest and the
    ///   farthest vertex. There A ≤ ΣD, so a dropped pair's part A w' of the mixture is at most D exp(Δζ/γ), below τ/2;
    ///   the other half is for the change of A.
    ///
    /// Vertices nearer than `near` count as at `near`, those beyond `far` as at `far`. So a radius of r pixels without
    /// depth grows by the factor √(1 + Δζ / (γ c)): keep near and far close around the scene, and γ large.
    pub fn cutoff_of(&self, scene: &Scene, cameras: &[Camera]) -> f64 {
        let mixed = self.outputs.color || self.outputs.depth || self.outputs.normal;
        if self.support == Support::Probability || !mixed || self.color == ColorAggregation::Hard {
            return self.cutoff();
        }
        let spread = |(view, camera): (usize, &Camera)| {
            let [nearest, farthest] = self.depth_scores(scene, view, camera)?;
            Some(match self.background {
                Background::Weighted => nearest - self.epsilon,
                Background::Composite => nearest - farthest,
            })
        };
        let most = cameras.iter().enumerate().filter_map(spread).fold(0.0, f64::max);
        let tau = match self.background {
            Background::Weighted => self.tau,
            Background::Composite => self.tau / 2.0,
        };
        // A billionth for rounding.
        (1.0 / tau - 1.0).ln() + most * (1.0 + 1e-9) / self.gamma
    }

    /// ζ of the nearest and of the farthest vertex that a camera sees, cut to [near, far]; none where it sees nothing.
    fn depth_scores(&self, scene: &Scene, view: usize, camera: &Camera) -> Option<[f64; 2]> {
        let row = match camera.projection() {
            Projection::Screen => [0.0, 0.0, 1.0, 0.0],
            _ => camera.view()[2],
        };
        let depth = |p: &[f32; 3]| (0..3).map(|k| row[k] * f64::from(p[k])).sum::<f64>() + row[3];
        let depths = scene.meshes.get(scene.mesh_of_view(view))?.positions().iter().map(depth);
        let [nearest, farthest] =
            depths.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)]);
        let score = |z: f64| (self.far - z.clamp(self.near, self.far)) / (self.far - self.near);
        (farthest >= self.near && nearest <= self.far).then(|| [score(nearest), score(farthest)])
    }

    /// Checks that the support fits the other settings.
    ///
    /// # Errors
    /// [`Error::Settings`] for a guarantee that the official quirks break.
    pub(super) fn validate_support(&self) -> Result<()> {
        if self.support == Support::Guaranteed && self.parity == super::Parity::Official {
            return Err(Error::Settings {
                field: "support",
                value: "guaranteed".into(),
                fix: "the official code's silhouette counts triangles that its colour does not: use parity model, or \
                       support probability"
                    .into(),
            });
        }
        Ok(())
    }
}
