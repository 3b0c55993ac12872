//! `softras fit`: fits a mesh to images.

pub mod args;
mod baselines;
mod begin;
mod benchmark;
mod camera_files;
mod cameras;
mod checkpoint;
mod color_error;
mod dig;
mod engine;
mod film;
mod maps;
mod paint;
mod plot;
mod recut;
mod report;
mod setup;
mod surface;
pub mod targets;
mod texels;
mod unseen;

use super::color::encoded;
use super::memory::Budget;
use super::outputs::Outputs;
use super::steps::{Loop, Steps};
use super::{Failure, note};
use args::FitArgs;
use engine::Engine;
use film::Film;
use paint::Painted;
use report::{Log, Scores};
use setup::Setup;
use softras::fit::{ShapeFit, Targets};
use softras::internals::files;
use softras::{Mesh, Renderer};
use targets::Views;

/// Steps between two checkpoints.
const CHECKPOINT_STEPS: usize = 100;

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<(), Failure> {
    if let Some(meshes) = &args.benchmark {
        return benchmark::run(args, meshes);
    }
    let (files, out) = (&args.files, args.out()?);
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
    let mut work = Work::begin(args, &setup, &views, &targets, &mut renderer)?;
    let ended = work.run(&mut renderer);
    let ended = ended.and_then(|()| work.paint(&views, &mut renderer));
    if let Err(failure) = ended {
        // The best mesh found before the error is still written.
        if let Some((best, step)) = work.best {
            softras::obj::write_obj(&encoded(&best)?, out)?;
            note(&format!("{} is the best mesh before the error, of step {step}", out.display()));
        }
        return Err(failure);
    }
    let best = work.found(&mut renderer)?;
    let scores = Scores::of(&best, &setup, &views, &mut renderer)?;
    softras::obj::write_obj(&encoded(&best)?, out)?;
    if let Some(path) = &files.gif {
        work.film.write(path)?;
    }
    if let Some(path) = &files.plot {
        plot::write(path, &work.log.losses())?;
    }
    let baselines = if args.method.baselines && !work.interrupted {
        baselines::run(args, &views, &mut renderer)?
    } else {
        Vec::new()
    };
    if let Some(path) = &files.json {
        let mut report = work.log.json(args, &setup, &scores, (renderer.device_name(), work.engine.reason()), &best);
        report["texture"] = work.painted.as_ref().map(Painted::json).into();
        report["baselines"] = baselines.iter().map(baselines::Baseline::json).collect();
        files::write_file(path, report.to_string().as_bytes())?;
    }
    report::tell(out, &work.log, &scores, &best)?;
    baselines.iter().try_for_each(|baseline| super::say(&baseline.sentence()))?;
    if work.interrupted { Err(Failure::Interrupted) } else { Ok(()) }
}

/// A fit in progress, with its log and its best mesh.
struct Work<'a> {
    args: &'a FitArgs,
    setup: &'a Setup,
    targets: &'a Targets,
    engine: Engine,
    /// The engine's first step.
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
    fn begin(
        args: &'a FitArgs,
        setup: &'a Setup,
        views: &Views,
        targets: &'a Targets,
        renderer: &mut Renderer,
    ) -> Result<Self, Failure> {
        let begin = |mesh: Mesh| ShapeFit::new(mesh, views.lights.clone(), setup.options.clone());
        let (mut fit, mut first) = (begin(setup.template.clone())?, 0);
        if let Some(path) = args.files.checkpoint.as_ref().filter(|path| args.files.resume && path.exists()) {
            let (step, mesh, state) = checkpoint::read(path, Budget::new(&args.read.memory))?;
            fit = begin(setup.resumed(step, mesh)?)?;
            fit.restore(state)?;
            first = step;
            note(&format!("going on from step {step} of {}", path.display()));
        }
        let film = Film::new(args.files.gif.is_some(), setup, views);
        let engine = Engine::new(fit, targets, &setup.settings(first), args.method.host, renderer)?;
        let log = Log::default();
        Ok(Self { args, setup, targets, engine, first, log, film, best: None, painted: None, interrupted: false })
    }

    /// Takes all steps, or those until Ctrl-C, and writes the checkpoint of the end.
    fn run(&mut self, renderer: &mut Renderer) -> Result<(), Failure> {
        let steps = self.first..self.setup.iterations;
        let next = Loop::over(steps).with_bar("step").until_interrupted()?.run(self, renderer)?;
        self.interrupted = next < self.setup.iterations;
        if self.interrupted {
            note(&format!("interrupted before step {next}: this is the best so far"));
        }
        self.keep_best(renderer)?;
        let mesh = self.engine.shape(renderer)?.mesh().clone();
        self.film.last(&mesh, self.setup, renderer)?;
        self.write_checkpoint(next, renderer)
    }

    /// Makes and fits a texture for the best mesh, where one is to be made and Ctrl-C has not ended the fit before.
    fn paint(&mut self, views: &Views, renderer: &mut Renderer) -> Result<(), Failure> {
        if !self.setup.paints || self.interrupted {
            return Ok(());
        }
        let (mesh, step) = match &self.best {
            Some(best) => best.clone(),
            None => (self.engine.shape(renderer)?.mesh().clone(), self.first),
        };
        let painted = paint::painted(self.args, self.setup, views, self.targets, &mesh, renderer)?;
        self.film.last(&painted.mesh, self.setup, renderer)?;
        self.interrupted = painted.interrupted;
        self.best = Some((painted.mesh.clone(), step));
        self.painted = Some(painted);
        Ok(())
    }

    /// The mesh of least loss, or the one to begin with where no step was taken.
    fn found(&mut self, renderer: &mut Renderer) -> Result<Mesh, Failure> {
        match self.best.take() {
            Some((best, _)) => Ok(best),
            None => Ok(self.engine.shape(renderer)?.mesh().clone()),
        }
    }

    /// Goes on with another fit from a step on, and keeps the best mesh of the one before.
    fn go_on_with(&mut self, fit: ShapeFit, step: usize, renderer: &mut Renderer) -> Result<(), Failure> {
        self.keep_best(renderer)?;
        self.engine = Engine::new(fit, self.targets, &self.setup.settings(step), self.args.method.host, renderer)?;
        self.first = step;
        Ok(())
    }

    /// The steps that take all views once: losses of different views are not comparable, but means over these steps are.
    fn turn(&self) -> usize {
        match self.setup.options.views_per_step {
            0 => 1,
            count => self.targets.cameras.len().div_ceil(count),
        }
    }

    /// Keeps the engine's best mesh if it is better than the best so far.
    fn keep_best(&mut self, renderer: &mut Renderer) -> Result<(), Failure> {
        let Some((mesh, step)) = self.engine.best(renderer)? else { return Ok(()) };
        let step = self.first + step;
        let turn = self.turn();
        let loss = |step: usize| self.log.loss(step, turn);
        if self.best.as_ref().is_none_or(|(_, best)| loss(step) < loss(*best)) {
            self.best = Some((mesh, step));
        }
        Ok(())
    }

    /// Writes the state before a step, where a checkpoint is wanted.
    fn write_checkpoint(&mut self, step: usize, renderer: &mut Renderer) -> Result<(), Failure> {
        let Some(path) = &self.args.files.checkpoint else { return Ok(()) };
        Ok(checkpoint::write(path, self.engine.shape(renderer)?, step)?)
    }

    /// Whether a checkpoint is due before a step. The state that the engine began with is the template's, or a checkpoint's already.
    fn saves(&self, step: usize) -> bool {
        self.args.files.checkpoint.is_some() && step > self.first && step.is_multiple_of(CHECKPOINT_STEPS)
    }
}

impl Steps for Work<'_> {
    const AHEAD: usize = 10;

    fn step(&mut self, at: usize, renderer: &mut Renderer) -> Result<(), Failure> {
        Ok(self.engine.step(renderer, &self.setup.settings(at), self.setup.rates(at))?)
    }

    fn finished(&mut self, at: usize, renderer: &mut Renderer) -> Result<Vec<String>, Failure> {
        let found = self.engine.found(renderer)?;
        let texts = found.iter().map(|(found, _)| format!("loss {:.5}", found.loss)).collect();
        let from = at - found.len();
        found.into_iter().enumerate().for_each(|(i, (found, seconds))| self.log.add(from + i, found, seconds));
        Ok(texts)
    }

    fn pauses(&self, at: usize) -> bool {
        self.saves(at) || self.setup.recuts(at) || self.setup.remakes(at) || self.film.shows(at)
    }

    fn pause(&mut self, at: usize, renderer: &mut Renderer) -> Result<(), Failure> {
        if self.saves(at) {
            self.write_checkpoint(at, renderer)?;
        }
        if self.setup.recuts(at) {
            self.recut(at, renderer)?;
        }
        if self.setup.remakes(at) {
            let fit = self.setup.remade(self.engine.shape(renderer)?, at)?;
            self.go_on_with(fit, at, renderer)?;
        }
        if self.film.shows(at) {
            let mesh = self.engine.shape(renderer)?.mesh().clone();
            self.film.last(&mesh, self.setup, renderer)?;
        }
        Ok(())
    }
}
