//! The settings of a frame. Their defaults are those of the official renderer. Equations are numbered as on the paper's
//! poster; `glsl/README.md` lists them.

use crate::error::{Error, Result, shown};

/// Which images τ bounds the error of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Support {
    /// A fragment outside its triangle with D < τ, that is d² ≥ σ ln(1/τ - 1), is dropped, as by SoftRas and PyTorch3D.
    /// Dropping n fragments changes the silhouette by at most n τ. It may change the colour without bound: a dropped
    /// triangle that is nearer than all others would have won the softmax, however small its D.
    #[default]
    Probability,
    /// The error of every image is bounded: fragments are dropped only where d² ≥ σ (ln(1/τ - 1) + Δζ/γ), Δζ the
    /// largest difference in this frame between a fragment's depth score ζ and that of what the pixel shows without it.
    /// Dropping n fragments changes no image by more than n τ of its range (1 for colours and backgrounds in [0, 1],
    /// `far` for depth, 2 for normals). Slower; see [`Settings::cutoff_of`] for the radius.
    Guaranteed,
}

/// Which images a frame renders; an image that is not asked for costs nothing. D is a fragment's coverage, w its
/// softmax weight, z its view depth and n its normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outputs {
    /// RGB.
    pub color: bool,
    /// The probability that the pixel is covered, 1 - Π(1 - D), unless [`SilhouetteAggregation`] says otherwise.
    pub silhouette: bool,
    /// Σ w z, view depth in world units.
    pub depth: bool,
    /// Σ w n, world space.
    pub normal: bool,
    /// Σ w f of the meshes' features f ([`Mesh::with_features`](crate::Mesh::with_features)), which every mesh must then have.
    pub features: bool,
}

impl Outputs {
    /// Every image that any mesh has: all but features.
    pub const ALL: Self = Self { color: true, silhouette: true, depth: true, normal: true, features: false };
    /// No image, to add to.
    pub const NOTHING: Self = Self { color: false, silhouette: false, depth: false, normal: false, features: false };
    /// The silhouette alone.
    pub const SILHOUETTE: Self = Self { silhouette: true, ..Self::NOTHING };
}

/// How the triangles near a pixel become its colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorAggregation {
    /// Depth-weighted softmax (eq. 2, 3).
    #[default]
    Softmax,
    /// The nearest triangle that covers the pixel's centre.
    Hard,
}

/// How the triangles near a pixel become its silhouette.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SilhouetteAggregation {
    /// 1 - Π(1 - D) (eq. 5).
    #[default]
    Product,
    /// Σ D / number of the mesh's triangles (the official "sum"), at most 1: of a triangle that the near plane cuts in
    /// two, both pieces count.
    Sum,
    /// 1 where any D > ½, else 0.
    Hard,
}

/// The distance whose sigmoid is D.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Distance {
    /// Squared distance to the triangle's boundary, screen units² (eq. 1).
    #[default]
    Euclidean,
    /// Square of the smallest barycentric coordinate, with its sign (the official "barycentric").
    Barycentric,
    /// D = 1 inside, 0 outside.
    Hard,
}

/// How the background enters the colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// As one more entry of the softmax, with score ε (the paper).
    #[default]
    Weighted,
    /// I = A Σ w' C + (1 - A) C_b, w' the softmax over triangles alone: what fitting should use.
    Composite,
}

/// Which triangles are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Faces {
    /// All of them.
    #[default]
    Both,
    /// Front faces only.
    Front,
}

/// Which winding, seen on the image, is the front of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrontFace {
    /// Counter-clockwise (OBJ files under an unmirrored camera).
    #[default]
    CounterClockwise,
    /// Clockwise (the official renderer, whose camera mirrors the image).
    Clockwise,
}

/// How corner values are interpolated over a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Affine in screen space (the paper): Σ b̂ c.
    #[default]
    Affine,
    /// Perspective-correct: Σ b̂ c z / z_k.
    Perspective,
}

/// Where a triangle is sampled for a pixel outside it: the barycentrics b̂ of its depth, colour, UV and normal there.
/// Inside they are the pixel's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfacePoint {
    /// At the triangle's point nearest to the pixel, to which d is measured.
    #[default]
    Nearest,
    /// At the pixel's barycentrics clamped to [0, 1] and divided by their sum (the paper). In a needle-shaped triangle
    /// this point may be far from the pixel, so that a hidden needle may show through the surface before it.
    Clip,
}

/// Which rules apply where the official code differs from the paper's mathematics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Parity {
    /// This crate's model.
    #[default]
    Model,
    /// The official code's image: background score 2ε, no near clipping, silhouettes that count triangles outside
    /// [near, far] and back faces, barycentric support cut by the box of the Euclidean radius, [`SurfacePoint::Clip`].
    Official,
}

/// All parameters of a frame besides meshes, cameras and lights.
///
/// A *fragment* is a (pixel, triangle) pair. Its coverage D = sigmoid(±d²/σ), d the distance from the pixel's centre to
/// the triangle's edge, is the probability that the triangle covers the pixel. The *support* of a triangle is where D ≥
/// τ.
///
/// # Choosing σ, γ and τ in pixels
/// - **σ** is how far a triangle reaches beyond its edge: D falls below τ at √(σ ln(1/τ - 1)) screen units, which are
///   half the image's height. With τ = 1e-4 that is r = 1.52 H √σ pixels: at H = 256, σ = 1e-5 reaches 1.2 pixels (a
///   picture), 1e-4 reaches 3.9 (fitting, near the end), 1e-3 reaches 12 (fitting, far from it). Beyond r a triangle
///   has no gradient, so begin with r as large as the distance that the mesh has to move, and shrink it. Work grows
///   with the area of the grown triangles: hardly with r while r is small against a triangle, as r² beyond. In an image of
///   twice the height an unchanged σ spans twice the pixels: [`Settings::with_blur_pixels`] keeps the pixels.
/// - **γ** is the difference of depth, as a share of far - near, at which the nearer of two triangles outweighs the
///   other e times: γ (far - near) world units. A tenth of the object's thickness gives hidden parts a gradient; a
///   hundredth renders surfaces as opaque. Near and far close around the object make γ mean the same for every scene;
///   with the official near 1 and far 100, γ = 1e-4 is 0.01 world units.
/// - **τ** is the error that truncation may cause: a pixel's value changes by at most τ for each fragment dropped
///   there. The radius depends on it weakly: τ = 1e-3 makes r 13 % smaller than 1e-4 does, 1e-6 22 % larger. The bound
///   holds for the silhouette with any [`Support`], for every image with [`Support::Guaranteed`].
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Image width in pixels, 1 to 16384.
    pub width: u32,
    /// Image height in pixels, 1 to 16384.
    pub height: u32,
    /// Sharpness of a triangle's edge: D = sigmoid(±d²/σ). Screen units² (1 = half the image height).
    pub sigma: f64,
    /// Softness of the depth ordering: weights are exp(ζ/γ).
    pub gamma: f64,
    /// Depth score of the background in the softmax, [`Background::Weighted`] only.
    pub epsilon: f64,
    /// A fragment outside its triangle with D < τ is dropped; in (0, ½).
    pub tau: f64,
    /// Whether τ bounds the error of the silhouette alone or of every image.
    pub support: Support,
    /// Nearest view depth, above 0; triangles are cut there.
    pub near: f64,
    /// Farthest view depth; fragments beyond it are dropped.
    pub far: f64,
    /// Which images to render.
    pub outputs: Outputs,
    /// How triangles become colour (and depth and normal).
    pub color: ColorAggregation,
    /// How triangles become the silhouette.
    pub silhouette: SilhouetteAggregation,
    /// The distance that D is the sigmoid of.
    pub distance: Distance,
    /// How the background enters the colour.
    pub background: Background,
    /// RGB of the background.
    pub background_color: [f64; 3],
    /// One or both faces.
    pub faces: Faces,
    /// Which winding is the front.
    pub front_face: FrontFace,
    /// Affine or perspective-correct colours.
    pub interpolation: Interpolation,
    /// Where a triangle is sampled outside itself; [`Parity::Official`] has [`SurfacePoint::Clip`] whatever this is.
    pub surface_point: SurfacePoint,
    /// The paper's model, or the official code's deviations from it.
    pub parity: Parity,
    /// Keep what the backward pass needs, 16 bytes a pixel; a frame without it cannot be differentiated. Calls for gradients
    /// set it themselves: [`Renderer::render_saved`](crate::Renderer::render_saved), fits, and plans with gradients.
    pub save: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 256,
            height: 256,
            sigma: 1e-5,
            gamma: 1e-4,
            epsilon: 1e-3,
            tau: 1e-4,
            support: Support::Probability,
            near: 1.0,
            far: 100.0,
            outputs: Outputs { color: true, silhouette: true, ..Outputs::NOTHING },
            color: ColorAggregation::Softmax,
            silhouette: SilhouetteAggregation::Product,
            distance: Distance::Euclidean,
            background: Background::Weighted,
            background_color: [0.0; 3],
            faces: Faces::Both,
            front_face: FrontFace::CounterClockwise,
            interpolation: Interpolation::Affine,
            surface_point: SurfacePoint::Nearest,
            parity: Parity::Model,
            save: false,
        }
    }
}

impl Settings {
    /// The largest width or height.
    pub const MAX_SIZE: u32 = 16384;

    /// Sets sigma so that a triangle's influence ends `pixels` outside it: r² = σ ln(1/τ - 1).
    ///
    /// Uses the height and τ that are set already.
    pub fn with_blur_pixels(mut self, pixels: f64) -> Self {
        let radius = pixels * 2.0 / f64::from(self.height);
        self.sigma = radius * radius / self.cutoff();
        self
    }

    /// ln(1/τ - 1): the culling radius squared in units of σ.
    pub fn cutoff(&self) -> f64 {
        (1.0 / self.tau - 1.0).ln()
    }

    /// The culling radius of the Euclidean distance in pixels.
    pub fn blur_pixels(&self) -> f64 {
        (self.sigma * self.cutoff()).sqrt() * f64::from(self.height) / 2.0
    }

    /// Checks every field's range.
    ///
    /// # Errors
    /// [`Error::Settings`] naming the field, its value and its range.
    pub fn validate(&self) -> Result<()> {
        // The value is formatted only for an error, so that valid settings need no allocation.
        let check = |ok: bool, field: &'static str, value: &dyn Fn() -> String, fix: &str| {
            if ok { Ok(()) } else { Err(Error::Settings { field, value: value(), fix: fix.into() }) }
        };
        for (field, size) in [("width", self.width), ("height", self.height)] {
            check((1..=Self::MAX_SIZE).contains(&size), field, &|| size.to_string(), "use 1 to 16384 pixels")?;
        }
        for (field, value, low, high, fix) in [
            ("sigma", self.sigma, 1e-12, 1e3, "use 1e-12 to 1e3 screen units²"),
            ("gamma", self.gamma, 1e-10, 1e6, "use 1e-10 to 1e6"),
            ("epsilon", self.epsilon, -1e3, 1e3, "use -1000 to 1000"),
            ("tau", self.tau, 1e-12, 0.4, "use 1e-12 to 0.4; 1e-4 is usual"),
            ("near", self.near, 1e-6, 1e9, "use 1e-6 to 1e9 world units"),
            ("far", self.far, self.near * (1.0 + 1e-6), 1e12, "must lie beyond near, at most at 1e12"),
        ] {
            // A bound that was rounded to single precision still counts as the bound.
            let is_bound = [low, high].iter().any(|&bound: &f64| value == f64::from(bound as f32));
            let within = (value >= low && value <= high) || is_bound;
            check(within, field, &|| shown(value), fix)?;
        }
        let background = &self.background_color;
        let finite = background.iter().all(|c| c.abs() <= 1e6);
        check(finite, "background_color", &|| format!("{background:?}"), "use values within ±1e6")?;
        let Outputs { color, silhouette, depth, normal, features } = self.outputs;
        let fix = "ask for at least one of color, silhouette, depth, normal, features";
        check(color || silhouette || depth || normal || features, "outputs", &|| "none".into(), fix)?;
        self.validate_support()
    }

    /// Checks that the support fits the other settings.
    ///
    /// # Errors
    /// [`Error::Settings`] for [`Support::Guaranteed`] under official parity, whose silhouette breaks the bound.
    fn validate_support(&self) -> Result<()> {
        if self.support == Support::Guaranteed && self.parity == Parity::Official {
            return Err(Error::Settings {
                field: "support",
                value: "guaranteed".into(),
                fix: "the official code's silhouette counts triangles that its colour does not: use parity model, or \
                       support probability"
                    .into(),
            });
        }
        Ok(())
    }
}
