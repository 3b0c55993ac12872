//! `eval`: renders a scene of numpy arrays to numpy arrays, for parity with recorded scenes.

mod derivatives;
mod keys;
mod screen;
mod upstream;
mod world;

use softras::scene::Parity;
use softras::{Camera, Frame, GradientMode, GradientRequest, Image, ImageGradient, Renderer, Result, Scene, Settings};
use softras_io::Budget;
use softras_io::npy::Data;
use softras_io::npz::{self, Archive};
use softras_lab::agreement::{self, Numbers, Subject};
use softras_reference::{ReferenceFrame, Truncation};
use std::path::PathBuf;

/// What the help says of the files.
pub const KEYS: &str = "\
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
  background background_color faces front_face interpolation surface_point: the settings, as the library names them
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
used are named in a note. Results are float32, or float64 with --device reference.";

/// The value of `--device` for the f64 reference.
const REFERENCE: &str = "reference";

/// What to render, and how.
#[derive(Debug, PartialEq)]
pub struct Options {
    /// The archive to read.
    scene: PathBuf,
    /// The archive to write.
    out: PathBuf,
    /// The rules of the image.
    parity: Parity,
    /// The gradient that is wanted too.
    gradient: Option<GradientMode>,
    /// A device, [`REFERENCE`], or the best device.
    device: Option<String>,
}

impl Options {
    /// Reads the words after `eval`.
    ///
    /// # Errors
    /// A sentence that says what is wrong with them.
    pub fn parse(words: impl IntoIterator<Item = String>) -> std::result::Result<Self, String> {
        let (mut scene, mut out, mut device) = (None, None, None);
        let (mut parity, mut gradient) = (Parity::Model, None);
        let mut words = words.into_iter();
        while let Some(word) = words.next() {
            let mut value = || words.next().ok_or(format!("{word} needs a value"));
            match word.as_str() {
                "-o" | "--out" => out = Some(PathBuf::from(value()?)),
                "--device" => device = Some(value()?),
                "--parity" => {
                    parity = match value()?.as_str() {
                        "model" => Parity::Model,
                        "official" => Parity::Official,
                        other => return Err(format!("--parity {other}: use model or official")),
                    }
                }
                "--gradient" => {
                    gradient = match value()?.as_str() {
                        "exact" => Some(GradientMode::Exact),
                        "paper" => Some(GradientMode::Paper),
                        other => return Err(format!("--gradient {other}: use exact or paper")),
                    }
                }
                _ if word.starts_with('-') => return Err(format!("{word}: there is no such option")),
                _ if scene.is_some() => return Err(format!("{word}: one scene is enough")),
                _ => scene = Some(PathBuf::from(word)),
            }
        }
        let scene = scene.ok_or("name the scene to read: SCENE.npz")?;
        let out = out.ok_or("name the archive to write: -o OUT.npz")?;
        if scene == out {
            return Err(format!("{}: it would be overwritten: give -o another name", out.display()));
        }
        Ok(Self { scene, out, parity, gradient, device })
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

/// A key, its shape and its values.
type Entry = (&'static str, Vec<usize>, Vec<f64>);

/// Renders, writes the archive, and returns a line that says what it holds.
///
/// # Errors
/// [`softras::Error::File`] naming the key that is wrong; otherwise as [`Renderer::render`].
pub fn run(options: &Options) -> Result<String> {
    let archive = Archive::open(&options.scene, Budget::new(None))?;
    let job = if archive.has("face_vertices") {
        screen::read(&archive, options.parity)?
    } else {
        world::read(&archive, options.parity)?
    };
    let wish = match options.gradient {
        Some(mode) => Some(Wish { mode, upstream: upstream::read(&archive, &job)? }),
        None => None,
    };
    let mut unknown = archive.unread();
    if job.layout == Layout::Screen {
        unknown.retain(|key| !screen::KNOWN.contains(key));
    }
    if !unknown.is_empty() {
        eprintln!("note: {}: keys that were not used: {}", options.scene.display(), npz::listed(unknown.into_iter()));
    }
    let (images, gradient) = render(options, &job, wish.as_ref())?;
    let mut entries = lay_out(&job, images);
    if let Some(gradient) = gradient {
        entries.extend(derivatives::arrays(&archive, &job, &gradient)?);
    }
    write(options, &entries)?;
    let list: Vec<_> = entries.iter().map(|(key, shape, _)| format!("{key} {shape:?}")).collect();
    Ok(format!("{}: {}", options.out.display(), list.join(", ")))
}

/// Writes float64 where the reference rendered, and float32 where a device did.
fn write(options: &Options, entries: &[Entry]) -> Result<()> {
    if options.device.as_deref() == Some(REFERENCE) {
        let arrays: Vec<_> = entries.iter().map(|(key, shape, data)| (*key, shape.clone(), Data::F64(data))).collect();
        return npz::write(&options.out, &arrays);
    }
    let single = |data: &[f64]| data.iter().map(|&x| x as f32).collect::<Vec<f32>>();
    let singles: Vec<_> = entries.iter().map(|(_, _, data)| single(data)).collect();
    let arrays = entries.iter().zip(&singles).map(|((key, shape, _), data)| (*key, shape.clone(), Data::F32(data)));
    npz::write(&options.out, &arrays.collect::<Vec<_>>())
}

/// The gradient that `--gradient` requests.
struct Wish {
    mode: GradientMode,
    upstream: ImageGradient,
}

/// The values of the images that a scene asks for, by name.
type Images = Vec<(&'static str, Vec<f64>)>;

/// Renders, and differentiates if requested, on the requested device.
fn render(options: &Options, job: &Job, wish: Option<&Wish>) -> Result<(Images, Option<Numbers>)> {
    let Job { scene, cameras, settings, .. } = job;
    if options.device.as_deref() == Some(REFERENCE) {
        let frame = softras_reference::render(scene, cameras, settings, Truncation::Tau)?;
        let differentiate = |wish: &Wish| {
            let subject = Subject { scene, cameras, settings };
            let gradient = agreement::reference_gradient(subject, &wish.upstream, wish.mode)?;
            Ok(agreement::reference_numbers(subject, &gradient))
        };
        let gradient: Option<Numbers> = wish.map(differentiate).transpose()?;
        return Ok((of_reference(frame), gradient));
    }
    let mut renderer = match &options.device {
        Some(selector) => Renderer::with_device(selector)?,
        None => Renderer::new()?,
    };
    let settings = &Settings { save: wish.is_some(), ..settings.clone() };
    let frame = renderer.render(scene, cameras, settings)?;
    let differentiate = |wish: &Wish| {
        let gradients = renderer.backward(&frame, &wish.upstream, &wanted(job.layout, wish.mode))?;
        Ok(agreement::numbers(&gradients))
    };
    let gradient: Option<Numbers> = wish.map(differentiate).transpose()?;
    Ok((of_device(&frame), gradient))
}

fn of_reference(frame: ReferenceFrame) -> Images {
    let ReferenceFrame { color, silhouette, depth, normal, .. } = frame;
    let all = [("color", color), ("silhouette", silhouette), ("depth", depth), ("normal", normal)];
    all.into_iter().filter(|(_, image)| !image.is_empty()).collect()
}

fn of_device(frame: &Frame) -> Images {
    let wide = |image: &Image| image.data.iter().map(|&x| x.into()).collect();
    frame.images().map(|(name, image)| (name, wide(image))).collect()
}

/// The gradients that the layout has keys for.
fn wanted(layout: Layout, mode: GradientMode) -> GradientRequest {
    match layout {
        Layout::Screen => {
            GradientRequest { positions: true, colors: true, texels: true, mode, ..GradientRequest::NOTHING }
        }
        Layout::World => GradientRequest { uvs: false, mode, ..GradientRequest::ALL },
    }
}

/// The arrays of the images.
fn lay_out(job: &Job, images: Images) -> Vec<Entry> {
    let (b, h, w) = (job.cameras.len(), job.settings.height as usize, job.settings.width as usize);
    if let ([(_, color), (_, alpha)], Layout::Screen) = (&images[..], job.layout) {
        let plane = |view: usize, channel: usize| (0..h * w).map(move |i| color[3 * (view * h * w + i) + channel]);
        let view = |view: usize| {
            let colors = (0..3).flat_map(move |channel| plane(view, channel));
            colors.chain(alpha[view * h * w..(view + 1) * h * w].iter().copied())
        };
        return vec![("soft_colors", vec![b, 4, h, w], (0..b).flat_map(view).collect())];
    }
    let shape = |name| if matches!(name, "color" | "normal") { vec![b, h, w, 3] } else { vec![b, h, w] };
    images.into_iter().map(|(name, values)| (name, shape(name), values)).collect()
}
