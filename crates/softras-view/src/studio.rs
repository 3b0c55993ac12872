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
    shrink::shrunk,
    standing::z_is_up,
};
use glam::DVec3;
use softras::{
    Camera, Error, Limits, Mesh, Renderer, Result, Scene, Settings,
    parts::{self, Band, Bands},
    scene::Shading,
};
use softras_io::Loaded;

/// Bands begin at multiples of so many rows of the picture, and so at the borders of tiles.
const BAND: usize = 4;

/// What is noted of a camera whose near and far leave the mesh out.
pub const MISSED: &str = "the mesh lies wholly outside the depths that this camera draws";

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
    /// Places the camera before a mesh, whose textures are made smaller where the device does not hold them. `outputs` are the images
    /// that frames have, `floats` says that the model's own values are wanted. The notes tell what was decided, and what of the mesh
    /// the camera's depths leave out.
    ///
    /// # Errors
    /// [`Error::Settings`] for solid alpha in modes in which it is not possible; [`Error::Camera`] for options that make no camera;
    /// [`Error::Mesh`] for a mesh that is too large or too small for any usual camera.
    pub fn new(
        loaded: Loaded,
        mut options: Options,
        outputs: &[Output],
        floats: bool,
        limits: &Limits,
    ) -> Result<(Self, Vec<String>)> {
        if options.is_solid() && !options.can_be_solid() {
            let fix = "solid needs the product silhouette, Euclidean distance and the composite background";
            return Err(Error::Settings { field: "alpha", value: "solid".into(), fix: fix.into() });
        }
        let Loaded { mesh, normals, opacity, unlit, origin, y_is_up, .. } = loaded;
        let mut notes = Vec::new();
        if options.has_no_axis() && !y_is_up && z_is_up(&mesh) {
            options.camera.up = Some([0.0, 0.0, 1.0]);
            notes.push("the mesh stands or lies on its lowest z, so z is taken to be up; --up 0,1,0 for y".into());
        }
        options.camera = options.camera.relative_to(origin);
        options.light.unlit |= unlit && options.light.lights.is_empty() && options.light.ambient.is_none();
        let (mesh, about) = shrunk(mesh, limits)?;
        notes.extend(about);
        let samples = options.samples(floats);
        let bounds = Bounds::of(&mesh);
        let (width, height) = options.look.size;
        let aspect = f64::from(width) / f64::from(height);
        let plain = Viewpoint::new(&options.camera, bounds, aspect);
        let first = match options.fill {
            Fill::Box => {
                let step = if let Motion::Sweep(sweep) = options.motion { Some(sweep.widest()) } else { None };
                let widest = look::settings(&options.look, &plain, outputs, 1, step);
                let share = fill::share(widest.sigma, widest.tau, aspect);
                fill::filling(&options.camera, &mesh, bounds, aspect, &options.motion.turns(), share)?
            }
            Fill::Sphere => plain,
        };
        let mesh = match (options.light.shading, options.crease) {
            (Shading::Smooth, Some(degrees)) => crease::creased(&mesh, &[], degrees)?,
            (Shading::Smooth, None) => crease::creased(&mesh, &normals, crease::DEFAULT)?,
            (Shading::Flat, _) => mesh,
        };
        let unit = BAND * samples as usize;
        // Whether a pixel is inside of a surface depends on its neighbours.
        let bands = Bands { unit, margin: if options.is_solid() { unit } else { 0 }, at_once: usize::MAX };
        let (mesh, glass) = layers::separate(mesh, &opacity)?;
        let (cut, near) = (first.cut(&mesh), first.near);
        if first.misses(bounds) {
            notes.push(MISSED.into());
        } else if cut > 0 {
            notes.push(format!("{cut} triangles lie before near ({near:.3}) and are cut there: lower --near"));
        }
        let (scene, outputs) = (Scene::new(mesh), outputs.to_vec());
        Ok((Self { options, outputs, samples, bounds, first, scene, glass, bands }, notes))
    }

    /// The likely reason why no frame shows anything of the mesh; `None` if a note has given it already, or if a frame shows something,
    /// `is_seen`, see [`Shot::is_seen`].
    pub fn nothing(&self, is_seen: bool) -> Option<&'static str> {
        let (camera, mesh) = (&self.options.camera, self.mesh());
        let corner = |i: u32| DVec3::from(mesh.positions()[i as usize].map(f64::from));
        let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
        let is_flat = mesh.triangles().iter().all(|corners| area(corners.map(corner)) == 0.0);
        let is_placed = camera.eye.is_some() || camera.target.is_some() || camera.distance.is_some();
        let is_cut = camera.near.is_some() || camera.far.is_some();
        if self.first.misses(self.bounds) {
            None
        } else if is_flat && self.glass.is_none() {
            Some("no triangle of the mesh has an area: at most a faint blur of them is in the picture")
        } else if is_seen {
            None
        } else if is_placed || is_cut || camera.orthographic.is_some() {
            Some(
                "nothing of the mesh is in the picture: it is not where the camera looks: without --eye, --look-at, --distance, \
                 --near, --far and --orthographic the camera finds it by itself",
            )
        } else {
            Some(
                "nothing of the mesh is in the picture: it is seen edge-on, or from behind with --faces front: give another \
                 --azimuth or --elevation",
            )
        }
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The opaque triangles.
    pub fn mesh(&self) -> &Mesh {
        &self.scene.meshes[0]
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
        let mut settings = look::settings(&options.look, &view, outputs, *samples, step);
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
