//! The promise that is made of a case, and how its error is measured.
//!
//! Every case has values in range and the same bits in a second run. Accuracy is promised where positions are a few units
//! and lie between near and far, and γ (far - near) ≥ 1e-4 world units. There, images are within 2e-5 of the f64 model for
//! σ ≥ 1e-5. For smaller σ the tolerance grows by √(1e-5/σ), and for a wide image by width / height. The silhouette keeps
//! this promise for thin triangles too; colour, depth and normals keep it only where no triangle is thin, because
//! barycentrics are distances divided by heights. Gradients are within 1e-3 of their norm, times √(1e-5/σ). Over a
//! composite background, gradients by colours are within 6e-8 of the norm of the upstream weights where that is more: it is
//! the last bit of a silhouette.

use super::draw::Case;
use crate::agreement::{self, GRADIENT, IMAGE_MARGIN, Subject, random_upstream};
use softras::scene::{Background, Settings};
use softras::{Frame, Gradients, Image, ImageGradient};
use softras_reference::{ReferenceFrame, render_culled};

/// The factor on tolerances for small σ: the rounding error of a distance is that of the corners, and x = d²/σ magnifies
/// it by 1/√σ.
fn sharpness(case: &Case) -> f64 {
    (1e-5 / case.settings.sigma).sqrt().max(1.0)
}

/// The tolerance of an image's value, in units of max(1, |value|). It grows with the aspect, because the corners of a wide
/// image have larger coordinates.
pub(super) fn tolerance(case: &Case) -> f64 {
    let aspect = f64::from(case.settings.width) / f64::from(case.settings.height);
    2e-5 * sharpness(case) * aspect.max(1.0)
}

/// The tolerance of a gradient, as a share of its L2 norm.
pub(super) fn gradient_tolerance(case: &Case) -> f64 {
    GRADIENT.worst * sharpness(case)
}

/// The largest error of an image, in units of max(1, |value|).
fn worst(image: Option<&Image>, expected: &[f64], margin: &[f64]) -> f64 {
    worst_in(image, expected, margin, |_| 1.0)
}

/// The largest error of an image, in units of max(`unit` of the value's index, |value|).
fn worst_in(image: Option<&Image>, expected: &[f64], margin: &[f64], unit: impl Fn(usize) -> f64) -> f64 {
    let Some(image) = image else { return 0.0 };
    let counts = |pixel: usize| margin.get(pixel).is_some_and(|m| *m >= IMAGE_MARGIN);
    let size = |i: usize| expected.get(i).map_or(1.0, |should| should.abs()).max(unit(i));
    agreement::differences(image, expected, counts).fold(0.0, |worst, (i, error)| worst.max(error / size(i)))
}

/// The largest error of the silhouette, and the largest error of any image.
pub(super) fn errors(frame: &Frame, reference: &ReferenceFrame, settings: &Settings) -> [f64; 2] {
    let silhouette = worst(frame.silhouette().ok(), &reference.silhouette, &reference.margin);
    let others = [(frame.color().ok(), &reference.color), (frame.normal().ok(), &reference.normal)];
    let all = others.map(|(image, expected)| worst(image, expected, &reference.margin));
    // Over a composite background, a depth is the silhouette times the depth that is seen; the latter is the unit.
    let shown = |i: usize| match settings.background {
        Background::Composite => reference.depth[i] / reference.silhouette.get(i).copied().unwrap_or(1.0).max(1e-6),
        Background::Weighted => 1.0,
    };
    let depth = worst_in(frame.depth().ok(), &reference.depth, &reference.margin, |i| shown(i).max(1.0));
    [silhouette, all.into_iter().fold(silhouette.max(depth), f64::max)]
}

/// The largest error of any image of a frame against the reference, in units of max(1, |value|).
///
/// # Errors
/// As [`softras_reference::render`].
pub fn image_error(frame: &Frame, case: &Case) -> softras::Result<f64> {
    Ok(errors(frame, &render_culled(&case.scene, &case.cameras, &case.settings)?, &case.settings)[1])
}

fn subject(case: &Case) -> Subject<'_> {
    Subject { scene: &case.scene, cameras: &case.cameras, settings: &case.settings }
}

/// A random weight in [-1, 1) for every value of the images, 0 where the margin is too small.
pub(super) fn upstream(case: &Case, margin: Option<&[f64]>) -> ImageGradient {
    random_upstream(subject(case), case.seed, case.settings.outputs, margin)
}

/// The [`upstream`] weights of several cases as one batch.
pub(super) fn upstream_of(cases: &[Case]) -> ImageGradient {
    let mut all = cases.iter().map(|case| upstream(case, None));
    let mut sum = all.next().unwrap_or_default();
    for next in all {
        let ImageGradient { color, silhouette, depth, normal, features } = next;
        append(&mut sum.color, color);
        append(&mut sum.silhouette, silhouette);
        append(&mut sum.depth, depth);
        append(&mut sum.normal, normal);
        append(&mut sum.features, features);
    }
    sum
}

fn append(to: &mut Option<Image>, image: Option<Image>) {
    if let (Some(to), Some(image)) = (to, image) {
        to.batch += image.batch;
        to.data.extend(image.data);
    }
}

/// The worst gradient's name and its error.
///
/// # Errors
/// As [`agreement::errors`].
pub(super) fn gradient_error(
    case: &Case,
    upstream: &ImageGradient,
    ours: &Gradients,
) -> Result<(&'static str, f64), String> {
    let tolerance = (gradient_tolerance(case), &GRADIENT);
    let errors = agreement::errors(subject(case), upstream, case.gradient, ours, tolerance)?;
    let worst = errors.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(worst.map_or(("none", 0.0), |(group, error)| (group.name, error)))
}
