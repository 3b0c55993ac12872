//! The arguments of `softras render`.

use crate::commands::{Failure, mesh_file::ReadArgs, parse};
use clap::{Args, ValueEnum, builder::Resettable};
use softras::{Settings, scene};
use softras_io::Curve;
use softras_view as view;
use softras_view::{Bounds, CameraOptions, LightOptions, Look, Motion, Options, Viewpoint};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  softras render fish -o fish.png
  softras render spot.obj -o spot.png --size 800x600 --azimuth 30 --background '#f4f1ea'
  softras render spot.obj -o spot.exr --output color,depth,normal
  softras render spot.obj -o soft.png --sigma 1e-3 --gamma 1e-2
  softras render spot.obj -o turn.gif --turntable 100
  softras render spot.obj -o blur.png --sweep sigma=1e-5..1e-2:8";

/// Render a mesh as pictures
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct RenderArgs {
    /// The mesh: .obj, .ply, .stl, .gltf, .glb, or a built-in one: fish
    pub mesh: PathBuf,
    /// The file to write: .png, .exr, .npy or .gif; may be repeated
    #[arg(short, long = "out", value_name = "FILE", required = true)]
    pub out: Vec<PathBuf>,
    /// Images to write: color, silhouette, depth, normal
    #[arg(
        long,
        value_enum,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "color",
        hide_possible_values = true
    )]
    pub output: Vec<Output>,
    /// Animate a turn of N frames around the vertical axis
    #[arg(long, value_name = "N", value_parser = parse::count, conflicts_with = "sweep")]
    pub turntable: Option<usize>,
    /// Animate sigma, gamma, tau or blur: sigma=1e-5..1e-2[:STEPS]
    #[arg(long, value_name = "SWEEP", value_parser = parse::sweep)]
    pub sweep: Option<parse::Sweep>,
    /// Print one JSON object: device, sizes, camera, settings, times, files
    #[arg(long)]
    pub json: bool,
    // Arguments after a flattened group get its heading, unless they name another.
    #[command(flatten)]
    pub look: LookArgs,
    /// Alpha of .png and .gif: solid inside of surfaces, or the model's
    #[arg(long, value_enum, value_name = "ALPHA", hide_possible_values = true, help_heading = "Picture")]
    pub alpha: Option<Alpha>,
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Fill the picture with the mesh's box or sphere
    #[arg(
        long,
        value_enum,
        value_name = "FRAME",
        default_value = "box",
        hide_possible_values = true,
        help_heading = "Camera"
    )]
    pub frame: Fit,
    #[command(flatten)]
    pub light: LightArgs,
    /// Compute normals, and keep edges sharper than this angle, 0 to 180
    #[arg(long, value_name = "DEGREES", value_parser = parse::crease, help_heading = "Light")]
    pub crease: Option<f64>,
    #[command(flatten)]
    pub modes: ModeArgs,
    #[command(flatten)]
    pub read: ReadArgs,
    /// Vulkan device: its index or a part of its name (`softras devices`)
    #[arg(long, value_name = "DEVICE", help_heading = "Input and device")]
    pub device: Option<String>,
}

/// The camera. By default all of the mesh is in the picture.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Camera")]
pub struct CameraArgs {
    /// Around the vertical axis; 0 looks from -z, 90 from +x
    #[arg(long, value_name = "DEGREES", value_parser = parse::number, allow_hyphen_values = true,
          default_value_t = 145.0)]
    pub azimuth: f64,
    /// Above the horizon of the point looked at
    #[arg(long, value_name = "DEGREES", value_parser = parse::elevation, allow_hyphen_values = true,
          default_value_t = 20.0)]
    pub elevation: f64,
    /// Distance to the point looked at [default: the mesh fits]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub distance: Option<f64>,
    /// Vertical angle of view
    #[arg(long, value_name = "DEGREES", value_parser = parse::angle_of_view, default_value_t = 30.0)]
    pub fov: f64,
    /// The vertical axis: 0,0,1 for z [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    pub up: Option<[f64; 3]>,
    /// The camera's position, in place of angles and distance
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::triple, allow_hyphen_values = true,
          conflicts_with_all = ["distance", "elevation", "azimuth"])]
    pub eye: Option<[f64; 3]>,
    /// The point looked at [default: the centre of the mesh]
    #[arg(long = "look-at", value_name = "X,Y,Z", value_parser = parse::triple, allow_hyphen_values = true)]
    pub target: Option<[f64; 3]>,
    /// Orthographic: half the image's height in world units, or fit
    #[arg(long, value_name = "HEIGHT", value_parser = parse::half_height, conflicts_with = "fov")]
    pub orthographic: Option<view::HalfHeight>,
    /// Nearest depth that is drawn [default: just before the mesh]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub near: Option<f64>,
    /// Farthest depth that is drawn [default: just behind the mesh]
    #[arg(long, value_name = "UNITS", value_parser = parse::positive)]
    pub far: Option<f64>,
}

impl CameraArgs {
    /// The arguments as options.
    pub fn options(&self) -> CameraOptions {
        let Self { eye, target, up, distance, elevation, azimuth, fov, orthographic, near, far } = *self;
        CameraOptions { eye, target, up, distance, elevation, azimuth, fov, orthographic, near, far }
    }

    /// The view of a mesh in these bounds. The arguments are in the coordinates of its file, where the mesh's origin is `origin`.
    pub fn view(
        &self,
        bounds: Bounds,
        origin: [f64; 3],
        (width, height): (usize, usize),
    ) -> Result<Viewpoint, Failure> {
        let view = Viewpoint::new(&self.options().relative_to(origin), bounds, width as f64 / height as f64);
        self.check_depths(&view).map(|()| view)
    }

    /// Refuses a farthest depth that is not beyond the nearest one.
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
    /// Pixels: the side of a square, or WIDTHxHEIGHT
    #[arg(long, value_name = "SIZE", value_parser = parse::size, default_value = "256", help_heading = Resettable::Reset)]
    pub size: (u32, u32),
    /// #rrggbb, a CSS name, or linear r,g,b [default: transparent]
    #[arg(long, value_name = "COLOUR", value_parser = parse::rgb, help_heading = Resettable::Reset)]
    pub background: Option<parse::Rgb>,
    /// N×N samples a pixel [default: 4; 1 with --sigma or --blur]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=8))]
    pub samples: Option<u32>,
    /// Softness of edges, (half heights)² [default: sharp]
    #[arg(long, value_parser = parse::positive)]
    pub sigma: Option<f64>,
    /// Softness of edges: pixels that a triangle reaches beyond its edges
    #[arg(long, value_name = "PIXELS", value_parser = parse::positive, conflicts_with = "sigma")]
    pub blur: Option<f64>,
    /// Depth softness, as a share of far - near
    #[arg(long, value_parser = parse::positive, default_value_t = 3e-6)]
    pub gamma: f64,
    /// Depth score of a weighted background
    #[arg(long, value_parser = parse::number, allow_hyphen_values = true, default_value_t = 1e-3)]
    pub epsilon: f64,
    /// Least influence of a triangle on a pixel
    #[arg(long, value_parser = parse::positive, default_value_t = 1e-4)]
    pub tau: f64,
    /// Meaning of tau: probability or guaranteed
    #[arg(long, value_enum, value_name = "MODE", default_value = "probability", hide_possible_values = true)]
    pub support: Support,
    /// composite, or weighted as in the paper
    #[arg(long, value_enum, value_name = "MODE", default_value = "composite", hide_possible_values = true)]
    pub background_mode: BackgroundMode,
    /// Read textures and write pictures without the sRGB curve
    #[arg(long)]
    pub raw: bool,
}

impl LookArgs {
    /// The curve by which numbers are encoded as bytes.
    pub fn curve(&self) -> Curve {
        if self.raw { Curve::Raw } else { Curve::Srgb }
    }

    /// The arguments as options, with the variant of the model that `modes` names.
    pub fn look(&self, modes: &ModeArgs) -> Look {
        let curve = self.curve();
        Look {
            size: self.size,
            sigma: self.sigma,
            blur: self.blur,
            background: self.background.map(|color| color.numbers(curve)),
            curve,
            model: Settings {
                gamma: self.gamma,
                epsilon: self.epsilon,
                tau: self.tau,
                support: self.support.into(),
                background: self.background_mode.into(),
                ..modes.settings()
            },
        }
    }
}

/// The lights. By default they are those of a studio, and move with the camera.
#[derive(Args, Debug)]
#[command(next_help_heading = "Light")]
pub struct LightArgs {
    /// Ambient light: a factor or r,g,b [default: 0.12 with --light]
    #[arg(long, value_name = "AMOUNT", value_parser = ambient)]
    pub ambient: Option<[f64; 3]>,
    /// A light from x,y,z[:intensity[:r,g,b]]; may be repeated
    #[arg(long, value_name = "LIGHT", value_parser = parse::light, allow_hyphen_values = true)]
    pub light: Vec<parse::Light>,
    /// Draw colours without light
    #[arg(long, conflicts_with_all = ["ambient", "light"])]
    pub unlit: bool,
    /// flat: a normal per triangle; smooth: per vertex
    #[arg(long, value_enum, value_name = "SHADING", default_value = "smooth", hide_possible_values = true)]
    pub shading: Shading,
}

impl LightArgs {
    /// The arguments as options. Colours in bytes are decoded by the curve that pictures are written with.
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
    /// Triangles to draw: both sides or front [default: by material]
    #[arg(long, value_enum, value_name = "FACES", hide_possible_values = true)]
    pub faces: Option<Faces>,
    /// Colour of a pixel: softmax or hard
    #[arg(long, value_enum, value_name = "MODE", default_value = "softmax", hide_possible_values = true)]
    pub color_mode: ColorMode,
    /// Silhouette of a pixel: product, sum or hard
    #[arg(long, value_enum, value_name = "MODE", default_value = "product", hide_possible_values = true)]
    pub silhouette_mode: SilhouetteMode,
    /// Distance: euclidean, barycentric or hard
    #[arg(long, value_enum, value_name = "MODE", default_value = "euclidean", hide_possible_values = true)]
    pub distance_mode: DistanceMode,
    /// Interpolation: perspective or affine
    #[arg(long, value_enum, value_name = "MODE", default_value = "perspective", hide_possible_values = true)]
    pub interpolation: Interpolation,
    /// Outside a triangle, sample: nearest or clip
    #[arg(long, value_enum, value_name = "MODE", default_value = "nearest", hide_possible_values = true)]
    pub surface_point: SurfacePoint,
}

impl ModeArgs {
    /// The arguments as settings; all others have the values of [`Look::default`].
    pub fn settings(&self) -> Settings {
        Settings {
            faces: self.faces.map_or(Settings::default().faces, Into::into),
            color: self.color_mode.into(),
            silhouette: self.silhouette_mode.into(),
            distance: self.distance_mode.into(),
            interpolation: self.interpolation.into(),
            surface_point: self.surface_point.into(),
            ..Look::default().model
        }
    }
}

impl RenderArgs {
    /// Everything about the picture. A sweep has `sweep_steps` steps unless a number was given.
    pub fn options(&self, sweep_steps: usize) -> Options {
        let motion = match (self.turntable, &self.sweep) {
            (Some(frames), _) => Motion::Turntable(frames),
            (None, Some(sweep)) => Motion::Sweep(sweep.of(sweep_steps)),
            (None, None) => Motion::Still,
        };
        Options {
            camera: self.camera.options(),
            fill: self.frame.into(),
            look: self.look.look(&self.modes),
            samples: self.look.samples,
            both_sides: self.modes.faces == Some(Faces::Both),
            alpha: self.alpha.map(Into::into),
            light: self.light.options(self.look.curve()),
            crease: self.crease,
            motion,
        }
    }
}

/// Defines a clap value for a mode of the library, and the conversion to it.
macro_rules! mode {
    ($name:ident => $library:path { $($variant:ident => $to:ident),+ $(,)? }) => {
        #[doc = concat!("[`", stringify!($library), "`] on the command line.")]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
        pub enum $name { $($variant),+ }
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
mode!(Fit => view::Fill { Box => Box, Sphere => Sphere });
mode!(Alpha => view::Alpha { Solid => Solid, Model => Model });
mode!(Output => view::Output { Color => Color, Silhouette => Silhouette, Depth => Depth, Normal => Normal });
