//! The surface whose vertices a network moves.

use burn::tensor::activation::sigmoid;
use burn::tensor::{Device, Tensor, TensorData};
use softras::{Mesh, Result, shapes};

/// Subdivisions of the sphere: 642 vertices.
const SUBDIVISIONS: u32 = 3;
/// The radius of the sphere that a new network gives, as a share of the half size of the space that shapes lie in.
const RADIUS: f64 = 0.5;
/// The least number whose logit is taken, so that it is finite. Its logit is so low that offsets do not visibly move it.
const LEAST: f64 = 1e-30;

/// The surface whose vertices a network moves, and how its offsets move them.
#[derive(Clone, Debug)]
pub struct Template {
    mesh: Mesh,
    /// For each coordinate the logit that an offset is added to.
    logits: Vec<f32>,
    /// The sign of each coordinate, for vertices that keep it; none for vertices that may go anywhere.
    signs: Option<Vec<f32>>,
}

impl Template {
    /// A sphere of 642 vertices, each of which may go anywhere: a coordinate is 2 s(logit + offset) - 1, with s the logistic
    /// function.
    pub fn sphere() -> Result<Self> {
        let mesh = shapes::icosphere(SUBDIVISIONS)?;
        let logits =
            mesh.positions().as_flattened().iter().map(|&x| logit(0.5 + 0.5 * RADIUS * f64::from(x))).collect();
        Ok(Self { mesh, logits, signs: None })
    }

    /// The official network's: every vertex keeps its octant, since a coordinate is sign(x) s(logit(|x| / 2) + offset).
    pub fn official(mesh: Mesh) -> Self {
        let coordinates = mesh.positions().as_flattened().iter();
        let logits = coordinates.clone().map(|&x| logit(RADIUS * f64::from(x.abs()))).collect();
        let signs = coordinates.map(|&x| if x == 0.0 { 0.0 } else { x.signum() }).collect();
        Self { logits, signs: Some(signs), mesh }
    }

    /// The surface.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The vertices `[pictures, vertices, 3]`, within ±1, that offsets of that shape give.
    pub fn moved(&self, offsets: Tensor<3>, device: &Device) -> Tensor<3> {
        let constant =
            |values: &[f32]| Tensor::from_data(TensorData::new(values.to_vec(), [1, values.len() / 3, 3]), device);
        let shares = sigmoid(offsets + constant(&self.logits));
        match &self.signs {
            Some(signs) => shares * constant(signs),
            None => shares.mul_scalar(2.0).sub_scalar(1.0),
        }
    }
}

fn logit(share: f64) -> f32 {
    let share = share.clamp(LEAST, 1.0 - f64::EPSILON);
    (share / (1.0 - share)).ln() as f32
}
