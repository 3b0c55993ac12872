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
Examples:
  softras fit --views views.npy --cameras cameras.npy -o shape.obj --json log.json
  softras fit --views photos -o shape.obj --color --gif fit.gif --plot loss.png
  softras fit --from spot.obj --views 24 --size 128 --color -o fitted.obj
  softras fit --from bunny.obj --color --shading smooth -o fitted.obj --gif fit.gif
  softras fit --from spot.obj --views 24 --size 256 --texture -o textured.obj
  softras fit --from spot.obj --template grey_spot.obj --texture -o textured.obj
  softras fit --views scans --depths scans/depths --normals scans/normals -o shape.obj

Views and cameras:
  IMAGES.npy   [N, 4, H, W] or [N, H, W, 4] (RGBA; alpha is the silhouette), [N, H, W] (silhouettes); bytes or
               floats from 0 to 1
  CAMERAS.npy  [N, 3]: distance, elevation, azimuth in degrees, looking at the origin: the official data, whose images
               are mirrored; [N, 4, 4]: world to view, z forward
  FOLDER       pictures, and their cameras in one of the following. Other fields are refused. The silhouette of a
               picture without transparency is every pixel that is not black (of JPEG, above 32 of 255).
               docs/cameras.md describes all, and
               --write-views writes an example.
  .../cameras.json     a list of objects with \"file\" and one of \"eye\" (and \"target\", \"up\"), \"distance\" with
                       \"elevation\" and \"azimuth\", \"world_to_camera\", \"camera_to_world\" (4x4, OpenCV's axes);
                       and \"fov\", the vertical angle of view in degrees, or \"intrinsics\" (3x3, pixels)
  .../transforms.json  as of NeRF, instant-ngp and nerfstudio
  .../images.txt       with cameras.txt, or images.bin with cameras.bin: COLMAP's model
  .../cameras.npz      of IDR and NeuS
  .../NAME_par.txt     of Middlebury's data
  --from MESH  renders the views from all around the mesh, and reports the 3D IoU with it

Ctrl-C ends the fit and writes the best mesh so far; --checkpoint FILE with --resume continues a fit.";

const USAGE: &str = "\
softras fit --views <IMAGES.npy|FOLDER> [--cameras <FILE>] -o <OUT.obj> [OPTIONS]
       softras fit --from <MESH> [--views <N>] -o <OUT.obj> [OPTIONS]";

/// Fit a mesh to images: its shape, and its colours with --color
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES, override_usage = USAGE)]
pub struct FitArgs {
    /// The mesh to begin with: `sphere`; `hull`, the largest solid that has the silhouettes, with its holes and parts; a mesh file
    /// (.obj, .ply, .stl, .gltf, .glb); or `auto`, a hull from 6 views on and else a sphere
    #[arg(long, value_name = "auto|hull|sphere|MESH", default_value = "auto")]
    pub template: String,
    /// Begin with a sphere, unless --template is given, of so many subdivisions, each of which halves its edges [default: 3,
    /// which gives 642 vertices]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=7))]
    pub subdivisions: Option<u32>,
    /// Images: a .npy file or a folder; with --from the number of views [default: 24]
    #[arg(long, value_name = "IMAGES.npy|FOLDER|N")]
    pub views: Option<String>,
    /// The cameras of the images: .npy, .json, .npz, _par.txt, or COLMAP's model, also as its folder [default: what the folder of
    /// images has]
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    pub cameras: Option<PathBuf>,
    /// Vertical angle of view of cameras whose file does not give one, degrees
    #[arg(long, value_name = "DEGREES", value_parser = parse::angle_of_view, default_value_t = 30.0)]
    pub fov: f64,
    /// Render the target images from this mesh file
    #[arg(long, value_name = "MESH")]
    pub from: Option<PathBuf>,
    /// Size in pixels of the images that --from renders
    #[arg(long, value_name = "SIZE", value_parser = parse::size, default_value = "128")]
    pub size: (u32, u32),
    /// Keep views that do not agree with the others, and holes that one mask alone shows
    #[arg(long)]
    pub keep_views: bool,
    /// Use only every N-th view
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), default_value_t = 1)]
    pub view_stride: u32,
    /// The mesh to write
    #[arg(short, long = "out", value_name = "OUT.obj")]
    pub out: PathBuf,
    /// Fit the colours too: the template's texels where it has a texture, else a colour for each vertex
    #[arg(long)]
    pub color: bool,
    /// Light the views that --from renders, and the mesh that is fitted, alike [default: none, but with --color smooth for a
    /// mesh of one colour, whose views show nothing but their outline without light]
    #[arg(long, value_enum, requires = "from")]
    pub shading: Option<Lighting>,
    /// Render depths or normals of --from too and fit to them
    #[arg(long, value_name = "MAP", value_enum, value_delimiter = ',', requires = "from")]
    pub also: Vec<Map>,
    /// Fit to depth maps too, a file of each picture's name: .exr (channel Z) or .npy ([H, W]), view depths in world units, or .png
    /// of 16 bits; 0 where the depth is not known
    #[arg(long, value_name = "FOLDER", requires = "views", conflicts_with = "from")]
    pub depths: Option<PathBuf>,
    /// World units of a step of depth maps in .png files
    #[arg(long, value_name = "LENGTH", value_parser = parse::positive, default_value_t = 0.001)]
    pub depth_unit: f64,
    /// Fit to normal maps too, a file of each picture's name: .exr (R, G, B) or .npy ([H, W, 3]), unit normals in world space, or
    /// .png, where black is -1 and white 1; 0, or black in .png, where the normal is not known
    #[arg(long, value_name = "FOLDER", requires = "views", conflicts_with = "from")]
    pub normals: Option<PathBuf>,
    /// Fit a texture: of a template that has one the texels alone, and its vertices stay; else first shape and vertex colours, as
    /// --color does, then the texels of a texture that is made for the mesh
    #[arg(long)]
    pub texture: bool,
    /// The most texels along a side of a texture that is made; what does not fit has longer texels
    #[arg(long, value_name = "TEXELS", requires = "texture", value_parser = clap::value_parser!(u32).range(16..=8192), default_value_t = 2048)]
    pub texture_size: u32,
    #[command(flatten)]
    pub read: ReadArgs,
    #[command(flatten)]
    pub method: MethodArgs,
    #[command(flatten)]
    pub files: FileArgs,
    /// The Vulkan device: its index or a part of its name [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
}

impl FitArgs {
    /// The method of the fit, for a template that was read.
    pub fn options(&self, template: Template) -> FitOptions {
        let method = &self.method;
        let steps = |given: &[u32]| given.iter().map(|&at| at as usize).collect();
        FitOptions {
            template,
            subdivisions: self.subdivisions,
            color: self.color,
            texture: self.texture.then_some(self.texture_size),
            keep_views: self.keep_views,
            view_stride: self.view_stride as usize,
            preset: method.preset.into(),
            iterations: method.iterations.map(|steps| steps as usize),
            rate: method.rate,
            color_rate: method.color_rate,
            sigma: method.sigma,
            gamma: method.gamma,
            loss: method.loss.image_loss(),
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
            size: self.size,
            fov: self.fov,
            color: self.colored() || self.files.write_views.is_some(),
            maps: self.also.iter().map(|&map| map.into()).collect(),
            shading: self.shading.map(Into::into).or(unlit),
        }
    }

    /// How views are read. A pixel takes four floats as it is read, as it is fitted and on the device, and as much again for each of
    /// the rendered samples under it, their gradients and what the device keeps of them.
    pub fn views_options(&self) -> ViewsOptions {
        let samples = u64::from(self.method.samples.unwrap_or(1));
        ViewsOptions {
            cameras: self.cameras.clone(),
            fov: self.fov,
            color: self.colored(),
            depths: self.depths.clone(),
            depth_unit: self.depth_unit,
            normals: self.normals.clone(),
            allow_outside: self.read.allow_outside,
            bytes_per_pixel: 48 + 64 * samples * samples,
        }
    }

    /// Refuses options that exclude each other.
    pub fn check(&self) -> Result<(), Failure> {
        self.check_source()?;
        let refuse = |what: &str| Err(Failure::Usage(what.into()));
        let official = self.method.preset == Preset::Official;
        if self.shading.is_some_and(|shading| shading != Lighting::None) && !self.colored() {
            return refuse("--shading: the light is seen in colours: add --color or --texture");
        }
        if official && self.files.resume && self.method.has_new_triangles() {
            return refuse(
                "--resume: the official parametrisation cannot be taken up after --subdivide-at or --remesh-at",
            );
        }
        if official && self.template == "hull" {
            return refuse("--template hull: the official method begins with its sphere: leave out one of the two");
        }
        let path = self.views.as_deref().filter(|_| self.from.is_none()).map(Path::new);
        if path.is_some_and(Path::is_file) {
            if self.cameras.is_none() {
                return refuse("--cameras: images in a .npy file need it");
            }
            if self.depths.is_some() || self.normals.is_some() {
                return refuse(
                    "--depths, --normals: their files have the names of pictures, which a .npy file of images has not",
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
        if self.texture && (self.depths.is_some() || self.normals.is_some() || !self.also.is_empty()) {
            let what = "--texture: of a textured template it fits the texels alone, which depths and normals do not tell: leave out \
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
                    that pictures are rendered of";
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

mode!(Lighting => softras_fit::Lighting {
    /// Colours as they are
    None => None,
    /// Light by the normal of each triangle
    Flat => Flat,
    /// Light by interpolated normals
    Smooth => Smooth,
});
mode!(Preset => softras_fit::Preset {
    /// Smoothed parameters, a shrinking sigma, and steps that do not tear the surface
    Smooth => Smooth,
    /// The official demo: displacements in logit space, Adam with rate 0.01, sigma 1e-4, the template at half its size
    Official => Official,
});
mode!(Scheme => Subdivision {
    /// At the middle of their edges: the surface stays what it is
    Midpoint => Midpoint,
    /// By Loop's scheme, which rounds the surface off: the steps after it bring the smooth surface back to the pictures
    Loop => Loop,
});
mode!(Map => softras_io::Map {
    /// View depths
    Depth => Depth,
    /// Normals in world space
    Normal => Normal,
});

/// The loss between silhouettes and their targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Loss {
    /// 1 - IoU of each view, for masks
    Iou,
    /// The mean absolute difference
    L1,
    /// The mean square difference, for targets with smooth outlines; use it with --samples 2 or more
    L2,
}

impl Loss {
    /// The loss itself.
    pub fn image_loss(self) -> ImageLoss {
        match self {
            Self::Iou => ImageLoss::NegativeIou,
            Self::L1 => ImageLoss::L1,
            Self::L2 => ImageLoss::L2,
        }
    }
}

/// The method of the fit.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Method")]
pub struct MethodArgs {
    /// The set of defaults
    #[arg(long, value_enum, default_value = "smooth")]
    pub preset: Preset,
    /// Number of steps [default: 500, and 150 from a hull]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub iterations: Option<u32>,
    /// Step length, constant or from the first to the last step: 0.01 or 0.02..0.002
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub rate: Option<(f64, f64)>,
    /// Step length of the colours
    #[arg(long, value_name = "RATE", value_parser = range)]
    pub color_rate: Option<(f64, f64)>,
    /// Softness of edges, screen units²: 1e-4 or 1e-4..1e-5
    #[arg(long, value_name = "SIGMA", value_parser = range)]
    pub sigma: Option<(f64, f64)>,
    /// Softness of the depth order, in units of far - near, for colours
    #[arg(long, value_name = "GAMMA", value_parser = range)]
    pub gamma: Option<(f64, f64)>,
    /// The loss between silhouettes and their targets
    #[arg(long, value_enum, default_value = "iou")]
    pub loss: Loss,
    /// Turn the target silhouettes into masks: pixels above 0.5 become 1, the others 0
    #[arg(long, conflicts_with = "samples")]
    pub masks: bool,
    /// Triangles to draw: all, or front faces only, whose silhouette of a closed surface is less enlarged by softness
    #[arg(long, value_enum, default_value = "both")]
    pub faces: Faces,
    /// Samples rendered along each side of a pixel of the target
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: Option<u32>,
    /// Views that a step compares, others in each, so that a step takes less time and every view is compared as often; on the
    /// host [default: all views]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub views_per_step: Option<u32>,
    /// How strongly steps are smoothed over the surface, λ of (I + λ L)⁻¹ [default: 5, 2 from a hull of one colour; none in
    /// the official preset]
    #[arg(long, value_name = "LAMBDA", value_parser = parse::positive)]
    pub smoothing: Option<f64>,
    /// Weight of the Laplacian regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub laplacian: Option<f64>,
    /// Weight of the flatten regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub flatten: Option<f64>,
    /// Weight of the normal consistency regulariser
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub normal_consistency: Option<f64>,
    /// Weight of the loss of colours, relative to that of silhouettes [default: 3, and 5 for
    /// an object of one colour under light]
    #[arg(long, value_name = "WEIGHT", value_parser = weight)]
    pub color_weight: Option<f64>,
    /// Weight of the loss of depths in units of the object's radius, relative to that of silhouettes
    #[arg(long, value_name = "WEIGHT", value_parser = weight, default_value_t = 10.0)]
    pub depth_weight: f64,
    /// Weight of the loss of normals, relative to that of silhouettes
    #[arg(long, value_name = "WEIGHT", value_parser = weight, default_value_t = 0.5)]
    pub normal_weight: f64,
    /// Subdivide every triangle into four before these steps (several separated by commas)
    #[arg(long, value_name = "STEP", value_delimiter = ',')]
    pub subdivide_at: Vec<u32>,
    /// How --subdivide-at divides them
    #[arg(long, value_enum, default_value = "midpoint", requires = "subdivide_at")]
    pub subdivision: Scheme,
    /// Remesh to triangles of even size before these steps (several separated by commas)
    #[arg(long, value_name = "STEP", value_delimiter = ',')]
    pub remesh_at: Vec<u32>,
    /// Leave the mesh the holes and parts that it begins with. Else a mesh that covers a hole of the pictures, leaves out a part or
    /// lies in itself is cut anew to the silhouettes after 0.3 and 0.6 of the steps, unless --template is a mesh file and with
    /// --preset official
    #[arg(long)]
    pub keep_topology: bool,
    /// Edge length of a hull and for --remesh-at in pixels of the images, constant or from the first to the last step: 1.5 or
    /// 2..1 [default: 1.5, and 2 for a hull]
    #[arg(long, value_name = "PIXELS", value_parser = range)]
    pub edge: Option<(f64, f64)>,
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
    /// Write a log of every step as JSON: losses, seconds, IoU of every view
    #[arg(long, value_name = "LOG.json")]
    pub json: Option<PathBuf>,
    /// Write a plot of the loss by step
    #[arg(long, value_name = "FILE.png", value_parser = parse::file_ending("png"))]
    pub plot: Option<PathBuf>,
    /// Write the fit as an animation, with the target beside it
    #[arg(long, value_name = "FILE.gif", value_parser = parse::file_ending("gif"))]
    pub gif: Option<PathBuf>,
    /// Write the state of the fit, at the end and every 100 steps, for --resume
    #[arg(long, value_name = "FILE.npz", value_parser = parse::file_ending("npz"))]
    pub checkpoint: Option<PathBuf>,
    /// Write the views that --from renders as PNG files, with a cameras.json, into this folder, which --views then reads
    #[arg(long, value_name = "FOLDER", requires = "from")]
    pub write_views: Option<PathBuf>,
    /// Continue from the checkpoint, if the file exists
    #[arg(long, requires = "checkpoint")]
    pub resume: bool,
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
