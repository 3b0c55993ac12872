//! Draws difficult scenes from seeds.

use super::form::{FORMS, Form, TABLE};
use super::soup::{Place, Soup, soup};
use crate::random::Random;
use glam::{DMat4, DVec3};
use softras::scene::{Lights, Parity, Support};
use softras::{Camera, GradientMode, Mesh, Projection, Result, Scene, Settings};

/// The promise that is made of a case; each one includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// Values are in range and a second run gives the same bits; promised of every case.
    Bounds,
    /// The silhouette's error is bounded too.
    Silhouette,
    /// The error of every image is bounded too.
    Images,
    /// The error of every gradient is bounded too.
    Gradients,
}

/// A scene to render and differentiate.
#[derive(Clone, Debug)]
pub struct Case {
    /// The seed that it was drawn from.
    pub seed: u64,
    /// The promise that is made of it.
    pub promise: Promise,
    /// The meshes and lights.
    pub scene: Scene,
    /// One camera.
    pub cameras: Vec<Camera>,
    /// The settings, not validated yet: some must be refused.
    pub settings: Settings,
    /// The mode of the gradient.
    pub gradient: GradientMode,
}

/// The kind of scenes to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// The number of combinations of modes to draw from, 1 to [`FORMS`].
    pub forms: usize,
    /// Whether meshes have hundreds to thousands of triangles, with some difficult ones among them, in images of 64 to 512
    /// pixels a side and with σ up to 1e-2. Otherwise meshes have a few triangles in images of about ten pixels.
    pub realistic: bool,
}

impl Default for Kind {
    fn default() -> Self {
        Self { forms: FORMS, realistic: false }
    }
}

/// Draws `count` cases of a seed with the same settings and lights, to be rendered as one batch.
///
/// Half of the seeds draw from the region in which accuracy is promised, the others from everywhere: coordinates from
/// 1e-40 to 1e20, settings over their whole ranges and beyond, near and far equal or swapped.
///
/// # Errors
/// A case is an error if its mesh or its camera is refused, which is a correct outcome of a case too.
pub fn batch(seed: u64, kind: Kind, count: usize) -> Vec<Result<Case>> {
    let mut draw = draw(seed, kind);
    if count > 1 {
        draw.settings.width = draw.settings.width.min(LONGEST);
        draw.settings.height = draw.settings.height.min(LONGEST);
    }
    let views: Vec<_> = (0..count).map(|_| draw.view()).collect();
    let lights = draw.form.lights(&mut draw.random);
    let seeds = (0..).map(|view| seed.wrapping_add(view));
    views.into_iter().zip(seeds).map(|(view, seed)| Ok(draw.case(seed, view?, lights.clone()))).collect()
}

/// Draws the case of a seed within the promise but with the given σ and γ, for the map of errors. It has all images, is
/// lit, and has a composite background.
///
/// # Errors
/// As [`batch`].
pub fn at(seed: u64, sigma: f64, gamma: f64) -> Result<Case> {
    // Scenes of only a few triangles show too little of the error.
    let full = |case: &Result<Case>| case.as_ref().is_ok_and(|c| c.scene.meshes[0].triangles().len() >= 12);
    let drawn = |i: u64| Draw::tame(Random::new(seed + 1000 * i), &TABLE[1], false).finish(seed);
    let mut case = (0..100).map(drawn).find(full).unwrap_or_else(|| drawn(0))?;
    (case.settings.width, case.settings.height) = (48, 48);
    case.settings.sigma = sigma;
    case.settings.gamma = gamma;
    Ok(case)
}

/// The most triangles of most meshes: few enough that the pixels of an image differ.
const USUAL: usize = 40;
/// The longest side of the images of a batch, which has many of them.
const LONGEST: u32 = 512;

/// The settings that all cases of a batch share, and the generator that draws the rest.
struct Draw {
    random: Random,
    form: &'static Form,
    settings: Settings,
    /// The most triangles of a mesh.
    most: usize,
    tame: bool,
    realistic: bool,
}

/// The parts that differ between the cases of a batch.
struct View {
    mesh: Mesh,
    camera: Camera,
    promise: Promise,
}

/// The combination of modes that the cases of a seed have, 0 to [`FORMS`] - 1. Running the seeds of one form after
/// another keeps the number of kernels in use small.
pub fn form(seed: u64, kind: Kind) -> usize {
    form_of(&mut Random::new(seed), kind)
}

fn form_of(random: &mut Random, kind: Kind) -> usize {
    random.below(kind.forms.clamp(1, FORMS))
}

fn draw(seed: u64, kind: Kind) -> Draw {
    let mut random = Random::new(seed);
    let form = &TABLE[form_of(&mut random, kind)];
    let make = if random.chance(0.5) { Draw::tame } else { Draw::wild };
    make(random, form, kind.realistic)
}

impl Draw {
    /// Draws settings within the promise, for positions of a few units between near and far.
    fn tame(mut random: Random, form: &'static Form, realistic: bool) -> Self {
        let (near, far) = (random.range(0.1, 1.0), random.log_range(10.0, 200.0));
        let gamma = random.log_range(1e-5, 1.0).max(1e-4 / (far - near));
        let mut settings = Settings {
            width: random.log_range(1.0, 40.0) as u32,
            height: random.log_range(4.0, 40.0) as u32,
            sigma: random.log_range(1e-6, 1e-2),
            gamma: if form.modes.support == Support::Guaranteed { gamma.max(0.05) } else { gamma },
            epsilon: random.choose(&[1e-3, 0.0, 0.9, -0.5]),
            tau: random.log_range(1e-6, 1e-1),
            near,
            far,
            background_color: random.color().map(f64::from),
            ..form.modes.clone()
        };
        if realistic {
            (settings.width, settings.height) = realistic_size(&mut random);
            settings.sigma = random.log_range(1e-6, 1e-3);
        }
        Self { random, form, settings, most: USUAL, tame: true, realistic }
    }

    /// Draws settings from everywhere.
    fn wild(mut random: Random, form: &'static Form, realistic: bool) -> Self {
        let (width, height) = if realistic { realistic_size(&mut random) } else { size(&mut random) };
        let (near, far) = depths(&mut random);
        let settings = Settings {
            width,
            height,
            // With a larger σ every triangle of a large mesh influences every pixel: seconds a scene, for what small
            // scenes show too.
            sigma: random.log_range(1e-12, if realistic { 1e-2 } else { 10.0 }),
            gamma: random.log_range(1e-10, 10.0),
            epsilon: if random.chance(0.5) { random.range(-1.0, 1.0) } else { random.choose(&[-1.0, 0.0, 1e-3, 1.0]) },
            tau: random.log_range(1e-12, 0.4),
            near,
            far,
            background_color: random.color().map(f64::from),
            ..form.modes.clone()
        };
        let most = match random.below(60) {
            0 => 0,
            1 => 1500,
            2..=4 => 300,
            _ => USUAL,
        };
        Self { random, form, settings, most, tame: false, realistic }
    }

    /// Draws a mesh and a camera.
    fn view(&mut self) -> Result<View> {
        if self.tame { self.tame_view() } else { self.wild_view() }
    }

    fn tame_view(&mut self) -> Result<View> {
        let random = &mut self.random;
        let camera = if random.chance(0.4) {
            Camera::screen()
        } else {
            Camera::look_at(random.direction() * 4.0, random.direction() * 0.3, random.direction(), plain_lens(random))?
        };
        let place = if *camera.projection() == Projection::Screen { Place::Screen } else { Place::World };
        let soup = self.soup(place)?;
        let promise = if !self.form.is_smooth() {
            Promise::Bounds
        } else if soup.thin {
            Promise::Silhouette
        } else if soup.kinked {
            Promise::Images
        } else {
            Promise::Gradients
        };
        self.with_appearance(soup.mesh()?, camera, promise, 1.0)
    }

    fn wild_view(&mut self) -> Result<View> {
        let (camera, place) = camera(&mut self.random, &self.settings)?;
        let soup = self.soup(place)?;
        let random = &mut self.random;
        let brightest = if random.chance(0.05) { random.log_range(1e-40, 3e38) as f32 } else { 1.0 };
        self.with_appearance(soup.mesh()?, camera, Promise::Bounds, brightest)
    }

    fn soup(&mut self, place: Place) -> Result<Soup> {
        let most = self.most as f64;
        let least = if self.most > USUAL { most / 2.0 } else { 1.0 };
        let count = if self.most == 0 { 0 } else { self.random.log_range(least, most) as usize };
        let mut soup = soup(&mut self.random, &self.settings, place, count, self.tame);
        if self.realistic {
            soup.add_surface(&mut self.random, &self.settings, place)?;
        }
        Ok(soup)
    }

    fn with_appearance(&mut self, mesh: Mesh, camera: Camera, promise: Promise, brightest: f32) -> Result<View> {
        let random = &mut self.random;
        let farthest = if promise == Promise::Bounds { random.choose(&[1.0, 2.0, 1e4]) } else { 2.0 };
        Ok(View { mesh: self.form.appearance(random, mesh, brightest, farthest)?, camera, promise })
    }

    fn case(&self, seed: u64, view: View, lights: Lights) -> Case {
        let View { mesh, camera, promise } = view;
        let scene = Scene::new(mesh).with_lights(lights);
        let gradient = self.form.gradient;
        Case { seed, promise, scene, cameras: vec![camera], settings: self.settings.clone(), gradient }
    }

    /// Draws the only case of a seed.
    fn finish(mut self, seed: u64) -> Result<Case> {
        let view = self.view()?;
        let lights = self.form.lights(&mut self.random);
        Ok(self.case(seed, view, lights))
    }
}

fn realistic_size(random: &mut Random) -> (u32, u32) {
    (random.log_range(64.0, 512.0) as u32, random.log_range(64.0, 512.0) as u32)
}

fn size(random: &mut Random) -> (u32, u32) {
    match random.below(40) {
        0 => (1, 4096),
        1 => (4096, 1),
        2 => (1, 1),
        3 => (random.choose(&[63, 64, 65]), random.choose(&[31, 32, 33])),
        _ => (random.log_range(1.0, 24.0) as u32, random.log_range(1.0, 24.0) as u32),
    }
}

/// Draws near and far.
fn depths(random: &mut Random) -> (f64, f64) {
    let plain = (random.range(0.1, 2.0), random.log_range(3.0, 200.0));
    match random.below(20) {
        0 => (plain.0, plain.0),
        1 => (plain.1, plain.0),
        2 => (1e-6, 1e12),
        3 => (1e9, 1e12),
        4 => (plain.0, plain.0 * (1.0 + 2e-6)),
        5 => (random.log_range(1e-7, 1e9), random.log_range(1e-6, 1e13)),
        _ => plain,
    }
}

fn plain_lens(random: &mut Random) -> Projection {
    if random.chance(0.7) {
        Projection::Perspective { fov_y: random.range(0.3, 1.5) }
    } else {
        Projection::Orthographic { half_height: random.log_range(0.5, 4.0) }
    }
}

/// Draws a camera and the space in which to place triangles for it.
#[allow(clippy::approx_constant)] // 3.1415 is nearly a half turn, the widest angle of view; π itself is refused.
fn camera(random: &mut Random, settings: &Settings) -> Result<(Camera, Place)> {
    let (width, height) = (f64::from(settings.width), f64::from(settings.height));
    // The official camera's projection is a mode of its own, drawn for forms with official parity only.
    let lenses = if settings.parity == Parity::Official { 5 } else { 4 };
    let lens = match random.below(lenses) {
        0 => return Ok((Camera::screen(), Place::Screen)),
        1 => Projection::Perspective { fov_y: random.choose(&[1e-5, 0.5, 1.5, 3.1415]) },
        2 => Projection::Orthographic { half_height: random.log_range(1e-9, 1e9) },
        3 => Projection::Pinhole {
            fx: height * random.log_range(1e-3, 1e3),
            fy: height * random.log_range(1e-3, 1e3),
            cx: width * random.range(-2.0, 3.0),
            cy: height * random.range(-2.0, 3.0),
        },
        _ => {
            let distortion = [(); 5].map(|()| random.range(-1e-3, 1e-3));
            let original_size = random.log_range(1.0, 1000.0);
            let (x, z) = (original_size, original_size / 2.0);
            let rows = [[x, 0.0, z, 0.0], [0.0, x, z, 0.0], [0.0, 0.0, 1.0, 0.0]];
            return Ok((Camera::official(rows, distortion, original_size)?, Place::View));
        }
    };
    if random.chance(0.5) {
        return Ok((Camera::from_matrix(DMat4::IDENTITY, lens)?, Place::View));
    }
    let distance = if random.chance(0.7) { 4.0 } else { random.log_range(1e-12, 1e13) };
    let eye = random.direction() * distance;
    // A camera straight above its target is refused, since the up vector (0, 1, 0) is parallel to the view.
    let eye = if random.chance(0.02) { DVec3::Y } else { eye };
    Ok((Camera::look_at(eye, DVec3::ZERO, DVec3::Y, lens)?, Place::World))
}
