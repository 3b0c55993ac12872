//! `softras eval`: renders a scene of numpy arrays to numpy arrays, for comparisons and for use from other languages.

mod derivatives;
mod keys;
mod screen;
mod upstream;
mod world;

use super::gradients::{self, Mode};
use super::outputs::Outputs;
use super::parse;
use super::progress::Progress;
use super::{Failure, describe, note, say};
use clap::{Args, ValueEnum};
use serde_json::json;
use softras::{Camera, Error, Frame, Image, ImageGradient, Renderer, Scene, Settings, Wanted, scene};
use crate::commands::mesh_file::MemoryArgs;
use softras_io::Budget;
use softras_io::npz::{self, Archive, Data};
use softras_reference::{ReferenceFrame, ReferenceGradients, Truncation};
use std::path::PathBuf;
use std::time::Instant;

const KEYS: &str = "\
A scene in SCREEN SPACE, by the official renderer's names:
  face_vertices  [B, F, 3, 3]   x, y (the image spans [-1, 1], y up) and view depth of each corner
  textures       [B, F, 3, 3]   RGB of each corner (opt_texture_type 'vertex'), or
                 [B, F, R², 3]  RGB cells ('surface')
  opt_image_size  opt_background_color  opt_near  opt_far  opt_fill_back  opt_eps  opt_sigma_val
  opt_gamma_val  opt_dist_eps  opt_texture_type  opt_dist_func (euclidean, barycentric, hard)
  opt_aggr_func_rgb (softmax, hard)  opt_aggr_func_alpha (prod, sum, hard)
The output is
  soft_colors    [B, 4, H, W]   RGB and alpha, row 0 at the top

A scene in WORLD SPACE:
  vertices       [V, 3] or [B, V, 3]
  triangles      [F, 3], counter-clockwise seen from outside
  colors         [3], [V, 3] or [F, 3]: for all, per vertex, per triangle (with colors_per 'vertex'
                 or 'triangle' where V = F); [B, V, 3] or [B, F, 3] with [B, V, 3] vertices
  view           [4, 4] or [B, 4, 4]: world to view; x right, y up, z forward
  fov_y (radians), or half_height, or fx fy cx cy (pixels): numbers or [B]
  width height sigma gamma epsilon tau support near far color silhouette distance
  background background_color faces front_face interpolation: the settings, as the library names them
  ambient_color  ambient_intensity  light_directions [L, 3]  light_colors [L, 3]
  light_intensities [L]  shading
  outputs        any of color, silhouette, depth, normal [default: color, silhouette]
The output has
  color [B, H, W, 3]  silhouette [B, H, W]  depth [B, H, W]  normal [B, H, W, 3]

GRADIENTS, with --gradient. In screen space the input also has
  grad_soft_colors       [B, 4, H, W]: dL/dsoft_colors of a loss L
and the output has, beside soft_colors,
  grad_face_vertices     [B, F, 3, 3]
  grad_textures          as textures; only where the file has them
In world space the input also has one or more of
  grad_color [B, H, W, 3]  grad_silhouette [B, H, W]  grad_depth [B, H, W]  grad_normal [B, H, W, 3]
each for an image among the outputs, and the output has, beside the images,
  grad_vertices          as vertices, summed over the views of each mesh
  grad_colors            as colors, summed over what shares them; [3] without colors
  grad_view              [B, 6]: by (v, w), where view-space points move by w x p + v: per world
                         unit and per radian
  grad_projection        [B, 1] by fov_y (per radian) or half_height; [B, 4] by fx, fy, cx, cy
  grad_ambient_color [3]  grad_ambient_intensity []  grad_light_directions [L, 3]
  grad_light_colors [L, 3]  grad_light_intensities [L]
  grad_background_color [3]  grad_sigma []  grad_gamma []  grad_epsilon []

Arrays may be float, int, bool or text, in C or Fortran order, stored or deflated. Keys that are not
used are named in a note. Results are float32, or float64 with --device reference.

Examples:
  softras eval scene.npz -o image.npz
  softras eval official.npz -o image.npz --parity official
  softras eval official.npz -o gradients.npz --parity official --gradient paper
  softras eval scene.npz -o truth.npz --device reference";

/// Render the scene of a numpy archive
#[derive(Args, Debug)]
#[command(after_help = KEYS)]
pub struct EvalArgs {
    /// The scene, as numpy.savez or numpy.savez_compressed writes it
    pub scene: PathBuf,
    /// The archive to write
    #[arg(short, long = "out", value_name = "FILE.npz", value_parser = parse::file_ending("npz"))]
    pub out: PathBuf,
    /// model: the rules of softras. official: the image of the official code with all its quirks; in screen space, front
    /// faces are then clockwise and the options are rounded to float32
    #[arg(long, value_enum, default_value = "model")]
    pub parity: Parity,
    /// Also differentiate a loss, which the input gives by its derivatives by the images
    #[arg(long, value_enum, value_name = "MODE")]
    pub gradient: Option<Mode>,
    /// The Vulkan device: its index or a part of its name; or `reference`, the brute-force f64 reference
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    #[command(flatten)]
    pub memory: MemoryArgs,
    /// Print one JSON object: device, sizes, settings, milliseconds of every stage
    #[arg(long)]
    pub json: bool,
}

/// The value of `--device` for the f64 reference.
const REFERENCE: &str = "reference";

/// [`scene::Parity`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Parity {
    Model,
    Official,
}

impl From<Parity> for scene::Parity {
    fn from(parity: Parity) -> Self {
        match parity {
            Parity::Model => Self::Model,
            Parity::Official => Self::Official,
        }
    }
}

/// The scene of a file, and how to render it.
struct Job {
    scene: Scene,
    cameras: Vec<Camera>,
    settings: Settings,
    layout: Layout,
}

/// How the results are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    /// `soft_colors` [B, 4, H, W].
    Screen,
    /// An array per output, channels last.
    World,
}

/// Runs the command.
pub fn run(args: &EvalArgs) -> Result<(), Failure> {
    Outputs::new([&args.out], [])?.spare([&args.scene])?;
    let start = Instant::now();
    let archive = Archive::open(&args.scene, Budget::new(args.memory.memory))?;
    let job = if archive.has("face_vertices") {
        screen::read(&archive, args.parity)?
    } else {
        world::read(&archive, args.parity)?
    };
    let wish = match args.gradient {
        Some(mode) => Some(Wish { mode, upstream: upstream::read(&archive, &job)? }),
        None => None,
    };
    let unknown = archive.unasked();
    if !unknown.is_empty() {
        let keys = npz::listed(unknown.iter().copied());
        note(&format!("{}: keys that were not used: {keys}", args.scene.display()));
    }
    archive.claim("rendering its scene", bytes_to_render(&job, wish.is_some()))?;
    let spinner = Progress::spinner("rendering");
    let Results { device, arrays: mut results, timings, gradient } = render(args, &job, wish.as_ref())?;
    drop(spinner);
    if let Some(gradient) = gradient {
        let single = |values: Vec<f64>| Floats::F32(values.into_iter().map(|x| x as f32).collect());
        let wrap = if device == REFERENCE { Floats::F64 } else { single };
        let named = derivatives::arrays(&archive, &job, &gradient)?;
        results.extend(named.into_iter().map(|(key, shape, values)| (key, shape, wrap(values))));
    }
    let arrays: Vec<_> = results.iter().map(|(key, shape, values)| (*key, shape.clone(), values.data())).collect();
    npz::write(&args.out, &arrays)?;
    if args.json {
        let shapes: serde_json::Map<_, _> = results.iter().map(|(k, s, _)| (k.to_string(), json!(s))).collect();
        let object = json!({
            "device": device, "views": job.cameras.len(), "settings": describe::settings(&job.settings),
            "triangles": job.scene.meshes.iter().map(|m| m.triangles().len()).collect::<Vec<_>>(),
            "timings": timings, "total_milliseconds": start.elapsed().as_secs_f64() * 1e3,
            "path": args.out.display().to_string(), "arrays": shapes, "unused_keys": unknown,
        });
        return say(&object.to_string());
    }
    let list: Vec<_> = results.iter().map(|(key, shape, _)| format!("{key} {shape:?}")).collect();
    say(&format!("{}: {}", args.out.display(), list.join(", ")))
}

/// About how many bytes it takes to render a job and hold its results: twice in f32 images and once as the arrays that
/// are written, or as much in f64; what each view keeps of its vertices and triangles; and with a gradient, what the
/// backward pass is given, keeps of the pixels and finds.
fn bytes_to_render(job: &Job, with_gradient: bool) -> u64 {
    let outputs = job.settings.outputs;
    let channels = [(outputs.color, 3), (outputs.silhouette, 1), (outputs.depth, 1), (outputs.normal, 3)];
    let channels: u64 = channels.into_iter().filter(|(is_asked, _)| *is_asked).map(|(_, count)| count).sum();
    let pixels = u64::from(job.settings.width) * u64::from(job.settings.height);
    let per_pixel = if with_gradient { 28 * channels + 48 } else { 16 * channels + 8 };
    let (per_vertex, per_triangle) = if with_gradient { (96, 384) } else { (64, 256) };
    let views = job.cameras.len();
    let of_view = |view: usize| {
        let mesh = &job.scene.meshes[job.scene.mesh_of_view(view)];
        let (vertices, triangles) = (mesh.positions().len() as u64, mesh.triangles().len() as u64);
        pixels * per_pixel + vertices * per_vertex + triangles * per_triangle
    };
    (0..views).map(of_view).fold(0, u64::saturating_add)
}

/// Values in single or double precision.
enum Floats {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Floats {
    fn data(&self) -> Data<'_> {
        match self {
            Self::F32(values) => Data::F32(values),
            Self::F64(values) => Data::F64(values),
        }
    }
}

type Arrays = Vec<(&'static str, Vec<usize>, Floats)>;

/// The gradient that `--gradient` requests.
struct Wish {
    mode: Mode,
    upstream: ImageGradient,
}

/// The results of a job.
struct Results {
    device: String,
    arrays: Arrays,
    timings: Vec<serde_json::Value>,
    gradient: Option<ReferenceGradients>,
}

/// Renders, and differentiates if requested, on the requested device.
fn render(args: &EvalArgs, job: &Job, wish: Option<&Wish>) -> Result<Results, Error> {
    let Job { scene, cameras, settings, .. } = job;
    if args.device.as_deref() == Some(REFERENCE) {
        let frame = softras_reference::render(scene, cameras, settings, Truncation::Tau)?;
        let arrays = lay_out(job, &ReferenceImages(&frame), Floats::F64)?;
        let differentiate = |wish: &Wish| {
            let upstream = gradients::upstream(&wish.upstream);
            softras_reference::gradient(scene, cameras, settings, &upstream, wish.mode.into())
        };
        let gradient = wish.map(differentiate).transpose()?;
        return Ok(Results { device: REFERENCE.into(), arrays, timings: Vec::new(), gradient });
    }
    let mut renderer = match &args.device {
        Some(selector) => Renderer::with_device(selector)?,
        None => Renderer::new()?,
    };
    renderer.time_stages(true);
    let settings = &Settings { save: wish.is_some(), ..settings.clone() };
    let frame = renderer.render(scene, cameras, settings)?;
    let times = frame.timings().iter().map(|t| json!({ "stage": t.stage, "milliseconds": t.milliseconds }));
    let (timings, arrays) = (times.collect(), lay_out(job, &DeviceImages(&frame), Floats::F32)?);
    let differentiate = |wish: &Wish| {
        let gradients = renderer.backward(&frame, &wish.upstream, &wanted(job.layout, wish.mode))?;
        gradients::as_parameters(&gradients, scene, cameras, settings)
    };
    let gradient = wish.map(differentiate).transpose()?;
    Ok(Results { device: renderer.device_name().into(), arrays, timings, gradient })
}

/// The gradients that the layout has keys for.
fn wanted(layout: Layout, mode: Mode) -> Wanted {
    let mode = mode.into();
    match layout {
        Layout::Screen => Wanted { positions: true, colors: true, texels: true, mode, ..Wanted::NOTHING },
        Layout::World => Wanted { uvs: false, mode, ..Wanted::ALL },
    }
}

/// The four images of a frame, from the device or from the reference.
trait Images<T> {
    fn color(&self) -> Option<&[T]>;
    fn silhouette(&self) -> Option<&[T]>;
    fn depth(&self) -> Option<&[T]>;
    fn normal(&self) -> Option<&[T]>;
}

struct DeviceImages<'a>(&'a Frame);
struct ReferenceImages<'a>(&'a ReferenceFrame);

impl Images<f32> for DeviceImages<'_> {
    fn color(&self) -> Option<&[f32]> {
        self.0.color().map(values)
    }
    fn silhouette(&self) -> Option<&[f32]> {
        self.0.silhouette().map(values)
    }
    fn depth(&self) -> Option<&[f32]> {
        self.0.depth().map(values)
    }
    fn normal(&self) -> Option<&[f32]> {
        self.0.normal().map(values)
    }
}

fn values(image: &Image) -> &[f32] {
    &image.data
}

impl Images<f64> for ReferenceImages<'_> {
    fn color(&self) -> Option<&[f64]> {
        Some(&self.0.color)
    }
    fn silhouette(&self) -> Option<&[f64]> {
        Some(&self.0.silhouette)
    }
    fn depth(&self) -> Option<&[f64]> {
        Some(&self.0.depth)
    }
    fn normal(&self) -> Option<&[f64]> {
        Some(&self.0.normal)
    }
}

fn lay_out<T: Copy>(job: &Job, images: &impl Images<T>, wrap: fn(Vec<T>) -> Floats) -> Result<Arrays, Error> {
    let (b, h, w) = (job.cameras.len(), job.settings.height as usize, job.settings.width as usize);
    let checked = |key: &'static str, values: Option<&[T]>, channels: usize| match values {
        Some(values) if values.len() == b * h * w * channels => Ok(values.to_vec()),
        _ => Err(Error::Scene {
            what: format!("the frame's {key} image is missing or has another size"),
            fix: "this is a bug in softras: please report it".into(),
        }),
    };
    if job.layout == Layout::Screen {
        let color = checked("color", images.color(), 3)?;
        let alpha = checked("silhouette", images.silhouette(), 1)?;
        let mut planes = Vec::with_capacity(b * 4 * h * w);
        for view in 0..b {
            let pixels = view * h * w..(view + 1) * h * w;
            (0..3).for_each(|channel| planes.extend(pixels.clone().map(|i| color[3 * i + channel])));
            planes.extend_from_slice(&alpha[pixels]);
        }
        return Ok(vec![("soft_colors", vec![b, 4, h, w], wrap(planes))]);
    }
    let asked = job.settings.outputs;
    let mut arrays = Vec::new();
    if asked.color {
        arrays.push(("color", vec![b, h, w, 3], wrap(checked("color", images.color(), 3)?)));
    }
    if asked.silhouette {
        arrays.push(("silhouette", vec![b, h, w], wrap(checked("silhouette", images.silhouette(), 1)?)));
    }
    if asked.depth {
        arrays.push(("depth", vec![b, h, w], wrap(checked("depth", images.depth(), 1)?)));
    }
    if asked.normal {
        arrays.push(("normal", vec![b, h, w, 3], wrap(checked("normal", images.normal(), 3)?)));
    }
    Ok(arrays)
}
