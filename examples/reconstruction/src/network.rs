//! The network of the paper: convolutions and full layers, which move the vertices of a sphere and its centre, and colour them.

use crate::config::Coloring;
use crate::palette::Palette;
use crate::template::Template;
use crate::{SIZE, fit_error};
use burn::module::{Initializer, Module};
use burn::nn::conv::{Conv2d, Conv2dConfig};
use burn::nn::{BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d};
use burn::tensor::activation::{relu, sigmoid};
use burn::tensor::{Device, Tensor, TensorData};
use softras::scene::Appearance;
use softras::{Mesh, Result};

/// How far the centre moves for an output of 1.
const CENTER_RATE: f64 = 0.1;

/// The layers that every network begins with: from a picture to a code. All scale with the width of the first.
#[derive(Module, Debug)]
pub struct Trunk {
    convolutions: Vec<Conv2d>,
    norms: Vec<BatchNorm>,
    layers: Vec<Linear>,
}

impl Trunk {
    /// Random weights.
    pub fn new(width: usize, device: &Device) -> Result<Self> {
        if !(1..=256).contains(&width) {
            let fix = "use 1 to 256; the official network has 64";
            return Err(fit_error(format!("a network of width {width}"), fix));
        }
        let channels = [4, width, 2 * width, 4 * width];
        let convolution = |i: usize| {
            let config = Conv2dConfig::new([channels[i], channels[i + 1]], [5, 5]).with_stride([2, 2]);
            config.with_padding(PaddingConfig2d::Explicit(2, 2, 2, 2)).init(device)
        };
        let sizes = [4 * width * (SIZE / 8).pow(2), 16 * width, 16 * width, 8 * width, 16 * width, Self::code(width)];
        Ok(Self {
            convolutions: (0..3).map(convolution).collect(),
            norms: (0..3).map(|i| BatchNormConfig::new(channels[i + 1]).init(device)).collect(),
            layers: sizes.array_windows().map(|&[from, to]| LinearConfig::new(from, to).init(device)).collect(),
        })
    }

    /// The length of the code.
    pub fn code(width: usize) -> usize {
        32 * width
    }

    /// The codes `[pictures, length]` of pictures `[pictures, 4, 64, 64]`, RGBA in [0, 1], and the maps `[pictures, 2 × width,
    /// 16, 16]` of the second convolution.
    pub fn forward(&self, pictures: Tensor<4>) -> (Tensor<2>, Tensor<4>) {
        let convolved = |maps, i: usize| relu(self.norms[i].forward(self.convolutions[i].forward(maps)));
        let maps = convolved(convolved(pictures, 0), 1);
        let last = convolved(maps.clone(), 2).flatten(1, 3);
        (self.layers.iter().fold(last, |code, layer| relu(layer.forward(code))), maps)
    }
}

/// The network that sees a mesh.
#[derive(Module, Debug)]
pub struct Network {
    trunk: Trunk,
    center: Linear,
    offsets: Linear,
    /// For networks that give each vertex a colour of its own.
    colors: Option<Linear>,
    /// For networks that choose colours from the picture.
    palette: Option<Palette>,
    #[module(skip)]
    template: Template,
}

/// The shapes that the network sees in a batch of pictures.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// `[pictures, vertices, 3]`, within ±½.
    pub positions: Tensor<3>,
    /// `[pictures, vertices, 3]`, in [0, 1], for networks that see colours.
    pub colors: Option<Tensor<3>>,
}

impl Network {
    /// A network with random weights that gives nearly the sphere for every picture.
    pub fn new(width: usize, coloring: Option<Coloring>, device: &Device) -> Result<Self> {
        Self::of_template(width, coloring, Template::sphere()?, device)
    }

    /// A network with random weights that moves the vertices of a template.
    pub fn of_template(width: usize, coloring: Option<Coloring>, template: Template, device: &Device) -> Result<Self> {
        let trunk = Trunk::new(width, device)?;
        let vertices = template.mesh().positions().len();
        let small = Initializer::Uniform { min: -1e-3, max: 1e-3 };
        let code = Trunk::code(width);
        let last = |to: usize| LinearConfig::new(code, to).with_initializer(small.clone()).init(device);
        let (center, offsets) = (last(3), last(3 * vertices));
        let colors = (coloring == Some(Coloring::Vertices)).then(|| last(3 * vertices));
        let palette = (coloring == Some(Coloring::Palette)).then(|| Palette::new(code, 2 * width, vertices, device));
        Ok(Self { trunk, center, offsets, colors, palette, template })
    }

    /// Whether it sees colours.
    pub fn is_colored(&self) -> bool {
        self.colors.is_some() || self.palette.is_some()
    }

    /// The shapes in pictures `[pictures, 4, 64, 64]`, RGBA in [0, 1].
    pub fn forward(&self, pictures: Tensor<4>) -> Shapes {
        let (count, device) = (pictures.dims()[0], pictures.device());
        let (code, maps) = self.trunk.forward(pictures.clone());
        let rows = |flat: Tensor<2>| {
            let vertices = flat.dims()[1] / 3;
            flat.reshape([count, vertices, 3])
        };
        let center = rows(self.center.forward(code.clone()).mul_scalar(CENTER_RATE)).tanh();
        // Within ±1, and again within ±1 after the centre has moved.
        let around = self.template.moved(rows(self.offsets.forward(code.clone())), &device);
        let room = (around.clone() * center.clone()).neg() + around.clone();
        let less = around.clone() * center.clone() + around.clone();
        let positive = around.greater_elem(0.0);
        let positions = (less.mask_where(positive, room) + center).mul_scalar(0.5);
        let colors = match (&self.palette, &self.colors) {
            (Some(palette), _) => Some(palette.forward(pictures, code, maps)),
            (None, colors) => colors.as_ref().map(|colors| sigmoid(rows(colors.forward(code)))),
        };
        Shapes { positions, colors }
    }
}

/// Pictures of four planes of bytes as a tensor `[pictures, 4, 64, 64]`.
pub fn pictures_tensor<'a>(pictures: impl IntoIterator<Item = &'a [u8]>, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = pictures.into_iter().flatten().map(|&byte| f32::from(byte) / 255.0).collect();
    let count = values.len() / (4 * SIZE * SIZE);
    Tensor::from_data(TensorData::new(values, [count, 4, SIZE, SIZE]), device)
}

/// The meshes that a network sees in pictures, on the device of its weights.
pub fn meshes(network: &Network, pictures: &[&[u8]], device: &Device) -> Result<Vec<Mesh>> {
    let shapes = network.forward(pictures_tensor(pictures.iter().copied(), device));
    let host = |tensor: Tensor<3>| {
        let read = tensor.try_into_vec_as::<f32>();
        read.map_err(|e| fit_error(format!("the network's output cannot be read ({e})"), "report this"))
    };
    let (positions, colors) = (host(shapes.positions)?, shapes.colors.map(host).transpose()?);
    let template = network.template.mesh();
    let size = 3 * template.positions().len();
    let rows = |values: &[f32], i: usize| values[i * size..(i + 1) * size].as_chunks::<3>().0.to_vec();
    let one = |i: usize| {
        let mesh = Mesh::new(rows(&positions, i), template.triangles().to_vec())?;
        match &colors {
            Some(colors) => mesh.with_appearance(Appearance::VertexColors(rows(colors, i))),
            None => Ok(mesh),
        }
    };
    (0..pictures.len()).map(one).collect()
}
