//! The losses of the paper as functions of burn's tensors: the IoU of silhouettes, and the smoothness of a surface.

use burn::tensor::{Device, IndexingUpdateOp, Int, Tensor, TensorData};
use softras::Result;
use softras_fit::Topology;

/// Keeps the IoU of two empty silhouettes finite, and the flatten loss at flat or empty edges; the official code's number.
const EPSILON: f64 = 1e-6;

/// The mean over views of 1 - Σ P T / (Σ (P + T - P T) + 1e-6), for silhouettes `[views, height, width]` of one shape.
pub fn iou_loss(predicted: Tensor<3>, target: Tensor<3>) -> Tensor<1> {
    let [views, height, width] = predicted.dims();
    let sum = |image: Tensor<3>| image.reshape([views, height * width]).sum_dim(1);
    let both = predicted.clone() * target.clone();
    let either = predicted + target - both.clone();
    (sum(both) / (sum(either) + EPSILON)).neg().add_scalar(1.0).mean()
}

/// The smoothness losses of meshes with one triangulation, which keep the surface smooth where silhouettes say nothing.
#[derive(Clone, Debug)]
pub struct Smoothness {
    /// Both ends of every edge, each once as a vertex and once as its neighbour.
    vertices: Tensor<1, Int>,
    neighbors: Tensor<1, Int>,
    /// One over the vertex's number of neighbours, for each entry of `vertices`: `[1, entries, 1]`.
    shares: Tensor<3>,
    /// For each edge between two triangles its two ends and the third vertices of both.
    flaps: [Tensor<1, Int>; 4],
}

impl Smoothness {
    /// For meshes of this many vertices with these triangles, on the device of their positions.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for an index out of range.
    pub fn new(vertices: usize, triangles: &[[u32; 3]], device: &Device) -> Result<Self> {
        let topology = Topology::new(vertices, triangles)?;
        let indices = |values: Vec<u32>| {
            let (values, count): (Vec<i32>, _) = (values.iter().map(|&i| i as i32).collect(), values.len());
            Tensor::<1, Int>::from_data(TensorData::new(values, [count]), device)
        };
        let mut pairs: Vec<[u32; 2]> = topology.edges().iter().flat_map(|&[a, b]| [[a, b], [b, a]]).collect();
        // A vertex without neighbours is its own, so that its offset is 0.
        pairs.extend((0..vertices as u32).filter(|&i| topology.neighbors(i as usize).is_empty()).map(|i| [i, i]));
        let share = |pair: &[u32; 2]| 1.0 / topology.neighbors(pair[0] as usize).len().max(1) as f32;
        let shares: Vec<f32> = pairs.iter().map(share).collect();
        let flaps: Vec<_> = topology.flaps().iter().filter(|flap| flap.official).collect();
        let corner = |of: fn(&softras_fit::Flap) -> u32| indices(flaps.iter().map(|flap| of(flap)).collect());
        Ok(Self {
            shares: Tensor::from_data(TensorData::new(shares, [1, pairs.len(), 1]), device),
            vertices: indices(pairs.iter().map(|p| p[0]).collect()),
            neighbors: indices(pairs.iter().map(|p| p[1]).collect()),
            flaps: [corner(|f| f.edge[0]), corner(|f| f.edge[1]), corner(|f| f.opposite[0]), corner(|f| f.opposite[1])],
        })
    }

    /// The mean over the batch of Σ |p_i - mean of its neighbours|², for positions `[batch, vertices, 3]`: the official
    /// Laplacian loss.
    pub fn laplacian(&self, positions: Tensor<3>) -> Tensor<1> {
        let batch = positions.dims()[0] as f64;
        let shares = positions.clone().select(1, self.neighbors.clone()) * self.shares.clone();
        let offsets = positions.select_assign(1, self.vertices.clone(), shares.neg(), IndexingUpdateOp::Add);
        (offsets.clone() * offsets).sum().div_scalar(batch)
    }

    /// The mean over the batch of Σ (1 + cos θ)² over edges, θ the angle between the two triangles there, π where they lie
    /// flat: the official flatten loss, with its small constants and over the edges that it lists.
    pub fn flatten(&self, positions: Tensor<3>) -> Tensor<1> {
        let batch = positions.dims()[0] as f64;
        let [from, to, left, right] = self.flaps.clone().map(|corner| positions.clone().select(1, corner));
        let edge = to - from.clone();
        let square = dot(edge.clone(), edge.clone()) + EPSILON;
        let across = |third: Tensor<3>| {
            let wing = third - from.clone();
            let length = (dot(wing.clone(), wing.clone()) + EPSILON).sqrt();
            let along = dot(edge.clone(), wing.clone());
            let cosine = along.clone() / (square.clone().sqrt() * length.clone() + EPSILON);
            let sine = (cosine.clone() * cosine).neg().add_scalar(1.0 + EPSILON).sqrt();
            (wing - edge.clone() * (along / square.clone()), length * sine)
        };
        let ((left, left_length), (right, right_length)) = (across(left), across(right));
        let cosine = dot(left, right) / (left_length * right_length + EPSILON) + 1.0;
        (cosine.clone() * cosine).sum().div_scalar(batch)
    }
}

/// The dot products of vectors along the last dimension, which stays with length 1.
fn dot(a: Tensor<3>, b: Tensor<3>) -> Tensor<3> {
    (a * b).sum_dim(2)
}
