//! `softras fit`: fits a mesh to images.

pub mod args;
mod begin;
mod camera_files;
mod cameras;
mod checkpoint;
mod color_error;
mod dig;
mod film;
mod maps;
mod paint;
mod plot;
mod recut;
mod report;
mod setup;
pub mod targets;
mod texels;
mod unseen;

use super::outputs::Outputs;
use super::steps::{Loop, Steps};
use super::{Failure, note};
use args::FitArgs;
use film::Film;
use paint::Painted;
use report::{Log, Scores};
use setup::Setup;
use softras::{Mesh, Renderer};
use softras_fit::{Fit, ShapeFit, Targets};
use softras_io::Budget;
use softras_io::output;
use std::time::Instant;
use targets::Views;

/// Steps between two checkpoints.
const CHECKPOINT_STEPS: usize = 100;

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<(), Failure> {
    let (files, out) = (&args.files, &args.out);
    args.check_source()?;
    let written = [&files.json, &files.plot, &files.gif, &files.checkpoint];
    let mut views = Vec::new();
    if let Some(folder) = &files.write_views {
        for folder in [folder.clone()].into_iter().chain(maps::folders(folder, &args.also)) {
            std::fs::create_dir_all(&folder).map_err(|source| softras::Error::Io { path: folder, source })?;
        }
        views = camera_files::names(folder, args.count_of_views()?);
        views.extend(maps::names(folder, &args.also, &views));
    }
    let outputs = Outputs::new(written.into_iter().flatten().chain(&views), [out])?;
    let mut renderer = super::open_device(args.device.as_deref(), args.read.memory.memory)?;
    let views = Views::read(args, &outputs, &mut renderer)?;
    let setup = Setup::new(args, &views, &mut renderer)?;
    let targets = targets::fitted(args, &views.targets);
    let mut work = Work::begin(args, &setup, &views, &targets)?;
    let ended = work.run(&mut renderer);
    let ended = ended.and_then(|()| work.paint(&views, &mut renderer));
    if let Err(failure) = ended {
        // The best mesh found before the error is still written.
        if let Some((best, step)) = work.best {
            softras_io::save(&best, out)?;
            note(&format!("{} is the best mesh before the error, of step {step}", out.display()));
        }
        return Err(failure);
    }
    let best = work.found();
    let scores = Scores::of(&best, &setup, &views, &mut renderer)?;
    softras_io::save(&best, out)?;
    if let Some(path) = &files.gif {
        work.film.write(path)?;
    }
    if let Some(path) = &files.plot {
        plot::write(path, &work.log.losses())?;
    }
    if let Some(path) = &files.json {
        let mut report = work.log.json(args, &setup, &scores, renderer.device_name(), &best);
        report["texture"] = work.painted.as_ref().map(Painted::json).into();
        output::write_file(path, report.to_string().as_bytes())?;
    }
    report::tell(out, &work.log, &scores, &best)?;
    if work.interrupted { Err(Failure::Interrupted) } else { Ok(()) }
}

/// A fit in progress, with its log and its best mesh.
struct Work<'a> {
    args: &'a FitArgs,
    setup: &'a Setup,
    targets: &'a Targets,
    fit: Fit,
    /// The first step of `fit`.
    first: usize,
    log: Log,
    film: Film,
    /// The mesh of least loss, and its step.
    best: Option<(Mesh, usize)>,
    /// The best mesh with the texture that was made for it.
    painted: Option<Painted>,
    /// Whether Ctrl-C ended the fit.
    interrupted: bool,
}

impl<'a> Work<'a> {
    /// Starts from the template or from a checkpoint.
    fn begin(args: &'a FitArgs, setup: &'a Setup, views: &Views, targets: &'a Targets) -> Result<Self, Failure> {
        let begin = |mesh: Mesh| ShapeFit::new(mesh, views.lights.clone(), setup.options.clone());
        let (mut fit, mut first) = (begin(setup.template.clone())?, 0);
        if let Some(path) = args.files.checkpoint.as_ref().filter(|path| args.files.resume && path.exists()) {
            let (step, mesh, state) = checkpoint::read(path, Budget::new(args.read.memory.memory))?;
            fit = begin(setup.resumed(step, mesh)?)?;
            fit.restore(state)?;
            first = step;
            note(&format!("going on from step {step} of {}", path.display()));
        }
        let film = Film::new(args.files.gif.is_some(), setup, views);
        let (fit, log) = (Fit::new(fit, targets), Log::default());
        Ok(Self { args, setup, targets, fit, first, log, film, best: None, painted: None, interrupted: false })
    }

    /// Takes all steps, or those until Ctrl-C, and writes the checkpoint of the end.
    fn run(&mut self, renderer: &mut Renderer) -> Result<(), Failure> {
        let steps = self.first..self.setup.iterations;
        let next = Loop::over(steps).with_bar("step").until_interrupted()?.run(self, renderer)?;
        self.interrupted = next < self.setup.iterations;
        if self.interrupted {
            note(&format!("interrupted before step {next}: this is the best so far"));
        }
        self.keep_best();
        let mesh = self.fit.shape().mesh().clone();
        self.film.last(&mesh, self.setup, renderer)?;
        self.write_checkpoint(next)
    }

    /// Makes and fits a texture for the best mesh, where one is to be made and Ctrl-C has not ended the fit before.
    fn paint(&mut self, views: &Views, renderer: &mut Renderer) -> Result<(), Failure> {
        if !self.setup.paints || self.interrupted {
            return Ok(());
        }
        let (mesh, step) = match &self.best {
            Some(best) => best.clone(),
            None => (self.fit.shape().mesh().clone(), self.first),
        };
        let painted = paint::painted(self.args, self.setup, views, self.targets, &mesh, renderer)?;
        self.film.last(&painted.mesh, self.setup, renderer)?;
        self.interrupted = painted.interrupted;
        self.best = Some((painted.mesh.clone(), step));
        self.painted = Some(painted);
        Ok(())
    }

    /// The mesh of least loss, or the one to begin with where no step was taken.
    fn found(&mut self) -> Mesh {
        match self.best.take() {
            Some((best, _)) => best,
            None => self.fit.shape().mesh().clone(),
        }
    }

    /// Goes on with another fit from a step on, and keeps the best mesh of the one before.
    fn go_on_with(&mut self, fit: ShapeFit, step: usize) {
        self.keep_best();
        self.fit = Fit::new(fit, self.targets);
        self.first = step;
    }

    /// The steps that take all views once: losses of different views are not comparable, but means over these steps are.
    fn turn(&self) -> usize {
        match self.setup.options.views_per_step {
            0 => 1,
            count => self.targets.cameras.len().div_ceil(count),
        }
    }

    /// Keeps the best mesh of `fit` if it is better than the best so far.
    fn keep_best(&mut self) {
        let Some((mesh, step)) = self.fit.best() else { return };
        let step = self.first + step;
        let turn = self.turn();
        let loss = |step: usize| self.log.loss(step, turn);
        if self.best.as_ref().is_none_or(|(_, best)| loss(step) < loss(*best)) {
            self.best = Some((mesh.clone(), step));
        }
    }

    /// Writes the state before a step, where a checkpoint is wanted.
    fn write_checkpoint(&self, step: usize) -> Result<(), Failure> {
        let Some(path) = &self.args.files.checkpoint else { return Ok(()) };
        Ok(checkpoint::write(path, self.fit.shape(), step)?)
    }

    /// Whether a checkpoint is due before a step. The state that `fit` began with is the template's, or a checkpoint's already.
    fn saves(&self, step: usize) -> bool {
        self.args.files.checkpoint.is_some() && step > self.first && step.is_multiple_of(CHECKPOINT_STEPS)
    }
}

impl Steps for Work<'_> {
    fn step(&mut self, at: usize, renderer: &mut Renderer) -> Result<String, Failure> {
        let began = Instant::now();
        let (rate, color_rate) = self.setup.rates(at);
        let found = self.fit.step(renderer, &self.setup.settings(at), rate, color_rate)?;
        let text = format!("loss {:.5}", found.loss);
        self.log.add(at, found, began.elapsed().as_secs_f64());
        Ok(text)
    }

    fn pauses(&self, at: usize) -> bool {
        self.saves(at) || self.setup.recuts(at) || self.setup.remakes(at) || self.film.shows(at)
    }

    fn pause(&mut self, at: usize, renderer: &mut Renderer) -> Result<(), Failure> {
        if self.saves(at) {
            self.write_checkpoint(at)?;
        }
        if self.setup.recuts(at) {
            self.recut(at, renderer)?;
        }
        if self.setup.remakes(at) {
            let fit = self.setup.remade(self.fit.shape(), at)?;
            self.go_on_with(fit, at);
        }
        if self.film.shows(at) {
            let mesh = self.fit.shape().mesh().clone();
            self.film.last(&mesh, self.setup, renderer)?;
        }
        Ok(())
    }
}
