//! Converts the options of a fit to a template, options of its steps, and schedules.

use super::{
    begin::{Begin, begin},
    options::{FitOptions, Preset, Template},
};
use crate::{
    ImageLoss, Parametrization, Regularizer, Schedule, ShapeFit, ShapeOptions, photographs::subject::Subject,
    work::Work,
};
use softras::{
    Mesh, Result, Settings,
    scene::{Appearance, Background, Interpolation},
    shapes::Samples,
};

/// Steps of a fit that begins with a sphere, and with a hull.
const ITERATIONS: usize = 500;
const HULL_ITERATIONS: usize = 150;
const QUICK_ITERATIONS: usize = 20;
/// The length of edges after remeshing, in pixels.
const EDGE: f64 = 1.5;
/// The flatten regulariser is a sum over edges. It weighs less for meshes of more triangles than this, so that it does not outweigh
/// the images.
const FLATTENED: f64 = 6000.0;
/// Shares of the steps before which the topology is tested. By the first the mesh has reached the outlines, so that background that
/// it covers is a hole and not an outline that it has yet to reach. The second tests what the first has left, with enough steps
/// after it for a new mesh to converge.
const RECUT_AT: [f64; 2] = [0.3, 0.6];

/// A fit of at least twice as many views that begins with their hull compares this many in each step until this share of the steps:
/// large steps need no more.
const FEW: usize = 12;
pub const FEW_UNTIL: f64 = 0.6;
/// From then on all views are compared, or of more than twice as many this many.
const MANY: usize = 48;

/// The views that a step compares, of a number of views, in the first [`FEW_UNTIL`] of the steps and in the others; 0: all.
pub fn views_per_step(given: &FitOptions, is_hull: bool, views: usize) -> [usize; 2] {
    match given.views_per_step {
        0 if is_hull && views >= 2 * FEW => [FEW, if views > 2 * MANY { MANY } else { 0 }],
        asked => [asked; 2],
    }
}

/// Everything about a fit that does not change while it runs.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The options as the user gave them.
    pub given: FitOptions,
    /// The mesh to begin with.
    pub template: Mesh,
    /// The samples of the views' hull, where the fit begins with it and may cut meshes to it.
    pub hull: Option<Samples>,
    /// The options of the steps of a small mesh; see [`Setup::options_of`].
    options: ShapeOptions,
    /// The number of steps.
    pub iterations: usize,
    /// Steps before which the topology is tested.
    recut_at: Vec<usize>,
    /// The views that a step compares before another step and from it on.
    views_per_step: [usize; 2],
    more_from: usize,
    /// Edge length for remeshing, world units.
    edge: Schedule,
    /// Step length of the vertices.
    rate: Schedule,
    /// Step length of the colours.
    color_rate: Schedule,
    sigma: Schedule,
    gamma: Schedule,
    depths: (f64, f64),
}

impl Setup {
    /// Makes the setup that the options ask for.
    pub fn new(given: FitOptions, subject: &Subject, work: &mut Work) -> Result<Self> {
        let official = given.preset == Preset::Official;
        let begin = begin(&given, subject, work)?;
        let is_hull = begin.hull.is_some();
        // Rate and sigma. A hull is near to the object, so that σ begins small: soft silhouettes are too large by some √σ, and the
        // mesh ends too small by as much. For one colour under light, where shading shows most of the shape, a larger σ gives better
        // hollows.
        let default = match (official, is_hull, begin.one_color) {
            (true, _, _) => ((0.01, 0.01), (1e-4, 1e-4)),
            (false, true, true) => ((0.02, 0.002), (3e-5, 2e-6)),
            (false, true, false) => ((0.02, 0.002), (1e-5, 3e-7)),
            (false, false, _) => ((0.03, 0.005), (1e-4, 1e-5)),
        };
        // The rate is in world units, so it scales with the size of the object.
        let unit = if official { 1.0 } else { subject.bounds.radius / REFERENCE_RADIUS };
        let rate = given.rate.unwrap_or((default.0.0 * unit, default.0.1 * unit));
        let (from, to) = given.edge.unwrap_or((EDGE, EDGE));
        let iterations = iterations(&given, is_hull);
        // A given mesh keeps its triangles, since that may be the purpose of the fit, and a quick fit and the official method never cut.
        let is_plain = given.preset != Preset::Smooth;
        let recuts = !(given.keep_topology || is_plain || matches!(given.template, Template::Mesh(_)));
        Ok(Self {
            options: shape_options(&given, official, &begin, subject),
            template: begin.mesh,
            iterations,
            recut_at: if recuts { RECUT_AT.map(|s| steps_of(s, iterations)).to_vec() } else { Vec::new() },
            views_per_step: views_per_step(&given, is_hull, given.fitted(subject).len()),
            more_from: steps_of(FEW_UNTIL, iterations),
            hull: begin.hull.filter(|_| recuts),
            edge: (from * subject.pixel, to * subject.pixel).into(),
            rate: rate.into(),
            color_rate: given.color_rate.unwrap_or((0.03, 0.005)).into(),
            sigma: given.sigma.unwrap_or(default.1).into(),
            gamma: given.gamma.unwrap_or((3e-2, 3e-3)).into(),
            depths: if official { (1.0, 100.0) } else { subject.depths },
            given,
        })
    }

    /// The options of the steps of a mesh.
    pub fn options_of(&self, mesh: &Mesh) -> ShapeOptions {
        let mut options = self.options.clone();
        let share = (FLATTENED / mesh.triangles().len() as f64).min(1.0);
        let is_own = self.given.preset == Preset::Official || self.given.flatten.is_some();
        let weights = options.regularizers.iter_mut().filter(|(kind, _)| *kind == Regularizer::Flatten && !is_own);
        weights.for_each(|(_, weight)| *weight *= share);
        options
    }

    /// The number of steps that a share of all steps is.
    pub fn share(&self, share: f64) -> usize {
        steps_of(share, self.iterations)
    }

    /// Whether the mesh is subdivided or remeshed before a step.
    pub fn remakes(&self, step: usize) -> bool {
        self.given.subdivide_at.contains(&step) || self.given.remesh_at.contains(&step)
    }

    /// The views that a step compares; 0: all.
    pub fn views_per_step(&self, step: usize) -> usize {
        self.views_per_step[usize::from(step >= self.more_from)]
    }

    /// Whether the topology is tested before a step.
    pub fn recuts(&self, step: usize) -> bool {
        self.recut_at.contains(&step)
    }

    /// The fit after subdividing or remeshing before a step.
    pub fn remade(&self, fit: &ShapeFit, step: usize) -> Result<ShapeFit> {
        let edge = self.edge.at_step(step, self.iterations);
        let fit = if self.given.remesh_at.contains(&step) { fit.remeshed(edge..=edge)? } else { fit.clone() };
        let mut fit =
            if self.given.subdivide_at.contains(&step) { fit.subdivided(self.given.subdivision)? } else { fit };
        fit.options.regularizers = self.options_of(fit.mesh()).regularizers;
        Ok(fit)
    }

    /// The mesh that a resumed fit starts from: the template, unless it may have got other triangles before that step.
    pub fn resumed(&self, step: usize, mesh: Mesh) -> Result<Mesh> {
        let mut changes = self.given.subdivide_at.iter().chain(&self.given.remesh_at).chain(&self.recut_at);
        if !changes.any(|&at| at < step) {
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
        (self.rate.at_step(step, self.iterations), self.color_rate.at_step(step, self.iterations))
    }

    /// The settings of a step, except for the image size.
    pub fn settings(&self, step: usize) -> Settings {
        Settings {
            sigma: self.sigma.at_step(step, self.iterations),
            gamma: self.gamma.at_step(step, self.iterations),
            near: self.depths.0,
            far: self.depths.1,
            // A triangle in front must not be cut off by tau while it still outweighs those behind it.
            tau: if self.given.is_colored() { 1e-6 } else { Settings::default().tau },
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            faces: self.given.faces,
            ..Settings::default()
        }
    }
}

/// The number of steps from a hull, or from another mesh.
pub fn iterations(given: &FitOptions, hull: bool) -> usize {
    given.iterations.unwrap_or(match given.preset {
        Preset::Quick => QUICK_ITERATIONS,
        _ if hull => HULL_ITERATIONS,
        _ => ITERATIONS,
    })
}

/// The radius that the cameras of the official data see around the origin; rates are for objects of this size.
const REFERENCE_RADIUS: f64 = 0.732;

/// A share of all steps, rounded up so that it is never 0: before the first step a sphere still covers background everywhere, and
/// must not be cut.
fn steps_of(share: f64, iterations: usize) -> usize {
    (share * iterations as f64).ceil() as usize
}

fn shape_options(given: &FitOptions, official: bool, begin: &Begin, subject: &Subject) -> ShapeOptions {
    let mut options = if official { ShapeOptions::official() } else { ShapeOptions::smooth() };
    if begin.hull.is_some() && begin.one_color {
        // Shading of a known colour shows the surface everywhere, so that it needs less smoothing.
        options.parametrization = Parametrization::Smoothed { lambda: 2.0 };
        options.regularizers = vec![(Regularizer::Laplacian, 1e-4), (Regularizer::Flatten, 1e-6)];
    }
    if let Some(lambda) = given.smoothing {
        options.parametrization = Parametrization::Smoothed { lambda };
    }
    options = options.weighted([given.laplacian, given.flatten, given.normal_consistency]);
    options.samples = given.samples;
    options.views_per_step = given.views_per_step;
    options.silhouette.0 = given.loss;
    options.color = (ImageLoss::L1, given.color_weight.unwrap_or(if begin.one_color { 5.0 } else { 3.0 }));
    options.depth = (ImageLoss::L1, given.depth_weight / subject.bounds.radius);
    options.normal = (ImageLoss::L1, given.normal_weight);
    (options.fit_colors, options.fit_positions) = (given.is_colored() && !begin.one_color, !given.keeps_shape());
    options
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_step_compares_more_than_48_of_very_many_views() {
        let of = |asked: usize, is_hull: bool, views: usize| {
            views_per_step(&FitOptions { views_per_step: asked, ..FitOptions::default() }, is_hull, views)
        };
        assert_eq!([23, 24, 96, 97].map(|views| of(0, true, views)), [[0, 0], [12, 0], [12, 0], [12, 48]]);
        // A sphere is far from the views, and a user knows what is asked for.
        assert_eq!([of(0, false, 97), of(7, true, 97)], [[0, 0], [7, 7]]);
    }
}
