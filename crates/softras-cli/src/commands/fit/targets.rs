//! The targets of a fit: images and their cameras.

use super::args::FitArgs;
use super::cameras;
use crate::commands::color::Curve;
use crate::commands::npz::npy::{self, Array, Values};
use crate::commands::outputs::Outputs as Files;
use crate::commands::{Failure, note, render::framing::Bounds};
use glam::DVec3;
use serde_json::Value;
use softras::fit::Targets;
use softras::internals::fit::pooled;
use softras::scene::{Appearance, Background, Interpolation, Outputs};
use softras::{Camera, Error, Image, Mesh, Renderer, Result, Scene, Settings};
use std::fs::File;
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
}

impl Views {
    /// Reads or renders the views that the arguments ask for, and reads the mesh to begin with. None of the files read may
    /// be one that will be written.
    pub fn read(args: &FitArgs, written: &Files, renderer: &mut Renderer) -> Result<Self, Failure> {
        let template = match args.template.as_str() {
            "sphere" => None,
            path => Some(args.read.read(Path::new(path), true, written)?.mesh),
        };
        let views = args.views.as_deref();
        if let Some(path) = &args.from {
            let count = views.map_or(Ok(24), str::parse).ok().filter(|n| (1..=1000).contains(n));
            let Some(count) = count else {
                return Err(Failure::Usage("--views: with --from it is a number of views from 1 to 1000".into()));
            };
            let mesh = args.read.read(path, true, written)?.mesh;
            return Ok(Self::made(args, mesh, template, count, renderer)?);
        }
        let path = Path::new(views.unwrap_or_default());
        let mut files = vec![path.to_path_buf()];
        files.extend(args.cameras.clone());
        let targets = if path.is_dir() { folder(args, path, &mut files)? } else { arrays(args, path)? };
        written.spare(files)?;
        let bounds = cameras::seen(&targets.cameras, targets.size()?);
        let depths = cameras::depths(&targets.cameras, bounds);
        Ok(Self { targets, truth: None, template, bounds, depths })
    }

    /// Renders the views from a mesh.
    fn made(args: &FitArgs, mesh: Mesh, template: Option<Mesh>, count: usize, renderer: &mut Renderer) -> Result<Self> {
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
            outputs: Outputs { color: args.colored(), silhouette: true, depth: false, normal: false },
            ..Settings::default()
        };
        if let (Appearance::Uniform(_), true, None) = (mesh.appearance(), args.colored(), args.shading) {
            note("the mesh has one colour: its views show only that and the outline (--shading smooth lights them)");
        }
        let scene = Scene::new(mesh.clone()).with_lights(args.lights());
        let frame = renderer.render(&scene, &cameras, &settings)?;
        let shrunk = |image: Option<&Image>| image.map(|i| pooled(i, SAMPLES as usize)).transpose();
        let (silhouette, color) = (shrunk(frame.silhouette())?, shrunk(frame.color())?);
        Ok(Self { targets: Targets { cameras, silhouette, color }, truth: Some(mesh), template, bounds, depths })
    }
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
    }
}

/// What a cameras.json looks like.
const FORMAT: &str = "write it, as [{\"file\": \"0.png\", \"distance\": 3, \"elevation\": 20, \"azimuth\": 45}, \
    {\"file\": \"1.png\", \"eye\": [0, 1, 3], \"target\": [0, 0, 0], \"fov\": 30}]";

fn fault<T>(path: &Path, what: impl Into<String>, fix: &str) -> Result<T> {
    Err(Error::File { path: path.into(), line: None, what: what.into(), fix: fix.into() })
}

/// A .npy file.
pub fn read_array(path: &Path) -> Result<(Vec<usize>, Vec<f64>, bool)> {
    let file = File::open(path).map_err(|source| Error::Io { path: path.into(), source })?;
    match npy::read(std::io::BufReader::new(file)) {
        Ok(Array { shape, values: Values::Numbers(values), dtype }) => {
            match values.iter().position(|x| !x.is_finite()) {
                Some(i) => fault(path, format!("value {i} is {}", values[i]), "every number must be finite"),
                None => Ok((shape, values, dtype == "uint8")),
            }
        }
        Ok(Array { dtype, .. }) => fault(path, format!("holds text ({dtype})"), "numbers are expected"),
        Err(what) => fault(path, what, "write it with numpy.save, as a plain array"),
    }
}

/// Images and cameras as numpy arrays.
fn arrays(args: &FitArgs, path: &Path) -> Result<Targets, Failure> {
    let Some(cameras) = &args.cameras else {
        return Err(Failure::Usage("--cameras: images in a .npy file need it".into()));
    };
    let (shape, values, bytes) = read_array(path)?;
    // The axes of [view, row, column, channel] in the file.
    let (sizes, strides) = match shape[..] {
        [n, c @ (1 | 3 | 4), h, w] => ([n, h, w, c], [c * h * w, w, 1, h * w]),
        [n, h, w, c @ (1 | 3 | 4)] => ([n, h, w, c], [h * w * c, w * c, c, 1]),
        [n, h, w] => ([n, h, w, 1], [h * w, w, 1, 0]),
        _ => return Err(fault(path, format!("has shape {shape:?}"), "use [N, 4, H, W], [N, H, W, 4] or [N, H, W]")?),
    };
    let [batch, height, width, channels] = sizes;
    if sizes.contains(&0) {
        return Err(fault(path, format!("has shape {shape:?}"), "give at least one pixel")?);
    }
    let scale = if bytes { 255.0 } else { 1.0 };
    let mut pixels = Vec::with_capacity(batch * height * width);
    for view in 0..batch {
        for row in 0..height {
            for column in 0..width {
                let at = view * strides[0] + row * strides[1] + column * strides[2];
                let channel = |k: usize| values[at + k * strides[3]] / scale;
                pixels.push(match channels {
                    1 => [channel(0); 4],
                    3 => rgba([channel(0), channel(1), channel(2)], None),
                    _ => rgba([channel(0), channel(1), channel(2)], Some(channel(3))),
                });
            }
        }
    }
    let cameras = cameras::read(cameras, args.fov)?;
    Ok(targets(args, cameras, [batch, height, width], &pixels))
}

/// Linear colour over black, and the silhouette; without alpha, the silhouette is every pixel that is not black.
fn rgba(bytes: [f64; 3], alpha: Option<f64>) -> [f64; 4] {
    let a = alpha.unwrap_or_else(|| f64::from(u8::from(bytes.iter().sum::<f64>() > 0.0)));
    let [r, g, b] = bytes.map(|byte| a * Curve::Srgb.decode(byte));
    [r, g, b, a]
}

fn targets(args: &FitArgs, cameras: Vec<Camera>, [batch, height, width]: [usize; 3], pixels: &[[f64; 4]]) -> Targets {
    let image = |channels: std::ops::Range<usize>| Image {
        batch,
        height,
        width,
        channels: channels.len(),
        data: pixels.iter().flat_map(|p| p[channels.clone()].iter().map(|&x| x as f32)).collect(),
    };
    Targets { cameras, silhouette: Some(image(3..4)), color: args.colored().then(|| image(0..3)) }
}

/// Reads PNG files with their cameras from cameras.json, and adds all these files to those that were read.
fn folder(args: &FitArgs, path: &Path, files: &mut Vec<PathBuf>) -> Result<Targets, Failure> {
    let list = args.cameras.clone().unwrap_or_else(|| path.join("cameras.json"));
    files.push(list.clone());
    let text = match std::fs::read_to_string(&list) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Err(fault(&list, "not found", FORMAT)?),
        text => text.map_err(|source| Error::Io { path: list.clone(), source })?,
    };
    let entries = match serde_json::from_str(&text) {
        Ok(Value::Array(entries)) if !entries.is_empty() => entries,
        Ok(_) => return Err(fault(&list, "is not a list of cameras", "see `softras fit --help`")?),
        Err(e) => return Err(fault(&list, format!("is not JSON ({e})"), "see `softras fit --help`")?),
    };
    let (mut cameras, mut pixels) = (Vec::new(), Vec::new());
    let mut size: Option<(usize, usize)> = None;
    for (i, entry) in entries.iter().enumerate() {
        cameras.push(cameras::of_json(&list, i, entry, args.fov)?);
        let Some(name) = entry["file"].as_str() else {
            return Err(fault(&list, format!("camera {i} has no \"file\""), "name its PNG file")?);
        };
        let file = path.join(name);
        check_inside(path, &file, args.read.allow_outside)?;
        let (width, height, image) = read_picture(&file)?;
        files.push(file.clone());
        if *size.get_or_insert((width, height)) != (width, height) {
            let what = format!("is {width}×{height} pixels, others are not");
            return Err(fault(&file, what, "use images of one size")?);
        }
        pixels.extend(image);
    }
    let (width, height) = size.unwrap_or_default();
    Ok(targets(args, cameras, [entries.len(), height, width], &pixels))
}

/// Refuses pictures outside the folder: a cameras.json of unknown origin must not make softras read other files.
fn check_inside(folder: &Path, file: &Path, allowed: bool) -> Result<()> {
    let real = |path: &Path| path.canonicalize().map_err(|source| Error::Io { path: path.into(), source });
    if allowed || real(file)?.starts_with(real(folder)?) {
        return Ok(());
    }
    fault(file, "lies outside the folder of views", "move it into the folder, or use --allow-outside")
}

/// Width, height and linear pixels of a picture file.
pub fn read_picture(path: &Path) -> Result<(usize, usize, Vec<[f64; 4]>)> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let picture = match image::load_from_memory(&bytes) {
        Ok(picture) => picture.into_rgba8(),
        Err(e) => return fault(path, format!("not a readable picture ({e})"), "give a .png file"),
    };
    let (width, height) = picture.dimensions();
    if width.max(height) > Settings::MAX_SIZE || width.min(height) == 0 {
        return fault(path, format!("is {width}×{height} pixels"), "use 1 to 16384 pixels a side");
    }
    let opaque = picture.pixels().all(|p| p.0[3] == 255);
    let linear = |p: &image::Rgba<u8>| {
        let [r, g, b, a] = p.0.map(|byte| f64::from(byte) / 255.0);
        rgba([r, g, b], (!opaque).then_some(a))
    };
    Ok((width as usize, height as usize, picture.pixels().map(linear).collect()))
}

/// Direction `i` of `count`, on a spiral over the unit sphere from low to high.
pub fn direction(i: usize, count: usize) -> DVec3 {
    // The spiral leaves out the poles, where (0, 1, 0) is not a valid up vector.
    let y = 0.92 * ((2 * i + 1) as f64 / count as f64 - 1.0);
    let turn = i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let radius = (1.0 - y * y).sqrt();
    DVec3::new(radius * turn.cos(), y, radius * turn.sin())
}
