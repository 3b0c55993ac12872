//! The arguments of `softras fit`.

use crate::commands::Failure;
use crate::commands::mesh_file::ReadArgs;
use crate::commands::parse;
use crate::commands::render::args::{Faces, mode};
use clap::{Args, ValueEnum};
use softras::{Mesh, scene::Appearance};
use softras_fit::{FitOptions, ImageLoss, Subdivision, Template, ViewsOfMesh};
use softras_io::ViewsOptions;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Views are a folder of pictures with their cameras (cameras.json, transforms.json,
COLMAP's model, cameras.npz, NAME_par.txt), or arrays; see docs/cameras.md. Alpha,
masks beside the pictures, or a plain background tell the object. Ctrl-C ends the
fit and writes the best mesh so far.

Examples:
  softras fit --views photos -o shape.obj --color --gif fit.gif --plot loss.png
  softras fit --views scans --depths scans/depths --normals scans/normals -o shape.obj
  softras fit --views views.npy --cameras cameras.npy -o shape.obj --json log.json
  softras fit --from fish --views 24 --size 256 --texture -o textured.obj
  softras fit --from spot.obj --template grey_spot.obj --texture -o textured.obj";

const USAGE: &str = "\
softras fit --views <IMAGES.npy|FOLDER> [--cameras <FILE>] -o <OUT.obj> [OPTIONS]
       softras fit --from <MESH> [--views <N>] -o <OUT.obj> [OPTIONS]";

/// Fit a mesh to images: its shape, and its colours with --color
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, override_usage = USAGE)]
pub struct FitArgs {
    /// Images: a folder or a .npy file; with --from the number of views
    #[arg(long, value_name = "VIEWS")]
    pub views: Option<String>,
    /// Cameras of the images [default: the camera file in the folder]
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    pub cameras: Option<PathBuf>,
    /// Render the target images from this mesh: a file or a built-in mesh
    #[arg(long, value_name = "MESH")]
    pub from: Option<PathBuf>,
    /// The mesh to write: .obj, .ply or .glb
    #[arg(short, long = "out", value_name = "FILE")]
    pub out: PathBuf,
    /// Fit colours: texels of a textured template, else a colour for each vertex
    #[arg(long)]
    pub color: bool,
    /// Fit the template's texture, or a new one if it has none
    #[arg(long)]
    pub texture: bool,
    /// The mesh to begin with: auto, hull, sphere, a file or a built-in mesh
    #[arg(long, value_name = "MESH", default_value = "auto")]
    pub template: String,
    #[command(flatten)]
    pub files: FileArgs,
    #[command(flatten)]
    pub targets: TargetArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE", help_heading = "Input and device")]
    pub device: Option<String>,
}

/// The targets to fit to, and how they are read or rendered.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Targets")]
pub struct TargetArgs {
    /// Size in pixels of the images that --from renders
    #[arg(long, value_name = "SIZE", value_parser = parse::size, default_value = "128")]
    pub size: (u32, u32),
    /// Light of --from's views and of the fit: none, flat or smooth
    #[arg(long, value_enum, value_name = "SHADING", requires = "from", hide_possible_values = true)]
    pub shading: Option<Lighting>,
    /// Fit to depth or normal maps of --from too
    #[arg(
        long,
        value_name = "MAPS",
        value_enum,
        value_delimiter = ',',
        requires = "from",
        hide_possible_values = true
    )]
    pub also: Vec<Map>,
    /// Folder of masks, named as the pictures: NAME.png or NAME.jpg.png [default: masks, mask or silhouettes beside them]
    #[arg(long, value_name = "FOLDER", alias = "mask-folder", requires = "views", conflicts_with = "from")]
    pub mask_path: Option<PathBuf>,
    /// Fit to depth maps too: NAME.exr, .npy, or .png of 16 bits
    #[arg(long, value_name = "FOLDER", requires = "views", conflicts_with = "from")]
    pub depths: Option<PathBuf>,
    /// World units of a step of depth maps in .png files
    #[arg(long, value_name = "LENGTH", value_parser = parse::positive, default_value_t = 0.001)]
    pub depth_unit: f64,
    /// Fit to normal maps too: NAME.exr, .npy or .png, in world space
    #[arg(long, value_name = "FOLDER", requires = "views", conflicts_with = "from")]
    pub normals: Option<PathBuf>,
    /// Vertical angle of view where no file gives one
    #[arg(long, value_name = "DEGREES", value_parser = parse::angle_of_view, default_value_t = 30.0)]
    pub fov: f64,
    /// Use only every N-th view
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), default_value_t = 1)]
    pub view_stride: u32,
    /// Judge the fit by N views that it does not use [default: one of every 12 views, at most 3]
    #[arg(long, value_name = "N")]
    pub hold_out: Option<u32>,
    /// Do not refine cameras, even where they disagree with views
    #[arg(long)]
    pub keep_cameras: bool,
    /// Do not correct colours where exposures differ
    #[arg(long)]
    pub keep_exposure: bool,
    /// Crop larger pictures to the object, to at most PIXELS a side; 0: never crop
    #[arg(long, value_name = "PIXELS", default_value_t = 192)]
    pub crop: u32,
    /// Keep views that contradict the others, and holes that one mask shows
    #[arg(long)]
    pub keep_views: bool,
}

impl FitArgs {
    /// The method of the fit, for a template that was read.
    pub fn options(&self, template: Template) -> FitOptions {
        let method = &self.method;
        let steps = |given: &[u32]| given.iter().map(|&at| at as usize).collect();
        FitOptions {
            template,
            subdivisions: method.subdivisions,
            color: self.color,
            texture: self.texture.then_some(method.texture_size),
            keep_views: self.targets.keep_views,
            keep_cameras: self.targets.keep_cameras,
            keep_exposure: self.targets.keep_exposure,
            crop: self.targets.crop as usize,
            view_stride: self.targets.view_stride as usize,
            hold_out: self.targets.hold_out.map(|count| count as usize),
            preset: method.preset.into(),
            iterations: method.iterations.map(|steps| steps as usize),
            rate: method.rate,
            color_rate: method.color_rate,
            sigma: method.sigma,
            gamma: method.gamma,
            loss: method.loss.into(),
            masks: method.masks,
            faces: method.faces.into(),
            samples: method.samples.unwrap_or(1) as usize,
            views_per_step: method.views_per_step.unwrap_or(0) as usize,
            smoothing: method.smoothing,
            laplacian: method.laplacian,
            flatten: method.flatten,
            normal_consistency: method.normal_consistency,
            color_weight: method.color_weight,
            depth_weight: method.depth_weight,
            normal_weight: method.normal_weight,
            subdivide_at: steps(&method.subdivide_at),
            subdivision: method.subdivision.into(),
            remesh_at: steps(&method.remesh_at),
            keep_topology: method.keep_topology,
            edge: method.edge,
        }
    }

    /// How views of `--from` are rendered. An object of one colour is lit where `--shading` says nothing, if colours are fitted and not
    /// a texture.
    pub fn views_of_mesh(&self, count: usize) -> ViewsOfMesh {
        let unlit = (!self.color || self.texture).then_some(softras_fit::Lighting::None);
        ViewsOfMesh {
            count,
            size: self.targets.size,
            fov: self.targets.fov,
            color: self.colored() || self.files.write_views.is_some(),
            maps: self.targets.also.iter().map(|&map| map.into()).collect(),
            shading: self.targets.shading.map(Into::into).or(unlit),
        }
    }

    /// How views are read. A pixel takes four floats as it is read, as it is fitted and on the device, and as much again for each of
    /// the rendered samples under it, their gradients and what the device keeps of them.
    pub fn views_options(&self) -> ViewsOptions {
        let samples = u64::from(self.method.samples.unwrap_or(1));
        ViewsOptions {
            cameras: self.cameras.clone(),
            masks: self.targets.mask_path.clone(),
            fov: self.targets.fov,
            color: self.colored(),
            depths: self.targets.depths.clone(),
            depth_unit: self.targets.depth_unit,
            normals: self.targets.normals.clone(),
            allow_outside: self.read.allow_outside,
            bytes_per_pixel: 48 + 64 * samples * samples,
            crop: softras_fit::Preset::from(self.method.preset).crop(self.targets.crop as usize) as u32,
            detail: if self.texture { self.method.texture_size } else { 0 },
        }
    }

    /// Refuses options that exclude each other.
    pub fn check(&self) -> Result<(), Failure> {
        self.check_source()?;
        self.from.as_ref().map_or(Ok(0), |_| self.count_of_views())?;
        let refuse = |what: &str| Err(Failure::Usage(what.into()));
        let official = self.method.preset == Preset::Official;
        if self.targets.shading.is_some_and(|shading| shading != Lighting::None) && !self.colored() {
            return refuse("--shading: the light is seen in colours: add --color or --texture");
        }
        if official && self.files.resume && self.method.has_new_triangles() {
            return refuse(
                "--resume: the official preset cannot resume with --subdivide-at or --remesh-at: leave one out",
            );
        }
        if official && self.template == "hull" {
            return refuse("--template hull: the official method begins with its sphere: leave out one of the two");
        }
        let path = self.views.as_deref().filter(|_| self.from.is_none()).map(Path::new);
        let is_array =
            |path: &Path| path.extension().is_some_and(|ending| ending == "npy") && !path.ends_with("poses_bounds.npy");
        if path.is_some_and(|path| path.is_file() && is_array(path)) {
            if self.cameras.is_none() {
                return refuse("--cameras: images in a .npy file need it");
            }
            if self.targets.depths.is_some() || self.targets.normals.is_some() {
                return refuse(
                    "--depths, --normals: maps are found by the pictures' names: give a folder, not a .npy file",
                );
            }
        }
        Ok(())
    }

    /// Refuses what a template with a texture excludes.
    pub fn check_template(&self, template: &Mesh) -> Result<(), Failure> {
        if !matches!(template.appearance(), Appearance::Textured { .. }) {
            return Ok(());
        }
        if self.method.has_new_triangles() {
            let what = "--subdivide-at, --remesh-at: the triangles of a textured template stay what they are";
            return Err(Failure::Usage(what.into()));
        }
        if self.texture
            && (self.targets.depths.is_some() || self.targets.normals.is_some() || !self.targets.also.is_empty())
        {
            let what = "--texture: with a textured template it fits only texels, not the shape, so maps do not help: leave out \
                        --also, --depths and --normals, or --texture for --color";
            return Err(Failure::Usage(what.into()));
        }
        Ok(())
    }

    /// Refuses a fit to nothing.
    fn check_source(&self) -> Result<(), Failure> {
        if self.from.is_some() || self.views.is_some() {
            return Ok(());
        }
        let what = "give --views or --from: --views names the pictures to fit to, a folder or a .npy file, and --from a mesh \
                    to render pictures of";
        Err(Failure::Usage(what.into()))
    }

    /// The number of views that `--from` renders.
    pub fn count_of_views(&self) -> Result<usize, Failure> {
        let count = self.views.as_deref().map_or(Ok(24), str::parse).ok().filter(|n| (1..=1000).contains(n));
        let what = "--views: with --from it is a number of views from 1 to 1000";
        count.ok_or_else(|| Failure::Usage(what.into()))
    }

    /// Whether colours are fitted.
    pub fn colored(&self) -> bool {
        self.color || self.texture
    }
}

mode!(Lighting => softras_fit::Lighting { None => None, Flat => Flat, Smooth => Smooth });
mode!(Preset => softras_fit::Preset { Smooth => Smooth, Quick => Quick, Official => Official });
mode!(Scheme => Subdivision { Midpoint => Midpoint, Loop => Loop });
mode!(Map => softras_io::Map { Depth => Depth, Normal => Normal });
mode!(Loss => ImageLoss { Iou => NegativeIou, L1 => L1, L2 => L2 });

/// The method of the fit.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Method")]
pub struct MethodArgs {
    /// The defaults: smooth, quick, or official (paper)
    #[arg(
        long,
        value_enum,
        value_name = "PRESET",
        default_value = "smooth",
        default_value_if("quick", "true", "quick"),
        hide_possible_values = true
    )]
    pub preset: Preset,
    /// A first look: the hull after 20 steps (as --preset quick)
    #[arg(long, conflicts_with = "preset")]
    pub quick: bool,
    /// Number of steps [default: 500, 150 from a hull, and 20 of a quick fit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub iterations: Option<u32>,
    /// Begin with a sphere of N subdivisions [default: 3, or 4 from six views on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=7))]
    pub subdivisions: Option<u32>,
    /// Step length: one number, or FIRST..LAST: 0.02..0.002
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub rate: Option<(f64, f64)>,
    /// Step length of the colours
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub color_rate: Option<(f64, f64)>,
    /// Softness of edges, (half image heights)²: 1e-4 or 1e-4..1e-5
    #[arg(long, value_name = "SIGMA", value_parser = range)]
    pub sigma: Option<(f64, f64)>,
    /// Softness of the depth order, for colours
    #[arg(long, value_name = "GAMMA", value_parser = range)]
    pub gamma: Option<(f64, f64)>,
    /// Loss of silhouettes: iou, l1 or l2
    #[arg(long, value_enum, value_name = "LOSS", default_value = "iou", hide_possible_values = true)]
    pub loss: Loss,
    /// Turn silhouettes into masks: above 0.5 is 1, else 0
    #[arg(long, conflicts_with = "samples")]
    pub masks: bool,
    /// Triangles to draw: both sides or front
    #[arg(long, value_enum, value_name = "FACES", default_value = "both", hide_possible_values = true)]
    pub faces: Faces,
    /// Samples rendered along each side of a pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: Option<u32>,
    /// Compare N views in each step, cycling through all of them [default: all; of 24 or more 12 in the first 0.6 of the steps from a hull]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub views_per_step: Option<u32>,
    /// λ of (I + λL)⁻¹, smooths steps [default: 5; 2 if lit]
    #[arg(long, value_name = "LAMBDA", value_parser = parse::positive)]
    pub smoothing: Option<f64>,
    /// Weight of the Laplacian regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub laplacian: Option<f64>,
    /// Weight of the flatten regulariser [default: 3e-5, 1e-6 if lit; less for over 6000 triangles]
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub flatten: Option<f64>,
    /// Weight of the normal consistency regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub normal_consistency: Option<f64>,
    /// Weight of the loss of colours [default: 3; 5 if lit]
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub color_weight: Option<f64>,
    /// Weight of the loss of depths, in object radii
    #[arg(long, value_name = "WEIGHT", value_parser = weight, default_value_t = 10.0)]
    pub depth_weight: f64,
    /// Weight of the loss of normals
    #[arg(long, value_name = "WEIGHT", value_parser = weight, default_value_t = 0.5)]
    pub normal_weight: f64,
    /// Split every triangle into four before these steps
    #[arg(long, value_name = "STEPS", value_delimiter = ',')]
    pub subdivide_at: Vec<u32>,
    /// How to split: midpoint, or loop (rounder)
    #[arg(
        long,
        value_enum,
        value_name = "SCHEME",
        default_value = "midpoint",
        requires = "subdivide_at",
        hide_possible_values = true
    )]
    pub subdivision: Scheme,
    /// Remesh to triangles of even size before these steps
    #[arg(long, value_name = "STEPS", value_delimiter = ',')]
    pub remesh_at: Vec<u32>,
    /// Edge length of a hull and of --remesh-at, pixels: 1.5 or 2..1
    #[arg(long, value_name = "PIXELS", value_parser = range)]
    pub edge: Option<(f64, f64)>,
    /// Cut no holes and add no parts while the fit runs
    #[arg(long)]
    pub keep_topology: bool,
    /// Most texels along a side of a new texture
    #[arg(long, value_name = "TEXELS", requires = "texture", value_parser = clap::value_parser!(u32).range(16..=8192),
          default_value_t = 2048)]
    pub texture_size: u32,
}

impl MethodArgs {
    /// Whether the mesh gets other triangles at steps that are given.
    fn has_new_triangles(&self) -> bool {
        !(self.subdivide_at.is_empty() && self.remesh_at.is_empty())
    }
}

/// Files besides the mesh.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Files")]
pub struct FileArgs {
    /// Write a log of every step: losses, seconds, IoU of every view
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Write a page that shows each view beside the mesh, cameras, losses and notes: .html
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("html"))]
    pub report: Option<PathBuf>,
    /// Write a plot of the loss by step: .png
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("png"))]
    pub plot: Option<PathBuf>,
    /// Write the fit as an animation beside its target: .gif
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("gif"))]
    pub gif: Option<PathBuf>,
    /// Write the state of the fit at its end and every 100 steps: .npz
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("npz"))]
    pub checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint, if the file exists
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
    /// Write the cameras of --views as they were refined: .json
    #[arg(long, value_name = "FILE", value_parser = parse::file_ending("json"), requires = "views", conflicts_with = "from")]
    pub save_cameras: Option<PathBuf>,
    /// Write the views of --from and their cameras, for --views
    #[arg(long, value_name = "FOLDER", requires = "from")]
    pub write_views: Option<PathBuf>,
}

/// `0.01`, or `0.02..0.002`.
fn range(text: &str) -> Result<(f64, f64), String> {
    match text.split_once("..") {
        Some((from, to)) => Ok((parse::positive(from)?, parse::positive(to)?)),
        None => parse::positive(text).map(|x| (x, x)),
    }
}

/// A finite number, at least 0.
fn weight(text: &str) -> Result<f64, String> {
    parse::number(text).and_then(|x| if x >= 0.0 { Ok(x) } else { Err(format!("{x} is below 0")) })
}
