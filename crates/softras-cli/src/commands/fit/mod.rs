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
mod report;
mod setup;
mod surface;
pub mod targets;
mod texels;
mod unseen;

use super::color::encoded;
use super::memory::Budget;
use super::outputs::Outputs;
use super::progress::Progress;
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
use std::sync::atomic::Ordering;
use targets::Views;

/// Steps between two checkpoints.
const CHECKPOINT_STEPS: usize = 100;
/// Steps between two queries of the device's results.
const AHEAD: usize = 10;

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
    let ended = work.run(args, &setup, &targets, &mut renderer);
    let ended = ended.and_then(|()| work.paint(args, &setup, &views, &targets, &mut renderer));
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
    if let Some(path) = &files.checkpoint {
        checkpoint::write(path, work.engine.shape(&mut renderer)?, work.next)?;
    }
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
struct Work {
    engine: Engine,
    /// The next step.
    next: usize,
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

impl Work {
    /// Starts from the template or from a checkpoint.
    fn begin(
        args: &FitArgs,
        setup: &Setup,
        views: &Views,
        targets: &Targets,
        renderer: &mut Renderer,
    ) -> Result<Self, Failure> {
        let begin = |mesh: Mesh| ShapeFit::new(mesh, views.lights.clone(), setup.options.clone());
        let (mut fit, mut next) = (begin(setup.template.clone())?, 0);
        if let Some(path) = args.files.checkpoint.as_ref().filter(|path| args.files.resume && path.exists()) {
            let (step, mesh, state) = checkpoint::read(path, Budget::new(&args.read.memory))?;
            fit = begin(setup.resumed(step, mesh)?)?;
            fit.restore(state)?;
            next = step;
            note(&format!("going on from step {step} of {}", path.display()));
        }
        let film = Film::new(args.files.gif.is_some(), setup, views);
        let engine = Engine::new(fit, targets, &setup.settings(next), args.method.host, renderer)?;
        Ok(Self { engine, next, first: next, log: Log::default(), film, best: None, painted: None, interrupted: false })
    }

    /// Takes all steps, or those until Ctrl-C.
    fn run(
        &mut self,
        args: &FitArgs,
        setup: &Setup,
        targets: &Targets,
        renderer: &mut Renderer,
    ) -> Result<(), Failure> {
        let stop = super::interrupted()?;
        let progress = Progress::counted("step", setup.iterations);
        progress.done(self.next);
        while self.next < setup.iterations {
            if stop.load(Ordering::Relaxed) {
                self.interrupted = true;
                note(&format!("interrupted before step {}: this is the best so far", self.next));
                break;
            }
            let step = self.next;
            if setup.remakes(step) {
                self.collect(&progress, renderer)?;
                self.keep_best(renderer)?;
                let fit = setup.remade(self.engine.shape(renderer)?, step)?;
                self.engine = Engine::new(fit, targets, &setup.settings(step), args.method.host, renderer)?;
                self.first = step;
            }
            if self.film.shows(step) {
                self.collect(&progress, renderer)?;
                let mesh = self.engine.shape(renderer)?.mesh().clone();
                self.film.last(&mesh, setup, renderer)?;
            }
            let rates = (setup.rate.at_step(step, setup.iterations), setup.color_rate(step));
            self.engine.step(renderer, &setup.settings(step), rates)?;
            self.next += 1;
            if self.next.is_multiple_of(AHEAD) || self.next == setup.iterations {
                self.collect(&progress, renderer)?;
            }
            if let Some(path) = args.files.checkpoint.as_ref().filter(|_| self.next.is_multiple_of(CHECKPOINT_STEPS)) {
                checkpoint::write(path, self.engine.shape(renderer)?, self.next)?;
            }
        }
        self.collect(&progress, renderer)?;
        self.keep_best(renderer)?;
        let mesh = self.engine.shape(renderer)?.mesh().clone();
        self.film.last(&mesh, setup, renderer)?;
        Ok(())
    }

    /// Makes and fits a texture for the best mesh, where one is to be made and Ctrl-C has not ended the fit before.
    fn paint(
        &mut self,
        args: &FitArgs,
        setup: &Setup,
        views: &Views,
        targets: &Targets,
        renderer: &mut Renderer,
    ) -> Result<(), Failure> {
        if !setup.paints || self.interrupted {
            return Ok(());
        }
        let (mesh, step) = match &self.best {
            Some(best) => best.clone(),
            None => (self.engine.shape(renderer)?.mesh().clone(), self.next),
        };
        let painted = paint::painted(args, setup, views, targets, &mesh, renderer)?;
        self.film.last(&painted.mesh, setup, renderer)?;
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

    /// Logs the steps that the engine has finished since the last call.
    fn collect(&mut self, progress: &Progress, renderer: &mut Renderer) -> Result<(), Failure> {
        let found = self.engine.found(renderer)?;
        let from = self.next - found.len();
        for (i, (found, seconds)) in found.into_iter().enumerate() {
            progress.tell(format!("loss {:.5}", found.loss));
            progress.step();
            self.log.add(from + i, found, seconds);
        }
        Ok(())
    }

    /// Keeps the engine's best mesh if it is better than the best so far.
    fn keep_best(&mut self, renderer: &mut Renderer) -> Result<(), Failure> {
        let Some((mesh, step)) = self.engine.best(renderer)? else { return Ok(()) };
        let step = self.first + step;
        if self.best.as_ref().is_none_or(|(_, best)| self.log.loss(step) < self.log.loss(*best)) {
            self.best = Some((mesh, step));
        }
        Ok(())
    }
}
