//! A shape fit with its targets and the best mesh that it has found.

use super::shape::{ShapeFit, StepLosses, steps_of_a_turn};
use softras::{
    Renderer, Result,
    scene::{Mesh, Settings},
};
use softras_io::Views;
use std::collections::VecDeque;

/// A shape fit in progress: it remembers its best mesh.
#[derive(Clone, Debug)]
pub struct ShapeRun {
    shape: ShapeFit,
    targets: Views,
    /// The mean losses of the latest steps in which every view was compared.
    latest: VecDeque<f64>,
    /// The least mean of them, its mesh, and its step.
    best: Option<(f64, Mesh, usize)>,
    taken: usize,
}

impl ShapeRun {
    /// Continues a shape fit.
    pub fn new(shape: ShapeFit, targets: &Views) -> Self {
        Self { shape, targets: targets.clone(), latest: VecDeque::new(), best: None, taken: 0 }
    }

    /// Takes a step: renders the targets' views, compares them, and moves vertices with step size `rate`, in world units
    /// about the distance that a vertex moves, and colours with `color_rate`. Returns the losses before the move. The fit sets
    /// size, outputs and `save` of the settings itself; near and far have to hold the mesh wherever it moves, see
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
        self.taken += 1;
        Ok(step)
    }

    /// Keeps the mesh before a step if its loss is the least. The losses of steps with different views are not comparable, so
    /// it is the mean over the steps in which the views had a turn; before the first turn ends, of those there are.
    fn keep_best(&mut self, before: Mesh, loss: f64) {
        let turn = steps_of_a_turn(self.shape.options().views_per_step, self.targets.cameras.len());
        self.latest.push_back(loss);
        if self.latest.len() > turn {
            self.latest.pop_front();
        }
        let mean = self.latest.iter().sum::<f64>() / self.latest.len() as f64;
        if self.taken < turn || self.best.as_ref().is_none_or(|(least, ..)| mean < *least) {
            self.best = Some((mean, before, self.taken));
        }
    }

    /// The fit after the steps taken: its mesh, and the state that it can be resumed from.
    pub fn shape(&self) -> &ShapeFit {
        &self.shape
    }

    /// The mesh of least loss and the number of its step, counted from 0 in this fit; `None` before the first step.
    pub fn best(&self) -> Option<(&Mesh, usize)> {
        self.best.as_ref().map(|(_, mesh, step)| (mesh, *step))
    }

    /// The mean loss of the best mesh's turn; infinite before the first step.
    pub(crate) fn least(&self) -> f64 {
        self.best.as_ref().map_or(f64::INFINITY, |(least, ..)| *least)
    }
}
