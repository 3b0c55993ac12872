//! Plans a fit on the device: kinds of losses, weights and sizes as the kernels read them. It does not use Vulkan.

use crate::constants as c;
use crate::error::{Result, shown};
use crate::fit::bad;
use crate::fit::image_loss::{ImageLoss, pooled};
use crate::fit::optimizer::Method;
use crate::fit::regularizer::Regularizer;
use crate::fit::shape::{Parametrization, ShapeFit, Targets};
use crate::image::Image;
use crate::scene::{Appearance, Outputs, Settings, Support};

use super::DeviceFit;
use super::arithmetic::Rates;
use super::smoother::{Smoother, inverse};
use super::tables::{Tables, logit_template};

/// The largest number of vertices and inner edges that one workgroup sums: Mesa before 23 ends loops of an invocation
/// after 65535 iterations.
const MOST_SUMMED: usize = 60_000 * c::FIT_GROUP as usize;

/// A loss as the kernels take it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossKind {
    /// One of the `LOSS_` constants.
    pub code: u32,
    pub delta: f32,
    pub weight: f32,
}

/// One resolution that the losses are averaged over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    pub width: u32,
    pub height: u32,
    /// Its first pixel in `pyramid`; `None` where it is the rendered image itself.
    pub pyramid_first: Option<u32>,
    /// Its first pixel in targets and weights.
    pub target_first: u32,
    /// Its first row in `loss_partials`.
    pub partial_first: u32,
    /// Blocks of pixels of a view.
    pub blocks: u32,
    /// Of value and gradient, of silhouette and colour: see `loss_scales`.
    pub scales: [f32; 4],
}

/// The sizes and numbers that the kernels of a fit take.
#[derive(Clone, Debug, PartialEq)]
pub struct FitPlan {
    pub views: u32,
    /// Of the rendered images.
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub levels: Vec<Level>,
    pub silhouette: LossKind,
    pub color: LossKind,
    pub masked: bool,
    /// Whether pixels have colours.
    pub has_color: bool,
    pub vertices: u32,
    pub edges: u32,
    pub flaps: u32,
    pub laplacian_weight: f32,
    pub flatten_weight: f32,
    pub edge_weight: f32,
    pub edge_target: f32,
    pub normal_weight: f32,
    /// For each of the options' regularizers, the index of its value among a record's penalties.
    pub penalties: Vec<usize>,
    pub logit: bool,
    pub smoothing: Option<Smoother>,
    pub method: Method,
    pub fit_colors: bool,
}

impl DeviceFit {
    /// Why a fit cannot run on the device and needs [`ShapeFit::step`]; `None` where it can.
    pub fn unsupported(fit: &ShapeFit) -> Option<String> {
        let options = fit.options();
        if !options.fit_positions {
            return Some("the fit moves no vertices".into());
        }
        if options.fit_colors && !matches!(fit.mesh().appearance(), Appearance::VertexColors(_)) {
            return Some("only vertex colours can be fitted on the device".into());
        }
        if options.views_per_step > 0 {
            return Some("steps of some of the views are taken on the host".into());
        }
        let kind = |r: &Regularizer| std::mem::discriminant(r);
        for (i, (regularizer, _)) in options.regularizers.iter().enumerate() {
            if options.regularizers[..i].iter().any(|(r, _)| kind(r) == kind(regularizer)) {
                return Some(format!("{regularizer:?} is given twice"));
            }
        }
        let (vertices, flaps) = (fit.topology().vertices(), fit.topology().flaps().len());
        if vertices + flaps > MOST_SUMMED {
            return Some(format!("{vertices} vertices and {flaps} inner edges are more than one workgroup sums"));
        }
        match options.parametrization {
            Parametrization::Smoothed { lambda } if Smoother::new(lambda, fit.topology()).is_none() => {
                Some(format!("a smoothing of λ = {lambda} needs the host's exact solution"))
            }
            _ => None,
        }
    }

    /// Why the device cannot compare these targets; `None` if it can.
    pub fn unsupported_targets(targets: &Targets) -> Option<String> {
        (targets.depth.is_some() || targets.normal.is_some())
            .then(|| "depths and normals are compared on the host".into())
    }

    /// Why a step with these settings cannot run on the device; `None` where it can.
    pub fn unsupported_settings(settings: &Settings) -> Option<String> {
        (settings.support == Support::Guaranteed)
            .then(|| "the radius of a guaranteed support depends on the mesh, which only the device knows".into())
    }
}

impl LossKind {
    fn new((loss, weight): (ImageLoss, f64), given: bool) -> Result<Self> {
        let (code, delta) = match loss {
            _ if !given => (c::LOSS_NONE, 0.0),
            ImageLoss::NegativeIou => (c::LOSS_IOU, 0.0),
            ImageLoss::L1 => (c::LOSS_L1, 0.0),
            ImageLoss::L2 => (c::LOSS_L2, 0.0),
            ImageLoss::Huber { delta } if delta > 0.0 && delta.is_finite() => (c::LOSS_HUBER, delta),
            ImageLoss::Huber { delta } => {
                return bad(format!("a Huber loss with delta {}", shown(delta)), "use one above 0");
            }
        };
        Ok(Self { code, delta: delta as f32, weight: if given { weight as f32 } else { 0.0 } })
    }

    /// The divisor of the sum over all views.
    fn divisor(&self, total: f64, views: f64) -> f64 {
        if self.code == c::LOSS_IOU { views } else { total }
    }
}

impl FitPlan {
    /// The plan of a fit to targets, and its tables. `weights`, `[views, height, width, 1]` of the targets' size,
    /// weighs pixels.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets or weights of other shapes, and for a fit that is [`DeviceFit::unsupported`].
    pub fn new(fit: &ShapeFit, targets: &Targets, weights: Option<&Image>) -> Result<(Self, Tables)> {
        if let Some(reason) = DeviceFit::unsupported(fit).or_else(|| DeviceFit::unsupported_targets(targets)) {
            return bad(reason, "fit it on the host (ShapeFit)");
        }
        let (height, width) = targets.size()?;
        let options = fit.options();
        let (topology, samples) = (fit.topology(), options.samples as u32);
        let of = |wanted: Regularizer| {
            let same = |r: &Regularizer| std::mem::discriminant(r) == std::mem::discriminant(&wanted);
            options.regularizers.iter().find(|(r, _)| same(r)).map_or(0.0, |(_, weight)| *weight as f32)
        };
        let edge_target = options.regularizers.iter().find_map(|(r, _)| match r {
            Regularizer::EdgeLength { target } => Some(*target as f32),
            _ => None,
        });
        let smoothing = match options.parametrization {
            Parametrization::Smoothed { lambda } => Smoother::new(lambda, topology),
            _ => None,
        };
        let mut plan = Self {
            views: targets.cameras.len() as u32,
            width: width as u32 * samples,
            height: height as u32 * samples,
            samples,
            levels: Vec::new(),
            silhouette: LossKind::new(options.silhouette, targets.silhouette.is_some())?,
            color: LossKind::new(options.color, targets.color.is_some())?,
            masked: weights.is_some(),
            has_color: targets.color.is_some(),
            vertices: topology.vertices() as u32,
            edges: topology.edges().len() as u32,
            flaps: topology.flaps().len() as u32,
            laplacian_weight: of(Regularizer::Laplacian),
            flatten_weight: of(Regularizer::Flatten),
            edge_weight: of(Regularizer::EdgeLength { target: 0.0 }),
            edge_target: edge_target.unwrap_or(0.0),
            normal_weight: of(Regularizer::NormalConsistency),
            penalties: options.regularizers.iter().map(|(r, _)| penalty_index(*r)).collect(),
            logit: options.parametrization == Parametrization::Logit,
            smoothing,
            method: options.method,
            fit_colors: options.fit_colors,
        };
        let mut tables = Tables::of(topology);
        plan.add_levels(&mut tables, targets, weights, options.levels)?;
        if plan.smoothing == Some(Smoother::Dense) {
            tables.inverse = inverse(fit)?;
        }
        if plan.logit {
            tables.logit_template = logit_template(fit)?;
        }
        Ok((plan, tables))
    }

    fn add_levels(
        &mut self,
        tables: &mut Tables,
        targets: &Targets,
        weights: Option<&Image>,
        levels: usize,
    ) -> Result<()> {
        let mut images = [targets.silhouette.clone(), targets.color.clone(), weights.cloned()];
        validate_weights(targets, weights)?;
        let views = self.views;
        let (mut pyramid, mut partials) = (0, 0);
        for level in 0..levels {
            if level > 0 {
                for image in images.iter_mut().flatten() {
                    *image = pooled(image, 2)?;
                }
            }
            let [silhouette, color, mask] = &images;
            let Some(shape) = silhouette.as_ref().or(color.as_ref()) else { break };
            let (width, height) = (shape.width as u32, shape.height as u32);
            let count = views * width * height;
            let total = mask.as_ref().map_or(f64::from(count), |m| m.data.iter().map(|&w| f64::from(w)).sum());
            let share = 1.0 / levels as f64;
            let scale = |kind: &LossKind, channels: f64| share / kind.divisor(total * channels, f64::from(views));
            let (s, k) = (scale(&self.silhouette, 1.0), scale(&self.color, 3.0));
            let scales =
                [s, k, s * f64::from(self.silhouette.weight), k * f64::from(self.color.weight)].map(|x| x as f32);
            let is_rendered = level == 0 && self.samples == 1;
            let blocks = (width * height).div_ceil(c::FIT_GROUP * c::LOSS_PIXELS);
            self.levels.push(Level {
                width,
                height,
                pyramid_first: (!is_rendered).then_some(pyramid),
                target_first: tables.target_pixels(self.has_color),
                partial_first: partials,
                blocks,
                scales,
            });
            pyramid += if is_rendered { 0 } else { count };
            partials += blocks * views;
            tables.push_targets(silhouette.as_ref(), color.as_ref());
            tables.weights.extend(mask.iter().flat_map(|m| &m.data));
        }
        Ok(())
    }

    /// Channels of a pixel in targets, pyramid and upstream.
    pub fn channels(&self) -> usize {
        if self.has_color { 4 } else { 1 }
    }

    /// Pixels of all levels in `pyramid`, at least 1.
    pub fn pyramid_pixels(&self) -> u32 {
        let size = |l: &Level| l.pyramid_first.map_or(0, |_| l.width * l.height * self.views);
        self.levels.iter().map(size).sum::<u32>().max(1)
    }

    /// Rows of parameters: one for each vertex, and one for the centre.
    pub fn rows(&self) -> u32 {
        self.vertices + u32::from(self.logit)
    }

    /// Whether a regularizer on vertices is used: Laplacian or edge length.
    pub fn vertex_penalties(&self) -> bool {
        self.has_penalty(0) || self.has_penalty(2)
    }

    /// Whether a regularizer on flaps is used: flatten or normal consistency.
    pub fn flap_penalties(&self) -> bool {
        self.has_penalty(1) || self.has_penalty(3)
    }

    /// Whether the options contain the regularizer of this index, see [`penalty_index`].
    pub fn has_penalty(&self, index: usize) -> bool {
        self.penalties.contains(&index)
    }

    /// The images to render.
    pub fn outputs(&self) -> Outputs {
        let silhouette = self.silhouette.code != c::LOSS_NONE;
        Outputs { color: self.has_color, silhouette, depth: false, normal: false }
    }

    /// The settings that a step is rendered with.
    pub fn settings(&self, settings: &Settings) -> Settings {
        let (width, height) = (self.width, self.height);
        Settings { width, height, outputs: self.outputs(), save: true, ..settings.clone() }
    }

    /// The optimiser's push constants in a step, counted from 1.
    pub fn rates(method: Method, step: i32, rate: f64) -> Rates {
        match method {
            Method::Sgd { momentum } => Rates {
                rate: rate as f32,
                first_decay: momentum as f32,
                first_share: 1.0,
                first_bias: 1.0,
                second_bias: 1.0,
                ..Rates::default()
            },
            Method::Adam { betas: [b1, b2], epsilon } | Method::UniformAdam { betas: [b1, b2], epsilon } => {
                let [c1, c2] = [b1, b2].map(|b| 1.0 - b.powi(step));
                Rates {
                    rate: rate as f32,
                    first_decay: b1 as f32,
                    first_share: (1.0 - b1) as f32,
                    first_bias: c1 as f32,
                    second_decay: b2 as f32,
                    second_share: (1.0 - b2) as f32,
                    second_bias: c2 as f32,
                    epsilon: epsilon as f32,
                }
            }
        }
    }

    /// The method's `METHOD_` constant.
    pub fn method_code(&self) -> u32 {
        match self.method {
            Method::Sgd { .. } => c::METHOD_SGD,
            Method::Adam { .. } => c::METHOD_ADAM,
            Method::UniformAdam { .. } => c::METHOD_UNIFORM,
        }
    }
}

/// The index of a regularizer's value among a record's four penalties.
fn penalty_index(regularizer: Regularizer) -> usize {
    match regularizer {
        Regularizer::Laplacian => 0,
        Regularizer::Flatten => 1,
        Regularizer::EdgeLength { .. } => 2,
        Regularizer::NormalConsistency => 3,
    }
}

fn validate_weights(targets: &Targets, weights: Option<&Image>) -> Result<()> {
    let Some(weights) = weights else { return Ok(()) };
    let (height, width) = targets.size()?;
    let expected = [targets.cameras.len(), height, width, 1];
    let shape = [weights.batch, weights.height, weights.width, weights.channels];
    if shape != expected || !weights.is_whole() {
        return bad(format!("weights of shape {shape:?} for targets {expected:?}"), "give one weight a pixel");
    }
    if !weights.data.iter().all(|w| w.is_finite() && *w >= 0.0) || weights.data.iter().all(|w| *w == 0.0) {
        return bad(
            "weights that are negative, not finite or all 0",
            "use finite weights of at least 0, one of them above 0",
        );
    }
    Ok(())
}
