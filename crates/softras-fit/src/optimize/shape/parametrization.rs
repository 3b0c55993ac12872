//! Parametrizations: how the numbers that an optimiser moves give vertex positions, and gradients the other way.

use crate::bad;
use crate::mesh::topology::Topology;
use crate::optimize::smoothed_parameters::Smoothing;
use glam::DVec3;
use softras::Result;

/// The parameters that the optimiser of a shape fit moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Parametrization {
    /// The vertex positions themselves.
    Vertices,
    /// That of the official demo: a displacement d of each vertex in logit space and a common centre c, for templates
    /// within (-1, 1). With y = sigmoid(logit|v| + d) sign(v) and t = tanh(c), a vertex is y (1 - t) + t where y ≥ 0
    /// and y (1 + t) + t where y < 0. A coordinate never changes its sign about the centre or leaves (-1, 1).
    Logit,
    /// u = (I + λ L) x for positions x and the mesh's graph Laplacian L (Nicolet et al. 2021): a step moves
    /// neighbouring vertices together. Use it with [`Method::UniformAdam`](crate::Method::UniformAdam).
    Smoothed {
        /// λ, usually 10 to 50; 0 smooths nothing.
        lambda: f64,
    },
}

/// A parametrization of one mesh.
#[derive(Clone, Debug)]
pub enum Parameters {
    /// The positions themselves.
    Vertices,
    /// Displacements of the template in logit space, and a centre.
    Logit { template: Vec<DVec3> },
    /// Smoothed positions.
    Smoothed(Box<Smoothing>),
}

impl Parameters {
    /// The parametrization, and the parameters that give the template.
    pub fn new(kind: Parametrization, topology: &Topology, template: &[DVec3]) -> Result<(Self, Vec<f64>)> {
        let flat = |vectors: &[DVec3]| vectors.iter().flat_map(|v| v.to_array()).collect::<Vec<f64>>();
        match kind {
            Parametrization::Vertices => Ok((Self::Vertices, flat(template))),
            Parametrization::Logit => {
                if let Some(i) = template.iter().position(|v| v.abs().max_element() >= 1.0) {
                    let what = format!("vertex {i} of the template is {}", template[i]);
                    return bad(
                        what,
                        "the logit parametrisation needs a template within (-1, 1): scale it, or use ShapeOptions::smooth()",
                    );
                }
                Ok((Self::Logit { template: template.to_vec() }, vec![0.0; 3 * template.len() + 3]))
            }
            Parametrization::Smoothed { lambda } => {
                let smoothing = Smoothing::new(topology, lambda)?;
                let values = flat(&smoothing.undo(template)?);
                Ok((Self::Smoothed(Box::new(smoothing)), values))
            }
        }
    }

    /// The positions.
    pub fn positions(&self, values: &[f64]) -> Result<Vec<DVec3>> {
        match self {
            Self::Vertices => Ok(vectors(values)),
            Self::Smoothed(smoothing) => {
                let mut positions = vectors(values);
                smoothing.apply(&mut positions)?;
                Ok(positions)
            }
            Self::Logit { template } => {
                let (displacements, centre) = values.split_at(3 * template.len());
                let one = |(&v, d): (&DVec3, DVec3)| {
                    DVec3::from_array([0, 1, 2].map(|k| logit_forward(v[k], d[k], centre[k].tanh()).0))
                };
                Ok(template.iter().zip(vectors(displacements)).map(one).collect())
            }
        }
    }

    /// dL by the parameters, from dL by the positions.
    pub fn pull(&self, values: &[f64], mut gradient: Vec<DVec3>) -> Result<Vec<f64>> {
        if let Self::Smoothed(smoothing) = self {
            smoothing.apply(&mut gradient)?;
        }
        let Self::Logit { template } = self else {
            return Ok(gradient.into_iter().flat_map(|g| g.to_array()).collect());
        };
        let (displacements, centre) = values.split_at(3 * template.len());
        let mut pulled = Vec::with_capacity(values.len());
        let mut by_centre = [0.0; 3];
        for (i, (v, g)) in template.iter().zip(&gradient).enumerate() {
            for k in 0..3 {
                let shift = centre[k].tanh();
                let (_, by_displacement, by_shift) = logit_forward(v[k], displacements[3 * i + k], shift);
                pulled.push(g[k] * by_displacement);
                by_centre[k] += g[k] * by_shift * (1.0 - shift * shift);
            }
        }
        pulled.extend(by_centre);
        Ok(pulled)
    }
}

/// A coordinate of the logit parametrization, and its derivatives by displacement and shift.
fn logit_forward(template: f64, displacement: f64, shift: f64) -> (f64, f64, f64) {
    if template == 0.0 {
        // The logit of 0 is -∞, so no displacement moves the coordinate.
        return (shift, 0.0, 1.0);
    }
    let (size, sign) = (template.abs(), template.signum());
    let share = 1.0 / (1.0 + (1.0 - size) / size * (-displacement).exp());
    let stretch = 1.0 - sign * shift;
    (sign * share * stretch + shift, sign * stretch * share * (1.0 - share), 1.0 - share)
}

fn vectors(values: &[f64]) -> Vec<DVec3> {
    values.chunks_exact(3).map(DVec3::from_slice).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The largest difference between the pulled gradient of Σ w·x and central differences.
    fn error(kind: Parametrization, factor: f64) -> f64 {
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]];
        let topology = Topology::new(4, &triangles).unwrap();
        let template = [[0.4, -0.3, 0.2], [-0.5, 0.1, 0.3], [0.2, 0.6, 0.0], [-0.1, -0.2, -0.7]].map(DVec3::from_array);
        let (parameters, mut values) = Parameters::new(kind, &topology, &template).unwrap();
        let restored = parameters.positions(&values).unwrap();
        assert!(restored.iter().zip(&template).all(|(a, b)| a.distance(*b) < 1e-12), "{restored:?}");
        values.iter_mut().enumerate().for_each(|(i, x)| *x += 0.1 * (i as f64).sin());
        let weights: Vec<DVec3> = (0..4).map(|i| DVec3::new(1.0, 0.5 * f64::from(i), -0.7)).collect();
        let loss = |values: &[f64]| -> f64 {
            parameters.positions(values).unwrap().iter().zip(&weights).map(|(x, w)| x.dot(*w)).sum()
        };
        let pulled = parameters.pull(&values, weights.clone()).unwrap();
        let mut worst = 0.0f64;
        for i in 0..values.len() {
            let at = |h: f64| {
                let mut moved = values.clone();
                moved[i] += h;
                loss(&moved)
            };
            worst = worst.max((factor * pulled[i] - (at(1e-5) - at(-1e-5)) / 2e-5).abs());
        }
        worst
    }

    #[test]
    fn gradients_are_pulled_through() {
        for kind in [Parametrization::Vertices, Parametrization::Logit, Parametrization::Smoothed { lambda: 3.0 }] {
            assert!(error(kind, 1.0) < 1e-8, "{kind:?}: {}", error(kind, 1.0));
            assert!(error(kind, 1.01) > 1e-3, "a wrong gradient of {kind:?} is not seen");
        }
    }

    #[test]
    fn a_template_beyond_the_box_is_refused() {
        let topology = Topology::new(1, &[]).unwrap();
        let far = Parameters::new(Parametrization::Logit, &topology, &[DVec3::new(0.0, 1.0, 0.0)]);
        assert!(far.is_err_and(|e| e.to_string().contains("within (-1, 1)")));
    }
}
