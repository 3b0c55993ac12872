//! `softras render`: renders a mesh file as pictures.

mod animation;
pub mod args;
mod report;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, note};
use args::RenderArgs;
use report::Report;
use softras::{Renderer, Settings};
use softras_io::{Budget, Loaded, PictureFormat};
use softras_view::{Alpha, Developed, Image, Output, Studio};
use std::path::{Path, PathBuf};
use std::time::Instant;

pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let targets = targets(args)?;
    let outputs = Outputs::new(targets.iter().map(|target| &target.path), [])?;
    check_samples(args, &targets)?;
    let start = Instant::now();
    let budget = Budget::new(args.read.memory);
    let mut loaded = args.read.read_layers(&args.mesh, !args.look.raw, &outputs, &budget)?;
    let mut notes = std::mem::take(&mut loaded.notes);
    let mut stage = Stage::new(args, loaded, &targets, &mut notes)?;
    let mut report = Report::new(&stage, notes);
    if args.turntable.is_some() || args.sweep.is_some() {
        animation::run(&mut stage, &targets, &mut report)?;
    } else {
        still(&mut stage, &targets, &mut report)?;
    }
    report.note_nothing(&stage.studio);
    report.print(args.json, start.elapsed())
}

/// Renders one picture and writes it into every target.
fn still(stage: &mut Stage<'_>, targets: &[RenderTarget], report: &mut Report) -> Result<(), Failure> {
    let mut made: Vec<_> = targets.iter().map(RenderTarget::developed).collect();
    let mut progress = Progress::spinner("rendering");
    stage.studio.shoot(&mut stage.renderer, 0.0, None, |shot| {
        let height = shot.settings.height as usize;
        if shot.rows.start == 0 && shot.rows.end < height {
            progress = Progress::counted("row", height);
        }
        report.add(shot);
        made.iter_mut().try_for_each(|made| made.add(shot))?;
        shot.rows.clone().for_each(|_| progress.step());
        Ok::<_, Failure>(())
    })?;
    drop(progress);
    for (target, made) in targets.iter().zip(made) {
        let image = made.finished(None);
        image.save(&target.path, target.output)?;
        let meaning = match image {
            Image::Picture(_, Some((low, high))) => Some(format!("white is depth {low:.4}, black is depth {high:.4}")),
            _ => None,
        };
        report.wrote(target, 1, meaning);
    }
    Ok(())
}

#[derive(Debug)]
struct RenderTarget {
    path: PathBuf,
    format: PictureFormat,
    output: Output,
}

impl RenderTarget {
    /// Whether the file holds the model's own values.
    fn has_floats(&self) -> bool {
        matches!(self.format, PictureFormat::Exr | PictureFormat::Npy)
    }

    fn developed(&self) -> Developed {
        Developed::new(self.output, self.has_floats())
    }
}

/// One target for every output and file; with several outputs each file's name gains the output's name.
fn targets(args: &RenderArgs) -> Result<Vec<RenderTarget>, Failure> {
    let mut outputs: Vec<Output> = args.output.iter().map(|&output| output.into()).collect();
    outputs.dedup();
    let animated = args.turntable.is_some() || args.sweep.is_some();
    let mut targets: Vec<RenderTarget> = Vec::new();
    for out in &args.out {
        let format = match (PictureFormat::of(out), animated) {
            (Some(format @ (PictureFormat::Png | PictureFormat::Gif)), true) => Ok(format),
            (Some(format @ (PictureFormat::Png | PictureFormat::Exr | PictureFormat::Npy)), false) => Ok(format),
            (Some(PictureFormat::Gif), false) => {
                Err(".gif is for several frames: add --turntable N or --sweep, or write .png, .exr or .npy")
            }
            (_, true) => Err("a turntable or a sweep is written as .gif, or as a .png contact sheet"),
            (None, false) => Err("the file's ending must be .png, .exr or .npy, or .gif with --turntable or --sweep"),
        };
        let format = format.map_err(|what| Failure::Usage(format!("--out {}: {what}", out.display())))?;
        for &output in &outputs {
            let path = if outputs.len() > 1 { named(out, output) } else { out.clone() };
            if targets.iter().any(|t| t.path == path) {
                return Err(Failure::Usage(format!("--out {}: would be written twice", path.display())));
            }
            targets.push(RenderTarget { path, format, output });
        }
    }
    Ok(targets)
}

/// Refuses samples that a file or a frame cannot have, and solid alpha in modes in which it is not possible.
fn check_samples(args: &RenderArgs, targets: &[RenderTarget]) -> Result<(), Failure> {
    let options = args.options(2);
    if options.alpha == Some(Alpha::Solid) && !options.can_be_solid() {
        let needs = "needs --silhouette-mode product, --distance-mode euclidean and --background-mode composite";
        return Err(Failure::Usage(format!("--alpha solid: {needs}")));
    }
    let side = args.look.size.0.max(args.look.size.1);
    match args.look.samples {
        Some(n) if n > 1 && targets.iter().any(RenderTarget::has_floats) => {
            Err(Failure::Usage(format!("--samples {n}: .exr and .npy hold the model's own values, one a pixel")))
        }
        Some(n) if n > Settings::MAX_SIZE / side => {
            let what = "pixels a side are more than the 16384 that a frame may have";
            Err(Failure::Usage(format!("--samples {n}: {} {what}", n * side)))
        }
        _ => Ok(()),
    }
}

/// `folder/name.png` to `folder/name_depth.png`.
fn named(path: &Path, output: Output) -> PathBuf {
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let ending = path.extension().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!("{stem}_{}.{ending}", output.name()))
}

/// Frames of a sweep that is an animation, and of one that is a contact sheet, where no number is given.
const SWEEP_FRAMES: usize = 24;
const SWEEP_CELLS: usize = 8;

/// The mesh before the camera, the renderer, and the arguments.
struct Stage<'a> {
    args: &'a RenderArgs,
    studio: Studio,
    /// The place of the mesh's origin in its file.
    origin: [f64; 3],
    /// Vertices and triangles of the mesh file.
    vertices: usize,
    triangles: usize,
    renderer: Renderer,
}

impl<'a> Stage<'a> {
    fn new(
        args: &'a RenderArgs,
        loaded: Loaded,
        targets: &[RenderTarget],
        notes: &mut Vec<String>,
    ) -> Result<Self, Failure> {
        let mut renderer = super::open_device(args.device.as_deref(), args.read.memory)?;
        renderer.time_stages(true);
        let is_animation = targets.iter().any(|target| target.format == PictureFormat::Gif);
        let options = args.options(if is_animation { SWEEP_FRAMES } else { SWEEP_CELLS });
        let outputs: Vec<Output> = args.output.iter().map(|&output| output.into()).collect();
        let (vertices, triangles) = (loaded.mesh.positions().len(), loaded.mesh.triangles().len());
        let (origin, floats) = (loaded.origin, targets.iter().any(RenderTarget::has_floats));
        let (studio, about) = Studio::new(loaded, options, &outputs, floats, &renderer.device_info().limits)?;
        args.camera.check_depths(&studio.viewpoint(0.0))?;
        about.iter().for_each(|text| note(text));
        notes.extend(about);
        Ok(Self { args, studio, origin, vertices, triangles, renderer })
    }
}
