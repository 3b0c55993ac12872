//! Solves (I + λ L) x = u on the device: by the dense inverse, or by Chebyshev's iteration.

use crate::error::Result;
use crate::fit::bad;
use crate::fit::shape::ShapeFit;
use crate::fit::topology::Topology;
use glam::DVec3;

/// Vertices up to which the dense inverse is used: one dispatch, where the iteration takes dozens.
const MOST_DENSE: usize = 1536;
/// The largest number of iterations; a λ that needs more is left to the host's exact solution.
const MOST_ITERATES: usize = 96;
/// The error of the iteration relative to its input.
const SMOOTHING_ERROR: f64 = 1e-2;

/// Chebyshev's iteration for one mesh and λ.
#[derive(Clone, Debug, PartialEq)]
pub struct Chebyshev {
    pub lambda: f32,
    pub relaxation: f32,
    /// ω of every iteration; their number is even.
    pub omegas: Vec<f32>,
}

/// How the smoothing is solved.
#[derive(Clone, Debug, PartialEq)]
pub enum Smoother {
    /// By multiplication with the dense inverse.
    Dense,
    /// By iteration.
    Iterated(Chebyshev),
}

impl Smoother {
    /// The solver for a mesh and λ; `None` where only the host's exact solution converges.
    pub fn new(lambda: f64, topology: &Topology) -> Option<Self> {
        if topology.vertices() <= MOST_DENSE {
            return Some(Self::Dense);
        }
        Chebyshev::new(lambda, topology).map(Self::Iterated)
    }
}

impl Chebyshev {
    /// The iteration for a mesh; `None` for a λ out of range or one that needs too many iterations.
    pub fn new(lambda: f64, topology: &Topology) -> Option<Self> {
        if !(0.0..=1e9).contains(&lambda) {
            return None;
        }
        let degree = |i: u32| topology.neighbors(i as usize).len();
        // The largest eigenvalue of L is at most the largest sum of the degrees of an edge's two ends (Anderson and
        // Morley 1985).
        let most = topology.edges().iter().map(|&[a, b]| degree(a) + degree(b)).max().unwrap_or(0);
        let (low, high) = (1.0, 1.0 + lambda * most as f64);
        let (middle, half) = (0.5 * (high + low), 0.5 * (high - low));
        let root = f64::sqrt(high / low);
        let quotient = (root - 1.0) / (root + 1.0);
        let steps = if quotient > 0.0 { (SMOOTHING_ERROR / 2.0).ln() / quotient.ln() } else { 1.0 };
        if steps.is_nan() || steps > MOST_ITERATES as f64 {
            return None;
        }
        let steps = (steps.ceil() as usize).max(1).next_multiple_of(2);
        let square = (half / middle).powi(2);
        let mut omega = 1.0;
        let mut omegas = Vec::with_capacity(steps);
        for step in 0..steps {
            omega = match step {
                0 => 1.0,
                1 => 2.0 / (2.0 - square),
                _ => 4.0 / (4.0 - square * omega),
            };
            omegas.push(omega as f32);
        }
        Some(Self { lambda: lambda as f32, relaxation: (1.0 / middle) as f32, omegas })
    }
}

/// The dense inverse of a fit's smoothing matrix, row by row, computed three columns at a time.
pub fn inverse(fit: &ShapeFit) -> Result<Vec<f32>> {
    let Some(smoothing) = fit.smoothing() else { return bad("no smoothing", "use the smoothed parametrisation") };
    let vertices = fit.topology().vertices();
    let mut inverse = vec![0.0; vertices * vertices];
    for first in (0..vertices).step_by(3) {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut columns = vec![DVec3::ZERO; vertices];
        axes.iter().zip(first..vertices).for_each(|(axis, column)| columns[column] = *axis);
        smoothing.apply(&mut columns)?;
        for (row, entries) in columns.iter().enumerate() {
            let entries = entries.to_array().into_iter().zip(first..vertices);
            // The computed inverse is symmetric only up to rounding; the lower half is used for both.
            entries.filter(|(_, column)| *column <= row).for_each(|(entry, column)| {
                inverse[row * vertices + column] = entry as f32;
                inverse[column * vertices + row] = entry as f32;
            });
        }
    }
    Ok(inverse)
}
