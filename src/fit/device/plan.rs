//! What a fit on the device takes: kinds, weights, sizes, as the kernels read them. Pure: no Vulkan.

use crate::constants as c;
use crate::error::Result;
use crate::fit::bad;
use crate::fit::image_loss::{ImageLoss, pooled};
use crate::fit::optimizer::Method;
use crate::fit::regularizer::Regularizer;
use crate::fit::shape::{Parametrization, ShapeFit, Targets};
use crate::fit::topology::Topology;
use crate::image::Image;
use crate::scene::{Appearance, Outputs, Settings, Support};
use glam::DVec3;

use super::arithmetic::Rates;

/// Vertices up to which smoothing takes all entries of the inverse: in one dispatch, where the iteration takes dozens.
const MOST_DENSE: usize = 1536;
/// Steps of the smoothing's iteration at most; a λ that takes more is for the host's exact solution.
const MOST_ITERATES: usize = 96;
/// How far the smoothing may be from the exact one, relative to what is smoothed.
const SMOOTHING_ERROR: f64 = 1e-2;

/// A loss as the kernels have it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossKind {
    /// LOSS_ of the constants.
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

/// Chebyshev's iteration for a mesh and a λ.
#[derive(Clone, Debug, PartialEq)]
pub struct Chebyshev {
    pub lambda: f32,
    pub relaxation: f32,
    /// ω of every step; an even number of them.
    pub omegas: Vec<f32>,
}

/// How smoothed parameters become positions.
#[derive(Clone, Debug, PartialEq)]
pub enum Smoother {
    /// By all entries of the inverse.
    Dense,
    /// By iteration.
    Iterated(Chebyshev),
}

/// The sizes and numbers of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitPlan {
    pub views: u32,
    /// Of what is rendered.
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub levels: Vec<Level>,
    pub silhouette: LossKind,
    pub color: LossKind,
    pub masked: bool,
    /// Pixels have colours.
    pub has_color: bool,
    pub vertices: u32,
    pub edges: u32,
    pub flaps: u32,
    pub laplacian_weight: f32,
    pub flatten_weight: f32,
    pub edge_weight: f32,
    pub edge_target: f32,
    pub normal_weight: f32,
    /// For each of the options' regularisers where its value stands in a record.
    pub penalties: Vec<usize>,
    pub logit: bool,
    pub smoothing: Option<Smoother>,
    pub method: Method,
    pub fit_colors: bool,
}

/// The tables that the kernels read, written once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// vertices + 1 places, then neighbours.
    pub neighbors: Vec<u32>,
    pub flaps: Vec<[u32; 4]>,
    /// vertices + 1 places, then 4 × flap + corner.
    pub flap_corners: Vec<u32>,
    /// All levels: one value a pixel, or four with colours.
    pub targets: Vec<f32>,
    /// All levels; empty without a mask.
    pub weights: Vec<f32>,
    /// (1 - |v|) / |v| with v's sign; empty but for the logit parametrisation.
    pub logit_template: Vec<[f32; 4]>,
    /// (I + λ L)⁻¹, row by row; empty but for [`Smoother::Dense`].
    pub inverse: Vec<f32>,
}

/// Why a fit cannot run on the device; `None` where it can.
pub fn unsupported(fit: &ShapeFit) -> Option<String> {
    let options = fit.options();
    if !options.fit_positions {
        return Some("no vertex moves".into());
    }
    if options.fit_colors && !matches!(fit.mesh().appearance(), Appearance::VertexColors(_)) {
        return Some("colours that are not the vertices' own are fitted on the host".into());
    }
    let kind = |r: &Regularizer| std::mem::discriminant(r);
    for (i, (regularizer, _)) in options.regularizers.iter().enumerate() {
        if options.regularizers[..i].iter().any(|(r, _)| kind(r) == kind(regularizer)) {
            return Some(format!("{regularizer:?} is there twice"));
        }
    }
    match options.parametrization {
        Parametrization::Smoothed { lambda } if Smoother::new(lambda, fit.topology()).is_none() => {
            Some(format!("a smoothing of λ = {lambda} takes the host's exact solution"))
        }
        _ => None,
    }
}

/// Why a step with these settings cannot run on the device.
pub fn unsupported_settings(settings: &Settings) -> Option<String> {
    (settings.support == Support::Guaranteed).then(|| "a guaranteed support follows the mesh, on the host".into())
}

impl LossKind {
    fn new((loss, weight): (ImageLoss, f64), given: bool) -> Result<Self> {
        let (code, delta) = match loss {
            _ if !given => (c::LOSS_NONE, 0.0),
            ImageLoss::NegativeIou => (c::LOSS_IOU, 0.0),
            ImageLoss::L1 => (c::LOSS_L1, 0.0),
            ImageLoss::L2 => (c::LOSS_L2, 0.0),
            ImageLoss::Huber { delta } if delta > 0.0 && delta.is_finite() => (c::LOSS_HUBER, delta),
            ImageLoss::Huber { delta } => return bad(format!("a Huber loss with delta {delta}"), "use one above 0"),
        };
        Ok(Self { code, delta: delta as f32, weight: if given { weight as f32 } else { 0.0 } })
    }

    /// What the sums of all views are divided by.
    fn divisor(&self, total: f64, views: f64) -> f64 {
        if self.code == c::LOSS_IOU { views } else { total }
    }
}

impl Smoother {
    /// `None` where only the host's exact solution will do.
    fn new(lambda: f64, topology: &Topology) -> Option<Self> {
        if topology.vertices() <= MOST_DENSE {
            return Some(Self::Dense);
        }
        Chebyshev::new(lambda, topology).map(Self::Iterated)
    }
}

impl Chebyshev {
    /// `None` for a λ out of range or one that takes too many steps.
    pub fn new(lambda: f64, topology: &Topology) -> Option<Self> {
        if !(0.0..=1e9).contains(&lambda) {
            return None;
        }
        let degree = |i: u32| topology.neighbors(i as usize).len();
        // No eigenvalue of L is larger than the degrees of some edge's ends together (Anderson and Morley 1985).
        let most = topology.edges().iter().map(|&[a, b]| degree(a) + degree(b)).max().unwrap_or(0);
        let (low, high) = (1.0, 1.0 + lambda * most as f64);
        let (middle, half) = (0.5 * (high + low), 0.5 * (high - low));
        let root = f64::sqrt(high / low);
        let quotient = (root - 1.0) / (root + 1.0);
        let steps = if quotient > 0.0 { (SMOOTHING_ERROR / 2.0).ln() / quotient.ln() } else { 1.0 };
        if steps.is_nan() || steps > MOST_ITERATES as f64 {
            return None;
        }
        let steps = (steps.ceil() as usize).max(1).next_multiple_of(2);
        let square = (half / middle).powi(2);
        let mut omega = 1.0;
        let mut omegas = Vec::with_capacity(steps);
        for step in 0..steps {
            omega = match step {
                0 => 1.0,
                1 => 2.0 / (2.0 - square),
                _ => 4.0 / (4.0 - square * omega),
            };
            omegas.push(omega as f32);
        }
        Some(Self { lambda: lambda as f32, relaxation: (1.0 / middle) as f32, omegas })
    }
}

impl FitPlan {
    /// Of a fit to targets, and its tables. `weights` masks pixels out: `[views, height, width, 1]` of the targets' size.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets or weights that do not fit together, and what only the host can do.
    pub fn new(fit: &ShapeFit, targets: &Targets, weights: Option<&Image>) -> Result<(Self, Tables)> {
        if let Some(reason) = unsupported(fit) {
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
            penalties: options.regularizers.iter().map(|(r, _)| place_of(*r)).collect(),
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
        judge_weights(targets, weights)?;
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

    /// Rows of parameters: one a vertex, and the centre's.
    pub fn rows(&self) -> u32 {
        self.vertices + u32::from(self.logit)
    }

    /// Whether the regularisers on vertices are wanted: Laplacian, edges.
    pub fn vertex_penalties(&self) -> bool {
        self.has_penalty(0) || self.has_penalty(2)
    }

    /// The same on flaps: flatten, normals.
    pub fn flap_penalties(&self) -> bool {
        self.has_penalty(1) || self.has_penalty(3)
    }

    /// Whether one of the options' regularisers stands at a place of the record.
    pub fn has_penalty(&self, place: usize) -> bool {
        self.penalties.contains(&place)
    }

    /// The images to render.
    pub fn outputs(&self) -> Outputs {
        let silhouette = self.silhouette.code != c::LOSS_NONE;
        Outputs { color: self.has_color, silhouette, depth: false, normal: false }
    }

    /// What a step is rendered with.
    pub fn settings(&self, settings: &Settings) -> Settings {
        let (width, height) = (self.width, self.height);
        Settings { width, height, outputs: self.outputs(), save: true, ..settings.clone() }
    }

    /// The optimiser's numbers in its so-manieth step, counted from 1.
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

    /// METHOD_ of the constants.
    pub fn method_code(&self) -> u32 {
        match self.method {
            Method::Sgd { .. } => c::METHOD_SGD,
            Method::Adam { .. } => c::METHOD_ADAM,
            Method::UniformAdam { .. } => c::METHOD_UNIFORM,
        }
    }
}

/// Where a regulariser's value stands among a record's four.
fn place_of(regularizer: Regularizer) -> usize {
    match regularizer {
        Regularizer::Laplacian => 0,
        Regularizer::Flatten => 1,
        Regularizer::EdgeLength { .. } => 2,
        Regularizer::NormalConsistency => 3,
    }
}

/// All entries of the inverse of a fit's smoothing, three columns at a time.
fn inverse(fit: &ShapeFit) -> Result<Vec<f32>> {
    let Some(smoothing) = fit.smoothing() else { return bad("no smoothing", "use the smoothed parametrisation") };
    let vertices = fit.topology().vertices();
    let mut inverse = vec![0.0; vertices * vertices];
    for first in (0..vertices).step_by(3) {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut columns = vec![DVec3::ZERO; vertices];
        axes.iter().zip(first..vertices).for_each(|(axis, column)| columns[column] = *axis);
        smoothing.apply(&mut columns)?;
        for (row, entries) in columns.iter().enumerate() {
            let entries = entries.to_array().into_iter().zip(first..vertices);
            // The matrix is symmetric, its solution only nearly: the lower half is the one.
            entries.filter(|(_, column)| *column <= row).for_each(|(entry, column)| {
                inverse[row * vertices + column] = entry as f32;
                inverse[column * vertices + row] = entry as f32;
            });
        }
    }
    Ok(inverse)
}

fn judge_weights(targets: &Targets, weights: Option<&Image>) -> Result<()> {
    let Some(weights) = weights else { return Ok(()) };
    let (height, width) = targets.size()?;
    let expected = [targets.cameras.len(), height, width, 1];
    let shape = [weights.batch, weights.height, weights.width, weights.channels];
    if shape != expected || weights.data.len() != expected.iter().product::<usize>() {
        return bad(format!("weights of shape {shape:?} for targets {expected:?}"), "give one weight a pixel");
    }
    if !weights.data.iter().all(|w| w.is_finite() && *w >= 0.0) || weights.data.iter().all(|w| *w == 0.0) {
        return bad("weights that are negative, not finite or all 0", "use 0 for what does not count, 1 for what does");
    }
    Ok(())
}

fn logit_template(fit: &ShapeFit) -> Result<Vec<[f32; 4]>> {
    let Some(template) = fit.logit_template() else { return bad("no template", "use the logit parametrisation") };
    let odds = |v: f64| if v == 0.0 { 0.0 } else { ((1.0 - v.abs()) / v.abs()).copysign(v) as f32 };
    Ok(template.iter().map(|v| [odds(v.x), odds(v.y), odds(v.z), 0.0]).collect())
}

impl Tables {
    fn of(topology: &Topology) -> Self {
        let vertices = topology.vertices();
        let mut corners = vec![Vec::new(); vertices];
        let mut flaps = Vec::with_capacity(topology.flaps().len());
        for (f, flap) in topology.flaps().iter().enumerate() {
            let [a, b] = flap.edge;
            let along = |t: u32| {
                let [i, j, k] = topology.triangles()[t as usize];
                [[i, j], [j, k], [k, i]].contains(&[a, b])
            };
            let bit = |on: bool, bit: u32| if on { bit } else { 0 };
            let bits = bit(flap.official, c::FLAP_OFFICIAL)
                | bit(along(flap.triangles[0]), c::FLAP_FIRST_ALONG)
                | bit(along(flap.triangles[1]), c::FLAP_SECOND_ALONG);
            let vertices = [a, b, flap.opposite[0], flap.opposite[1]];
            for (corner, &v) in vertices.iter().enumerate() {
                corners[v as usize].push(4 * f as u32 + corner as u32);
            }
            flaps.push([a | bits, b, vertices[2], vertices[3]]);
        }
        let neighbors: Vec<Vec<u32>> = (0..vertices).map(|i| topology.neighbors(i).to_vec()).collect();
        Self { neighbors: rows(&neighbors), flaps, flap_corners: rows(&corners), ..Self::default() }
    }

    fn target_pixels(&self, has_color: bool) -> u32 {
        (self.targets.len() / if has_color { 4 } else { 1 }) as u32
    }

    fn push_targets(&mut self, silhouette: Option<&Image>, color: Option<&Image>) {
        match color {
            Some(color) => {
                for (i, rgb) in color.data.chunks_exact(3).enumerate() {
                    self.targets.extend(rgb);
                    self.targets.push(silhouette.map_or(0.0, |s| s.data[i]));
                }
            }
            None => self.targets.extend(silhouette.iter().flat_map(|s| &s.data)),
        }
    }
}

/// Rows of different lengths as one array: where each begins, counted from the array's start, and where the last ends.
fn rows(rows: &[Vec<u32>]) -> Vec<u32> {
    let mut next = rows.len() as u32 + 1;
    let mut flat = vec![next];
    for row in rows {
        next += row.len() as u32;
        flat.push(next);
    }
    flat.extend(rows.iter().flatten());
    flat
}
