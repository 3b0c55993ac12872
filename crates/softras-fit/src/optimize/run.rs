//! A shape fit with its targets and the best mesh that it has found.

use super::shape::{ShapeFit, StepLosses, steps_of_a_turn};
use softras::{
    Renderer, Result,
    scene::{Mesh, Settings},
};
use softras_io::Views;
use std::collections::VecDeque;

/// A mesh of least loss: the mean loss of a turn of the views, the mesh before its last step, and that step's number.
type Best = (f64, Mesh, usize);

/// A shape fit in progress: it remembers its best mesh.
///
/// ```
/// use softras::{Camera, Lights, Projection, Renderer, Scene, Settings, shapes};
/// use softras_fit::{Schedule, ShapeFit, ShapeOptions, ShapeRun};
/// use softras_io::Views;
///
/// # fn main() -> softras::Result<()> {
/// let mut renderer = Renderer::new()?;
/// // The targets: the silhouettes of a cube. Yours would be masks of photographs, with the cameras that took them.
/// let goal = Scene::new(shapes::cube()?);
/// let around = |i: u32| Camera::from_angles(4.0, 20.0, 90.0 * f64::from(i), Projection::Perspective { fov_y: 0.6 });
/// let cameras = (0..4).map(around).collect::<softras::Result<Vec<_>>>()?;
/// // Near and far have room for a mesh that moves.
/// let settings = Settings { width: 32, height: 32, ..Settings::default() }.with_depths_of(&goal, &cameras, 0.5);
/// let silhouette = Some(renderer.render(&goal, &cameras, &settings)?.silhouette()?.clone());
/// let targets = Views { cameras, silhouette, ..Views::default() };
///
/// // A sphere, moved by the method of the command `softras fit`, with softness and steps that shrink.
/// let shape = ShapeFit::new(shapes::icosphere(2)?, Lights::unlit(), ShapeOptions::smooth())?;
/// let mut fit = ShapeRun::new(shape, &targets);
/// let (rate, sigma) = (Schedule::from((0.04, 0.007)), Schedule::from((3e-4, 1e-5)));
/// for step in 0..10 {
///     let settings = Settings { sigma: sigma.at_step(step, 10), ..settings.clone() };
///     fit.step(&mut renderer, &settings, rate.at_step(step, 10), 0.0)?;
/// }
/// assert!(fit.best().is_some_and(|(mesh, step)| mesh.positions().len() == 162 && step > 0));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct ShapeRun {
    shape: ShapeFit,
    pub(crate) targets: Views,
    /// The losses of the latest steps, at most as many as compare every view once.
    latest: VecDeque<f64>,
    best: Option<Best>,
    /// The best of the shapes before this one.
    before: Option<Best>,
    /// The first step of this shape, and the next.
    first: usize,
    next: usize,
}

impl ShapeRun {
    /// Continues a shape fit.
    pub fn new(shape: ShapeFit, targets: &Views) -> Self {
        Self { shape, targets: targets.clone(), latest: VecDeque::new(), best: None, before: None, first: 0, next: 0 }
    }

    /// Takes a step: it renders the targets' views, compares them, and moves vertices and colours. A vertex moves by about `rate`
    /// world units, a colour by about `color_rate`. Returns the losses before the move. The fit sets size, outputs and `save` of the
    /// settings itself; near and far have to hold the mesh wherever it moves, see
    /// [`Settings::with_depths_of`].
    ///
    /// # Errors
    /// As [`ShapeFit::step`].
    pub fn step(
        &mut self,
        renderer: &mut Renderer,
        settings: &Settings,
        rate: f64,
        color_rate: f64,
    ) -> Result<StepLosses> {
        let before = self.shape.mesh().clone();
        let step = self.shape.step(renderer, settings, &self.targets, rate, color_rate)?;
        self.keep_best(before, step.loss);
        self.next += 1;
        Ok(step)
    }

    /// Keeps the mesh before a step if its loss is the least. The losses of steps with different views are not comparable, so
    /// this is the mean loss of the latest steps that compared every view once, or of all steps if there were fewer.
    fn keep_best(&mut self, before: Mesh, loss: f64) {
        let turn = self.turn();
        self.latest.push_back(loss);
        if self.latest.len() > turn {
            self.latest.pop_front();
        }
        let mean = self.latest.iter().sum::<f64>() / self.latest.len() as f64;
        if self.next - self.first < turn || self.best.as_ref().is_none_or(|(least, ..)| mean < *least) {
            self.best = Some((mean, before, self.next));
        }
    }

    /// The number of steps that together compare every view once.
    pub(crate) fn turn(&self) -> usize {
        steps_of_a_turn(self.shape.options().views_per_step, self.targets.cameras.len())
    }

    /// Compares another number of views from the next step on. Losses of fewer views are not those of all, so the best mesh is looked
    /// for anew.
    pub(crate) fn compare(&mut self, views_per_step: usize) {
        if views_per_step != self.shape.options().views_per_step {
            self.shape.options.views_per_step = views_per_step;
            (self.best, self.before, self.first) = (None, None, self.next);
            self.latest.clear();
        }
    }

    /// Goes on with another shape from a step on, and remembers the best mesh of those before.
    pub(crate) fn go_on_with(&mut self, shape: ShapeFit, step: usize) {
        self.before = self.least().cloned();
        (self.shape, self.best) = (shape, None);
        self.latest.clear();
        (self.first, self.next) = (step, step);
    }

    /// The fit after the steps taken: its mesh, and the state that it can be resumed from.
    pub fn shape(&self) -> &ShapeFit {
        &self.shape
    }

    /// The number of the next step, counted from 0.
    pub(crate) fn next_step(&self) -> usize {
        self.next
    }

    /// The mesh of least loss and the number of its step, counted from 0; `None` before the first step.
    pub fn best(&self) -> Option<(&Mesh, usize)> {
        self.least().map(|(_, mesh, step)| (mesh, *step))
    }

    fn least(&self) -> Option<&Best> {
        self.before.iter().chain(&self.best).min_by(|a, b| a.0.total_cmp(&b.0))
    }
}
