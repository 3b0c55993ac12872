//! A fit from views to a mesh, as `softras fit` does it.

pub mod announcement;
pub mod begin;
pub mod checkpoint;
pub mod hollows;
pub mod options;
pub mod paint;
pub mod scores;
pub mod setup;
pub mod texels;
pub mod topology_recut;

use crate::{
    ShapeFit, ShapeOptions, ShapeRun, StepLosses, bad,
    photographs::{
        agreement, exposure, mask_width, refine,
        seen::Seen,
        subject::{Subject, ViewsOfMesh},
    },
    work::{Event, Progress, Stage, Told, Work},
};
use options::{FitOptions, Preset, Template};
use paint::Painted;
use scores::{Scores, genus};
use setup::Setup;
use softras::{Lights, Mesh, Renderer, Result, Settings};
use softras_io::{Budget, Views};
use std::{ops::ControlFlow, path::Path, time::Instant};

/// A fit that is to be made: views of an object, and how.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The views, and what is known of the object in them.
    pub subject: Subject,
    /// The method.
    pub options: FitOptions,
}

impl Fit {
    /// A fit of the shape alone, by the silhouettes of views.
    ///
    /// # Errors
    /// Those of [`Views::size`].
    pub fn new(views: Views) -> Result<Self> {
        Ok(Self { subject: Subject::of(views)?, options: FitOptions::default() })
    }

    /// A fit to views that are rendered from all around a mesh, which are lit where `views` says so.
    ///
    /// # Errors
    /// Those of [`Subject::rendered`].
    pub fn of_mesh(mesh: Mesh, views: &ViewsOfMesh, renderer: &mut Renderer) -> Result<Self> {
        Ok(Self { subject: Subject::rendered(mesh, views, renderer, || ())?, options: FitOptions::default() })
    }

    /// Colours too.
    pub fn color(mut self) -> Self {
        self.options.color = true;
        self
    }

    /// The whole method.
    pub fn options(mut self, options: FitOptions) -> Self {
        self.options = options;
        self
    }

    /// Makes the mesh to begin with, and what else does not change. `told` hears of it, and may end it.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for options that exclude each other or views that do not fit together, and where `told` ends it;
    /// otherwise as [`Renderer::render`].
    pub fn begin(self, renderer: &mut Renderer, told: &mut Told) -> Result<Fitting> {
        let Self { mut subject, options } = self;
        if !options.is_colored() {
            subject.views.color = None;
        }
        let mut notes = Vec::new();
        let mut work = Work::new(renderer, &mut notes, told, Stage::Views, 0);
        work.goes_on()?;
        // Views that were rendered agree.
        let are_photographs = subject.truth.is_none() && options.preset != Preset::Official;
        if are_photographs && let Some((crops, note)) = subject.views.cropped(options.preset.crop(options.crop))? {
            subject = Subject { held_out: subject.held_out, ..Subject::of(crops)? };
            work.notes.push(note);
        }
        announcement::tell(&options, &subject, &mut work)?;
        if are_photographs {
            reconcile(&mut subject, &options, &mut work)?;
        }
        if subject.held_out.is_empty() {
            subject.held_out = options.held_out(&subject);
        }
        work.begin(Stage::Start, 0)?;
        let setup = Setup::new(options, &subject, &mut work)?;
        if are_photographs && !setup.given.keep_exposure {
            exposure::leveled(&mut subject, &setup.template, &setup.settings(0), &mut work)?;
        }
        let views = setup.given.compared(&subject);
        let options = setup.options_of(&setup.template);
        let shape = ShapeFit::new(setup.template.clone(), subject.lights.clone(), options)?;
        work.goes_on()?;
        let run = ShapeRun::new(shape, &views);
        Ok(Fitting { subject, setup, run, steps: Vec::new(), notes, is_stopped: false })
    }

    /// Fits to the end, or until `told` breaks it.
    ///
    /// # Errors
    /// As [`Fit::begin`] and [`Fitting::step`].
    pub fn run(self, renderer: &mut Renderer, mut told: impl FnMut(Event<'_>) -> ControlFlow<()>) -> Result<Fitted> {
        let mut fitting = self.begin(renderer, &mut told)?;
        while fitting.step(renderer, &mut told)? {}
        let painted = fitting.paint(renderer, &mut told)?;
        fitting.finish(painted, renderer, &mut told)
    }
}

/// Makes photographs agree: leaves out wrong ones and mends masks and cameras, each with a note.
///
/// Each stage needs those before it. A wrong mask carves the others' object away, so it goes first. Cameras would move to where
/// masks that are too wide meet, so these are narrowed before. Exposures are compared at points of the first mesh, so they
/// are levelled after that is made, in [`Fit::begin`].
fn reconcile(subject: &mut Subject, options: &FitOptions, work: &mut Work) -> Result<()> {
    let is_quick = options.preset == Preset::Quick;
    if !options.keep_views {
        agreement::settle(subject, work)?;
    }
    let is_narrowed = !options.keep_views && !is_quick && mask_width::narrowed(subject, work)?;
    if !options.keep_cameras && !is_quick && !options.keeps_shape() {
        refine::refined(subject, is_narrowed, work)?;
    }
    Ok(())
}

/// A step of a fit.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Its number.
    pub at: usize,
    /// The losses before it moved anything.
    pub losses: StepLosses,
    /// The seconds that it took.
    pub seconds: f64,
}

/// A fit in progress.
#[derive(Clone, Debug)]
pub struct Fitting {
    pub(crate) subject: Subject,
    pub(crate) setup: Setup,
    /// The steps with the views that are compared.
    pub(crate) run: ShapeRun,
    steps: Vec<Taken>,
    /// Notes for the user.
    notes: Vec<String>,
    is_stopped: bool,
}

impl Fitting {
    /// Takes the next step. Before it the mesh is subdivided, remeshed or cut anew where that is due. Returns false at the end, and once
    /// `told` has stopped the fit.
    ///
    /// # Errors
    /// As [`ShapeFit::step`], and of what the mesh is subdivided, remeshed or cut with.
    pub fn step(&mut self, renderer: &mut Renderer, told: &mut Told) -> Result<bool> {
        let (at, of) = (self.run.next_step(), self.setup.iterations);
        if at >= of || self.is_stopped {
            return Ok(false);
        }
        let mut notes = std::mem::take(&mut self.notes);
        let mut work = Work::new(renderer, &mut notes, told, Stage::Shape, of);
        work.at.taken = at;
        let outcome = self.advance(at, &mut work);
        self.is_stopped = work.is_stopped();
        self.notes = notes;
        if self.is_stopped { Ok(false) } else { outcome.map(|()| true) }
    }

    fn advance(&mut self, at: usize, work: &mut Work) -> Result<()> {
        if self.setup.recuts(at) {
            self.recut(at, work)?;
        }
        if self.setup.remakes(at) {
            let shape = self.setup.remade(self.run.shape(), at)?;
            self.run.go_on_with(shape, at);
        }
        self.run.compare(self.setup.views_per_step(at));
        let began = Instant::now();
        let (rate, color_rate) = self.setup.rates(at);
        let losses = self.run.step(work.renderer, &self.setup.settings(at), rate, color_rate)?;
        let loss = losses.loss;
        self.steps.push(Taken { at, losses, seconds: began.elapsed().as_secs_f64() });
        work.step(Some(loss))
    }

    /// The number of the next step.
    pub fn next_step(&self) -> usize {
        self.run.next_step()
    }

    /// The number of steps in all.
    pub fn step_count(&self) -> usize {
        self.setup.iterations
    }

    /// The mesh as it is.
    pub fn mesh(&self) -> &Mesh {
        self.run.shape().mesh()
    }

    /// The mesh of least loss so far, and its step; `None` before the first.
    pub fn best(&self) -> Option<(&Mesh, usize)> {
        self.run.best()
    }

    /// The mesh of least loss, or the one to begin with where no step was taken.
    fn found(&self) -> Mesh {
        self.best().map_or(self.mesh(), |(best, _)| best).clone()
    }

    /// The views as they are compared: crops where pictures are larger, without those that were left out, with cameras refined.
    pub fn views(&self) -> &Views {
        &self.subject.views
    }

    /// The mesh of least loss; vertices that no fitted view sees have the colours of those beside them.
    fn colored(&self, renderer: &mut Renderer) -> Result<Mesh> {
        let (mut mesh, given) = (self.found(), &self.setup.given);
        if matches!(given.template, Template::Mesh(_)) || given.preset == Preset::Official || !given.is_colored() {
            return Ok(mesh);
        }
        let settings = self.setup.settings(self.setup.iterations);
        let views = &self.run.targets;
        let all: Vec<usize> = (0..views.cameras.len()).collect();
        let seen = Seen::of(&mesh, views, &settings, renderer)?;
        // So few steps do not reach the colours, which the views show where no light is on them.
        if given.preset == Preset::Quick && self.subject.lights.directional.is_empty() {
            mesh = seen.painted(mesh, &all)?;
        }
        seen.spread(mesh, &all)
    }

    /// Notes for the user: where the mesh was cut anew, why it begins with what it does, and more.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Makes a texture for the best mesh and fits its texels, where one is to be made, until `told` breaks it.
    ///
    /// # Errors
    /// Those of [`with_atlas`](crate::with_atlas), and of rendering.
    pub fn paint(&mut self, renderer: &mut Renderer, told: &mut Told) -> Result<Option<Painted>> {
        let given = &self.setup.given;
        let Some(side) = given.texture.filter(|_| !given.keeps_shape() && !self.is_stopped) else { return Ok(None) };
        let best = self.colored(renderer)?;
        let mut work = Work::new(renderer, &mut self.notes, told, Stage::Texture, 0);
        let painted = paint::painted(&best, side, &self.setup, &self.subject, &self.run.targets, &mut work)?;
        work.notes.push(painted.sentence());
        // A break is seen in the texture.
        let _ = work.goes_on();
        self.is_stopped = work.is_stopped();
        Ok(Some(painted))
    }

    /// The end: the best mesh, or the painted one, and how good it is. Where `told` breaks it, the mesh is not judged; a fit that was
    /// broken before is judged nevertheless.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn finish(self, painted: Option<Painted>, renderer: &mut Renderer, told: &mut Told) -> Result<Fitted> {
        let mesh = match &painted {
            Some(painted) => painted.mesh.clone(),
            None => self.colored(renderer)?,
        };
        let mut at = Progress { stage: Stage::Scores, taken: 0, of: 0, loss: None };
        let mut is_broken = false;
        let mut goes_on = || {
            is_broken |= told(Event::Progress(at)).is_break() && !self.is_stopped;
            at.taken += 1;
            if is_broken { bad("a fit that was stopped", "begin it again") } else { Ok(()) }
        };
        let scores = match Scores::of(&mesh, &self.setup, &self.subject, renderer, &mut goes_on) {
            Err(_) if is_broken => {
                let (parts, genus) = genus(&mesh)?;
                Scores { parts, genus, ..Scores::default() }
            }
            scores => scores?,
        };
        let is_complete = !is_broken
            && self.next_step() == self.setup.iterations
            && painted.as_ref().is_none_or(|painted| painted.is_complete);
        let settings = self.setup.settings(self.setup.iterations);
        let (options, view_stride) = (self.run.shape().options().clone(), self.setup.given.view_stride);
        let (Subject { views, lights, .. }, steps, notes) = (self.subject, self.steps, self.notes);
        Ok(Fitted { mesh, scores, steps, painted, is_complete, options, view_stride, notes, views, settings, lights })
    }

    /// Writes the state before the next step as an .npz file, which [`Fitting::resume`] reads.
    ///
    /// # Errors
    /// [`softras::Error::Io`].
    pub fn save_checkpoint(&self, path: &Path) -> Result<()> {
        checkpoint::write(path, self.run.shape(), self.next_step())
    }

    /// Goes on from a file of [`Fitting::save_checkpoint`], made with the same views and options. Returns the number of the next step.
    ///
    /// # Errors
    /// [`softras::Error::File`] for what is no such file, [`softras::Error::Fit`] for one of another fit.
    pub fn resume(&mut self, path: &Path, budget: Budget) -> Result<usize> {
        let (step, mesh, state) = checkpoint::read(path, budget)?;
        if self.setup.given.preset == Preset::Official && self.setup.given.has_new_triangles() {
            return bad(
                "the official parametrization after --subdivide-at or --remesh-at",
                "such a fit cannot resume: leave out one",
            );
        }
        let mesh = self.setup.resumed(step, mesh)?;
        let options = self.setup.options_of(&mesh);
        let mut shape = ShapeFit::new(mesh, self.subject.lights.clone(), options)?;
        shape.restore(state)?;
        self.run.go_on_with(shape, step);
        Ok(step)
    }
}

/// A mesh that was fitted.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The mesh of least loss, with its texture where one was made.
    pub mesh: Mesh,
    /// How good it is.
    pub scores: Scores,
    /// All steps with their losses.
    pub steps: Vec<Taken>,
    /// The texture that was made.
    pub painted: Option<Painted>,
    /// Whether all steps were taken.
    pub is_complete: bool,
    /// The options of the steps, as the fit chose them.
    pub options: ShapeOptions,
    /// The stride of the views: each `view_stride`th was used.
    pub view_stride: usize,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// The views as they were compared: cropped, with refined cameras and levelled exposures.
    pub views: Views,
    /// Settings and lights of the last step.
    pub(crate) settings: Settings,
    pub(crate) lights: Lights,
}

impl Fitted {
    /// The numbers of all steps with their losses.
    pub fn losses(&self) -> Vec<(usize, f64)> {
        self.steps.iter().map(|taken| (taken.at, taken.losses.loss)).collect()
    }

    /// The median of a step's seconds; `None` without steps.
    pub fn seconds_per_step(&self) -> Option<f64> {
        let mut seconds: Vec<f64> = self.steps.iter().map(|taken| taken.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        seconds.get(seconds.len() / 2).copied()
    }
}
