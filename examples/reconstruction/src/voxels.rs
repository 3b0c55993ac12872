//! The voxel network to compare with: the same layers up to the code, then transposed convolutions to 32³ voxels. It learns
//! from the solids of the training objects, which the mesh network never sees.

use crate::bits::Bits;
use crate::network::{Trunk, pictures_tensor};
use crate::{VOXELS, fit_error};
use burn::module::Module;
use burn::nn::conv::{ConvTranspose3d, ConvTranspose3dConfig};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use softras::Result;

/// Voxels along the side of the first grid, from which three layers double it to 32.
const FIRST: usize = VOXELS / 8;

/// The network that sees voxels.
#[derive(Module, Debug)]
pub struct VoxelNetwork {
    trunk: Trunk,
    first: Linear,
    layers: Vec<ConvTranspose3d>,
}

impl VoxelNetwork {
    /// Random weights; about as many as a [`super::network::Network`] of the same width has with colours.
    pub fn new(width: usize, device: &Device) -> Result<Self> {
        let trunk = Trunk::new(width, device)?;
        let channels = [6 * width, 3 * width, 2 * width, 1];
        let layer = |&[from, to]: &[usize; 2]| {
            let config = ConvTranspose3dConfig::new([from, to], [4; 3]).with_stride([2; 3]).with_padding([1; 3]);
            config.init(device)
        };
        Ok(Self {
            trunk,
            first: LinearConfig::new(Trunk::code(width), channels[0] * FIRST.pow(3)).init(device),
            layers: channels.array_windows().map(layer).collect(),
        })
    }

    /// The logits `[pictures, 32³]` of each voxel's being inside, in the order of the official data.
    pub fn forward(&self, pictures: Tensor<4>) -> Tensor<2> {
        let flat = self.first.forward(self.trunk.forward(pictures).0);
        let [count, length] = flat.dims();
        let mut grid: Tensor<5> = flat.reshape([count, length / FIRST.pow(3), FIRST, FIRST, FIRST]);
        for layer in &self.layers {
            grid = layer.forward(relu(grid));
        }
        grid.flatten(1, 4)
    }

    /// The solids in pictures, on the device of the weights: every voxel that is more likely inside than outside.
    pub fn solids(&self, pictures: &[&[u8]], device: &Device) -> Result<Vec<Bits>> {
        let logits = self.forward(pictures_tensor(pictures.iter().copied(), device)).try_into_vec_as::<f32>();
        let logits =
            logits.map_err(|e| fit_error(format!("the network's output cannot be read ({e})"), "report this"))?;
        Ok(logits.chunks_exact(VOXELS.pow(3)).map(|one| Bits::new(one.iter().map(|x| *x > 0.0))).collect())
    }
}

/// The mean over voxels of the binary cross entropy between logits `[pictures, 32³]` and solids.
pub fn cross_entropy<'a>(logits: Tensor<2>, solids: impl Iterator<Item = &'a Bits>) -> Tensor<1> {
    let inside: Vec<f32> = solids.flat_map(Bits::bytes).map(f32::from).collect();
    let inside = Tensor::<2>::from_data(TensorData::new(inside, logits.dims()), &logits.device());
    // -t log s(x) - (1 - t) log(1 - s(x)) for the logistic function s, without overflow.
    let far = logits.clone().abs().neg().exp().add_scalar(1.0).log();
    (relu(logits.clone()) - logits * inside + far).mean()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_entropy_is_that_of_the_formula() {
        let device = Device::flex();
        let inside: Vec<bool> = (0..VOXELS.pow(3)).map(|i| i % 3 == 0).collect();
        let solid = Bits::new(inside.iter().copied());
        let logits: Vec<f32> = (0..VOXELS.pow(3)).map(|i| (i % 97) as f32 * 0.2 - 9.0).collect();
        let expected = logits.iter().zip(&inside).map(|(&x, &inside)| {
            let share = 1.0 / (1.0 + (-f64::from(x)).exp());
            -if inside { share } else { 1.0 - share }.ln()
        });
        let expected = expected.sum::<f64>() / logits.len() as f64;
        let logits = Tensor::<2>::from_data(TensorData::new(logits, [1, VOXELS.pow(3)]), &device);
        let loss: f32 = cross_entropy(logits, [&solid].into_iter()).into_scalar();
        assert!((f64::from(loss) - expected).abs() < 1e-5 * expected, "{loss} and {expected}");
        // Far from 0 as well.
        let far = Tensor::<2>::full([1, VOXELS.pow(3)], 300.0, &device);
        let loss: f32 = cross_entropy(far, [&solid].into_iter()).into_scalar();
        assert!((loss - 200.0).abs() < 0.01, "{loss}");
    }
}
