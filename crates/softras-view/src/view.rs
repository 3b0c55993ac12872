//! A picture of a mesh in a few words.

use crate::{
    animation,
    developed::Developed,
    options::{Motion, Options, Output},
    studio::Studio,
};
use softras::{Error, Mesh, Renderer, Result};
use softras_io::{Loaded, Picture};

/// A mesh, and how it is looked at.
#[derive(Clone, Debug)]
pub struct View {
    loaded: Loaded,
    options: Options,
}

impl View {
    /// All of a mesh, 256 by 256 pixels, from the front and a little from above, on a transparent background.
    pub fn of(mesh: &Mesh) -> Self {
        Self::of_loaded(mesh.clone().into())
    }

    /// A mesh file with its normals and its transparent materials, seen as [`of`](Self::of) says.
    pub fn of_loaded(loaded: Loaded) -> Self {
        Self { loaded, options: Options::default() }
    }

    /// The size in pixels.
    pub fn size(mut self, width: u32, height: u32) -> Self {
        self.options.look.size = (width, height);
        self
    }

    /// Degrees around the vertical axis, and above the horizon.
    pub fn from_angles(mut self, azimuth: f64, elevation: f64) -> Self {
        (self.options.camera.azimuth, self.options.camera.elevation) = (azimuth, elevation);
        self
    }

    /// The background, linear light from 0 to 1.
    pub fn background(mut self, color: [f64; 3]) -> Self {
        self.options.look.background = Some(color);
        self
    }

    /// Everything about the picture.
    pub fn options(mut self, options: Options) -> Self {
        self.options = options;
        self
    }

    /// One picture.
    ///
    /// # Errors
    /// As [`View::frames`].
    pub fn render(&self, renderer: &mut Renderer) -> Result<Picture> {
        let still = Options { motion: Motion::Still, ..self.options.clone() };
        Ok(self.shown(&still, renderer)?.0.swap_remove(0))
    }

    /// The frames of the options' motion, on the background or, where there are several, on white, with notes on them: those of the
    /// file, the axis that was taken to be up, and why nothing is seen. [`softras_io::write_gif`] writes a turntable;
    /// [`sheet`](crate::sheet) makes one picture of a sweep, whose labels are those of its [`moments`](crate::moments).
    ///
    /// # Errors
    /// Those of [`Studio::new`] and [`Studio::shoot`].
    pub fn frames(&self, renderer: &mut Renderer) -> Result<(Vec<Picture>, Vec<String>)> {
        self.shown(&self.options, renderer)
    }

    fn shown(&self, options: &Options, renderer: &mut Renderer) -> Result<(Vec<Picture>, Vec<String>)> {
        let limits = renderer.device_info().limits;
        let (mut studio, about) = Studio::new(self.loaded.clone(), options.clone(), &[Output::Color], false, &limits)?;
        let (mut frames, mut is_seen) = (Vec::new(), false);
        for moment in animation::moments(options) {
            let mut made = Developed::new(Output::Color, false);
            studio.shoot::<Error>(renderer, moment.turn, moment.step, |shot| {
                is_seen |= shot.is_seen();
                made.add(shot)
            })?;
            let picture = made.finished(None).into_picture();
            let is_still = options.motion == Motion::Still;
            frames.push(if is_still { picture } else { picture.flattened(animation::ground(options)) });
        }
        let notes = self.loaded.notes.iter().cloned().chain(about).chain(studio.nothing(is_seen).map(String::from));
        Ok((frames, notes.collect()))
    }
}
