//! Training from pairs of views: the shape that is seen in either view is rendered in both.

use crate::checkpoint::{self, Status};
use crate::config::{Config, Hard, Row};
use crate::data::Set;
use crate::network::{Network, Shapes, pictures_tensor};
use crate::pairs::Pairs;
use crate::template::Template;
use crate::weights::numbered;
use crate::{SIZE, VIEWS, camera, fit_error, hard};
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::tensor::{Device, Tensor};
use softras::scene::{Appearance, Background, Outputs};
use softras::{Camera, Mesh, Renderer, Result, Scene, Settings};
use softras_burn::{Inputs, Smoothness, SoftRas, Views, iou_loss};
use std::path::Path;

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

/// The values that no step changes, on one device.
#[derive(Debug)]
struct Constants {
    smoothness: Smoothness,
    device: Device,
}

impl Constants {
    fn new(template: &Mesh, device: Device) -> Result<Self> {
        Ok(Self { smoothness: Smoothness::new(template.positions().len(), template.triangles(), &device)?, device })
    }
}

fn optimizer() -> ModuleOptimizer {
    AdamConfig::new().with_epsilon(1e-8).init()
}

impl Trainer {
    /// A new network.
    pub fn new(config: Config, renderer: Renderer) -> Result<Self> {
        config.validate()?;
        let device = Device::flex().autodiff();
        device.seed(config.seed);
        let network = numbered(Network::new(config.width, config.seen_colors(), &device)?);
        Self::with(Status { config, step: 0, curve: Vec::new(), best: None }, network, optimizer(), renderer, device)
    }

    /// Goes on from a checkpoint, as if the training had never ended.
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
        let mut template = Template::sphere()?.mesh().clone();
        if status.config.color > 0.0 {
            let white = vec![[1.0; 3]; template.positions().len()];
            template = template.with_appearance(Appearance::VertexColors(white))?;
        }
        Ok(Self {
            validation: Constants::new(&template, device.clone().inner())?,
            training: Constants::new(&template, device)?,
            cameras: (0..VIEWS).map(camera).collect::<Result<_>>()?,
            softras: SoftRas::new(renderer),
            status,
            network,
            optimizer,
            template,
        })
    }

    /// The status that a checkpoint records: the configuration and the curve so far.
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
    pub fn step(&mut self, set: &Set) -> Result<Row> {
        let config = &self.status.config;
        let step = self.status.step as u64;
        let pairs = Pairs::draw(set, config.pairs, config.seed.wrapping_mul(0x9e37_79b9).wrapping_add(step << 20));
        let decayed = 5 * self.status.step >= 3 * config.steps;
        let rate = config.rate * if decayed { 0.3 } else { 1.0 };
        let (loss, row) = self.losses(&self.network, &self.training, set, &pairs)?;
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        self.softras.take_fault()?;
        self.network = self.optimizer.step(rate, self.network.clone(), gradients);
        self.status.step += 1;
        self.status.curve.push(row);
        Ok(row)
    }

    /// The loss on pairs of another set that are the same at every call; whether it is the least so far.
    pub fn validate(&mut self, set: &Set) -> Result<(f32, bool)> {
        let pairs = Pairs::draw(set, 2 * self.status.config.pairs, 1);
        let (_, row) = self.losses(&self.network.valid(), &self.validation, set, &pairs)?;
        let is_best = self.status.best.is_none_or(|best| row.loss() < best);
        if is_best {
            self.status.best = Some(row.loss());
        }
        Ok((row.loss(), is_best))
    }

    /// Writes a checkpoint.
    pub fn save(&self, path: &Path) -> Result<()> {
        checkpoint::write(path, &self.status, &self.network, &self.optimizer)
    }

    /// The loss of a network on pairs of a set, and what it is the sum of.
    fn losses(&self, network: &Network, constants: &Constants, set: &Set, pairs: &Pairs) -> Result<(Tensor<1>, Row)> {
        let config = &self.status.config;
        let pictures = pairs.seen().map(|(object, view)| set.objects[object].picture(view));
        let pictures = pictures_tensor(pictures, &constants.device);
        let shapes = network.forward(pictures.clone());
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
        let color = color.as_ref().map_or(0.0, value);
        let losses = [value(&loss), value(&silhouette), color, value(&laplacian), value(&flatten)];
        let row = Row { step: self.status.step + 1, losses };
        if !row.loss().is_finite() {
            return Err(fit_error(format!("the loss of step {} is {}", row.step, row.loss()), "use a smaller rate"));
        }
        Ok((loss, row))
    }

    /// Silhouettes, and colours where the network sees them: every shape in its own view, then every shape in the other one.
    fn images(&self, shapes: &Shapes, cameras: Vec<Camera>) -> Result<(Tensor<3>, Option<Tensor<4>>)> {
        let config = &self.status.config;
        let packed = |rows: &Tensor<3>| {
            let [count, vertices, _] = rows.dims();
            Tensor::cat(vec![rows.clone(); 2], 0).reshape([2 * count * vertices, 3])
        };
        let (positions, colors) = (packed(&shapes.positions), shapes.colors.as_ref().map(packed));
        let scene = Scene::batch(vec![self.template.clone(); cameras.len()]);
        let mut views = Views { scene, cameras, settings: settings(config) };
        let inputs = Inputs { positions: Some(positions.clone()), colors: colors.clone(), ..Inputs::default() };
        let (silhouette, color) = self.rendered(&views, &inputs)?;
        if config.hard.is_none() {
            return Ok((silhouette, color));
        }
        // The values of hard images with the gradient of soft ones.
        views.settings = hard(views.settings);
        let (positions, colors) = (Some(positions.detach()), colors.map(Tensor::detach));
        let (hard, hard_color) = self.rendered(&views, &Inputs { positions, colors, ..Inputs::default() })?;
        let color = color.zip(hard_color).map(|(soft, hard)| soft.clone() + (hard - soft).detach());
        Ok((silhouette.clone() + (hard - silhouette).detach(), color))
    }

    fn rendered(&self, views: &Views, inputs: &Inputs) -> Result<(Tensor<3>, Option<Tensor<4>>)> {
        let images = self.softras.render(views, inputs)?;
        let silhouette =
            images.silhouette.ok_or_else(|| fit_error("the renderer gave no silhouette", "report this"))?;
        Ok((silhouette, images.color))
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
        outputs: Outputs { color: config.color > 0.0, silhouette: true, ..Outputs::NOTHING },
        ..Settings::default()
    };
    if config.hard == Some(Hard::Edge) { settings.with_blur_pixels(1.0) } else { settings }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::config::tests::small;
    use crate::{synthesis, weights};

    fn new(config: Config) -> Trainer {
        Trainer::new(config, Renderer::new().unwrap()).unwrap()
    }

    /// Trains for `count` more steps.
    fn steps(trainer: &mut Trainer, set: &Set, count: usize) -> Vec<Row> {
        (0..count).map(|_| trainer.step(set).unwrap()).collect()
    }

    /// All weights of a network in training.
    fn weights(trainer: &Trainer) -> Vec<f32> {
        let weights = weights::list(&trainer.network.valid());
        assert!(weights.len() > 20);
        weights.into_iter().flat_map(|weight| weight.values).collect()
    }

    #[test]
    fn training_resumes_to_the_bit_and_learns() {
        let (set, folder) = (synthesis::tests::small(), tempfile::tempdir().unwrap());
        let path = folder.path().join("half");
        let mut whole = new(small());
        let curve = steps(&mut whole, &set, 6);
        assert!(whole.is_done());
        assert!(curve[5].loss() < curve[0].loss(), "{curve:?}");

        let mut part = new(small());
        steps(&mut part, &set, 3);
        part.save(&path).unwrap();
        let mut resumed = Trainer::resume(&path, Renderer::new().unwrap()).unwrap();
        steps(&mut resumed, &set, 3);
        assert_eq!(resumed.status().curve, curve);
        assert_eq!(weights(&whole), weights(&resumed));
        let (loss, is_best) = resumed.validate(&set).unwrap();
        assert!(loss.is_finite() && is_best);
    }

    #[test]
    fn the_seed_decides_the_first_weights() {
        let first = |seed| weights(&new(Config { seed, ..small() }));
        assert_eq!(first(5), first(5));
        assert_ne!(first(5), first(6));
    }

    #[test]
    fn hard_images_and_silhouettes_alone_learn_as_well() {
        let set = synthesis::tests::small();
        for (hard, color) in [(Some(Hard::Edge), 1.0), (None, 0.0)] {
            let curve = steps(&mut new(Config { hard, color, steps: 12, rate: 3e-3, ..small() }), &set, 12);
            let mean = |rows: &[Row]| rows.iter().map(Row::overlap).sum::<f32>() / rows.len() as f32;
            assert!(mean(&curve[9..]) > mean(&curve[..3]), "{hard:?} {color}: {curve:?}");
            assert_eq!(curve.iter().all(|row| row.losses[2] == 0.0), color == 0.0);
        }
    }
}
