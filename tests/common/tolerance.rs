//! Every tolerance of the tests, each with its reason.

use super::scenes::{Case, Kind};
use softras::{Projection, scene::Distance};
pub use softras_check::agreement::{GRADIENT, GradientTolerance};

/// How far the kernels may be from the reference.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// The largest error of a value, in units of max(1, |value|).
    pub value: f64,
    /// Pixels with a smaller margin are not compared: there the model jumps within the kernels' rounding.
    pub margin: f64,
    /// The largest share of pixels that may go uncompared.
    pub left_out: f64,
}

/// The main promise: every image of every scene is within 2e-5 of the f64 model. It covers γ (far - near) ≥ 1e-4 world
/// units: a sharper order would depend on depths that f32 positions of a few units cannot tell apart.
///
/// Margin: the kernels' squared distances are good to about 1e-5 of the cut-off's, their depths to 1e-6; 1e-4 leaves
/// room for both. A pixel of a soup lies near some hundred cut-offs, each at a margin below 1e-4 for one pixel in 10⁴, so
/// some per cent of the pixels of a small image go uncompared, in the mean 0.1 %.
pub const IMAGE: Tolerance = Tolerance { value: 2e-5, margin: 1e-4, left_out: 0.1 };

/// The promise where its inputs are harder than f32 can carry it: each factor is how much a rounding is magnified.
pub fn of(case: &Case) -> Tolerance {
    let sigma = case.settings.sigma;
    let projection = case.cameras[0].projection();
    let edge = match (projection, case.settings.distance) {
        // The distorted projection works in single precision where the others carry 48 bits: positions are good to 1e-7,
        // and D's slope at an edge is 0.3 / √σ.
        (Projection::Official { .. }, _) => (1e-3 / sigma).sqrt(),
        // Barycentrics are good to 1e-7; D's slope by them is the same.
        (_, Distance::Barycentric) => (1e-3 / sigma).sqrt(),
        // An edge's distance is good to 2⁻²⁴ of a triangle that may span the image.
        _ => (1e-5 / sigma).sqrt(),
    };
    // A corner cut by the near plane is one more rounding from the file's, its triangle many times as large as the image,
    // and γ (far - near) there goes down to 1e-3.
    let cut = if case.kind == Kind::Clipped { 5.0 } else { 1.0 };
    // A log weight that changes by 256 within a world unit is rounded to 2⁻¹⁶, and its weight with it.
    let steep = std::f64::consts::LOG2_E / ((case.settings.far - case.settings.near) * case.settings.gamma) / 256.0;
    Tolerance { value: IMAGE.value * edge.max(1.0) * cut * steep.clamp(1.0, 2.0), ..IMAGE }
}

/// For pixels computed by hand: a few roundings of an f32 near 1, exp within 3 + 2|x| of its last places.
pub const BY_HAND: f64 = 2e-6;

/// One scene computed in two orders: sums of up to some thousand terms, each with half a unit in its last place.
pub const SAME_SCENE: Tolerance = Tolerance { value: 2e-5, margin: 1e-4, left_out: 0.1 };

/// A gradient with the sums of another number of lanes: some hundred terms that nearly cancel, in another order.
pub const OTHER_LANES: f64 = 1e-4;

/// Some ten thousand triangles a pixel. Nearly every pixel has one of them within rounding of its cut-off, and one that
/// falls on the other side moves a value by about τ = 1e-4; pixels at a closer call than 1e-6 are left out.
pub const CROWD: Tolerance = Tolerance { value: 2e-4, margin: 1e-6, left_out: 0.2 };

/// Any number of layers: sums of 32 terms with half a unit in the last place each, and what is measured of those (2.3e-6).
pub const LAYERS: Tolerance = Tolerance { value: 5e-6, margin: 1e-4, left_out: 0.1 };

/// D of faces with edges of 0.003 screen units: the promise to those who fit fine meshes.
pub const SMALL_FACE: f64 = 1e-3;

/// A triangle cut at `near` that reaches `depth` behind it: on the screen it is depth / near times as large as it looks
/// at its far end, and f32 barycentrics are good to 2⁻²⁴ of the whole, so that what is seen of it is that much coarser.
pub fn cut_at(near: f64, depth: f64) -> Tolerance {
    Tolerance { value: IMAGE.value + 8e-6 * depth / near, ..IMAGE }
}

/// One frame from kernels that are specialised in two ways: the compiler orders some sums otherwise, so a few last places of
/// values up to about 4.
pub const OTHER_KERNEL: f32 = 5e-6;
