//! A mesh before the camera: what all frames of a picture or an animation share.

use crate::{
    animation::Step,
    bounds::Bounds,
    crease, fill,
    framing::{self, Viewpoint},
    layers::{self, Glass},
    look,
    options::{Fill, Motion, Options, Output},
    shot::Shot,
};
use softras::{
    Camera, Error, Mesh, Renderer, Result, Scene, Settings,
    parts::{self, Band, Bands},
    scene::Shading,
};

/// Bands begin at multiples of so many rows of the picture, and so at the borders of tiles.
const BAND: usize = 4;

/// A mesh before the camera.
pub struct Studio {
    options: Options,
    outputs: Vec<Output>,
    samples: u32,
    bounds: Bounds,
    /// The view before the first turn.
    first: Viewpoint,
    /// The opaque triangles of the mesh, with vertices split where its edges are kept.
    scene: Scene,
    /// The transparent ones.
    glass: Option<Glass>,
    bands: Bands,
}

impl Studio {
    /// Places the camera. `normals` are those of the triangles' corners in the mesh's file and `opacity` one number for each
    /// triangle; both may be empty. `outputs` are the images that frames have, `samples` those along each side of a pixel.
    ///
    /// # Errors
    /// [`Error::Settings`] for solid alpha in modes in which that is not known how; [`Error::Camera`] for options of which
    /// there is no camera.
    pub fn new(
        mesh: Mesh,
        normals: &[[[f32; 3]; 3]],
        opacity: &[f32],
        options: Options,
        outputs: &[Output],
        samples: u32,
    ) -> Result<Self> {
        if options.is_solid() && !options.can_be_solid() {
            let fix = "solid needs the product silhouette, Euclidean distance and the composite background";
            return Err(Error::Settings { field: "alpha", value: "solid".into(), fix: fix.into() });
        }
        let bounds = Bounds::of(&mesh);
        let (width, height) = options.look.size;
        let aspect = f64::from(width) / f64::from(height);
        let plain = Viewpoint::new(&options.camera, bounds, aspect, 0.0);
        let first = match options.fill {
            Fill::Box => {
                let step = if let Motion::Sweep(sweep) = options.motion { Some(sweep.widest()) } else { None };
                let widest = look::settings(&options.look, &options.modes, &plain, outputs, 1, step);
                let share = fill::share(widest.sigma, widest.tau, aspect);
                fill::filling(&options.camera, &mesh, bounds, aspect, &options.motion.turns(), share)?
            }
            Fill::Sphere => plain,
        };
        let mesh = match (options.light.shading, options.crease) {
            (Shading::Smooth, Some(degrees)) => crease::creased(&mesh, &[], degrees)?,
            (Shading::Smooth, None) => crease::creased(&mesh, normals, crease::DEFAULT)?,
            (Shading::Flat, _) => mesh,
        };
        let unit = BAND * samples as usize;
        // Whether a pixel is inside of a surface depends on its neighbours.
        let bands = Bands { unit, margin: if options.is_solid() { unit } else { 0 }, at_once: usize::MAX };
        let (mesh, glass) = layers::separate(mesh, opacity)?;
        let (scene, outputs) = (Scene::new(mesh), outputs.to_vec());
        Ok(Self { options, outputs, samples, bounds, first, scene, glass, bands })
    }

    /// The sphere around the mesh.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The opaque triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.scene.meshes[0]
    }

    /// Whether the mesh has transparent triangles.
    pub fn has_glass(&self) -> bool {
        self.glass.is_some()
    }

    /// Where the camera is after a turn around the vertical axis, in degrees.
    pub fn viewpoint(&self, turn: f64) -> Viewpoint {
        self.first.turned(&self.options.camera, self.bounds, turn)
    }

    /// Renders one frame, `turn` degrees around the axis and with a sweep's step, in bands from top to bottom where it is too
    /// large to be rendered at once.
    ///
    /// # Errors
    /// As [`Renderer::render`], or of `take`.
    pub fn shoot<E: From<Error>>(
        &mut self,
        renderer: &mut Renderer,
        turn: f64,
        step: Option<Step>,
        mut take: impl FnMut(&Shot) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        let view = self.viewpoint(turn);
        let Self { options, outputs, samples, scene, glass, bands, .. } = self;
        let mut settings = look::settings(&options.look, &options.modes, &view, outputs, *samples, step);
        // Layers are blended by depth.
        settings.outputs.depth |= glass.is_some();
        let (curve, transparent) = (options.look.curve, options.look.background.is_none());
        scene.lights = framing::lights(&options.light, &view)?;
        let (is_solid, camera) = (options.is_solid(), view.camera()?);
        let samples = *samples as usize;
        let lights = scene.lights.clone();
        let layers = |camera: &Camera, settings: &Settings| {
            let layer = glass.as_mut().map(|glass| glass.shoot(renderer, camera, &lights, settings)).transpose()?;
            Ok((renderer.render(scene, &[*camera], settings)?, layer))
        };
        parts::in_bands(&camera, &settings, bands, layers, |Band { frame: (frame, layer), rows, above }| {
            let settings = settings.clone();
            take(&Shot { frame, layer, rows, above, view, settings, samples, curve, transparent, is_solid })
        })
    }
}
