//! `softras render`: renders a mesh file as pictures.

mod animation;
pub mod args;
mod crease;
mod developed;
mod enclosing;
mod fill;
pub mod formats;
pub mod framing;
pub mod gif;
pub mod layers;
pub mod look;
pub mod picture;
mod report;
pub mod sheet;
mod solid;
mod standing;

use super::memory::Budget;
use super::outputs::Outputs;
use super::parts::{self, Band, Bands};
use super::progress::Progress;
use super::{Failure, note};
use args::{CameraArgs, Fit, Output, RenderArgs};
use developed::Developed;
use formats::Format;
use framing::{Bounds, View};
use layers::Glass;
use picture::Shot;
use report::{Report, Written};
use softras::obj::Loaded;
use softras::{Camera, Mesh, Renderer, Scene, Settings};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let targets = targets(args)?;
    let outputs = Outputs::new(targets.iter().map(|target| &target.path), [])?;
    let samples = samples(args, &targets)?;
    look::validate_alpha(args)?;
    let start = Instant::now();
    let budget = Budget::new(&args.read.memory);
    let mut loaded = args.read.read_layers(&args.mesh, !args.look.raw, &outputs, &budget)?;
    let mut notes = std::mem::take(&mut loaded.notes);
    let camera = upright(args, &loaded.mesh, &mut notes);
    let mut stage = Stage::new(args, camera, loaded, samples)?;
    let misses = stage.view(0.0).misses(stage.bounds);
    if misses {
        notes.push("the mesh lies wholly outside the depths that this camera draws".into());
        notes.last().into_iter().for_each(|text| note(text));
    }
    let mut report = Report::new(&stage, notes);
    if args.turntable.is_some() || args.sweep.is_some() {
        animation::run(&mut stage, &targets, &mut report)?;
    } else {
        still(&mut stage, &targets, &mut report)?;
    }
    if !misses {
        report.note_nothing(&stage);
    }
    report.print(args.json, start.elapsed())
}

/// Renders one picture and writes it into every target.
fn still(stage: &mut Stage<'_>, targets: &[Target], report: &mut Report) -> Result<(), Failure> {
    let mut made: Vec<_> = targets.iter().map(|target| Developed::new(target.output, target.format)).collect();
    let mut progress = Progress::spinner("rendering");
    stage.shoot(0.0, None, |shot| {
        let height = shot.settings.height as usize;
        if shot.rows.start == 0 && shot.rows.end < height {
            progress = Progress::counted("row", height);
        }
        report.add(shot);
        made.iter_mut().try_for_each(|made| made.add(shot))?;
        shot.rows.clone().for_each(|_| progress.step());
        Ok(())
    })?;
    drop(progress);
    for (target, made) in targets.iter().zip(made) {
        let meaning = formats::write(&target.path, target.format, &made.finished(None), target.output)?;
        report.wrote(Written::still(target, meaning));
    }
    Ok(())
}

/// The arguments of the camera with a vertical axis: the one given, or one that the mesh stands on, with a note if that is not
/// y. glTF files say that y is up, who gives the camera's place has seen the mesh's coordinates, and
/// --frame sphere is the same camera however the mesh is turned.
fn upright(args: &RenderArgs, mesh: &Mesh, notes: &mut Vec<String>) -> CameraArgs {
    let mut camera = args.camera;
    let ending = args.mesh.extension().map(|ending| ending.to_ascii_lowercase()).unwrap_or_default();
    let is_given = camera.up.is_some() || camera.eye.is_some() || args.frame == Fit::Sphere;
    if is_given || ending == "gltf" || ending == "glb" {
        return camera;
    }
    if let Some(axis) = standing::other_axis(mesh) {
        let mut up = [0.0; 3];
        up[axis] = 1.0;
        camera.up = Some(up);
        let name = ["x", "y", "z"][axis];
        notes.push(format!("the mesh stands on its lowest {name}, so {name} is taken to be up; --up 0,1,0 for y"));
        notes.last().into_iter().for_each(|text| note(text));
    }
    camera
}

/// One file to write.
#[derive(Debug)]
struct Target {
    path: PathBuf,
    format: Format,
    output: Output,
}

/// One target for every output and file; with several outputs each file's name gains the output's name.
fn targets(args: &RenderArgs) -> Result<Vec<Target>, Failure> {
    let mut outputs = args.output.clone();
    outputs.dedup();
    let animated = args.turntable.is_some() || args.sweep.is_some();
    let mut targets: Vec<Target> = Vec::new();
    for out in &args.out {
        let format = Format::of(out);
        let format = match (format, animated) {
            (Some(format @ (Format::Png | Format::Gif)), true) => format,
            (Some(format @ (Format::Png | Format::Exr | Format::Npy)), false) => format,
            (Some(Format::Gif), false) => {
                let what = "is for several frames: add --turntable N or --sweep, or write .png, .exr or .npy";
                return Err(Failure::Usage(format!("--out {}: .gif {what}", out.display())));
            }
            (_, true) => {
                let what = "a turntable or a sweep is written as .gif, or as a .png contact sheet";
                return Err(Failure::Usage(format!("--out {}: {what}", out.display())));
            }
            (None, false) => {
                let what = "the file's ending must be .png, .exr or .npy, or .gif with --turntable or --sweep";
                return Err(Failure::Usage(format!("--out {}: {what}", out.display())));
            }
        };
        for &output in &outputs {
            let path = if outputs.len() > 1 { named(out, output) } else { out.clone() };
            if targets.iter().any(|t| t.path == path) {
                return Err(Failure::Usage(format!("--out {}: would be written twice", path.display())));
            }
            targets.push(Target { path, format, output });
        }
    }
    Ok(targets)
}

/// The number of samples along each side of a pixel.
fn samples(args: &RenderArgs, targets: &[Target]) -> Result<u32, Failure> {
    let floats = targets.iter().any(|t| matches!(t.format, Format::Exr | Format::Npy));
    let asked_soft = args.look.sigma.is_some() || args.look.blur.is_some();
    let side = args.look.size.0.max(args.look.size.1);
    let most = softras::Settings::MAX_SIZE / side;
    match args.look.samples {
        Some(n) if n > 1 && floats => {
            Err(Failure::Usage(format!("--samples {n}: .exr and .npy hold the model's own values, one a pixel")))
        }
        Some(n) if n > most => {
            let what = "pixels a side are more than the 16384 that a frame may have";
            Err(Failure::Usage(format!("--samples {n}: {} {what}", n * side)))
        }
        Some(n) => Ok(n),
        None if floats || asked_soft => Ok(1),
        None => Ok(most.clamp(1, 3)),
    }
}

/// `folder/name.png` to `folder/name_depth.png`.
fn named(path: &Path, output: Output) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let ending = path.extension().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!("{stem}_{}.{ending}", output.name()))
}

/// The mesh, the renderer, and the arguments that apply to every frame.
struct Stage<'a> {
    args: &'a RenderArgs,
    /// The arguments of the camera, with the vertical axis that was guessed.
    camera: CameraArgs,
    bounds: Bounds,
    /// The view before the first turn.
    first: View,
    /// The opaque triangles of the mesh, with vertices split where its edges are kept.
    scene: Scene,
    /// The transparent ones.
    glass: Option<Glass>,
    /// Vertices and triangles of the mesh file.
    vertices: usize,
    triangles: usize,
    renderer: Renderer,
    samples: u32,
    bands: Bands,
}

/// Bands begin at multiples of so many rows of the picture, and so at the borders of tiles.
const BAND: usize = 4;

impl<'a> Stage<'a> {
    fn new(args: &'a RenderArgs, camera: CameraArgs, loaded: Loaded, samples: u32) -> Result<Self, Failure> {
        let (mesh, normals) = (loaded.mesh, &loaded.normals);
        let mut renderer = super::open_device(args.device.as_deref(), args.read.memory.memory)?;
        renderer.time_stages(true);
        let (bounds, vertices, triangles) = (Bounds::of(&mesh), mesh.positions().len(), mesh.triangles().len());
        let (width, height) = args.look.size;
        let aspect = f64::from(width) / f64::from(height);
        let first = match args.frame {
            Fit::Box => {
                let widest = look::widest(args, &View::new(&camera, bounds, aspect, 0.0));
                let share = fill::share(widest.sigma, widest.tau, aspect);
                fill::filling(&camera, &mesh, bounds, aspect, &animation::turns(args), share)?
            }
            Fit::Sphere => View::new(&camera, bounds, aspect, 0.0),
        };
        framing::check_depths(&camera, &first)?;
        let mesh = match args.light.shading {
            args::Shading::Smooth => match args.crease {
                Some(degrees) => crease::creased(&mesh, &[], degrees)?,
                None => crease::creased(&mesh, normals, crease::DEFAULT)?,
            },
            args::Shading::Flat => mesh,
        };
        let unit = BAND * samples as usize;
        // Whether a pixel is inside of a surface depends on its neighbours.
        let bands = Bands { unit, margin: if look::is_solid(args) { unit } else { 0 }, at_once: usize::MAX };
        let (mesh, glass) = layers::separate(mesh, &loaded.opacity)?;
        let scene = Scene::new(mesh);
        Ok(Self { args, camera, bounds, first, scene, glass, vertices, triangles, renderer, samples, bands })
    }

    fn view(&self, turn: f64) -> View {
        self.first.turned(&self.camera, self.bounds, turn)
    }

    /// Renders one frame, `turn` degrees around the axis and with a sweep's step, in bands from top to bottom where it is too
    /// large to be rendered at once.
    fn shoot(
        &mut self,
        turn: f64,
        step: Option<animation::Step>,
        mut take: impl FnMut(&Shot) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (args, samples) = (self.args, self.samples);
        let view = self.view(turn);
        let mut settings = look::settings(&args.look, &args.modes, &view, &args.output, samples, step);
        // Layers are blended by depth.
        settings.outputs.depth |= self.glass.is_some();
        let (curve, transparent) = (args.look.curve(), args.look.background.is_none());
        self.scene.lights = framing::lights(&args.light, curve, &view)?;
        let (is_solid, camera) = (look::is_solid(args), view.camera()?);
        let Self { renderer, scene, glass, bands, .. } = self;
        let samples = samples as usize;
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
