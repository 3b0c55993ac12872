//! The network of the paper: an encoder of convolutions, and a decoder that moves the vertices of a sphere and its centre.

use super::{SIZE, fit_error};
use burn::module::{Initializer, Module, ModuleVisitor, Param};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::{relu, sigmoid};
use burn::tensor::{Device, Tensor, TensorData};
use softras::{Mesh, Result, shapes};

/// Subdivisions of the sphere: 642 vertices.
const SUBDIVISIONS: u32 = 3;
/// The radius of the sphere that a new network gives, as a share of the half size of the space that shapes lie in.
const RADIUS: f64 = 0.5;
/// How far the centre moves for an output of 1.
const CENTER_RATE: f64 = 0.1;

/// The network. All layers scale with the width of the first.
#[derive(Module, Debug)]
pub struct Network {
    convolutions: Vec<Conv2d>,
    norms: Vec<BatchNorm>,
    encoder: Vec<Linear>,
    decoder: Vec<Linear>,
    center: Linear,
    offsets: Linear,
    colors: Option<Linear>,
}

/// What the network sees in a batch of pictures.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// `[pictures, vertices, 3]`, within ±½.
    pub positions: Tensor<3>,
    /// `[pictures, vertices, 3]`, in [0, 1], for networks that see colours.
    pub colors: Option<Tensor<3>>,
}

/// The sphere whose vertices the network moves.
///
/// # Errors
/// None: the sphere is always the same.
pub fn sphere() -> Result<Mesh> {
    shapes::icosphere(SUBDIVISIONS)
}

impl Network {
    /// A network with random weights that gives nearly the sphere for every picture.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a width outside 1 to 256.
    pub fn new(width: usize, color: bool, seed: u64, device: &Device) -> Result<Self> {
        if !(1..=256).contains(&width) {
            return fit_error(format!("a network of width {width}"), "use 1 to 256; the official network has 64");
        }
        device.seed(seed);
        let vertices = sphere()?.positions().len();
        let channels = [4, width, 2 * width, 4 * width];
        let convolution = |i: usize| {
            let config = Conv2dConfig::new([channels[i], channels[i + 1]], [5, 5]).with_stride([2, 2]);
            config.with_padding(PaddingConfig2d::Explicit(2, 2, 2, 2)).init(device)
        };
        let linear = |from: usize, to: usize| LinearConfig::new(from, to).init(device);
        let small = Initializer::Uniform { min: -1e-3, max: 1e-3 };
        let last = |to: usize| LinearConfig::new(32 * width, to).with_initializer(small.clone()).init(device);
        Ok(Self {
            convolutions: (0..3).map(convolution).collect(),
            norms: (0..3).map(|i| BatchNormConfig::new(channels[i + 1]).init(device)).collect(),
            encoder: vec![
                linear(4 * width * (SIZE / 8).pow(2), 16 * width),
                linear(16 * width, 16 * width),
                linear(16 * width, 8 * width),
            ],
            decoder: vec![linear(8 * width, 16 * width), linear(16 * width, 32 * width)],
            center: last(3),
            offsets: last(3 * vertices),
            colors: color.then(|| last(3 * vertices)),
        })
    }

    /// The shapes in pictures `[pictures, 4, 64, 64]`, RGBA in [0, 1].
    pub fn forward(&self, pictures: Tensor<4>, sphere: &Tensor<3>) -> Shapes {
        let count = pictures.dims()[0];
        let mut maps = pictures;
        for (convolution, norm) in self.convolutions.iter().zip(&self.norms) {
            maps = relu(norm.forward(convolution.forward(maps)));
        }
        let mut code: Tensor<2> = maps.flatten(1, 3);
        for layer in self.encoder.iter().chain(&self.decoder) {
            code = relu(layer.forward(code));
        }
        let rows = |flat: Tensor<2>| {
            let vertices = flat.dims()[1] / 3;
            flat.reshape([count, vertices, 3])
        };
        let center = rows(self.center.forward(code.clone()).mul_scalar(CENTER_RATE)).tanh();
        // Within ±1, and again within ±1 after the centre has moved.
        let around = sigmoid(rows(self.offsets.forward(code.clone())) + sphere.clone()).mul_scalar(2.0).sub_scalar(1.0);
        let room = (around.clone() * center.clone()).neg() + around.clone();
        let less = around.clone() * center.clone() + around.clone();
        let positive = around.greater_elem(0.0);
        let positions = (less.mask_where(positive, room) + center).mul_scalar(0.5);
        let colors = self.colors.as_ref().map(|colors| sigmoid(rows(colors.forward(code))));
        Shapes { positions, colors }
    }

    /// Whether all weights are finite.
    pub fn is_finite(&self) -> bool {
        struct Finite(bool);
        impl ModuleVisitor for Finite {
            fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
                let sum = param.val().abs().sum().try_into_vec_as::<f32>();
                self.0 &= sum.is_ok_and(|sum| sum.iter().all(|x| x.is_finite()));
            }
        }
        let mut finite = Finite(true);
        self.visit(&mut finite);
        finite.0
    }
}

/// The logits of the sphere's vertices, `[1, vertices, 3]`, as [`Network::forward`] takes them.
///
/// # Errors
/// None: the sphere is always the same.
pub fn sphere_logits(device: &Device) -> Result<Tensor<3>> {
    let sphere = sphere()?;
    let logit = |x: f32| {
        let share = 0.5 + 0.5 * RADIUS * f64::from(x);
        (share / (1.0 - share)).ln() as f32
    };
    let logits: Vec<f32> = sphere.positions().as_flattened().iter().map(|&x| logit(x)).collect();
    let vertices = sphere.positions().len();
    Ok(Tensor::from_data(TensorData::new(logits, [1, vertices, 3]), device))
}

/// Pictures of four planes of bytes as a tensor `[pictures, 4, 64, 64]`.
pub fn pictures_tensor<'a>(pictures: impl IntoIterator<Item = &'a [u8]>, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = pictures.into_iter().flatten().map(|&byte| f32::from(byte) / 255.0).collect();
    let count = values.len() / (4 * SIZE * SIZE);
    Tensor::from_data(TensorData::new(values, [count, 4, SIZE, SIZE]), device)
}
