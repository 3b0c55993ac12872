//! Converts the arguments of `softras fit` to a template, options and schedules.

use super::args::{FitArgs, Preset};
use super::targets::Views;
use crate::commands::Failure;
use softras::fit::{ImageLoss, Parametrization, Regularizer, Schedule, ShapeFit, ShapeOptions};
use softras::scene::{Appearance, Background, Faces, Interpolation};
use softras::{Lights, Mesh, Settings, shapes};

/// The sphere's radius as a share of the radius that the cameras see.
const SPHERE: f64 = 0.65;

/// The sigma that stands for no softness: its width, a few ten-thousandths of a screen unit, is far below a pixel.
const HARD_SIGMA: f64 = 1e-7;

/// Everything about a fit that does not change while it runs.
pub struct Setup {
    /// The mesh to begin with.
    pub template: Mesh,
    /// The options of the fit.
    pub options: ShapeOptions,
    /// The number of steps.
    pub iterations: usize,
    /// Every `stride`-th view is used.
    pub stride: usize,
    subdivide_at: Vec<usize>,
    remesh_at: Vec<usize>,
    /// Edge length for remeshing, world units.
    edge: Schedule,
    /// Step length of the vertices.
    pub rate: Schedule,
    colors: Schedule,
    sigma: Schedule,
    gamma: Schedule,
    depths: (f64, f64),
    faces: Faces,
    /// The lights of the views and of the fit.
    pub lights: Lights,
}

impl Setup {
    /// Makes the setup that the arguments ask for.
    pub fn new(args: &FitArgs, views: &Views) -> Result<Self, Failure> {
        let method = &args.method;
        let official = method.preset == Preset::Official;
        if args.shading.is_some() && !args.colored() {
            return Err(Failure::Usage("--shading: the light is seen in colours: add --color or --texture".into()));
        }
        let steps = |given: &[u32]| given.iter().map(|&at| at as usize).collect::<Vec<usize>>();
        let (subdivide_at, remesh_at) = (steps(&method.subdivide_at), steps(&method.remesh_at));
        if official && args.files.resume && !(subdivide_at.is_empty() && remesh_at.is_empty()) {
            let what = "--resume: the official parametrisation cannot be taken up after --subdivide-at or --remesh-at";
            return Err(Failure::Usage(what.into()));
        }
        let pixel = 2.0 * views.bounds.radius / views.targets.size()?.0 as f64;
        let stride = args.view_stride as usize;
        let range = |given: Option<(f64, f64)>, default: (f64, f64)| {
            let (from, to) = given.unwrap_or(default);
            if from == to { Schedule::Constant(from) } else { Schedule::Exponential { from, to } }
        };
        let default = if official { ((0.01, 0.01), (1e-4, 1e-4)) } else { ((0.03, 0.005), (1e-4, 1e-5)) };
        // The rate is in world units, so it scales with the size of the object.
        let unit = if official { 1.0 } else { views.bounds.radius / REFERENCE_RADIUS };
        let (from, to) = method.rate.unwrap_or((default.0.0 * unit, default.0.1 * unit));
        Ok(Self {
            template: template(args, views)?,
            faces: method.faces.into(),
            lights: args.lights(),
            options: options(args, official),
            iterations: method.iterations as usize,
            stride,
            subdivide_at,
            remesh_at,
            edge: range(Some((method.edge.0 * pixel, method.edge.1 * pixel)), (pixel, pixel)),
            rate: range(Some((from, to)), (from, to)),
            colors: range(method.color_rate, (0.03, 0.005)),
            sigma: range(method.sigma, default.1),
            gamma: range(method.gamma, (3e-2, 3e-3)),
            depths: if official { (1.0, 100.0) } else { views.depths },
        })
    }

    /// Whether the mesh is subdivided or remeshed before a step.
    pub fn remakes(&self, step: usize) -> bool {
        self.subdivide_at.contains(&step) || self.remesh_at.contains(&step)
    }

    /// The fit after subdividing or remeshing before a step.
    pub fn remade(&self, fit: &ShapeFit, step: usize) -> Result<ShapeFit, Failure> {
        let edge = self.edge.at_step(step, self.iterations);
        let fit = if self.remesh_at.contains(&step) { fit.remeshed(edge)? } else { fit.clone() };
        Ok(if self.subdivide_at.contains(&step) { fit.subdivided()? } else { fit })
    }

    /// The mesh that a resumed fit starts from: the template, unless it was subdivided or remeshed before that step.
    pub fn resumed(&self, step: usize, mesh: Mesh) -> Result<Mesh, Failure> {
        if !self.subdivide_at.iter().chain(&self.remesh_at).any(|&at| at < step) {
            return Ok(self.template.clone());
        }
        let appearance = match self.template.appearance() {
            // The colours are restored with the state.
            Appearance::VertexColors(_) => Appearance::VertexColors(vec![[0.5; 3]; mesh.positions().len()]),
            other => other.clone(),
        };
        Ok(mesh.with_appearance(appearance)?)
    }

    /// Replaces the schedules of σ and γ by their last values.
    pub fn hold_softness(&mut self) {
        self.sigma = Schedule::Constant(self.sigma.at(1.0));
        self.gamma = Schedule::Constant(self.gamma.at(1.0));
    }

    /// Makes edges as hard as single precision allows, so that there is a gradient only where an edge passes a pixel's
    /// centre.
    pub fn harden(&mut self) {
        self.hold_softness();
        self.sigma = Schedule::Constant(HARD_SIGMA);
    }

    /// The step length of the colours.
    pub fn color_rate(&self, step: usize) -> f64 {
        self.colors.at_step(step, self.iterations)
    }

    /// The settings of a step, except for the image size.
    pub fn settings(&self, step: usize) -> Settings {
        Settings {
            sigma: self.sigma.at_step(step, self.iterations),
            gamma: self.gamma.at_step(step, self.iterations),
            near: self.depths.0,
            far: self.depths.1,
            // A triangle in front must not be cut off by tau while it still outweighs those behind it.
            tau: if self.options.fit_colors { 1e-6 } else { Settings::default().tau },
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            faces: self.faces,
            ..Settings::default()
        }
    }
}

/// The radius that the cameras of the official data see around the origin; rates are for objects of this size.
const REFERENCE_RADIUS: f64 = 0.732;

fn options(args: &FitArgs, official: bool) -> ShapeOptions {
    let method = &args.method;
    let mut options = if official { ShapeOptions::official() } else { ShapeOptions::smooth() };
    if let Some(lambda) = method.smoothing {
        options.parametrization = Parametrization::Smoothed { lambda };
    }
    let mut weights = options.regularizers.clone();
    weights.push((Regularizer::NormalConsistency, 0.0));
    let given = [method.laplacian, method.flatten, method.normals];
    weights.iter_mut().zip(given).for_each(|(weight, given)| weight.1 = given.unwrap_or(weight.1));
    options.regularizers = weights.into_iter().filter(|(_, weight)| *weight > 0.0).collect();
    options.samples = method.samples.unwrap_or(1) as usize;
    options.silhouette.0 = method.loss.image_loss();
    options.color = (ImageLoss::L1, method.color_weight);
    (options.fit_colors, options.fit_positions) = (args.colored(), !args.texture);
    options
}

/// The mesh to begin with, placed where the cameras look.
fn template(args: &FitArgs, views: &Views) -> Result<Mesh, Failure> {
    let official = args.method.preset == Preset::Official;
    let mesh = match &views.template {
        Some(mesh) => mesh.clone(),
        None => {
            let (center, radius) = (views.bounds.center.to_array(), SPHERE * views.bounds.radius);
            let (center, radius) = if official { ([0.0; 3], 1.0) } else { (center, radius) };
            placed(&shapes::icosphere(args.subdivisions)?, |p, k| f64::from(p) * radius + center[k])?
        }
    };
    let mesh = if official { placed(&mesh, |p, _| 0.5 * f64::from(p))? } else { mesh };
    let textured = matches!(mesh.appearance(), Appearance::Textured { .. });
    if args.texture && !textured {
        return Err(Failure::Usage("--texture: give a textured mesh as --template".into()));
    }
    if textured && !(args.method.subdivide_at.is_empty() && args.method.remesh_at.is_empty()) {
        let what = "--subdivide-at, --remesh-at: the triangles of a textured template stay what they are";
        return Err(Failure::Usage(what.into()));
    }
    let colors = vec![[0.5; 3]; mesh.positions().len()];
    Ok(match args.colored() {
        true if textured => mesh,
        true => mesh.with_appearance(Appearance::VertexColors(colors))?,
        false => mesh.with_appearance(Appearance::Uniform([0.8; 3]))?,
    })
}

fn placed(mesh: &Mesh, place: impl Fn(f32, usize) -> f64) -> Result<Mesh, Failure> {
    let positions = mesh.positions().iter().map(|p| [0, 1, 2].map(|k| place(p[k], k) as f32)).collect();
    Ok(Mesh::new(positions, mesh.triangles().to_vec())?.with_appearance(mesh.appearance().clone())?)
}
