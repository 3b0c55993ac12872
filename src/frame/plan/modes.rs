//! The specialization constants, and what is known of a frame beyond its settings.

use super::PlanInput;
use crate::constants as c;
use crate::scene::{
    Background, Camera, ColorAggregation, Distance, Faces, FrontFace, Interpolation, Parity, Settings, Shading,
    SilhouetteAggregation,
};

/// How the depths of a frame's meshes lie to its near and far planes; unknown is `true`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DepthSpan {
    /// Some triangle may cross the near plane.
    pub crosses_near: bool,
    /// Some fragment may lie beyond the far plane.
    pub crosses_far: bool,
}

/// What colours the meshes of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampling {
    /// Some mesh has surface cells.
    pub surface: bool,
    /// Some mesh has image textures.
    pub image: bool,
}

impl DepthSpan {
    /// From the box around a mesh, as one camera sees it.
    pub fn of(bounds: Option<([f32; 3], [f32; 3])>, camera: &Camera, settings: &Settings) -> Self {
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
        // A millionth for the rounding of the kernels.
        let slack = 1e-6 * (nearest.abs() + farthest.abs());
        Self { crosses_near: nearest - slack < settings.near, crosses_far: farthest + slack > settings.far }
    }

    /// True of either.
    pub fn or(self, other: Self) -> Self {
        Self {
            crosses_near: self.crosses_near || other.crosses_near,
            crosses_far: self.crosses_far || other.crosses_far,
        }
    }
}

fn output_bits(settings: &Settings) -> u32 {
    let o = settings.outputs;
    let bit = |on: bool, bit: u32| if on { bit } else { 0 };
    bit(o.color, c::OUTPUT_COLOR)
        | bit(o.silhouette, c::OUTPUT_SILHOUETTE)
        | bit(o.depth, c::OUTPUT_DEPTH)
        | bit(o.normal, c::OUTPUT_NORMAL)
}

/// The specialization constants: everything that changes what is compiled.
pub(super) fn modes_of(input: &PlanInput) -> Vec<(&'static str, u32)> {
    let s = input.settings;
    let official = s.parity == Parity::Official;
    let shaded = s.outputs.color || s.outputs.depth || s.outputs.normal;
    let depth_range = match (official, input.depth_span.crosses_far) {
        // The official silhouette counts every depth, so only shaded images care.
        (true, _) if shaded => c::DEPTH_RANGE_OFFICIAL,
        (false, true) => c::DEPTH_RANGE_FAR,
        _ => c::DEPTH_RANGE_INSIDE,
    };
    let smooth = input.lights.shading == Shading::Smooth && (s.outputs.normal || !input.lights.is_unlit());
    vec![
        ("OUTPUTS", output_bits(s)),
        ("COLOR_MODE", if s.color == ColorAggregation::Hard { c::COLOR_HARD } else { c::COLOR_SOFTMAX }),
        (
            "SILHOUETTE_MODE",
            match s.silhouette {
                SilhouetteAggregation::Product => c::SILHOUETTE_PRODUCT,
                SilhouetteAggregation::Sum => c::SILHOUETTE_SUM,
                SilhouetteAggregation::Hard => c::SILHOUETTE_HARD,
            },
        ),
        (
            "DISTANCE",
            match s.distance {
                Distance::Euclidean => c::DISTANCE_EUCLIDEAN,
                Distance::Barycentric => c::DISTANCE_BARYCENTRIC,
                Distance::Hard => c::DISTANCE_HARD,
            },
        ),
        (
            "SAMPLING",
            u32::from(input.sampling.surface) * c::SAMPLING_SURFACE
                + u32::from(input.sampling.image) * c::SAMPLING_IMAGE,
        ),
        ("PERSPECTIVE_CORRECT", u32::from(s.interpolation == Interpolation::Perspective)),
        ("COMPOSITE", u32::from(s.background == Background::Composite)),
        ("DEPTH_RANGE", depth_range),
        ("SAVE", u32::from(input.save)),
        ("NEAR_CLIP", u32::from(clips(input))),
        ("SMOOTH", u32::from(smooth)),
        ("LIT", u32::from(!input.lights.is_unlit())),
        ("FRONT_ONLY", u32::from(s.faces == Faces::Front)),
        ("CLOCKWISE_FRONT", u32::from(s.front_face == FrontFace::Clockwise)),
        ("OFFICIAL", u32::from(official)),
        ("DISTORTED", u32::from(input.distorted)),
    ]
}

/// Whether triangles may be cut by the near plane, so that each has two slots.
pub(super) fn clips(input: &PlanInput) -> bool {
    input.depth_span.crosses_near && input.settings.parity == Parity::Model
}
