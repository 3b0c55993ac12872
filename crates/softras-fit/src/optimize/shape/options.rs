//! The method of a shape fit, and the two that are known to work.

use super::parametrization::Parametrization;
use crate::{ImageLoss, Method, Regularizer};

/// The method of a shape fit.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeOptions {
    /// The parameters that the optimiser moves.
    pub parametrization: Parametrization,
    /// The optimisation method.
    pub method: Method,
    /// The loss of the silhouettes and its weight.
    pub silhouette: (ImageLoss, f64),
    /// The loss of the colours and its weight.
    pub color: (ImageLoss, f64),
    /// The loss of the depths, in world units, and its weight.
    pub depth: (ImageLoss, f64),
    /// The loss of the normals and its weight.
    pub normal: (ImageLoss, f64),
    /// Penalties with their weights.
    pub regularizers: Vec<(Regularizer, f64)>,
    /// Number of pixels rendered per target pixel along each side; their mean is compared. Use 2 or more for targets
    /// with antialiased outlines.
    pub samples: usize,
    /// Number of views that each step compares, cycling through all of them; 0 for all views in every step. The losses of a step
    /// are those of its views.
    pub views_per_step: usize,
    /// Whether vertices move.
    pub fit_positions: bool,
    /// Whether the mesh's colours (vertex colours or texels) are fitted too.
    pub fit_colors: bool,
}

impl ShapeOptions {
    /// The method of `softras fit`, for templates of any size and place: vertices that move with their neighbours (λ = 5) by
    /// Adam with one step size for all, the loss 1 - IoU, a Laplacian weight of 0.01 and a flatten weight of 0.00003. Step
    /// sizes from 4 % of the object's radius to 0.7 % are a good beginning, with σ from 1e-4 to 1e-5.
    pub fn smooth() -> Self {
        Self {
            parametrization: Parametrization::Smoothed { lambda: 5.0 },
            method: Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-8 },
            regularizers: vec![(Regularizer::Laplacian, 0.01), (Regularizer::Flatten, 3e-5)],
            ..Self::official()
        }
    }

    /// Replaces the weights of the Laplacian, flatten and normal consistency regularizers by those that are given.
    #[must_use]
    pub fn weighted(mut self, given: [Option<f64>; 3]) -> Self {
        let all = [Regularizer::Laplacian, Regularizer::Flatten, Regularizer::NormalConsistency];
        let own = |kind| self.regularizers.iter().find(|(other, _)| *other == kind).map_or(0.0, |(_, weight)| *weight);
        let weights = all.into_iter().zip(given).map(|(kind, given)| (kind, given.unwrap_or_else(|| own(kind))));
        self.regularizers = weights.filter(|(_, weight)| *weight > 0.0).collect();
        self
    }

    /// The method of the official demo: logit displacements, the loss 1 - IoU, a Laplacian weight of 0.03, a flatten
    /// weight of 0.0003, and Adam with betas 0.5 and 0.99 (the demo's rate is 0.01). For objects and templates around the
    /// origin, within (-1, 1); [`shapes::icosphere`](softras::shapes::icosphere), which reaches to ±1, begins at half its size as in
    /// the demo.
    pub fn official() -> Self {
        Self {
            parametrization: Parametrization::Logit,
            method: Method::Adam { betas: [0.5, 0.99], epsilon: 1e-8 },
            silhouette: (ImageLoss::NegativeIou, 1.0),
            color: (ImageLoss::L1, 1.0),
            depth: (ImageLoss::L1, 1.0),
            normal: (ImageLoss::L1, 1.0),
            regularizers: vec![(Regularizer::Laplacian, 0.03), (Regularizer::Flatten, 0.0003)],
            samples: 1,
            views_per_step: 0,
            fit_positions: true,
            fit_colors: false,
        }
    }
}
