//! Optimisers: gradient descent with momentum, Adam and AdamUniform.

/// An optimisation method with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Gradient descent with momentum: m ← μ m + g, x ← x - rate m.
    Sgd {
        /// μ, 0 to below 1.
        momentum: f64,
    },
    /// Adam (Kingma and Ba 2015): every parameter has its own step size.
    Adam {
        /// Decay of the running means of the gradient and of its square.
        betas: [f64; 2],
        /// Added to the root of the mean square.
        epsilon: f64,
    },
    /// Adam with the smallest step size of all parameters for each of them (Nicolet et al. 2021, "AdamUniform"). It
    /// keeps the direction of the mean gradient, which
    /// [`Parametrization::Smoothed`](crate::Parametrization::Smoothed) needs.
    UniformAdam {
        /// Decay of the running means of the gradient and of its square.
        betas: [f64; 2],
        /// Added to the root of the mean square.
        epsilon: f64,
    },
}

impl Method {
    /// Adam with its usual constants: betas 0.9 and 0.999, ε 1e-8.
    pub const ADAM: Self = Self::Adam { betas: [0.9, 0.999], epsilon: 1e-8 };
}

/// An optimiser of a fixed number of parameters, with the running means of their gradients.
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
    /// An optimiser for this number of parameters, before its first step.
    pub fn new(method: Method, parameters: usize) -> Self {
        let second = if let Method::Sgd { .. } = method { 0 } else { parameters };
        Self { method, first: vec![0.0; parameters], second: vec![0.0; second], steps: 0 }
    }

    /// Moves the parameters by one step against the gradient. If the lengths differ, parameters beyond the shorter one
    /// do not move.
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

    /// Steps taken.
    pub fn steps(&self) -> i32 {
        self.steps
    }

    /// Its state, to be saved: the number of steps taken, the mean gradient (or momentum), the mean square (empty for
    /// SGD).
    pub fn state(&self) -> (i32, Vec<f64>, Vec<f64>) {
        (self.steps, self.first.clone(), self.second.clone())
    }

    /// Continues from a saved [`Optimizer::state`]. Returns `false` and changes nothing when the sizes differ, and for
    /// numbers that no state has: a negative number of steps, a mean that is not finite, a mean square below 0.
    pub fn restore(&mut self, (steps, first, second): &(i32, Vec<f64>, Vec<f64>)) -> bool {
        let fits = first.len() == self.first.len()
            && second.len() == self.second.len()
            && *steps >= 0
            && first.iter().all(|x| x.is_finite())
            && second.iter().all(|x| x.is_finite() && *x >= 0.0);
        if fits {
            self.first.clone_from(first);
            self.second.clone_from(second);
            self.steps = *steps;
        }
        fits
    }
}
