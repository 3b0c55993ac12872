//! The colours of the paper: the network samples a palette from the picture, and every vertex mixes the palette.
//!
//! A colour of the palette is a weighted mean of the picture's pixels, and a vertex's colour is a weighted mean of the
//! palette's; both kinds of weights are softmaxes, so that every colour lies between colours of the picture. The weight of a
//! pixel is α exp(q · f), where α is its alpha, f are the features of the block of 4×4 pixels that it is in, and q is what the
//! palette's colour looks for. Features are the maps of the second convolution there, and cosine waves that encode the place.

use crate::SIZE;
use burn::module::{Initializer, Module, Param};
use burn::nn::{Linear, LinearConfig};
use burn::tensor::activation::{relu, softmax};
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::AvgPoolOptions;
use burn::tensor::{Device, Tensor, TensorData};
use std::f64::consts::PI;

/// Colours of a palette.
const COLORS: usize = 8;
/// Blocks along a picture's side, as many as the maps of the second convolution have pixels.
const SIDE: usize = SIZE / 4;
const BLOCKS: usize = SIDE * SIDE;
/// Waves along each side, of one half period to as many half periods.
const WAVES: usize = 4;
/// The alpha of blocks that the object is not in: their weight is next to nothing, and finite.
const LEAST_ALPHA: f64 = 1e-6;

/// The layers that choose the colours of a mesh's vertices.
#[derive(Module, Debug)]
pub struct Palette {
    /// The part of each query q that is the same for all pictures: `[1, colours × features]`. The colours begin apart, since
    /// vertices could not tell equal ones from each other.
    queries: Param<Tensor<2>>,
    /// The part of each query that depends on the code of the picture.
    by_code: Linear,
    hidden: Linear,
    selection: Linear,
}

impl Palette {
    /// Random weights, for codes of length `code`, maps of `channels` channels, and meshes of `vertices` vertices.
    pub fn new(code: usize, channels: usize, vertices: usize, device: &Device) -> Self {
        let features = channels + 2 * WAVES;
        let uniform = |most: f64| Initializer::Uniform { min: -most, max: most };
        let hidden = code / 4;
        Self {
            queries: uniform(1.0).init([1, COLORS * features], device),
            by_code: LinearConfig::new(code, COLORS * features).with_bias(false).init(device),
            hidden: LinearConfig::new(code, hidden).init(device),
            selection: LinearConfig::new(hidden, COLORS * vertices).with_initializer(uniform(1e-3)).init(device),
        }
    }

    /// The colours `[pictures, vertices, 3]` of the vertices, in [0, 1], for pictures `[pictures, 4, 64, 64]`, their codes, and
    /// their maps `[pictures, channels, 16, 16]`.
    pub fn forward(&self, pictures: Tensor<4>, code: Tensor<2>, maps: Tensor<4>) -> Tensor<3> {
        let blocks = Blocks::new(pictures);
        let palette = self.sampling(&blocks, code.clone(), maps).matmul(blocks.colors);
        self.mixing(code).matmul(palette)
    }

    /// The weight of each block in each colour of the palette: `[pictures, colours, blocks]`, of sum 1 over blocks.
    fn sampling(&self, blocks: &Blocks, code: Tensor<2>, maps: Tensor<4>) -> Tensor<3> {
        let [count, channels, ..] = maps.dims();
        let features = Tensor::cat(vec![maps.reshape([count, channels, BLOCKS]), waves(count, &code.device())], 1);
        let queries = self.queries.val() + self.by_code.forward(code);
        let queries = queries.reshape([count, COLORS, channels + 2 * WAVES]);
        softmax(queries.matmul(features) + blocks.log_alpha.clone(), 2)
    }

    /// The weight of each colour of the palette in each vertex: `[pictures, vertices, colours]`, of sum 1 over colours.
    fn mixing(&self, code: Tensor<2>) -> Tensor<3> {
        let logits = self.selection.forward(relu(self.hidden.forward(code)));
        let [count, length] = logits.dims();
        softmax(logits.reshape([count, length / COLORS, COLORS]), 2)
    }
}

/// Pictures in blocks of 4×4 pixels.
struct Blocks {
    /// The mean colour of the object in each block: `[pictures, blocks, 3]`.
    colors: Tensor<3>,
    /// The logarithm of each block's mean alpha: `[pictures, 1, blocks]`.
    log_alpha: Tensor<3>,
}

impl Blocks {
    fn new(pictures: Tensor<4>) -> Self {
        let count = pictures.dims()[0];
        let means = avg_pool2d(pictures, AvgPoolOptions::new([SIZE / SIDE; 2])).reshape([count, 4, BLOCKS]);
        let alpha = means.clone().narrow(1, 3, 1) + LEAST_ALPHA;
        // Pictures have their colours over black.
        let colors = (means.narrow(1, 0, 3) / alpha.clone()).clamp(0.0, 1.0);
        Self { colors: colors.swap_dims(1, 2), log_alpha: alpha.log() }
    }
}

/// The place of each block as cosine waves along both sides: `[pictures, waves, blocks]`.
fn waves(count: usize, device: &Device) -> Tensor<3> {
    let value =
        |wave: usize, at: usize| (PI * (wave % WAVES + 1) as f64 * (at as f64 + 0.5) / SIDE as f64).cos() as f32;
    let along = |wave: usize, block: usize| if wave < WAVES { block % SIDE } else { block / SIDE };
    let values = (0..2 * WAVES).flat_map(|wave| (0..BLOCKS).map(move |block| value(wave, along(wave, block))));
    let waves = TensorData::new(values.collect::<Vec<f32>>(), [1, 2 * WAVES, BLOCKS]);
    Tensor::<3>::from_data(waves, device).repeat_dim(0, count)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use burn::optim::{AdamConfig, GradientsParams};
    use burn::tensor::Distribution;

    const CODE: usize = 32;
    const CHANNELS: usize = 2;
    const VERTICES: usize = 10;
    const RED: [f32; 3] = [0.9, 0.2, 0.1];
    const BLUE: [f32; 3] = [0.1, 0.3, 0.8];

    /// A disc whose left half is red and whose right half is blue, the same for every picture.
    fn pictures(count: usize, device: &Device) -> Tensor<4> {
        let at = |plane: usize, x: usize, y: usize| {
            let inside = (x as f32 - 31.5).hypot(y as f32 - 31.5) < 24.0;
            let color = if x < SIZE / 2 { RED } else { BLUE };
            if !inside { 0.0 } else { color.get(plane).copied().unwrap_or(1.0) }
        };
        let values = (0..4 * SIZE * SIZE).map(|i| at(i / (SIZE * SIZE), i % SIZE, i / SIZE % SIZE));
        let one = TensorData::new(values.collect::<Vec<f32>>(), [1, 4, SIZE, SIZE]);
        Tensor::<4>::from_data(one, device).repeat_dim(0, count)
    }

    /// A new palette, and codes and maps of two pictures that differ.
    fn given(device: &Device) -> (Palette, Tensor<2>, Tensor<4>) {
        device.seed(4);
        let random = Distribution::Uniform(0.0, 1.0);
        let maps = Tensor::random([2, CHANNELS, SIDE, SIDE], random, device);
        (Palette::new(CODE, CHANNELS, VERTICES, device), Tensor::random([2, CODE], random, device), maps)
    }

    fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
        tensor.try_into_vec_as().unwrap()
    }

    #[test]
    fn weights_sum_to_one_and_leave_out_what_is_transparent() {
        let device = Device::flex();
        let (palette, code, maps) = given(&device);
        let blocks = Blocks::new(pictures(2, &device));
        let sampling = palette.sampling(&blocks, code.clone(), maps);
        assert_eq!(sampling.dims(), [2, COLORS, BLOCKS]);
        let mixing = palette.mixing(code);
        assert_eq!(mixing.dims(), [2, VERTICES, COLORS]);
        for sum in [values(sampling.clone().sum_dim(2)), values(mixing.sum_dim(2))].concat() {
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        }
        // The first block is outside of the disc.
        let corner = values(sampling.clone().narrow(2, 0, 1));
        assert!(corner.iter().all(|weight| *weight < 1e-4), "{corner:?}");
        // Colours of the palette look at different places from the beginning.
        let [first, second] = [0, 1].map(|color| values(sampling.clone().narrow(1, color, 1)));
        let apart: f32 = first.iter().zip(&second).map(|(a, b)| (a - b).abs()).sum();
        assert!(apart > 0.1, "{apart}");
    }

    #[test]
    fn two_flat_colors_give_colors_between_them() {
        let device = Device::flex();
        let (palette, code, maps) = given(&device);
        let colors = values(palette.forward(pictures(2, &device), code.clone(), maps.clone()));
        assert_eq!(colors.len(), 2 * VERTICES * 3);
        for color in colors.as_chunks::<3>().0 {
            let shares = [0, 1, 2].map(|k| (color[k] - BLUE[k]) / (RED[k] - BLUE[k]));
            assert!(shares.iter().all(|share| (-1e-3..=1.001).contains(share)), "{color:?}");
            assert!(shares.iter().all(|share| (share - shares[0]).abs() < 1e-3), "{color:?}");
        }
        let nothing = values(palette.forward(Tensor::zeros([2, 4, SIZE, SIZE], &device), code, maps));
        assert!(nothing.iter().all(|x| *x == 0.0), "{nothing:?}");
    }

    #[test]
    fn vertices_learn_which_color_is_theirs() {
        let device = Device::flex().autodiff();
        let (mut palette, code, maps) = given(&device);
        let colors: Vec<f32> = (0..2 * VERTICES).flat_map(|i| if i % 2 == 0 { RED } else { BLUE }).collect();
        let target = Tensor::<3>::from_data(TensorData::new(colors, [2, VERTICES, 3]), &device);
        let mut optimizer = AdamConfig::new().init();
        let loss = |palette: &Palette| {
            let colors = palette.forward(pictures(2, &device), code.clone(), maps.clone());
            (colors - target.clone()).abs().mean()
        };
        for _ in 0..60 {
            let gradients = GradientsParams::from_grads(loss(&palette).backward(), &palette);
            palette = optimizer.step(3e-2, palette, gradients);
        }
        // The loss of one colour for all vertices, the best of them.
        let one: f32 = (0..3).map(|k| (RED[k] - BLUE[k]).abs() / 6.0).sum();
        let learned: f32 = loss(&palette).into_scalar();
        assert!(learned < 0.1 * one, "{learned} of {one}");
    }
}
