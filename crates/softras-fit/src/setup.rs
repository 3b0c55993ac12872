//! Converts the options of a fit to a template, options of its steps, and schedules.

use crate::{
    ImageLoss, Parametrization, Regularizer, Schedule, ShapeFit, ShapeOptions, Subdivision,
    begin::{Begin, begin},
    options::{FitOptions, Preset, Template},
    recut,
    subject::Subject,
};
use softras::{
    Lights, Mesh, Renderer, Result, Settings,
    scene::{Appearance, Background, Faces, Interpolation},
};

/// Steps of a fit that begins with a sphere, and with a hull.
const ITERATIONS: usize = 500;
const HULL_ITERATIONS: usize = 150;
/// The length of edges after remeshing, in pixels.
const EDGE: f64 = 1.5;

/// Everything about a fit that does not change while it runs.
#[derive(Clone, Debug)]
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
    subdivision: Subdivision,
    remesh_at: Vec<usize>,
    /// Steps before which the topology is looked at.
    recut_at: Vec<usize>,
    /// The centre and the side of the cube around the object.
    pub cube: ([f64; 3], f64),
    /// Edge length for remeshing, world units.
    edge: Schedule,
    /// The length of a pixel of the images about the middle of the object, world units.
    pub pixel: f64,
    /// Step length of the vertices.
    pub rate: Schedule,
    colors: Schedule,
    sigma: Schedule,
    gamma: Schedule,
    depths: (f64, f64),
    faces: Faces,
    /// Whether colours are compared.
    pub colored: bool,
    /// Whether a texture is made for the mesh that is found.
    pub paints: bool,
    /// The lights of the views and of the fit.
    pub lights: Lights,
}

impl Setup {
    /// Makes the setup that the options ask for.
    pub fn new(
        options: &FitOptions,
        subject: &Subject,
        notes: &mut Vec<String>,
        renderer: &mut Renderer,
    ) -> Result<Self> {
        let official = options.preset == Preset::Official;
        let pixel = subject.pixel;
        let range = |given: Option<(f64, f64)>, default: (f64, f64)| {
            let (from, to) = given.unwrap_or(default);
            if from == to { Schedule::Constant(from) } else { Schedule::Exponential { from, to } }
        };
        let begin = begin(options, subject, notes, renderer)?;
        // Rate and sigma. A hull is near to what is sought, and is not to be blurred away: silhouettes are too large by some √σ,
        // by which the mesh ends too small. Where light tells most of the shape, a wider edge gives the better hollows.
        let default = match (official, begin.hull, begin.one_color) {
            (true, _, _) => ((0.01, 0.01), (1e-4, 1e-4)),
            (false, true, true) => ((0.02, 0.002), (3e-5, 2e-6)),
            (false, true, false) => ((0.02, 0.002), (1e-5, 3e-7)),
            (false, false, _) => ((0.03, 0.005), (1e-4, 1e-5)),
        };
        // The rate is in world units, so it scales with the size of the object.
        let unit = if official { 1.0 } else { subject.bounds.radius / REFERENCE_RADIUS };
        let (from, to) = options.rate.unwrap_or((default.0.0 * unit, default.0.1 * unit));
        let iterations = options.iterations.unwrap_or(if begin.hull { HULL_ITERATIONS } else { ITERATIONS });
        // A mesh of a file keeps its triangles, which may be what the fit is for, and the official method has none of this.
        let recuts = !(options.keep_topology || official || matches!(options.template, Template::Mesh(_)));
        Ok(Self {
            colored: options.is_colored(),
            options: shape_options(options, official, &begin, subject),
            paints: options.texture.is_some() && !options.keeps_shape(),
            pixel,
            template: begin.mesh,
            faces: options.faces,
            lights: subject.lights.clone(),
            iterations,
            recut_at: if recuts { recut::SHARES.map(|s| steps_of(s, iterations)).to_vec() } else { Vec::new() },
            cube: subject.cube(),
            stride: options.view_stride,
            subdivide_at: options.subdivide_at.clone(),
            subdivision: options.subdivision,
            remesh_at: options.remesh_at.clone(),
            edge: range(options.edge.map(|(from, to)| (from * pixel, to * pixel)), (EDGE * pixel, EDGE * pixel)),
            rate: range(Some((from, to)), (from, to)),
            colors: range(options.color_rate, (0.03, 0.005)),
            sigma: range(options.sigma, default.1),
            gamma: range(options.gamma, (3e-2, 3e-3)),
            depths: if official { (1.0, 100.0) } else { subject.depths },
        })
    }

    /// The number of steps that a share of all steps is.
    pub fn share(&self, share: f64) -> usize {
        steps_of(share, self.iterations)
    }

    /// Whether the mesh is subdivided or remeshed before a step.
    pub fn remakes(&self, step: usize) -> bool {
        self.subdivide_at.contains(&step) || self.remesh_at.contains(&step)
    }

    /// Whether the topology is looked at before a step.
    pub fn recuts(&self, step: usize) -> bool {
        self.recut_at.contains(&step)
    }

    /// Whether the mesh gets other triangles at steps that were given.
    pub fn has_new_triangles(&self) -> bool {
        !(self.subdivide_at.is_empty() && self.remesh_at.is_empty())
    }

    /// The fit after subdividing or remeshing before a step.
    pub fn remade(&self, fit: &ShapeFit, step: usize) -> Result<ShapeFit> {
        let edge = self.edge.at_step(step, self.iterations);
        let fit = if self.remesh_at.contains(&step) { fit.remeshed(edge..=edge)? } else { fit.clone() };
        Ok(if self.subdivide_at.contains(&step) { fit.subdivided(self.subdivision)? } else { fit })
    }

    /// The mesh that a resumed fit starts from: the template, unless it may have got other triangles before that step.
    pub fn resumed(&self, step: usize, mesh: Mesh) -> Result<Mesh> {
        if !self.subdivide_at.iter().chain(&self.remesh_at).chain(&self.recut_at).any(|&at| at < step) {
            return Ok(self.template.clone());
        }
        let appearance = match self.template.appearance() {
            // The colours are restored with the state.
            Appearance::VertexColors(_) => Appearance::VertexColors(vec![[0.5; 3]; mesh.positions().len()]),
            other => other.clone(),
        };
        mesh.with_appearance(appearance)
    }

    /// The step lengths of the vertices and of the colours.
    pub fn rates(&self, step: usize) -> (f64, f64) {
        (self.rate.at_step(step, self.iterations), self.color_rate(step))
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
            tau: if self.colored { 1e-6 } else { Settings::default().tau },
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            faces: self.faces,
            ..Settings::default()
        }
    }
}

/// The radius that the cameras of the official data see around the origin; rates are for objects of this size.
const REFERENCE_RADIUS: f64 = 0.732;

/// The number of steps that a share of all is, and never 0: nothing is cut before the first step, where a sphere covers what it is
/// yet to shrink from.
fn steps_of(share: f64, iterations: usize) -> usize {
    (share * iterations as f64).ceil() as usize
}

fn shape_options(given: &FitOptions, official: bool, begin: &Begin, subject: &Subject) -> ShapeOptions {
    let mut options = if official { ShapeOptions::official() } else { ShapeOptions::smooth() };
    if begin.hull && begin.one_color {
        // Light on a known colour shows the surface everywhere, so that less has to be assumed of it.
        options.parametrization = Parametrization::Smoothed { lambda: 2.0 };
        options.regularizers = vec![(Regularizer::Laplacian, 1e-4), (Regularizer::Flatten, 1e-6)];
    }
    if let Some(lambda) = given.smoothing {
        options.parametrization = Parametrization::Smoothed { lambda };
    }
    let mut weights = options.regularizers.clone();
    weights.push((Regularizer::NormalConsistency, 0.0));
    let own = [given.laplacian, given.flatten, given.normal_consistency];
    weights.iter_mut().zip(own).for_each(|(weight, own)| weight.1 = own.unwrap_or(weight.1));
    options.regularizers = weights.into_iter().filter(|(_, weight)| *weight > 0.0).collect();
    options.samples = given.samples;
    options.views_per_step = given.views_per_step;
    options.silhouette.0 = given.loss;
    options.color = (ImageLoss::L1, given.color_weight.unwrap_or(if begin.one_color { 5.0 } else { 3.0 }));
    options.depth = (ImageLoss::L1, given.depth_weight / subject.bounds.radius);
    options.normal = (ImageLoss::L1, given.normal_weight);
    (options.fit_colors, options.fit_positions) = (given.is_colored() && !begin.one_color, !given.keeps_shape());
    options
}
