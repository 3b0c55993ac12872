//! Training from pairs of views: the shape that is seen in either view is rendered in both.

use super::checkpoint::{self, Status};
use super::config::{Config, Hard, Row};
use super::data::Set;
use super::model::Model;
use super::network::{Network, Shapes, pictures_tensor};
use super::pairs::Pairs;
use super::team::{Alone, Team, average_gradients, average_running};
use super::template::Template;
use super::voxels::cross_entropy;
use super::{SIZE, VIEWS, camera, fit_error};
use crate::{Inputs, Smoothness, SoftRas, Views, iou_loss};
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsAccumulator, GradientsParams, ModuleOptimizer};
use burn::tensor::{Device, Tensor};
use softras::scene::{Appearance, Background, ColorAggregation, Distance, Outputs, SilhouetteAggregation};
use softras::{Camera, Mesh, Renderer, Result, Scene, Settings};
use std::path::Path;
use std::rc::Rc;

/// A network in training.
pub struct Trainer {
    status: Status,
    model: Model,
    optimizer: ModuleOptimizer,
    softras: SoftRas,
    training: Constants,
    validation: Constants,
    template: Mesh,
    cameras: Vec<Camera>,
    team: Rc<dyn Team>,
}

/// Tensors that no step changes, on one device.
#[derive(Debug)]
struct Constants {
    smoothness: Smoothness,
    device: Device,
}

impl Constants {
    fn new(device: Device) -> Result<Self> {
        let sphere = Template::sphere()?;
        let smoothness = Smoothness::new(sphere.mesh().positions().len(), sphere.mesh().triangles(), &device)?;
        Ok(Self { smoothness, device })
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
        let model = Model::new(&config, &device)?;
        Self::with(Status { config, step: 0, curve: Vec::new(), best: None }, model, optimizer(), renderer, device)
    }

    /// Goes on from a checkpoint, as if the training had never ended.
    ///
    /// # Errors
    /// As [`checkpoint::read`].
    pub fn resume(path: &Path, renderer: Renderer) -> Result<Self> {
        let device = Device::flex().autodiff();
        let (status, model, resumed) = checkpoint::read(path, &device, Some(optimizer()))?;
        Self::with(status, model, resumed.unwrap_or_else(optimizer), renderer, device)
    }

    fn with(
        status: Status,
        model: Model,
        optimizer: ModuleOptimizer,
        renderer: Renderer,
        device: Device,
    ) -> Result<Self> {
        let template = Template::sphere()?.mesh().clone();
        let template = if status.config.color > 0.0 {
            let white = vec![[1.0; 3]; template.positions().len()];
            template.with_appearance(Appearance::VertexColors(white))?
        } else {
            template
        };
        let [training, validation] = [device.clone(), device.inner()].map(Constants::new);
        let cameras = (0..VIEWS).map(camera).collect::<Result<_>>()?;
        let (softras, training, validation) = (SoftRas::new(renderer), training?, validation?);
        let team = Rc::new(Alone);
        Ok(Self { status, model, optimizer, softras, training, validation, template, cameras, team })
    }

    /// Shares the steps with other processes, which train the same network from the same seed.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] where the shares of a step cannot be divided evenly.
    pub fn with_team(self, team: Rc<dyn Team>) -> Result<Self> {
        let shares = self.status.config.shares;
        if !shares.is_multiple_of(team.size()) {
            let what = format!("{shares} shares of a step for {} processes", team.size());
            return fit_error(what, "start a number of processes that divides the shares (--shares)");
        }
        Ok(Self { team, ..self })
    }

    /// The processes that train.
    pub fn team(&self) -> &dyn Team {
        &*self.team
    }

    /// What a checkpoint says: the configuration and the curve so far.
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// The number of the network's weights.
    pub fn weights(&self) -> usize {
        self.model.num_params()
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
        let shares = pairs.shares(config.shares);
        let own: Vec<&Pairs> = shares.iter().skip(self.team.rank()).step_by(self.team.size()).collect();
        let (mut sum, mut losses) = (GradientsAccumulator::new(), [0.0; 5]);
        for pairs in &own {
            let (loss, row) = self.losses(&self.model, &self.training, set, pairs)?;
            let gradients = loss.div_scalar(own.len() as f64).backward();
            self.softras.take_fault()?;
            sum.accumulate(&self.model, GradientsParams::from_grads(gradients, &self.model));
            losses.iter_mut().zip(row.losses()).for_each(|(sum, loss)| *sum += loss / own.len() as f32);
        }
        self.team.average(&mut losses);
        let row = Row::new(self.status.step + 1, losses);
        let gradients = average_gradients(sum.grads(), &self.model, &*self.team);
        self.model = self.optimizer.step(rate, self.model.clone(), gradients);
        self.status.step += 1;
        self.status.curve.push(row);
        Ok(row)
    }

    /// Takes the means over all processes of the batch norms' running means: what else they know is the same in all.
    pub fn gather(&mut self) {
        self.model = average_running(self.model.clone(), &*self.team);
    }

    /// The loss on pairs of another set that are the same at every call; whether it is the least so far.
    ///
    /// # Errors
    /// As [`Trainer::step`].
    pub fn validate(&mut self, set: &Set) -> Result<(f32, bool)> {
        let pairs = Pairs::draw(set, 2 * self.status.config.pairs, 1);
        let (_, row) = self.losses(&self.model.valid(), &self.validation, set, &pairs)?;
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
        checkpoint::write(path, &self.status, &self.model, &self.optimizer)
    }

    fn losses(&self, model: &Model, constants: &Constants, set: &Set, pairs: &Pairs) -> Result<(Tensor<1>, Row)> {
        let pictures = pairs.seen().map(|(object, view)| set.objects[object].picture(view));
        let pictures = pictures_tensor(pictures, &constants.device);
        let (loss, losses) = match model {
            Model::Mesh(network) => self.by_pictures(network, constants, pictures, pairs)?,
            Model::Voxels(network) => {
                let loss =
                    cross_entropy(network.forward(pictures), pairs.seen().map(|(object, _)| &set.objects[object]));
                (loss.clone(), [loss.into_scalar(), 0.0, 0.0, 0.0, 0.0])
            }
        };
        let row = Row::new(self.status.step + 1, losses);
        if !row.loss.is_finite() {
            return fit_error(format!("the loss of step {} is {}", row.step, row.loss), "use a smaller rate");
        }
        Ok((loss, row))
    }

    /// The loss of a network that sees meshes, and the losses as [`Row::losses`] orders them.
    fn by_pictures(
        &self,
        network: &Network,
        constants: &Constants,
        pictures: Tensor<4>,
        pairs: &Pairs,
    ) -> Result<(Tensor<1>, [f32; 5])> {
        let config = &self.status.config;
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
        Ok((loss, losses))
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
        let images = match config.hard {
            Some(Hard::Nmr) => self.softras.render_hard(&views, &inputs)?,
            _ => self.softras.render(&views, &inputs)?,
        };
        let (Some(silhouette), color) = (images.silhouette, images.color) else {
            return fit_error("the renderer gave no silhouette", "report this");
        };
        match config.hard {
            None => Ok((silhouette, color)),
            Some(Hard::Nmr) => Ok((halved(silhouette.unsqueeze_dim(3)).squeeze_dim(3), color.map(halved))),
            Some(Hard::Edge) => self.hardened(silhouette, color, views, &inputs),
        }
    }

    /// The values of hard images with the gradient of soft ones.
    fn hardened(
        &self,
        silhouette: Tensor<3>,
        color: Option<Tensor<4>>,
        views: Views,
        inputs: &Inputs,
    ) -> Result<(Tensor<3>, Option<Tensor<4>>)> {
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

/// Images `[count, height, width, channels]` at half their resolution: the means of four pixels.
fn halved(images: Tensor<4>) -> Tensor<4> {
    let [count, height, width, channels] = images.dims();
    let blocks = images.reshape([count, height / 2, 2, width / 2, 2 * channels]).sum_dim(2);
    let blocks = blocks.reshape([count, height / 2, width / 2, 2, channels]).sum_dim(3);
    blocks.reshape([count, height / 2, width / 2, channels]).mul_scalar(0.25)
}

/// How shapes are rendered in training.
fn settings(config: &Config) -> Settings {
    // The authors of that renderer render at twice the resolution.
    let side = SIZE as u32 * if config.hard == Some(Hard::Nmr) { 2 } else { 1 };
    let settings = Settings {
        width: side,
        height: side,
        sigma: config.sigma,
        // About 0.01 world units of depth.
        near: 1.5,
        far: 4.0,
        gamma: 4e-3,
        background: Background::Composite,
        outputs: Outputs { color: config.color > 0.0, silhouette: true, depth: false, normal: false },
        ..Settings::default()
    };
    if config.hard == Some(Hard::Edge) { settings.with_blur_pixels(1.0) } else { settings }
}
