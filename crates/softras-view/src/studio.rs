//! A mesh before the camera: what all frames of a picture or an animation share.

use crate::{
    animation::Step,
    bounds::Bounds,
    crease,
    facing::Sided,
    fill,
    framing::{self, Viewpoint},
    layers::{self, Glass},
    look,
    options::{Fill, Motion, Options, Output},
    panes::MOST,
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

/// The most samples of all layers of a band: 20 to 40 bytes each.
const MOST_SAMPLES: usize = 1 << 24;

/// Bands begin at multiples of this number of rows of the picture, and so at the borders of tiles.
const BAND: usize = 4;

/// The note on a camera whose near and far leave the mesh out.
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
    opaque: Sided,
    /// The transparent ones.
    glass: Option<Glass>,
    /// Whether the model's own values are wanted.
    floats: bool,
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
        let Loaded { mesh, normals, opacity, mut single_sided, unlit, origin, y_is_up, .. } = loaded;
        if options.both_sides {
            single_sided.clear();
        }
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
                let sigma = if options.is_sharp(floats) { 0.0 } else { widest.sigma };
                let share = fill::share(sigma, widest.tau, aspect);
                fill::filling(&options.camera, &mesh, bounds, aspect, &options.motion.turns(), share)?
            }
            Fill::Sphere => plain,
        };
        let mesh = match (options.light.shading, options.crease) {
            _ if options.light.unlit && !outputs.contains(&Output::Normal) => mesh,
            (Shading::Smooth, Some(degrees)) => crease::creased(&mesh, &[], degrees)?,
            (Shading::Smooth, None) => crease::creased(&mesh, &normals, crease::DEFAULT)?,
            (Shading::Flat, _) => crease::creased(&mesh, &[], 0.0)?,
        };
        options.light.shading = Shading::Smooth;
        let unit = BAND * samples as usize;
        let bands = Bands { unit, margin: 0, at_once: usize::MAX };
        let (opaque, glass) = layers::separate(Sided { mesh, single_sided }, &opacity)?;
        let (cut, near) = (first.cut(&opaque.mesh), first.near);
        if first.misses(bounds) {
            notes.push(MISSED.into());
        } else if cut > 0 {
            notes.push(format!("{cut} triangles lie before near ({near:.3}) and are cut there: lower --near"));
        }
        let outputs = outputs.to_vec();
        let studio = Self { options, outputs, samples, bounds, first, opaque, glass, floats, bands };
        if let Some(glass) = &studio.glass {
            let crowded = glass.crowded(&first.camera()?, &studio.settings(&first, None));
            if crowded > 0 {
                notes.push(format!(
                    "{crowded} transparent triangles lie behind {MOST} others: the nearest of them is drawn"
                ));
            }
        }
        Ok((studio, notes))
    }

    /// The settings of a frame.
    fn settings(&self, view: &Viewpoint, step: Option<Step>) -> Settings {
        let mut settings = look::settings(&self.options.look, view, &self.outputs, self.samples, step);
        // Layers are blended by depth.
        settings.outputs.depth |= self.glass.is_some();
        if self.options.is_sharp(self.floats) { look::sharp(settings) } else { settings }
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
        if self.first.misses(self.bounds) || mesh.triangles().is_empty() {
            None
        } else if is_flat && self.glass.is_none() {
            Some("no triangle of the mesh has an area: at most a faint blur of them is in the picture")
        } else if is_seen {
            None
        } else if self.opaque.single_sided.contains(&true) {
            Some(
                "nothing of the mesh is in the picture: its single-sided materials are seen from behind, which --faces both draws, or \
                 it is not where the camera looks",
            )
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
        &self.opaque.mesh
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
        let (view, samples) = (self.viewpoint(turn), self.samples as usize);
        let (camera, settings) = (view.camera()?, self.settings(&view, step));
        let Self { options, opaque, glass, floats, bands, .. } = self;
        let (curve, transparent) = (options.look.curve, options.look.background.is_none());
        let is_solid = options.is_solid() && !options.is_sharp(*floats);
        let lights = framing::lights(&options.light, &view)?;
        let scene = Scene::new(opaque.shown(&camera, !*floats)?).with_lights(lights.clone());
        let mut panes = glass.as_ref().map_or(Ok(Vec::new()), |glass| glass.panes(&camera, &settings, !*floats))?;
        // Whether a pixel is inside of a surface depends on its neighbours.
        bands.margin = if is_solid { bands.unit } else { 0 };
        bands.at_once =
            bands.at_once.min((MOST_SAMPLES / (settings.width as usize * bands.unit * (1 + panes.len()))).max(1));
        let frames = |camera: &Camera, settings: &Settings| {
            let layers =
                panes.iter_mut().map(|pane| pane.shoot(renderer, camera, &lights, settings)).collect::<Result<_>>()?;
            Ok((renderer.render(&scene, &[*camera], settings)?, layers))
        };
        parts::in_bands(&camera, &settings, bands, frames, |Band { frame: (frame, layers), rows, above }| {
            let settings = settings.clone();
            take(&Shot { frame, layers, rows, above, view, settings, samples, curve, transparent, is_solid })
        })
    }
}
