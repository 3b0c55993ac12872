//! The options of a picture: its content, camera, look and motion.

use softras::{
    Settings,
    scene::{Background, DirectionalLight, Distance, Interpolation, Shading, SilhouetteAggregation},
};
use softras_io::Curve;

/// One kind of image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The lit colour.
    Color,
    /// The coverage, 0 to 1.
    Silhouette,
    /// The view depth.
    Depth,
    /// The surface normal.
    Normal,
}

impl Output {
    /// The name on the command line and in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Silhouette => "silhouette",
            Self::Depth => "depth",
            Self::Normal => "normal",
        }
    }
}

/// The bounds of the mesh that fill the picture, where neither the camera's place nor its distance is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fill {
    /// The box of its projected vertices fills 90 %, or less where a blur needs room, in all frames of a turntable.
    #[default]
    Box,
    /// Its bounding sphere fills 85 % of the smaller side; the camera stays in its place however the mesh is turned.
    Sphere,
}

/// The meaning of a picture's alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alpha {
    /// 1 inside of surfaces, soft at their outlines.
    Solid,
    /// The model's silhouette, which is below 1 at the edges between triangles.
    Model,
}

/// Half the image's height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HalfHeight {
    /// Large enough for the mesh.
    Fit,
    /// World units.
    Given(f64),
}

/// The camera. By default all of the mesh is in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraOptions {
    /// The camera's position, world units; `None`: by distance, elevation and azimuth.
    pub eye: Option<[f64; 3]>,
    /// The point looked at; `None`: the centre of the smallest sphere around the mesh.
    pub target: Option<[f64; 3]>,
    /// Up in the picture, and the axis of azimuth, elevation and turntable; `None`: y.
    pub up: Option<[f64; 3]>,
    /// From the target to the camera, world units; `None`: so that the mesh fits.
    pub distance: Option<f64>,
    /// Degrees above the target's horizon.
    pub elevation: f64,
    /// Degrees around the vertical axis: 0 looks from -z towards +z, 90 from +x, 180 from +z (with y up).
    pub azimuth: f64,
    /// The vertical angle of view, degrees.
    pub fov: f64,
    /// Half the image's height of an orthographic projection; `None`: a perspective one.
    pub orthographic: Option<HalfHeight>,
    /// The nearest depth that is drawn; `None`: just before the mesh's bounding sphere.
    pub near: Option<f64>,
    /// The farthest depth that is drawn; `None`: just behind the mesh's bounding sphere.
    pub far: Option<f64>,
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            eye: None,
            target: None,
            up: None,
            distance: None,
            elevation: 20.0,
            azimuth: 145.0,
            fov: 30.0,
            orthographic: None,
            near: None,
            far: None,
        }
    }
}

impl CameraOptions {
    /// The camera with its points given from an origin in its coordinates ([`softras_io::Loaded::origin`]).
    pub fn relative_to(mut self, origin: [f64; 3]) -> Self {
        let moved = |point: [f64; 3]| [0, 1, 2].map(|k| point[k] - origin[k]);
        (self.eye, self.target) = (self.eye.map(moved), self.target.map(moved));
        self
    }

    /// The vertical axis: the one given, or y.
    pub fn vertical(&self) -> [f64; 3] {
        self.up.unwrap_or([0.0, 1.0, 0.0])
    }
}

/// The size, softness and background of a picture, and the variant of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Softness of edges, screen units²; `None`: sharp, or a blur of 1.23 rendered pixels ([`Options::is_sharp`]).
    pub sigma: Option<f64>,
    /// Softness of edges as the distance in pixels that a triangle's influence reaches; it takes the place of `sigma`.
    pub blur: Option<f64>,
    /// Linear light, 0 to 1; `None`: transparent.
    pub background: Option<[f64; 3]>,
    /// How numbers become bytes.
    pub curve: Curve,
    /// All other settings of the renderer; those above, depths and outputs are each frame's own. By default γ is 3e-6, about what
    /// single precision tells apart, so that a sign hides the wall behind it however large the scene is; the background is composite,
    /// and interpolation is right in perspective.
    pub model: Settings,
}

impl Default for Look {
    fn default() -> Self {
        let model = Settings {
            gamma: 3e-6,
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            ..Settings::default()
        };
        Self { size: (256, 256), sigma: None, blur: None, background: None, curve: Curve::Srgb, model }
    }
}

/// The lights. By default a key light from the upper left, a fill light from the right, a rim light from behind, all of them
/// moving with the camera, and light from everywhere that is stronger from above.
#[derive(Clone, Debug, PartialEq)]
pub struct LightOptions {
    /// Ambient light; `None`: 0.05 from below to 0.22 from above, or 0.12 beside lights that are given.
    pub ambient: Option<[f64; 3]>,
    /// Lights in world space, instead of the default ones.
    pub lights: Vec<DirectionalLight>,
    /// Colours are drawn without lighting.
    pub unlit: bool,
    /// Normals for lighting.
    pub shading: Shading,
}

impl Default for LightOptions {
    fn default() -> Self {
        Self { ambient: None, lights: Vec::new(), unlit: false, shading: Shading::Smooth }
    }
}

/// Everything about a picture but the mesh.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The camera.
    pub camera: CameraOptions,
    /// The bounds of the mesh that fill the picture.
    pub fill: Fill,
    /// Size, softness and background.
    pub look: Look,
    /// Each pixel averages this number of samples squared; `None`: 4 a side, or 1 where softness was asked for, or as many as a
    /// frame can have.
    pub samples: Option<u32>,
    /// Draw both sides of single-sided materials ([`softras_io::Loaded::single_sided`]).
    pub both_sides: bool,
    /// `None`: solid, but the model's where the softness of edges or unusual modes were asked for.
    pub alpha: Option<Alpha>,
    /// The lights.
    pub light: LightOptions,
    /// With smooth shading, normals are computed from the triangles, and edges at which the surface bends by more than this many
    /// degrees are kept; `None`: the normals of the file, and 40 where it has none.
    pub crease: Option<f64>,
    /// The change from frame to frame.
    pub motion: Motion,
}

impl Options {
    /// Whether each sample of a picture shows the surface that it hits. A soft edge would draw what is small and near as larger than
    /// it is. The model is drawn where softness, another of its settings or its alpha is asked for. `floats`: its own values are wanted.
    pub fn is_sharp(&self, floats: bool) -> bool {
        let asked_soft =
            self.look.sigma.is_some() || self.look.blur.is_some() || matches!(self.motion, Motion::Sweep(_));
        let (usual, faces) = (Look::default().model, self.look.model.faces);
        !floats && !asked_soft && self.alpha != Some(Alpha::Model) && self.look.model == Settings { faces, ..usual }
    }

    /// The samples along each side of a pixel. `floats`: the model's own values are wanted, one a pixel.
    pub fn samples(&self, floats: bool) -> u32 {
        let asked_soft = self.look.sigma.is_some() || self.look.blur.is_some();
        let most = Settings::MAX_SIZE / self.look.size.0.max(self.look.size.1).max(1);
        match self.samples {
            Some(samples) => samples,
            None if floats || asked_soft => 1,
            None => most.clamp(1, 4),
        }
    }

    /// Whether the vertical axis is guessed from the mesh. It is not if the options give it, or the camera's place, which needs
    /// knowledge of the mesh's coordinates; nor for [`Fill::Sphere`], whose camera is the same however the mesh is turned.
    pub(crate) fn has_no_axis(&self) -> bool {
        self.camera.up.is_none() && self.camera.eye.is_none() && self.fill == Fill::Box
    }

    /// Whether alpha is 1 inside of surfaces in pictures of the model: unless its softness or its own values were asked for.
    pub fn is_solid(&self) -> bool {
        let look = &self.look;
        let swept = matches!(self.motion, Motion::Sweep(Sweep { swept: Swept::Sigma | Swept::Blur, .. }));
        let asked_soft = look.curve == Curve::Raw || look.sigma.is_some() || look.blur.is_some() || swept;
        self.alpha.map_or(self.can_be_solid() && !asked_soft, |alpha| alpha == Alpha::Solid)
    }

    /// Whether alpha can be solid: the silhouette is the one whose least value inside of a surface is known, and colour fades with it.
    pub fn can_be_solid(&self) -> bool {
        let model = &self.look.model;
        model.silhouette == SilhouetteAggregation::Product
            && model.distance == Distance::Euclidean
            && model.background == Background::Composite
    }
}

/// The change from frame to frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Motion {
    /// One picture.
    #[default]
    Still,
    /// One turn around the vertical axis in this number of frames; the lights move with the camera.
    Turntable(usize),
    /// A setting that changes.
    Sweep(Sweep),
}

impl Motion {
    /// The turns of all frames, in degrees.
    pub fn turns(&self) -> Vec<f64> {
        let count = if let Self::Turntable(count) = self { *count } else { 1 };
        (0..count).map(|i| 360.0 * i as f64 / count as f64).collect()
    }
}

/// The setting that a sweep changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Swept {
    /// [`Settings::sigma`].
    Sigma,
    /// [`Settings::gamma`].
    Gamma,
    /// [`Settings::tau`].
    Tau,
    /// Sigma by its blur radius in pixels.
    Blur,
}

impl Swept {
    /// The name on the command line and on contact sheets.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sigma => "sigma",
            Self::Gamma => "gamma",
            Self::Tau => "tau",
            Self::Blur => "blur",
        }
    }
}

/// Values of a setting, evenly spaced in their logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    /// The setting that changes.
    pub swept: Swept,
    /// The first value.
    pub from: f64,
    /// The last value.
    pub to: f64,
    /// The number of values, at least 2.
    pub steps: usize,
}

impl Sweep {
    /// The values.
    pub fn values(&self) -> Vec<f64> {
        let ratio = (self.to / self.from).ln();
        let at = |i: usize| self.from * (ratio * i as f64 / (self.steps - 1) as f64).exp();
        (0..self.steps).map(|i| if i + 1 == self.steps { self.to } else { at(i) }).collect()
    }

    /// The value whose blur reaches farthest.
    pub(crate) fn widest(&self) -> (Swept, f64) {
        match self.swept {
            Swept::Tau => (self.swept, self.from.min(self.to)),
            _ => (self.swept, self.from.max(self.to)),
        }
    }
}
