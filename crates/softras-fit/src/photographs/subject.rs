//! The object that a fit is to find: its views, and what else is known of it.

use super::cameras::{self, Sphere};
use crate::{pooled, sized};
use softras::{
    Image, Lights, Mesh, Renderer, Result, Scene, Settings, parts,
    scene::{Appearance, Background, DirectionalLight, Interpolation, Outputs, Shading},
};
use softras_io::{Map, Views};
use std::borrow::Cow;

/// Samples along each side of a pixel of views that are rendered.
const SAMPLES: usize = 3;
/// The most samples of a view, which an image in a buffer of any device can have. Pixels of larger views have fewer samples.
const MOST_SAMPLES: usize = 8_000_000;
/// The fewest and the most samples along the longest side of a hull.
const LEAST_HULL: usize = 32;
const MOST_HULL: usize = 192;

/// Views of an object, and what is known of it besides.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The views.
    pub views: Views,
    /// The numbers of views that are not fitted, by which the result is judged.
    pub held_out: Vec<usize>,
    /// The mesh that the views were rendered from, if known.
    pub truth: Option<Mesh>,
    /// A sphere around the object.
    pub bounds: Sphere,
    /// The length of a pixel about the middle of the object, world units.
    pub pixel: f64,
    /// Nearest and farthest depth that is drawn.
    pub depths: (f64, f64),
    /// The lights of the views and of the fit.
    pub lights: Lights,
    /// Whether the whole object has one colour, so that the light on it shows its shape.
    pub one_color: bool,
}

impl Subject {
    /// An object where all cameras look, unlit, of any colours.
    ///
    /// # Errors
    /// Those of [`Views::size`]; [`softras::Error::Fit`] for cameras that look away from each other.
    pub fn of(views: Views) -> Result<Self> {
        let bounds = cameras::seen(&views)?;
        let depths = cameras::depths(&views.cameras, bounds);
        let pixel = cameras::pixel(&views.cameras, bounds.center, views.size()?);
        let (held_out, lights) = (Vec::new(), Lights::unlit());
        Ok(Self { views, held_out, truth: None, bounds, pixel, depths, lights, one_color: false })
    }

    /// Keeps some of the views, in an order, with all that is told by view. Those held out that are not among them are gone.
    ///
    /// # Panics
    /// For a view that there is not.
    pub fn keep(&mut self, views: &[usize]) {
        if let Cow::Owned(some) = self.views.some(views) {
            self.views = some;
        }
        let kept = (0..views.len()).filter(|at| self.held_out.contains(&views[*at]));
        self.held_out = kept.collect();
    }

    /// The centre and the side of the cube that a hull is carved in.
    pub(crate) fn cube(&self) -> ([f64; 3], f64) {
        (self.bounds.center.to_array(), 2.0 * self.bounds.radius)
    }

    /// Samples along the longest side of a hull: one for each pixel that the object may take in a picture.
    pub(crate) fn samples(&self) -> Result<usize> {
        let (height, width) = self.views.size()?;
        let across = 2.0 * self.bounds.radius / self.pixel;
        Ok((across as usize).clamp(height.min(width), height.max(width)).clamp(LEAST_HULL, MOST_HULL))
    }

    /// Renders views of a mesh from all around and calls `done` after each.
    ///
    /// # Errors
    /// As [`Renderer::render`].
    pub fn rendered(
        mesh: Mesh,
        options: &ViewsOfMesh,
        renderer: &mut Renderer,
        mut done: impl FnMut(),
    ) -> Result<Self> {
        let bounds = Sphere::around(&mesh);
        let cameras = cameras::around(bounds, options.count, options.fov)?;
        let depths = cameras::depths(&cameras, bounds);
        let size = (options.size.1 as usize, options.size.0 as usize);
        let samples = samples(size);
        let settings = Settings {
            sigma: 1e-7,
            near: depths.0,
            far: depths.1,
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            outputs: Outputs {
                color: options.color,
                silhouette: true,
                depth: options.maps.contains(&Map::Depth),
                normal: options.maps.contains(&Map::Normal),
                features: false,
            },
            ..sized(&Settings::default(), size, samples)
        };
        let one_color = matches!(mesh.appearance(), Appearance::Uniform(_)) && options.color;
        let lights = options.lights(one_color);
        let scene = Scene::new(mesh).with_lights(lights.clone());
        let mut views = Views { cameras, ..Views::default() };
        let cameras = views.cameras.clone();
        parts::in_batches(renderer, &scene, &cameras, &settings, |range, frame| {
            append(&mut views.silhouette, frame.silhouette().ok(), samples)?;
            append(&mut views.color, frame.color().ok(), samples)?;
            append(&mut views.depth, frame.depth().ok(), samples)?;
            append(&mut views.normal, frame.normal().ok(), samples)?;
            range.for_each(|_| done());
            Ok(())
        })?;
        let truth = scene.meshes.into_iter().next();
        // The views show little more than the sphere.
        let pixel = 2.0 * bounds.radius / f64::from(options.size.0.min(options.size.1));
        Ok(Self { views, held_out: Vec::new(), truth, bounds, pixel, depths, lights, one_color })
    }
}

/// Samples along each side of a pixel of views of a size.
pub fn samples((height, width): (usize, usize)) -> usize {
    let fits = |samples: &usize| samples.pow(2).saturating_mul(height).saturating_mul(width) <= MOST_SAMPLES;
    (1..=SAMPLES).rev().find(fits).unwrap_or(1)
}

/// Appends views, shrunk to the size of the others.
fn append(all: &mut Option<Image>, views: Option<&Image>, samples: usize) -> Result<()> {
    let Some(views) = views else { return Ok(()) };
    let part = pooled(views, samples)?;
    match all {
        Some(all) => {
            all.batch += part.batch;
            all.data.extend(part.data);
        }
        None => *all = Some(part),
    }
    Ok(())
}

/// How a mesh is rendered to views.
#[derive(Clone, Debug)]
pub struct ViewsOfMesh {
    /// The number of views.
    pub count: usize,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// The vertical angle of view, degrees.
    pub fov: f64,
    /// Whether the views have colours.
    pub color: bool,
    /// The other maps of the views.
    pub maps: Vec<Map>,
    /// How they are lit; `None`: smoothly if the mesh has one colour, of which unlit views show only the outline, and else not at all.
    pub shading: Option<Lighting>,
}

impl Default for ViewsOfMesh {
    fn default() -> Self {
        Self { count: 24, size: (128, 128), fov: 30.0, color: true, maps: Vec::new(), shading: None }
    }
}

/// How views and fit are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lighting {
    /// Colours as they are.
    None,
    /// Light by the normal of each triangle.
    Flat,
    /// Light by interpolated normals.
    Smooth,
}

impl ViewsOfMesh {
    /// No lights, or three that shine from fixed sides, each stronger than the next, so that the brightness shows which way a surface
    /// faces.
    fn lights(&self, one_color: bool) -> Lights {
        let shading = match self.shading {
            Some(Lighting::None) => return Lights::unlit(),
            None if !one_color => return Lights::unlit(),
            Some(Lighting::Flat) => Shading::Flat,
            Some(Lighting::Smooth) | None => Shading::Smooth,
        };
        let one = |direction, intensity| DirectionalLight { direction, color: [1.0; 3], intensity };
        Lights {
            ambient_color: [1.0; 3],
            ambient_intensity: 0.2,
            directional: vec![one([0.5, 0.8, -0.4], 0.6), one([-0.8, 0.1, -0.3], 0.3), one([0.2, -0.3, 0.9], 0.25)],
            shading,
        }
    }
}
