//! Steps against a gradient.

/// Which way of stepping, with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Gradient descent with momentum: m ← μ m + g, x ← x - rate m.
    Sgd {
        /// μ, 0 to below 1.
        momentum: f64,
    },
    /// Adam (Kingma and Ba 2015): every parameter has its own pace.
    Adam {
        /// Decay of the mean of the gradient and of its square.
        betas: [f64; 2],
        /// Added to the root of the mean square.
        epsilon: f64,
    },
    /// Adam with one pace for all parameters, that of the largest (Nicolet et al. 2021, "AdamUniform"): the direction of
    /// the gradient stays, which a [`crate::fit::smoothing::Smoothing`] needs.
    UniformAdam {
        /// Decay of the mean of the gradient and of its square.
        betas: [f64; 2],
        /// Added to the root of the mean square.
        epsilon: f64,
    },
}

impl Method {
    /// Adam as it is usually meant: betas 0.9 and 0.999, ε 1e-8.
    pub const ADAM: Self = Self::Adam { betas: [0.9, 0.999], epsilon: 1e-8 };
}

/// An optimiser of a fixed number of parameters and what it remembers of their gradients.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimizer {
    method: Method,
    /// Mean (or momentum) of the gradient.
    first: Vec<f64>,
    /// Mean of its square; empty for SGD.
    second: Vec<f64>,
    steps: i32,
}

impl Optimizer {
    /// For so many parameters.
    pub fn new(method: Method, parameters: usize) -> Self {
        let second = if let Method::Sgd { .. } = method { 0 } else { parameters };
        Self { method, first: vec![0.0; parameters], second: vec![0.0; second], steps: 0 }
    }

    /// Moves the parameters against the gradient; those beyond the shorter of the two stay.
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64], rate: f64) {
        self.steps = self.steps.saturating_add(1);
        let each = parameters.iter_mut().zip(gradient).zip(&mut self.first);
        match self.method {
            Method::Sgd { momentum } => each.for_each(|((x, g), m)| {
                *m = momentum * *m + g;
                *x -= rate * *m;
            }),
            Method::Adam { betas: [b1, b2], epsilon } => {
                let [c1, c2] = [b1, b2].map(|b| 1.0 - b.powi(self.steps));
                each.zip(&mut self.second).for_each(|(((x, g), m), v)| {
                    *m = b1 * *m + (1.0 - b1) * g;
                    *v = b2 * *v + (1.0 - b2) * g * g;
                    *x -= rate * (*m / c1) / ((*v / c2).sqrt() + epsilon);
                });
            }
            Method::UniformAdam { betas: [b1, b2], epsilon } => {
                let [c1, c2] = [b1, b2].map(|b| 1.0 - b.powi(self.steps));
                let mut largest = 0.0f64;
                for (v, g) in self.second.iter_mut().zip(gradient) {
                    *v = b2 * *v + (1.0 - b2) * g * g;
                    largest = largest.max(*v);
                }
                let pace = rate / c1 / ((largest / c2).sqrt() + epsilon);
                each.for_each(|((x, g), m)| {
                    *m = b1 * *m + (1.0 - b1) * g;
                    *x -= pace * *m;
                });
            }
        }
    }

    /// Forgets all gradients, as at the beginning.
    pub fn reset(&mut self) {
        self.first.fill(0.0);
        self.second.fill(0.0);
        self.steps = 0;
    }

    /// What it remembers, to be saved: steps taken, then the means.
    pub fn state(&self) -> (i32, &[f64], &[f64]) {
        (self.steps, &self.first, &self.second)
    }

    /// Takes up where a saved [`Optimizer::state`] left off; `false`, and nothing changed, when the sizes differ.
    pub fn restore(&mut self, steps: i32, first: &[f64], second: &[f64]) -> bool {
        let fits = first.len() == self.first.len() && second.len() == self.second.len();
        if fits {
            self.first.copy_from_slice(first);
            self.second.copy_from_slice(second);
            self.steps = steps;
        }
        fits
    }
}
