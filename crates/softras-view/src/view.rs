//! A picture of a mesh in a few words.

use crate::{
    animation::{self, Moment},
    developed::Developed,
    options::{Motion, Options, Output},
    shrink::shrunk,
    studio::Studio,
};
use softras::{Error, Mesh, Renderer, Result};
use softras_io::{Loaded, Picture};

/// A mesh, and how it is looked at.
#[derive(Clone, Debug)]
pub struct View {
    mesh: Mesh,
    normals: Vec<[[f32; 3]; 3]>,
    opacity: Vec<f32>,
    origin: [f64; 3],
    /// Whether the file says that light does not shade it.
    unlit: bool,
    options: Options,
}

impl View {
    /// All of a mesh, 256 by 256 pixels, from the front and a little from above, on a transparent background.
    pub fn of(mesh: &Mesh) -> Self {
        let (normals, opacity, origin) = (Vec::new(), Vec::new(), [0.0; 3]);
        Self { mesh: mesh.clone(), normals, opacity, origin, unlit: false, options: Options::default() }
    }

    /// The same of a mesh file, with its normals and its transparent materials.
    pub fn of_loaded(loaded: Loaded) -> Self {
        let Loaded { mesh, normals, opacity, origin, unlit, .. } = loaded;
        Self { mesh, normals, opacity, origin, unlit, options: Options::default() }
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
    /// Those of [`Studio::new`] and [`Studio::shoot`].
    pub fn render(&self, renderer: &mut Renderer) -> Result<Picture> {
        let moment = Moment { turn: 0.0, step: None, label: String::new() };
        Ok(self.frames(Motion::Still, vec![moment], renderer)?.swap_remove(0))
    }

    /// The frames of one turn around the vertical axis, on the background or on white. [`softras_io::write_gif`] writes them.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn turntable(&self, frames: usize, renderer: &mut Renderer) -> Result<Vec<Picture>> {
        self.moving(Motion::Turntable(frames), renderer)
    }

    /// The frames of a setting that changes, each with its label, on the background or on white. [`sheet`](crate::sheet) makes one
    /// picture of them.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn sweep(&self, sweep: crate::Sweep, renderer: &mut Renderer) -> Result<Vec<(Picture, String)>> {
        let labels = animation::moments(&Options { motion: Motion::Sweep(sweep), ..self.options.clone() });
        let frames = self.moving(Motion::Sweep(sweep), renderer)?;
        Ok(frames.into_iter().zip(labels.into_iter().map(|moment| moment.label)).collect())
    }

    fn moving(&self, motion: Motion, renderer: &mut Renderer) -> Result<Vec<Picture>> {
        let options = Options { motion, ..self.options.clone() };
        let frames = self.frames(motion, animation::moments(&options), renderer)?;
        Ok(frames.into_iter().map(|frame| frame.flattened(animation::ground(&options))).collect())
    }

    fn frames(&self, motion: Motion, moments: Vec<Moment>, renderer: &mut Renderer) -> Result<Vec<Picture>> {
        let mut options = Options { motion, ..self.options.clone() };
        options.camera = options.camera.relative_to(self.origin);
        options.light.unlit |= self.unlit && options.light.lights.is_empty() && options.light.ambient.is_none();
        let samples = options.samples(false);
        let mesh = shrunk(self.mesh.clone(), &renderer.device_info().limits)?.0;
        let mut studio = Studio::new(mesh, &self.normals, &self.opacity, options, &[Output::Color], samples)?;
        let one = |moment: Moment| {
            let mut made = Developed::new(Output::Color, false);
            studio.shoot::<Error>(renderer, moment.turn, moment.step, |shot| made.add(shot))?;
            Ok(made.finished(None).into_picture())
        };
        moments.into_iter().map(one).collect()
    }
}
