//! The targets of a fit: images and their cameras.

use super::args::FitArgs;
use super::maps::{self, Map};
use super::{camera_files, cameras};
use crate::commands::outputs::Outputs as Files;
use crate::commands::progress::Progress;
use crate::commands::{Failure, note};
use glam::DVec3;
use softras::parts;
use softras::scene::{Appearance, Background, Interpolation, Outputs};
use softras::{Camera, Error, Image, Lights, Mesh, Renderer, Result, Scene, Settings};
use softras_fit::Targets;
use softras_fit::pooled;
use softras_io::Budget;
use softras_io::Curve;
use softras_io::npy::{self, Array, Numbers};
use softras_io::{PictureFile, input};
use softras_view::Bounds;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The targets that are fitted: every `view_stride`-th view, with its silhouette as a mask where `--masks` is given.
pub fn fitted(args: &FitArgs, targets: &Targets) -> Targets {
    let mut some = every(targets, args.view_stride as usize);
    if let Some(silhouette) = some.silhouette.as_mut().filter(|_| args.method.masks) {
        silhouette.data.iter_mut().for_each(|x| *x = f32::from(*x > 0.5));
    }
    some
}

/// Samples along each side of a pixel of the images that `--from` renders.
const SAMPLES: u32 = 3;

/// The images, and what is known of the object in them.
pub struct Views {
    /// Images and cameras.
    pub targets: Targets,
    /// The mesh that they were rendered from, if known.
    pub truth: Option<Mesh>,
    /// The mesh to begin with, if it is that of a file.
    pub template: Option<Mesh>,
    /// A sphere around the object.
    pub bounds: Bounds,
    /// Nearest and farthest depth that is drawn.
    pub depths: (f64, f64),
    /// The lights of the views and of the fit.
    pub lights: Lights,
    /// Whether all of the object has one colour.
    pub one_color: bool,
}

impl Views {
    /// Whether the fit is one of the template's texels alone.
    pub fn keeps_shape(&self, args: &FitArgs) -> bool {
        let textured = |mesh: &Mesh| matches!(mesh.appearance(), Appearance::Textured { .. });
        args.texture && self.template.as_ref().is_some_and(textured)
    }

    /// The centre and the side of the cube that a hull is carved in.
    pub fn cube(&self) -> ([f64; 3], f64) {
        (self.bounds.center.to_array(), 2.0 * self.bounds.radius)
    }

    /// Reads or renders the views that the arguments ask for, and reads the mesh to begin with. None of the files read may
    /// be one that will be written.
    pub fn read(args: &FitArgs, written: &Files, renderer: &mut Renderer) -> Result<Self, Failure> {
        let budget = Budget::new(args.read.memory.memory);
        let template = match args.template.as_str() {
            "auto" | "sphere" | "hull" => None,
            path => Some(args.read.read(Path::new(path), true, written, &budget)?.mesh),
        };
        let views = args.views.as_deref();
        if let Some(path) = &args.from {
            let count = args.count_of_views()?;
            let mesh = args.read.read(path, true, written, &budget)?.mesh;
            return Self::made(args, mesh, template, count, renderer);
        }
        let path = Path::new(views.unwrap_or_default());
        let mut files = vec![path.to_path_buf()];
        files.extend(args.cameras.clone());
        let targets =
            if path.is_dir() { folder(args, path, &mut files, &budget)? } else { arrays(args, path, &budget)? };
        written.spare(files)?;
        let bounds = cameras::seen(&targets.cameras, targets.size()?);
        let depths = cameras::depths(&targets.cameras, bounds);
        Ok(Self { targets, truth: None, template, bounds, depths, lights: Lights::unlit(), one_color: false })
    }

    /// Renders the views from a mesh.
    pub fn made(
        args: &FitArgs,
        mesh: Mesh,
        template: Option<Mesh>,
        count: usize,
        renderer: &mut Renderer,
    ) -> Result<Self, Failure> {
        let bounds = Bounds::around_box(&mesh);
        let cameras = cameras::around(bounds, count, args.fov)?;
        let depths = cameras::depths(&cameras, bounds);
        let settings = Settings {
            width: args.size.0 * SAMPLES,
            height: args.size.1 * SAMPLES,
            sigma: 1e-7,
            near: depths.0,
            far: depths.1,
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            outputs: Outputs {
                color: args.colored() || args.files.write_views.is_some(),
                silhouette: true,
                depth: args.also.contains(&Map::Depth),
                normal: args.also.contains(&Map::Normal),
            },
            ..Settings::default()
        };
        let one_color = matches!(mesh.appearance(), Appearance::Uniform(_)) && args.color && !args.texture;
        if one_color && args.shading.is_none() {
            note("the mesh has one colour, so that its views are lit (--shading none shows its outline alone)");
        }
        let lights = args.lights(one_color);
        let scene = Scene::new(mesh.clone()).with_lights(lights.clone());
        let mut targets = Targets { cameras, ..Targets::default() };
        let progress = Progress::counted("view", count);
        let cameras = targets.cameras.clone();
        parts::in_batches(renderer, &scene, &cameras, &settings, |views, frame| {
            append(&mut targets.silhouette, frame.silhouette())?;
            append(&mut targets.color, frame.color())?;
            append(&mut targets.depth, frame.depth())?;
            append(&mut targets.normal, frame.normal())?;
            views.for_each(|_| progress.step());
            Ok(())
        })?;
        drop(progress);
        if let (Some(folder), Some(silhouette), Some(color)) =
            (&args.files.write_views, &targets.silhouette, &targets.color)
        {
            camera_files::write(folder, &cameras, silhouette, color)?;
            maps::write(folder, &targets, &camera_files::names(folder, cameras.len()))?;
        }
        targets.color = targets.color.filter(|_| args.colored());
        Ok(Self { targets, truth: Some(mesh), template, bounds, depths, lights, one_color })
    }
}

/// Appends views, shrunk to the size of the targets.
fn append(all: &mut Option<Image>, views: Option<&Image>) -> Result<()> {
    let Some(views) = views else { return Ok(()) };
    let part = pooled(views, SAMPLES as usize)?;
    match all {
        Some(all) => {
            all.batch += part.batch;
            all.data.extend(part.data);
        }
        None => *all = Some(part),
    }
    Ok(())
}

/// The images of some views.
pub fn some(image: &Image, views: Range<usize>) -> Image {
    let data = views.clone().flat_map(|view| image.view(view)).copied().collect();
    Image { batch: views.len(), data, ..*image }
}

/// Every `stride`-th view.
pub fn every(targets: &Targets, stride: usize) -> Targets {
    let views: Vec<usize> = (0..targets.cameras.len()).step_by(stride).collect();
    let some = |image: &Image| Image {
        batch: views.len(),
        data: views.iter().flat_map(|&view| image.view(view)).copied().collect(),
        ..*image
    };
    Targets {
        cameras: views.iter().map(|&view| targets.cameras[view]).collect(),
        silhouette: targets.silhouette.as_ref().map(some),
        color: targets.color.as_ref().map(some),
        depth: targets.depth.as_ref().map(some),
        normal: targets.normal.as_ref().map(some),
    }
}

fn fault<T>(path: &Path, what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::File { path: path.into(), line: None, what: what.into(), fix: fix.into() })
}

/// A .npy file of finite numbers.
pub fn read_array(path: &Path, budget: &Budget) -> Result<Array> {
    let file = input::open(path)?;
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    input::refuse_empty(path, bytes)?;
    budget.count_file(bytes);
    let room = |bytes| budget.claim(path, "the array", bytes).map_err(|error| error.to_string());
    let array = match npy::read(std::io::BufReader::new(file), room) {
        Ok(array) => array,
        Err(what) => return fault(path, what, "write it with numpy.save, as a plain array"),
    };
    let odd = numbers(path, &array)?.iter().enumerate().find(|(_, x)| !x.is_finite());
    match odd {
        Some((i, x)) => fault(path, format!("value {i} is {x:?}"), "every number must be finite"),
        None => Ok(array),
    }
}

/// The numbers of a file's array.
pub fn numbers<'a>(path: &Path, array: &'a Array) -> Result<Numbers<'a>> {
    match array.numbers() {
        Some(numbers) => Ok(numbers),
        None => fault(path, format!("holds text ({})", array.dtype()), "numbers are expected"),
    }
}

/// Bytes that a pixel of the targets takes: four floats as it is read, as it is fitted and on the device, and as much
/// again for each of the rendered samples under it, their gradients and what the device keeps of them.
fn bytes_per_pixel(args: &FitArgs) -> u64 {
    let samples = u64::from(args.method.samples.unwrap_or(1));
    48 + 64 * samples * samples
}

/// Claims the memory for a fit to so many pixels.
fn claim_pixels(args: &FitArgs, budget: &Budget, path: &Path, pixels: u64) -> Result<()> {
    budget.claim(path, &format!("a fit to {pixels} pixels"), pixels.saturating_mul(bytes_per_pixel(args)))
}

/// Images and cameras as numpy arrays.
fn arrays(args: &FitArgs, path: &Path, budget: &Budget) -> Result<Targets, Failure> {
    // What is not there is no .npy file that lacks its cameras.
    std::fs::metadata(path).map_err(|source| softras::Error::Io { path: path.into(), source })?;
    let Some(cameras) = &args.cameras else {
        return Err(Failure::Usage("--cameras: images in a .npy file need it".into()));
    };
    if args.depths.is_some() || args.normals.is_some() {
        let what = "--depths, --normals: their files have the names of pictures, which a .npy file of images has not";
        return Err(Failure::Usage(what.into()));
    }
    let array = read_array(path, budget)?;
    // The axes of [view, row, column, channel] in the file.
    let (sizes, strides) = match array.shape[..] {
        [n, c @ (1 | 3 | 4), h, w] => ([n, h, w, c], [c * h * w, w, 1, h * w]),
        [n, h, w, c @ (1 | 3 | 4)] => ([n, h, w, c], [h * w * c, w * c, c, 1]),
        [n, h, w] => ([n, h, w, 1], [h * w, w, 1, 0]),
        ref shape => {
            return Err(fault(path, format!("has shape {shape:?}"), "use [N, 4, H, W], [N, H, W, 4] or [N, H, W]")?);
        }
    };
    let [batch, height, width, channels] = sizes;
    if sizes.contains(&0) {
        return Err(fault(path, format!("has shape {:?}", array.shape), "give at least one pixel")?);
    }
    claim_pixels(args, budget, path, (batch * height * width) as u64)?;
    let values = numbers(path, &array)?;
    let scale = if array.dtype() == "uint8" { 255.0 } else { 1.0 };
    let mut pixels = Pixels::new(args);
    for view in 0..batch {
        for row in 0..height {
            for column in 0..width {
                let at = view * strides[0] + row * strides[1] + column * strides[2];
                let channel = |k: usize| values.at(at + k * strides[3]) / scale;
                pixels.push(match channels {
                    1 => [channel(0); 4],
                    3 => rgba([channel(0), channel(1), channel(2)], None),
                    _ => rgba([channel(0), channel(1), channel(2)], Some(channel(3))),
                });
            }
        }
    }
    let cameras = cameras::read(cameras, args.fov, budget)?;
    Ok(pixels.targets(cameras, [batch, height, width]))
}

/// The pixels of all targets, as they are fitted.
struct Pixels {
    silhouette: Vec<f32>,
    color: Option<Vec<f32>>,
}

impl Pixels {
    fn new(args: &FitArgs) -> Self {
        Self { silhouette: Vec::new(), color: args.colored().then(Vec::new) }
    }

    fn push(&mut self, [r, g, b, a]: [f64; 4]) {
        self.silhouette.push(a as f32);
        if let Some(color) = &mut self.color {
            color.extend([r as f32, g as f32, b as f32]);
        }
    }

    fn targets(self, cameras: Vec<Camera>, [batch, height, width]: [usize; 3]) -> Targets {
        let image = |channels: usize, data: Vec<f32>| Image { batch, height, width, channels, data };
        let color = self.color.map(|color| image(3, color));
        Targets { cameras, silhouette: Some(image(1, self.silhouette)), color, ..Targets::default() }
    }
}

/// Linear colour over black, and the silhouette; without alpha, the silhouette is every pixel that is not black.
fn rgba(bytes: [f64; 3], alpha: Option<f64>) -> [f64; 4] {
    let a = alpha.unwrap_or_else(|| f64::from(u8::from(bytes.iter().sum::<f64>() > 0.0)));
    let [r, g, b] = bytes.map(|byte| a * Curve::Srgb.decode(byte));
    [r, g, b, a]
}

/// Reads pictures with their cameras from a file of them, and adds all these files to those that were read.
fn folder(args: &FitArgs, path: &Path, files: &mut Vec<PathBuf>, budget: &Budget) -> Result<Targets, Failure> {
    let (list, views) = camera_files::read(path, args.cameras.as_deref(), args.fov)?;
    files.push(list.clone());
    let mut cameras = Vec::with_capacity(views.len());
    let mut size: Option<(u32, u32)> = None;
    // All pictures are counted before the first is decoded.
    for view in &views {
        let file = path.join(&view.file);
        check_inside(path, &file, args.read.allow_outside)?;
        let picture = PictureFile::open(&file)?;
        files.push(file.clone());
        let (width, height) = (picture.width, picture.height);
        cameras.push(view.camera(&list, (width, height))?);
        if *size.get_or_insert((width, height)) != (width, height) {
            let what = format!("is {width}×{height} pixels, others are not");
            return Err(fault(&file, what, "use images of one size")?);
        }
        budget.count_file(picture.file_bytes);
        claim_pixels(args, budget, &file, picture.pixels())?;
    }
    let mut pixels = Pixels::new(args);
    for view in &views {
        for_each_pixel(&path.join(&view.file), |pixel| pixels.push(pixel))?;
    }
    let (width, height) = size.unwrap_or_default();
    let (width, height) = (width as usize, height as usize);
    let mut targets = pixels.targets(cameras, [views.len(), height, width]);
    let pictures: Vec<PathBuf> = views.into_iter().map(|view| view.file).collect();
    let mut maps = |map: Map, folder: &Option<PathBuf>| -> Result<Option<Image>> {
        let Some(folder) = folder else { return Ok(None) };
        map.read_all(folder, &pictures, (width, height), args.depth_unit, files, budget).map(Some)
    };
    (targets.depth, targets.normal) = (maps(Map::Depth, &args.depths)?, maps(Map::Normal, &args.normals)?);
    Ok(targets)
}

/// Refuses pictures outside the folder: a cameras.json of unknown origin must not make softras read other files.
fn check_inside(folder: &Path, file: &Path, allowed: bool) -> Result<()> {
    let real = |path: &Path| path.canonicalize().map_err(|source| Error::Io { path: path.into(), source });
    if allowed || real(file)?.starts_with(real(folder)?) {
        return Ok(());
    }
    fault(file, "lies outside the folder of views", "move it into the folder, or use --allow-outside")
}

/// Decodes a picture file and visits its pixels, linear colour over black and alpha.
fn for_each_pixel(path: &Path, mut visit: impl FnMut([f64; 4])) -> Result<()> {
    let picture = PictureFile::open(path)?.decode(path)?.into_rgba8();
    let opaque = picture.pixels().all(|p| p.0[3] == 255);
    for pixel in picture.pixels() {
        let [r, g, b, a] = pixel.0.map(|byte| f64::from(byte) / 255.0);
        visit(rgba([r, g, b], (!opaque).then_some(a)));
    }
    Ok(())
}

/// Width, height and linear pixels of a picture file, each of which takes `bytes_per_pixel` of the budget.
pub fn read_picture(path: &Path, budget: &Budget, bytes_per_pixel: u64) -> Result<(usize, usize, Vec<[f64; 4]>)> {
    let picture = PictureFile::open(path)?;
    let (width, height) = (picture.width as usize, picture.height as usize);
    budget.count_file(picture.file_bytes);
    let what = format!("a picture of {width}×{height} pixels");
    budget.claim(path, &what, picture.pixels().saturating_mul(bytes_per_pixel))?;
    let mut pixels = Vec::with_capacity(width * height);
    for_each_pixel(path, |pixel| pixels.push(pixel))?;
    Ok((width, height, pixels))
}

/// Direction `i` of `count`, on a spiral over the unit sphere from low to high.
pub fn direction(i: usize, count: usize) -> DVec3 {
    // The spiral leaves out the poles, where (0, 1, 0) is not a valid up vector.
    let y = 0.92 * ((2 * i + 1) as f64 / count as f64 - 1.0);
    let turn = i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * turn.cos(), y, radius * turn.sin())
}
