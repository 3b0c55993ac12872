//! Schedules: how σ, γ, the step size or another number changes in the course of a fit.

/// A number as a function of progress, 0 at the first step and 1 at the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Schedule {
    /// One value throughout.
    Constant(f64),
    /// From one value to another by equal factors; both above 0.
    Exponential {
        /// At progress 0.
        from: f64,
        /// At progress 1.
        to: f64,
    },
}

impl From<(f64, f64)> for Schedule {
    /// Goes from the first to the second value by one factor each step. Equal values give a constant.
    fn from((from, to): (f64, f64)) -> Self {
        if from == to { Self::Constant(from) } else { Self::Exponential { from, to } }
    }
}

impl Schedule {
    /// The value at a progress, which is clamped to [0, 1].
    pub fn at(self, progress: f64) -> f64 {
        let t = progress.clamp(0.0, 1.0);
        match self {
            Self::Constant(value) => value,
            Self::Exponential { from, to } => from * (to / from).powf(t),
        }
    }

    /// The value at `step`, counted from 0, of `steps`.
    pub fn at_step(self, step: usize, steps: usize) -> f64 {
        self.at(step as f64 / steps.saturating_sub(1).max(1) as f64)
    }
}
