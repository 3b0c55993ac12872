//! The arguments of `softras render`.

use crate::commands::{Failure, mesh_file::ReadArgs, parse};
use clap::{Args, ValueEnum};
use softras::scene;
use softras_io::Curve;
use softras_view as view;
use softras_view::{CameraOptions, LightOptions, Look, Modes, Motion, Options, Viewpoint};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  softras render bunny.obj -o bunny.png
  softras render spot.obj -o spot.png --size 800x600 --azimuth 30 --background '#f4f1ea'
  softras render spot.obj -o spot.exr --output color,depth,normal
  softras render spot.obj -o soft.png --sigma 1e-3 --gamma 1e-2
  softras render spot.obj -o turn.gif --turntable 100
  softras render spot.obj -o blur.png --sweep sigma=1e-5..1e-2:8

Files, by their ending:
  .png  8 bit; colour as sRGB with straight alpha, opaque with --background; depth from white
        (nearest) to black; normals as (n + 1) / 2 in camera axes right, up, towards the viewer;
        surfaces are opaque inside, their outlines are soft (--alpha model: the model's values)
  .exr  32-bit float, the model's values: linear RGBA premultiplied by alpha, RGB with
        --background; depth (Z), silhouette (Y), world-space normals (RGB)
  .npy  float32 [H, W, C], row 0 at the top; values as in .exr
  .gif  several frames: --turntable or --sweep, either of which also makes a .png contact sheet
Transparent materials (d or Tr of .mtl files, the alpha of a glTF base colour) are blended over the
rest by depth, the nearest one in each pixel; what a texture's alpha leaves out is cut out.
With the composite background depth and normals, too, are multiplied by alpha in .exr and .npy.";

/// Render a mesh file as pictures
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct RenderArgs {
    /// The mesh: .obj (its .mtl and textures beside it), .ply, .stl, .gltf or .glb
    pub mesh: PathBuf,
    /// The file to write: .png, .exr, .npy or .gif (may be repeated). With several --output values each file's name gains
    /// the output's name, as in OUT_depth.png
    #[arg(short, long = "out", value_name = "FILE", required = true)]
    pub out: Vec<PathBuf>,
    /// The images to write (several separated by commas, or by repeating the option)
    #[arg(long, value_enum, value_delimiter = ',', default_value = "color")]
    pub output: Vec<Output>,
    #[command(flatten)]
    pub read: ReadArgs,
    /// The Vulkan device: its index or a part of its name, as `softras devices` lists them [default: the best one]
    #[arg(long, value_name = "DEVICE")]
    pub device: Option<String>,
    /// Print one JSON object: device, sizes, camera, settings, milliseconds of every stage, files
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// What fills the picture, where neither the camera's place nor its distance is given. box: the projected vertices fill
    /// 90 %, or less where a blur needs room, in all frames of a turntable; sphere: the bounding sphere fills 85 %, from the
    /// same place however the mesh is turned, as for `grad` and `pose`
    #[arg(long, value_enum, default_value = "box", help_heading = "Camera")]
    pub frame: Fit,
    #[command(flatten)]
    pub look: LookArgs,
    /// The alpha of .png and .gif files. solid: 1 inside of surfaces, soft at their outlines; model: the model's own values,
    /// which are below 1 at the edges between triangles, as in .exr and .npy files [default: solid; model with --raw,
    /// --sigma, --blur, a sweep of these, and for modes other than the defaults]
    #[arg(long, value_enum, help_heading = "Picture")]
    pub alpha: Option<Alpha>,
    #[command(flatten)]
    pub light: LightArgs,
    /// With smooth shading, compute normals from the triangles, and keep edges at which the surface bends by more than this
    /// many degrees; 180 keeps none [default: the normals of the file; 40 where it has none]
    #[arg(long, value_name = "DEGREES", value_parser = parse::crease, help_heading = "Light")]
    pub crease: Option<f64>,
    #[command(flatten)]
    pub modes: ModeArgs,
    /// Animate one turn of N frames around the vertical axis, 25 frames a second; the lights move with the camera
    #[arg(long, value_name = "N", value_parser = parse::count, conflicts_with = "sweep", help_heading = "Animation")]
    pub turntable: Option<usize>,
    /// Animate sigma, gamma, tau or blur over a range, in N steps that are even in its logarithm: sigma=1e-5..1e-2[:N]
    #[arg(long, value_name = "NAME=FROM..TO[:N]", value_parser = parse::sweep, help_heading = "Animation")]
    pub sweep: Option<parse::Sweep>,
}

/// The camera. By default all of the mesh is in the picture.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Camera")]
pub struct CameraArgs {
    /// The camera's position, world units
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::triple, allow_hyphen_values = true,
          conflicts_with_all = ["distance", "elevation", "azimuth"])]
    pub eye: Option<[f64; 3]>,
    /// The point looked at [default: the centre of the smallest sphere around the mesh]
    #[arg(long = "look-at", value_name = "X,Y,Z", value_parser = parse::triple, allow_hyphen_values = true)]
    pub target: Option<[f64; 3]>,
    /// The vertical axis: up in the picture, and the axis of azimuth, elevation and turntable (0,0,1 for z-up files)
    /// [default: 0,1,0; `render` takes z or x, with a note, where the mesh has a base to stand on there and none below]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    pub up: Option<[f64; 3]>,
    /// Distance from the target to the camera, world units [default: so that the mesh fits]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub distance: Option<f64>,
    /// Elevation of the camera above the target's horizon, degrees
    #[arg(long, value_name = "DEGREES", value_parser = parse::elevation, allow_hyphen_values = true,
          default_value_t = 20.0)]
    pub elevation: f64,
    /// Azimuth around the vertical axis, degrees: 0 looks from -z towards +z, 90 from +x, 180 from +z (with y up)
    #[arg(long, value_name = "DEGREES", value_parser = parse::number, allow_hyphen_values = true,
          default_value_t = 145.0)]
    pub azimuth: f64,
    /// Vertical angle of view, degrees
    #[arg(long, value_name = "DEGREES", value_parser = parse::angle_of_view, default_value_t = 30.0)]
    pub fov: f64,
    /// Orthographic projection: half the image's height in world units, or `fit`
    #[arg(long, value_name = "HALF_HEIGHT", value_parser = parse::half_height, conflicts_with = "fov")]
    pub orthographic: Option<view::HalfHeight>,
    /// Nearest depth that is drawn; gamma is in units of far - near [default: just before the mesh's bounding sphere]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub near: Option<f64>,
    /// Farthest depth that is drawn [default: just behind the mesh's bounding sphere]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub far: Option<f64>,
}

impl CameraArgs {
    /// The same as options.
    pub fn options(&self) -> CameraOptions {
        let Self { eye, target, up, distance, elevation, azimuth, fov, orthographic, near, far } = *self;
        CameraOptions { eye, target, up, distance, elevation, azimuth, fov, orthographic, near, far }
    }

    /// Refuses a farthest depth that is not beyond the nearest one.
    ///
    /// # Errors
    /// [`Failure::Usage`] naming the options that say so.
    pub fn check_depths(&self, view: &Viewpoint) -> Result<(), Failure> {
        // Without --far, the farthest depth lies beyond any that --near names.
        let Some(far) = self.far.filter(|_| view.far <= view.near) else { return Ok(()) };
        Err(Failure::Usage(match self.near {
            Some(near) => format!(
                "--near {near} --far {far}: what is drawn lies between them, so near must be less than far: swap them, or leave \
             one out"
            ),
            None => format!(
                "--far {far}: the mesh begins at depth {:.4}, behind all that is drawn: give a larger --far, or --near as well",
                view.near
            ),
        }))
    }
}

/// The size, softness and background of the picture.
#[derive(Args, Debug)]
#[command(next_help_heading = "Picture")]
pub struct LookArgs {
    /// Size in pixels: the side of a square, or WIDTHxHEIGHT
    #[arg(long, value_name = "SIZE", value_parser = parse::size, default_value = "256")]
    pub size: (u32, u32),
    /// Render N×N samples for each pixel of the picture and average them [default: 3, or as many as the device can hold; 1
    /// with --sigma or --blur, and for .exr and .npy, which hold the values of the model]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: Option<u32>,
    /// Softness of edges, screen units² (1 = half the image's height) [default: a blur of 1.23 rendered pixels, which
    /// is 1e-5 at a height of 256]
    #[arg(long, value_parser = parse::positive)]
    pub sigma: Option<f64>,
    /// Softness of edges, as the distance in pixels that a triangle's influence reaches beyond its edges
    #[arg(long, value_name = "PIXELS", value_parser = parse::positive, conflicts_with = "sigma")]
    pub blur: Option<f64>,
    /// Softness of the depth order, in units of far - near; the default shows what is nearer and nothing behind it, the
    /// model's own is 1e-4
    #[arg(long, value_parser = parse::positive, default_value_t = 3e-6)]
    pub gamma: f64,
    /// Score of the background against the triangles, with --background-mode weighted
    #[arg(long, value_parser = parse::number, allow_hyphen_values = true, default_value_t = 1e-3)]
    pub epsilon: f64,
    /// The influence on a pixel below which a triangle is ignored there
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// probability: tau bounds the error of the silhouette; guaranteed: tau bounds the error of every image, for which
    /// triangles reach farther
    #[arg(long, value_enum, default_value = "probability")]
    pub support: Support,
    /// Background: r,g,b (linear light, 0 to 1), #rrggbb or a name of CSS 2, as white [default: transparent; white in .gif files and contact sheets]
    #[arg(long, value_name = "COLOUR", value_parser = parse::rgb)]
    pub background: Option<parse::Rgb>,
    /// composite: colour fades with the silhouette; weighted: the background is one more entry of the softmax, as in the
    /// paper
    #[arg(long, value_enum, default_value = "composite")]
    pub background_mode: BackgroundMode,
    /// Read the bytes of textures and write those of pictures without the sRGB curve, as the official renderer does, in
    /// place of working in linear light
    #[arg(long)]
    pub raw: bool,
}

impl LookArgs {
    /// The curve by which numbers are encoded as bytes.
    pub fn curve(&self) -> Curve {
        if self.raw { Curve::Raw } else { Curve::Srgb }
    }

    /// The same as options.
    pub fn look(&self) -> Look {
        let curve = self.curve();
        Look {
            size: self.size,
            sigma: self.sigma,
            blur: self.blur,
            gamma: self.gamma,
            epsilon: self.epsilon,
            tau: self.tau,
            support: self.support.into(),
            background: self.background.map(|color| color.numbers(curve)),
            background_mode: self.background_mode.into(),
            curve,
        }
    }
}

/// The lights. By default a key light from the upper left, a fill light from the right, a rim light from behind, all of them
/// moving with the camera, and light from everywhere that is stronger from above.
#[derive(Args, Debug)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// Ambient light: a factor or r,g,b [default: 0.05 from below to 0.22 from above; 0.12 with --light]
    #[arg(long, value_name = "AMOUNT", value_parser = ambient)]
    pub ambient: Option<[f64; 3]>,
    /// A light in direction x,y,z (world space, towards the light), instead of the default lights; may be repeated
    #[arg(long, value_name = "X,Y,Z[:INTENSITY[:R,G,B]]", value_parser = parse::light, allow_hyphen_values = true)]
    pub light: Vec<parse::Light>,
    /// Draw colours without lighting
    #[arg(long, conflicts_with_all = ["ambient", "light"])]
    pub unlit: bool,
    /// Normals for lighting: flat has one per triangle, smooth one per vertex
    #[arg(long, value_enum, default_value = "smooth")]
    pub shading: Shading,
}

impl LightArgs {
    /// The same as options; colours in bytes are decoded by the curve that pictures are written with.
    pub fn options(&self, curve: Curve) -> LightOptions {
        let given = |light: &parse::Light| scene::DirectionalLight {
            direction: light.direction,
            color: light.color.numbers(curve),
            intensity: light.intensity,
        };
        LightOptions {
            ambient: self.ambient,
            lights: self.light.iter().map(given).collect(),
            unlit: self.unlit,
            shading: self.shading.into(),
        }
    }
}

fn ambient(text: &str) -> Result<[f64; 3], String> {
    if text.contains(',') { parse::triple(text) } else { parse::number(text).map(|x| [x; 3]) }
}

/// The variant of the model.
#[derive(Args, Debug)]
#[command(next_help_heading = "Model")]
pub struct ModeArgs {
    /// Triangles to draw: all, or only those whose corners are counter-clockwise in the picture, so that no colour of a face
    /// turned away is in the outlines of a closed mesh
    #[arg(long, value_enum, default_value = "both")]
    pub faces: Faces,
    /// How the triangles of a pixel are combined to a colour
    #[arg(long, value_enum, default_value = "softmax")]
    pub color_mode: ColorMode,
    /// How the triangles of a pixel are combined to the silhouette
    #[arg(long, value_enum, default_value = "product")]
    pub silhouette_mode: SilhouetteMode,
    /// The distance that decides a triangle's influence on a pixel
    #[arg(long, value_enum, default_value = "euclidean")]
    pub distance_mode: DistanceMode,
    /// Interpolation of colours over a triangle: affine on the screen, as in the paper, or perspective-correct
    #[arg(long, value_enum, default_value = "perspective")]
    pub interpolation: Interpolation,
    /// Where a triangle is sampled for a pixel outside it: at its point nearest to the pixel, or, as in the paper, at
    /// barycentric coordinates clipped to [0, 1], which on a needle lie far from the pixel
    #[arg(long, value_enum, default_value = "nearest")]
    pub surface_point: SurfacePoint,
}

impl ModeArgs {
    /// The same as options.
    pub fn modes(&self) -> Modes {
        Modes {
            faces: self.faces.into(),
            color: self.color_mode.into(),
            silhouette: self.silhouette_mode.into(),
            distance: self.distance_mode.into(),
            interpolation: self.interpolation.into(),
            surface_point: self.surface_point.into(),
        }
    }
}

impl RenderArgs {
    /// Everything about the picture, for a camera with the vertical axis that was guessed. A sweep has `sweep_steps` steps unless a number
    /// was given.
    pub fn options(&self, camera: CameraOptions, sweep_steps: usize) -> Options {
        let motion = match (self.turntable, &self.sweep) {
            (Some(frames), _) => Motion::Turntable(frames),
            (None, Some(sweep)) => Motion::Sweep(sweep.of(sweep_steps)),
            (None, None) => Motion::Still,
        };
        Options {
            camera,
            fill: self.frame.into(),
            look: self.look.look(),
            samples: self.look.samples,
            alpha: self.alpha.map(Into::into),
            light: self.light.options(self.look.curve()),
            crease: self.crease,
            modes: self.modes.modes(),
            motion,
        }
    }
}

/// Defines a clap value for a mode of the library, and the conversion to it.
macro_rules! mode {
    ($name:ident => $library:path { $($(#[$doc:meta])* $variant:ident => $to:ident),+ $(,)? }) => {
        #[doc = concat!("[`", stringify!($library), "`] on the command line.")]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub enum $name { $($(#[$doc])* $variant),+ }
        impl From<$name> for $library {
            fn from(mode: $name) -> Self {
                match mode { $($name::$variant => Self::$to),+ }
            }
        }
    };
}

pub(crate) use mode;

mode!(BackgroundMode => scene::Background { Weighted => Weighted, Composite => Composite });
mode!(Support => scene::Support { Probability => Probability, Guaranteed => Guaranteed });
mode!(Shading => scene::Shading { Flat => Flat, Smooth => Smooth });
mode!(Faces => scene::Faces { Both => Both, Front => Front });
mode!(ColorMode => scene::ColorAggregation { Softmax => Softmax, Hard => Hard });
mode!(SilhouetteMode => scene::SilhouetteAggregation { Product => Product, Sum => Sum, Hard => Hard });
mode!(DistanceMode => scene::Distance { Euclidean => Euclidean, Barycentric => Barycentric, Hard => Hard });
mode!(Interpolation => scene::Interpolation { Affine => Affine, Perspective => Perspective });
mode!(SurfacePoint => scene::SurfacePoint { Nearest => Nearest, Clip => Clip });
mode!(Fit => view::Fill {
    /// The box of its projected vertices fills 90 % of the picture
    Box => Box,
    /// Its bounding sphere fills 85 % of the smaller side
    Sphere => Sphere,
});
mode!(Alpha => view::Alpha {
    /// 1 inside of surfaces
    Solid => Solid,
    /// The model's silhouette
    Model => Model,
});
mode!(Output => view::Output {
    /// The lit colour
    Color => Color,
    /// The coverage, 0 to 1
    Silhouette => Silhouette,
    /// The view depth
    Depth => Depth,
    /// The surface normal
    Normal => Normal,
});
