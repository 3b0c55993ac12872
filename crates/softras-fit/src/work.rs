//! The renderer and the listener that the stages of a fit share, and the events that the listener is told.

use crate::bad;
use softras::{Renderer, Result};
use std::{fmt, ops::ControlFlow};

/// A part of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Views are compared with each other.
    Views,
    /// Cameras are refined.
    Cameras,
    /// Masks are compared with colours.
    Masks,
    /// The mesh to begin with is made.
    Start,
    /// The mesh is fitted.
    Shape,
    /// Its texture is made.
    Texture,
    /// The result is judged.
    Scores,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Views => "views",
            Self::Cameras => "cameras",
            Self::Masks => "masks",
            Self::Start => "hull",
            Self::Shape => "step",
            Self::Texture => "texture",
            Self::Scores => "scores",
        })
    }
}

/// Where a fit is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// The part that is worked on.
    pub stage: Stage,
    /// How much of it is done, of [`Progress::of`].
    pub taken: usize,
    /// How much there is to do; 0 where that is not known.
    pub of: usize,
    /// The loss before the last step; `None` where there is none.
    pub loss: Option<f64>,
}

/// An event that a fit tells while it works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event<'a> {
    /// The plan: what the fit is going to do, and about how long that takes.
    Plan(&'a str),
    /// A note for the user.
    Note(&'a str),
    /// Where the fit is.
    Progress(Progress),
}

/// Who is told, and may end the fit.
pub type Told<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + 'a;

/// Asked between parts of work that takes long; an error ends it.
pub type GoesOn<'a> = dyn FnMut() -> Result<()> + 'a;

/// A renderer, and who is told.
pub struct Work<'a> {
    pub renderer: &'a mut Renderer,
    /// Notes for the user; those up to `sent` have been told.
    pub notes: &'a mut Vec<String>,
    sent: usize,
    told: &'a mut Told<'a>,
    pub at: Progress,
    is_stopped: bool,
}

impl<'a> Work<'a> {
    /// Begins with a stage of `of` parts; the notes so far have been told.
    pub fn new(
        renderer: &'a mut Renderer,
        notes: &'a mut Vec<String>,
        told: &'a mut Told,
        stage: Stage,
        of: usize,
    ) -> Self {
        let at = Progress { stage, taken: 0, of, loss: None };
        Self { renderer, sent: notes.len(), notes, told, at, is_stopped: false }
    }

    /// Begins a stage of `of` parts.
    ///
    /// # Errors
    /// As [`Work::goes_on`].
    pub fn begin(&mut self, stage: Stage, of: usize) -> Result<()> {
        self.at = Progress { stage, taken: 0, of, loss: None };
        self.goes_on()
    }

    /// Tells that a part of the stage is done.
    ///
    /// # Errors
    /// As [`Work::goes_on`].
    pub fn step(&mut self, loss: Option<f64>) -> Result<()> {
        self.at = Progress { taken: self.at.taken + 1, loss, ..self.at };
        self.goes_on()
    }

    /// Tells where the fit is, and the notes since the last call.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] where the fit is to end.
    pub fn goes_on(&mut self) -> Result<()> {
        let new = self.notes[self.sent..].iter().map(|note| Event::Note(note));
        for event in new.chain([Event::Progress(self.at)]) {
            self.is_stopped |= (self.told)(event).is_break();
        }
        self.sent = self.notes.len();
        if self.is_stopped { bad("a fit that was stopped", "begin it again") } else { Ok(()) }
    }

    /// Tells what will be done.
    ///
    /// # Errors
    /// As [`Work::goes_on`].
    pub fn plan(&mut self, text: &str) -> Result<()> {
        self.is_stopped |= (self.told)(Event::Plan(text)).is_break();
        self.goes_on()
    }

    /// Whether it was told that the fit is to end.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }
}
