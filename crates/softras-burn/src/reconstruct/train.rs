//! Training from pairs of views: the shape that is seen in either view is rendered in both.

use super::checkpoint::{self, Status};
use super::data::Set;
use super::network::{Network, Shapes, pictures_tensor, sphere, sphere_logits};
use super::{SIZE, VIEWS, camera, fit_error};
use crate::{Inputs, Smoothness, SoftRas, Views, iou_loss};
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use softras::scene::{Appearance, Background, ColorAggregation, Distance, Outputs, SilhouetteAggregation};
use softras::{Camera, Mesh, Renderer, Result, Scene, Settings};
use softras_cli::random::Random;
use std::path::Path;

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Config {
    /// Channels of the first convolution; 64 in the official network.
    pub width: usize,
    /// Steps in all.
    pub steps: usize,
    /// Objects of a step, each seen in two views.
    pub pairs: usize,
    /// Adam's rate; × 0.3 after three fifths of the steps, as officially.
    pub rate: f64,
    /// σ of the renderings.
    pub sigma: f64,
    /// Weight of the Laplacian loss.
    pub laplacian: f64,
    /// Weight of the flatten loss.
    pub flatten: f64,
    /// Weight of the colour loss; 0 for a network of shapes alone.
    pub color: f64,
    /// Whether the images are hard, and their gradient that of an edge one pixel wide.
    pub hard: bool,
    /// Decides the first weights and the order of the pictures.
    pub seed: u64,
}

impl Config {
    /// Checks every number's range.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] naming the field.
    pub fn validate(&self) -> Result<()> {
        let counts = [("width", self.width, 256), ("steps", self.steps, 10_000_000), ("pairs", self.pairs, 1024)];
        if let Some((name, value, most)) = counts.into_iter().find(|(_, value, most)| !(1..=*most).contains(value)) {
            return fit_error(format!("{name} = {value}"), &format!("use 1 to {most}"));
        }
        let numbers = [
            ("rate", self.rate, 1e-9, 1.0),
            ("sigma", self.sigma, 1e-7, 1e-1),
            ("laplacian", self.laplacian, 0.0, 1e3),
            ("flatten", self.flatten, 0.0, 1e3),
            ("color", self.color, 0.0, 1e3),
        ];
        match numbers.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => {
                fit_error(format!("{name} = {value}"), &format!("use {low:e} to {high:e}"))
            }
            None => Ok(()),
        }
    }
}

/// The losses of a step, each before its weight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The step, from 1.
    pub step: usize,
    /// The weighted sum of all.
    pub loss: f32,
    /// 1 - IoU of the silhouettes.
    pub silhouette: f32,
    /// Mean absolute difference of the colours; 0 for networks without.
    pub color: f32,
    /// The Laplacian loss.
    pub laplacian: f32,
    /// The flatten loss.
    pub flatten: f32,
}

/// Objects of a step, by their index, each with two views.
struct Pairs(Vec<(usize, [usize; 2])>);

impl Pairs {
    fn draw(set: &Set, pairs: usize, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let one = |_| {
            let (object, first) = (random.below(set.objects.len()), random.below(VIEWS));
            (object, [first, (first + 1 + random.below(VIEWS - 1)) % VIEWS])
        };
        Self((0..pairs).map(one).collect())
    }

    /// The views, one of each pair after another, then the other of each.
    fn seen(&self) -> impl Iterator<Item = (usize, usize)> {
        [0, 1].into_iter().flat_map(|side| self.0.iter().map(move |(object, views)| (*object, views[side])))
    }

    /// The view that each of [`Pairs::seen`] is paired with.
    fn others(&self) -> impl Iterator<Item = (usize, usize)> {
        [1, 0].into_iter().flat_map(|side| self.0.iter().map(move |(object, views)| (*object, views[side])))
    }
}

/// A network in training.
pub struct Trainer {
    status: Status,
    network: Network,
    optimizer: ModuleOptimizer,
    softras: SoftRas,
    training: Constants,
    validation: Constants,
    template: Mesh,
    cameras: Vec<Camera>,
}

/// Tensors that no step changes, on one device.
#[derive(Debug)]
struct Constants {
    smoothness: Smoothness,
    logits: Tensor<3>,
    device: Device,
}

impl Constants {
    fn new(device: Device) -> Result<Self> {
        let sphere = sphere()?;
        let smoothness = Smoothness::new(sphere.positions().len(), sphere.triangles(), &device)?;
        Ok(Self { smoothness, logits: sphere_logits(&device)?, device })
    }
}

fn optimizer() -> ModuleOptimizer {
    AdamConfig::new().with_epsilon(1e-8).init()
}

impl Trainer {
    /// A new network.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for a number out of range.
    pub fn new(config: Config, renderer: Renderer) -> Result<Self> {
        config.validate()?;
        let device = Device::flex().autodiff();
        let network = Network::new(config.width, config.color > 0.0, config.seed, &device)?;
        Self::with(Status { config, step: 0, curve: Vec::new(), best: None }, network, optimizer(), renderer, device)
    }

    /// Goes on from a checkpoint, as if the training had never ended.
    ///
    /// # Errors
    /// As [`checkpoint::read`].
    pub fn resume(path: &Path, renderer: Renderer) -> Result<Self> {
        let device = Device::flex().autodiff();
        let (status, network, resumed) = checkpoint::read(path, &device, Some(optimizer()))?;
        Self::with(status, network, resumed.unwrap_or_else(optimizer), renderer, device)
    }

    fn with(
        status: Status,
        network: Network,
        optimizer: ModuleOptimizer,
        renderer: Renderer,
        device: Device,
    ) -> Result<Self> {
        let template = sphere()?;
        let template = if status.config.color > 0.0 {
            let white = vec![[1.0; 3]; template.positions().len()];
            template.with_appearance(Appearance::VertexColors(white))?
        } else {
            template
        };
        let [training, validation] = [device.clone(), device.inner()].map(Constants::new);
        let cameras = (0..VIEWS).map(camera).collect::<Result<_>>()?;
        let (softras, training, validation) = (SoftRas::new(renderer), training?, validation?);
        Ok(Self { status, network, optimizer, softras, training, validation, template, cameras })
    }

    /// What a checkpoint says: the configuration and the curve so far.
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// The number of the network's weights.
    pub fn weights(&self) -> usize {
        self.network.num_params()
    }

    /// Whether all steps are taken.
    pub fn is_done(&self) -> bool {
        self.status.step >= self.status.config.steps
    }

    /// Takes one step on some pairs of views of the set.
    ///
    /// # Errors
    /// As [`SoftRas::render`] and [`SoftRas::take_fault`]; [`softras::Error::Fit`] when the loss is not finite.
    pub fn step(&mut self, set: &Set) -> Result<Row> {
        let config = &self.status.config;
        let step = self.status.step as u64;
        let pairs = Pairs::draw(set, config.pairs, config.seed.wrapping_mul(0x9e37_79b9).wrapping_add(step << 20));
        let decayed = 5 * self.status.step >= 3 * config.steps;
        let rate = config.rate * if decayed { 0.3 } else { 1.0 };
        let (loss, row) = self.losses(&self.network, &self.training, set, &pairs)?;
        let gradients = loss.backward();
        self.softras.take_fault()?;
        let gradients = GradientsParams::from_grads(gradients, &self.network);
        self.network = self.optimizer.step(rate, self.network.clone(), gradients);
        self.status.step += 1;
        self.status.curve.push(row);
        Ok(row)
    }

    /// The loss on pairs of another set that are the same at every call; whether it is the least so far.
    ///
    /// # Errors
    /// As [`Trainer::step`].
    pub fn validate(&mut self, set: &Set) -> Result<(f32, bool)> {
        let pairs = Pairs::draw(set, 2 * self.status.config.pairs, 1);
        let (_, row) = self.losses(&self.network.valid(), &self.validation, set, &pairs)?;
        let is_best = self.status.best.is_none_or(|best| row.loss < best);
        if is_best {
            self.status.best = Some(row.loss);
        }
        Ok((row.loss, is_best))
    }

    /// Writes a checkpoint.
    ///
    /// # Errors
    /// As [`checkpoint::write`].
    pub fn save(&self, path: &Path) -> Result<()> {
        checkpoint::write(path, &self.status, &self.network, &self.optimizer)
    }

    fn losses(&self, network: &Network, constants: &Constants, set: &Set, pairs: &Pairs) -> Result<(Tensor<1>, Row)> {
        let config = &self.status.config;
        let pictures = pairs.seen().map(|(object, view)| set.objects[object].picture(view));
        let pictures = pictures_tensor(pictures, &constants.device);
        let shapes = network.forward(pictures.clone(), &constants.logits);
        let cameras: Vec<Camera> = pairs.seen().chain(pairs.others()).map(|(_, view)| self.cameras[view]).collect();
        let (silhouette, color) = self.images(&shapes, cameras)?;
        // The second half of the pictures is the first half's other view.
        let half = pairs.0.len();
        let [first, second] = [0, half].map(|from| pictures.clone().narrow(0, from, half));
        let targets = Tensor::cat(vec![pictures, second, first], 0);
        let count = targets.dims()[0];
        let alpha = targets.clone().narrow(1, 3, 1).reshape([count, SIZE, SIZE]);
        let silhouette = iou_loss(silhouette, alpha);
        let laplacian = constants.smoothness.laplacian(shapes.positions.clone());
        let flatten = constants.smoothness.flatten(shapes.positions);
        let mut loss = silhouette.clone()
            + laplacian.clone().mul_scalar(config.laplacian)
            + flatten.clone().mul_scalar(config.flatten);
        let color = color.map(|color| (color - targets.narrow(1, 0, 3).permute([0, 2, 3, 1])).abs().mean());
        if let Some(color) = &color {
            loss = loss + color.clone().mul_scalar(config.color);
        }
        let value = |loss: &Tensor<1>| loss.clone().into_scalar::<f32>();
        let row = Row {
            step: self.status.step + 1,
            loss: value(&loss),
            silhouette: value(&silhouette),
            color: color.as_ref().map_or(0.0, value),
            laplacian: value(&laplacian),
            flatten: value(&flatten),
        };
        if !row.loss.is_finite() {
            return fit_error(format!("the loss of step {} is {}", row.step, row.loss), "use a smaller rate");
        }
        Ok((loss, row))
    }

    /// Silhouettes, and colours where the network sees them: every shape in its own view, then every shape in the other one.
    fn images(&self, shapes: &Shapes, cameras: Vec<Camera>) -> Result<(Tensor<3>, Option<Tensor<4>>)> {
        let config = &self.status.config;
        let packed = |rows: Tensor<3>| {
            let [count, vertices, _] = rows.dims();
            Tensor::cat(vec![rows.clone(), rows], 0).reshape([2 * count * vertices, 3])
        };
        let inputs = Inputs {
            positions: Some(packed(shapes.positions.clone())),
            colors: shapes.colors.clone().map(packed),
            ..Inputs::default()
        };
        let scene = Scene::batch(vec![self.template.clone(); cameras.len()]);
        let views = Views { scene, cameras, settings: settings(config) };
        let images = self.softras.render(&views, &inputs)?;
        let (Some(silhouette), color) = (images.silhouette, images.color) else {
            return fit_error("the renderer gave no silhouette", "report this");
        };
        if !config.hard {
            return Ok((silhouette, color));
        }
        // The values of the hard images with the gradient of the others.
        let settings = Settings {
            color: ColorAggregation::Hard,
            silhouette: SilhouetteAggregation::Hard,
            distance: Distance::Hard,
            ..views.settings.clone()
        };
        let detached = |tensor: &Option<Tensor<2>>| tensor.clone().map(Tensor::detach);
        let inputs =
            Inputs { positions: detached(&inputs.positions), colors: detached(&inputs.colors), ..Inputs::default() };
        let hard = self.softras.render(&Views { settings, ..views }, &inputs)?;
        let Some(hard_silhouette) = hard.silhouette else { return Ok((silhouette, color)) };
        let silhouette = silhouette.clone() + (hard_silhouette - silhouette).detach();
        let color = color.zip(hard.color).map(|(soft, hard)| soft.clone() + (hard - soft).detach());
        Ok((silhouette, color))
    }
}

/// How shapes are rendered in training.
fn settings(config: &Config) -> Settings {
    let settings = Settings {
        width: SIZE as u32,
        height: SIZE as u32,
        sigma: config.sigma,
        // About 0.01 world units of depth.
        near: 1.5,
        far: 4.0,
        gamma: 4e-3,
        background: Background::Composite,
        outputs: Outputs { color: config.color > 0.0, silhouette: true, depth: false, normal: false },
        ..Settings::default()
    };
    if config.hard { settings.with_blur_pixels(1.0) } else { settings }
}

/// The meshes that a network sees in pictures, on the device of its weights.
///
/// # Errors
/// [`softras::Error::Mesh`] where a vertex is not finite.
pub fn meshes(network: &Network, pictures: &[&[u8]], device: &Device) -> Result<Vec<Mesh>> {
    let shapes = network.forward(pictures_tensor(pictures.iter().copied(), device), &sphere_logits(device)?);
    let host = |tensor: Tensor<3>| {
        let read = tensor.try_into_vec_as::<f32>();
        read.or_else(|e| fit_error(format!("the network's output cannot be read ({e})"), "report this"))
    };
    let (positions, colors) = (host(shapes.positions)?, shapes.colors.map(host).transpose()?);
    let template = sphere()?;
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
