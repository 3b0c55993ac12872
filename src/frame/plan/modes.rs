//! The specialization constants, and the properties of a scene that they depend on.

use super::PlanInput;
use crate::constants as c;
use crate::scene::{
    Background, Camera, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Mesh, Outputs, Parity, Projection,
    Settings, Shading, SilhouetteAggregation, SurfacePoint,
};
use glam::DVec3;

/// The smallest and largest corner of a box.
type Bounds = ([f32; 3], [f32; 3]);

/// How the depths of a frame's meshes compare with its near and far planes. `true` is safe if the answer is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthSpan {
    /// Some triangle may cross the near plane.
    pub crosses_near: bool,
    /// Some fragment may lie beyond the far plane.
    pub crosses_far: bool,
}

/// The kinds of texture that the meshes of a frame have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampling {
    /// Some mesh has surface cells.
    pub surface: bool,
    /// Some mesh has image textures.
    pub image: bool,
    /// Some image has an alpha below 1.
    pub opacity: bool,
}

/// The kinds of camera of a frame that need code of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lenses {
    /// Some camera is [`Projection::Official`], which may distort.
    pub distorted: bool,
    /// Some camera is [`Projection::Orthographic`].
    pub orthographic: bool,
}

impl Lenses {
    /// Those of some cameras.
    pub fn of<'a>(cameras: impl IntoIterator<Item = &'a Camera>) -> Self {
        cameras.into_iter().fold(Self::default(), |all, camera| Self {
            distorted: all.distorted || matches!(camera.projection(), Projection::Official { .. }),
            orthographic: all.orthographic || matches!(camera.projection(), Projection::Orthographic { .. }),
        })
    }

    /// Whether kernels for these serve the cameras of `other` as well.
    pub fn serve(self, other: Self) -> bool {
        self.distorted >= other.distorted && self.orthographic >= other.orthographic
    }
}

impl DepthSpan {
    /// For a mesh of these bounds (least and largest corner in world space) seen by one camera.
    pub fn of(bounds: Option<Bounds>, camera: &Camera, settings: &Settings) -> Self {
        let Some((low, high)) = bounds else {
            return Self { crosses_near: false, crosses_far: false };
        };
        let row = camera.view()[2];
        let (mut nearest, mut farthest) = (row[3], row[3]);
        for axis in 0..3 {
            let ends = [row[axis] * f64::from(low[axis]), row[axis] * f64::from(high[axis])];
            nearest += ends[0].min(ends[1]);
            farthest += ends[0].max(ends[1]);
        }
        Self::of_depths(nearest, farthest, settings)
    }

    /// The span of a mesh. If its box crosses a plane, every vertex is tested, since the box is larger than the mesh, and a frame
    /// in which nothing crosses is faster.
    pub(crate) fn of_mesh(mesh: &Mesh, bounds: Option<Bounds>, camera: &Camera, settings: &Settings) -> Self {
        let inside = Self { crosses_near: false, crosses_far: false };
        let of_box = Self::of(bounds, camera, settings);
        if of_box == inside {
            return inside;
        }
        let depth = |p: [f32; 3]| camera.to_view(DVec3::from(p.map(f64::from))).z;
        let widest = (f64::INFINITY, f64::NEG_INFINITY);
        let (nearest, farthest) =
            mesh.used_positions().map(depth).fold(widest, |(low, high), z| (low.min(z), high.max(z)));
        Self::of_depths(nearest, farthest, settings)
    }

    fn of_depths(nearest: f64, farthest: f64, settings: &Settings) -> Self {
        // The kernels compute depths in single precision, whose rounding error is below a millionth.
        let slack = 1e-6 * (nearest.abs() + farthest.abs());
        Self { crosses_near: nearest - slack < settings.near, crosses_far: farthest + slack > settings.far }
    }

    /// Each field is `true` if it is in either.
    pub fn or(self, other: Self) -> Self {
        Self {
            crosses_near: self.crosses_near || other.crosses_near,
            crosses_far: self.crosses_far || other.crosses_far,
        }
    }
}

macro_rules! modes {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident = $glsl:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name {
            $($(#[$doc])* pub $field: u32,)*
        }

        impl $name {
            /// The constants' names in GLSL with their values.
            pub fn list(&self) -> [(&'static str, u32); [$($glsl),*].len()] {
                [$(($glsl, self.$field)),*]
            }
        }
    };
}

modes! {
    /// The specialization constants of a frame, which every kernel is compiled for.
    Modes {
        /// OUTPUT_ bits of the images.
        outputs = "OUTPUTS",
        /// COLOR_: how colours are aggregated.
        color_mode = "COLOR_MODE",
        /// SILHOUETTE_: how the silhouette is aggregated.
        silhouette_mode = "SILHOUETTE_MODE",
        /// DISTANCE_: what a probability is computed from.
        distance = "DISTANCE",
        /// SAMPLING_ bits of the kinds of texture.
        sampling = "SAMPLING",
        /// 1: attributes are interpolated with perspective correction.
        perspective_correct = "PERSPECTIVE_CORRECT",
        /// SURFACE_POINT_: where a triangle is sampled outside itself.
        surface_point = "SURFACE_POINT",
        /// 1: the background is composited by the silhouette.
        composite = "COMPOSITE",
        /// DEPTH_RANGE_: how fragments beyond the far plane are rejected.
        depth_range = "DEPTH_RANGE",
        /// 1: the frame keeps what backward needs.
        save = "SAVE",
        /// 1: triangles may cross the near plane, so each has two records.
        near_clip = "NEAR_CLIP",
        /// 1: vertices are lit, not triangles.
        smooth = "SMOOTH",
        /// 1: some mesh gives the normals of its vertices, which are lit.
        given_normals = "GIVEN_NORMALS",
        /// 1: the lights are others than [`Lights::unlit`](crate::Lights::unlit).
        lit = "LIT",
        /// 1: back faces are culled.
        front_only = "FRONT_ONLY",
        /// 1: triangles whose corners run clockwise face the camera.
        clockwise_front = "CLOCKWISE_FRONT",
        /// 1: the official implementation's formulas.
        official = "OFFICIAL",
        /// 1: some camera has lens distortion.
        distorted = "DISTORTED",
        /// 1: some camera is orthographic, and depth is linear on its screen.
        parallel = "PARALLEL",
        /// 1: the kernel forward_soft serves the frame.
        soft = "SOFT",
        /// 1: tiles without a list are drawn in this frame.
        walks = "WALKS",
        /// 1: some image has an alpha below 1.
        opacity = "OPACITY",
        /// Texels of a vertex's features, four features each; 0 without an image of them.
        feature_texels = "FEATURE_TEXELS",
        /// OUTPUT_ bits of the images that have an upstream gradient; 0 in a forward frame.
        upstream = "UPSTREAM",
        /// GRADIENT_ bits of the inputs to differentiate by; 0 in a forward frame.
        gradients = "GRADIENTS",
        /// 1: the paper's gradient.
        paper = "PAPER",
        /// 1: vertices take their gradients from the triangles' sums over pixels, without corner gradients between.
        per_vertex = "PER_VERTEX",
        /// The most loop passes of one invocation, over all its loops, that the device executes correctly.
        loop_passes = "LOOP_PASSES",
    }
}

/// The OUTPUT_ bits of some images.
pub(super) fn output_bits(o: Outputs) -> u32 {
    let bit = |on: bool, bit: u32| if on { bit } else { 0 };
    bit(o.color, c::OUTPUT_COLOR)
        | bit(o.silhouette, c::OUTPUT_SILHOUETTE)
        | bit(o.depth, c::OUTPUT_DEPTH)
        | bit(o.normal, c::OUTPUT_NORMAL)
        | bit(o.features, c::OUTPUT_FEATURES)
}

impl Modes {
    /// The modes of a forward frame.
    pub(super) fn new(input: &PlanInput) -> Self {
        let s = input.settings;
        let official = s.parity == Parity::Official;
        let shaded = s.outputs.color || s.outputs.depth || s.outputs.normal || s.outputs.features;
        let depth_range = match (official, input.depth_span.crosses_far) {
            // The official silhouette includes every depth, so the range matters to shaded images only.
            (true, _) if shaded => c::DEPTH_RANGE_OFFICIAL,
            (false, true) => c::DEPTH_RANGE_FAR,
            _ => c::DEPTH_RANGE_INSIDE,
        };
        // In the hard mode colours come from pixels inside the triangle, where both points are the pixel's own. Depths
        // outside matter if the far plane rejects fragments, and texels outside if they have an alpha.
        let hard = s.color == ColorAggregation::Hard;
        let samples_outside = !hard || depth_range != c::DEPTH_RANGE_INSIDE || input.sampling.opacity;
        let lit = !input.lights.is_unlit();
        let smooth = input.lights.shading == Shading::Smooth && (s.outputs.normal || lit);
        Self {
            outputs: output_bits(s.outputs),
            color_mode: if s.color == ColorAggregation::Hard { c::COLOR_HARD } else { c::COLOR_SOFTMAX },
            silhouette_mode: match s.silhouette {
                SilhouetteAggregation::Product => c::SILHOUETTE_PRODUCT,
                SilhouetteAggregation::Sum => c::SILHOUETTE_SUM,
                SilhouetteAggregation::Hard => c::SILHOUETTE_HARD,
            },
            distance: match s.distance {
                Distance::Euclidean => c::DISTANCE_EUCLIDEAN,
                Distance::Barycentric => c::DISTANCE_BARYCENTRIC,
                Distance::Hard => c::DISTANCE_HARD,
            },
            sampling: u32::from(input.sampling.surface) * c::SAMPLING_SURFACE
                + u32::from(input.sampling.image) * c::SAMPLING_IMAGE,
            perspective_correct: u32::from(s.interpolation == Interpolation::Perspective),
            surface_point: match s.surface_point {
                SurfacePoint::Nearest if !official && samples_outside => c::SURFACE_POINT_NEAREST,
                _ => c::SURFACE_POINT_CLIP,
            },
            composite: u32::from(s.background == Background::Composite),
            depth_range,
            save: u32::from(input.save),
            near_clip: u32::from(clips(input)),
            smooth: u32::from(smooth),
            given_normals: u32::from(smooth && input.tables.normals > 0),
            lit: u32::from(lit),
            front_only: u32::from(s.faces == Faces::Front),
            clockwise_front: u32::from(s.front_face == FrontFace::Clockwise),
            official: u32::from(official),
            distorted: u32::from(input.lenses.distorted),
            parallel: u32::from(input.lenses.orthographic && !official),
            soft: u32::from(is_soft(s) && depth_range == c::DEPTH_RANGE_INSIDE && !input.sampling.opacity),
            opacity: u32::from(input.sampling.opacity),
            loop_passes: input.loop_passes,
            walks: u32::from(input.rare.walked),
            feature_texels: input.feature_texels(),
            ..Self::default()
        }
    }
}

/// The largest log2 weight of eq. 3 in forward_soft, whose sums are relative to an integer log weight: a float of this size
/// still has a resolution of a half, and beyond 2²⁴ it does not hold every integer.
const LARGEST_SOFT_WEIGHT: f64 = 4_194_304.0;

/// Whether the frame computes eq. 1, 2, 3 and 5 of the model, with log weights that forward_soft can hold.
fn is_soft(s: &Settings) -> bool {
    // The scores of eq. 3 lie within 0 and 1, that of the background is ε.
    let largest_weight = s.epsilon.abs().max(1.0) * std::f64::consts::LOG2_E / s.gamma;
    largest_weight <= LARGEST_SOFT_WEIGHT
        && s.color == ColorAggregation::Softmax
        && s.silhouette == SilhouetteAggregation::Product
        && s.distance == Distance::Euclidean
        && s.parity == Parity::Model
}

/// Whether triangles may be clipped at the near plane, so each has two records.
pub(super) fn clips(input: &PlanInput) -> bool {
    input.depth_span.crosses_near && input.settings.parity == Parity::Model
}
