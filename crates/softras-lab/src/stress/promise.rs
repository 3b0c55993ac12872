//! What is promised of a case, and how its error is measured.
//!
//! Every case has values in range and the same bits in a second run. Accuracy is promised where positions are a few units
//! and lie between near and far, and γ (far - near) ≥ 1e-4 world units. There, images are within 2e-5 of the f64 model for
//! σ ≥ 1e-5. For smaller σ the tolerance grows by √(1e-5/σ), and for a wide image by width / height. The silhouette keeps
//! this promise for thin triangles too; colour, depth and normals keep it only where no triangle is thin, because
//! barycentrics are distances divided by heights. Gradients are within 1e-3 of their norm, times √(1e-5/σ). Over a
//! composite background, gradients by colours are within 6e-8 of the norm of the upstream weights where that is more: it is
//! the last bit of a silhouette.

use super::draw::Case;
use crate::gradients;
use crate::random::Random;
use softras::scene::{Appearance, Background, Outputs, Settings};
use softras::{Frame, Gradients, Image, ImageGradient, Result};
use softras_reference::{ReferenceFrame, ReferenceGradients, gradient, render_culled};

/// What is promised of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// Values are in range and a second run gives the same bits; promised of every case.
    Bounds,
    /// The silhouette's error is bounded too.
    Silhouette,
    /// The error of every image is bounded too.
    Images,
    /// The error of every gradient is bounded too.
    Gradients,
}

/// Pixels with a smaller [`ReferenceFrame::margin`] do not count: within the kernels' rounding the model is discontinuous
/// there.
const MARGIN: f64 = 1e-4;
/// The same for gradients.
const GRADIENT_MARGIN: f64 = 1e-3;
/// The tolerance of a gradient, as a share of its L2 norm, for σ ≥ 1e-5.
const GRADIENT: f64 = 1e-3;

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
    GRADIENT * sharpness(case)
}

/// The largest error of an image, in units of max(1, |value|).
fn worst(image: Option<&Image>, expected: &[f64], margin: &[f64]) -> f64 {
    worst_in(image, expected, margin, |_| 1.0)
}

/// The largest error of an image, in units of max(`unit` of the value's index, |value|).
fn worst_in(image: Option<&Image>, expected: &[f64], margin: &[f64], unit: impl Fn(usize) -> f64) -> f64 {
    let Some(image) = image else { return 0.0 };
    if image.data.len() != expected.len() {
        return f64::INFINITY;
    }
    let pairs = image.data.iter().zip(expected).enumerate();
    let counted = pairs.filter(|(i, _)| margin.get(i / image.channels).is_some_and(|m| *m >= MARGIN));
    counted.fold(0.0, |worst, (i, (&is, should))| {
        let error = (f64::from(is) - should).abs() / should.abs().max(unit(i));
        if error.is_nan() { f64::INFINITY } else { error.max(worst) }
    })
}

/// The largest error of the silhouette, and the largest error of any image.
pub(super) fn errors(frame: &Frame, reference: &ReferenceFrame, settings: &Settings) -> [f64; 2] {
    let silhouette = worst(frame.silhouette(), &reference.silhouette, &reference.margin);
    let others = [(frame.color(), &reference.color), (frame.normal(), &reference.normal)];
    let all = others.map(|(image, expected)| worst(image, expected, &reference.margin));
    // Over a composite background, a depth is the silhouette times the depth that is seen; the latter is the unit.
    let shown = |i: usize| match settings.background {
        Background::Composite => reference.depth[i] / reference.silhouette.get(i).copied().unwrap_or(1.0).max(1e-6),
        Background::Weighted => 1.0,
    };
    let depth = worst_in(frame.depth(), &reference.depth, &reference.margin, |i| shown(i).max(1.0));
    [silhouette, all.into_iter().fold(silhouette.max(depth), f64::max)]
}

/// The largest error of any image of a frame against the reference, in units of max(1, |value|).
///
/// # Errors
/// As [`softras_reference::render`].
pub fn image_error(frame: &Frame, case: &Case) -> Result<f64> {
    Ok(errors(frame, &render_culled(&case.scene, &case.cameras, &case.settings)?, &case.settings)[1])
}

/// A random weight in [-1, 1) for every value of the images, 0 where the margin is too small.
pub(super) fn upstream(case: &Case, margin: Option<&[f64]>) -> ImageGradient {
    let (height, width) = (case.settings.height as usize, case.settings.width as usize);
    let random = &mut Random::new(case.seed ^ 0x5eed);
    let jumps = |pixel: usize| margin.is_some_and(|m| m.get(pixel).is_none_or(|m| *m < GRADIENT_MARGIN));
    let mut image = |wanted: bool, channels: usize| {
        wanted.then(|| {
            let values = (0..height * width * channels).map(|i| (i / channels, random.range(-1.0, 1.0) as f32));
            let data = values.map(|(pixel, weight)| if jumps(pixel) { 0.0 } else { weight }).collect();
            Image { batch: 1, height, width, channels, data }
        })
    };
    let Outputs { color, silhouette, depth, normal } = case.settings.outputs;
    ImageGradient {
        color: image(color, 3),
        silhouette: image(silhouette, 1),
        depth: image(depth, 1),
        normal: image(normal, 3),
    }
}

/// The [`upstream`] weights of several cases as one batch.
pub(super) fn upstream_of(cases: &[Case]) -> ImageGradient {
    let mut all = cases.iter().map(|case| upstream(case, None));
    let mut sum = all.next().unwrap_or_default();
    for next in all {
        let ImageGradient { color, silhouette, depth, normal } = next;
        append(&mut sum.color, color);
        append(&mut sum.silhouette, silhouette);
        append(&mut sum.depth, depth);
        append(&mut sum.normal, normal);
    }
    sum
}

fn append(to: &mut Option<Image>, image: Option<Image>) {
    if let (Some(to), Some(image)) = (to, image) {
        to.batch += image.batch;
        to.data.extend(image.data);
    }
}

/// The worst gradient's name and its error |ours - reference| / |reference|. The divisor has a floor: a tenth of the usual
/// norm of that gradient over other signs of the weights, for gradients that cancel by chance, and a thousandth of the
/// weights in the gradient's unit, for gradients that vanish.
///
/// # Errors
/// As [`softras_reference::gradient`].
pub(super) fn gradient_error(case: &Case, upstream: &ImageGradient, ours: &Gradients) -> Result<(&'static str, f64)> {
    let reference = reference_gradient(case, upstream)?;
    let groups = groups(case, ours, &reference);
    let strict = groups.iter().map(|(name, ours, reference)| (*name, relative(ours, reference, 0.0)));
    let worst = most(strict);
    if worst.1 <= gradient_tolerance(case) {
        return Ok(worst);
    }
    let mut usual = vec![0.0; groups.len()];
    for round in 0..4 {
        let other = groups_of(case, &reference_gradient(case, &with_signs(upstream, round))?);
        usual.iter_mut().zip(&other).for_each(|(sum, (_, values))| *sum += norm(values).powi(2) / 4.0);
    }
    let weights = norm(&flat(upstream));
    let floors = groups.iter().zip(usual).map(|(g, usual)| (0.1 * usual.sqrt()).max(least(case, g.0, weights)));
    Ok(most(
        groups.iter().zip(floors).map(|((name, ours, reference), floor)| (*name, relative(ours, reference, floor))),
    ))
}

fn most(errors: impl Iterator<Item = (&'static str, f64)>) -> (&'static str, f64) {
    errors.fold(("none", 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a })
}

fn reference_gradient(case: &Case, upstream: &ImageGradient) -> Result<ReferenceGradients> {
    gradient(&case.scene, &case.cameras, &case.settings, &gradients::upstream(upstream), case.gradient)
}

type Values = (&'static str, Vec<f64>);

fn groups_of(case: &Case, reference: &ReferenceGradients) -> Vec<Values> {
    let texels = match case.scene.meshes[0].appearance() {
        Appearance::Textured { .. } => reference.texture_texels(0, 0),
        _ => reference.surface_texels(0),
    };
    vec![
        ("positions", reference.positions(0).to_vec()),
        ("colors", reference.colors(0).to_vec()),
        ("texels", texels.to_vec()),
        ("UVs", reference.uvs(0).to_vec()),
        ("twist", reference.twist(0).to_vec()),
        ("background", reference.background().to_vec()),
        ("sigma", vec![reference.sigma()]),
        ("gamma", vec![reference.gamma()]),
        ("epsilon", vec![reference.epsilon()]),
    ]
}

fn groups(case: &Case, ours: &Gradients, reference: &ReferenceGradients) -> Vec<(&'static str, Vec<f64>, Vec<f64>)> {
    let wide = |values: &[f32]| values.iter().map(|&x| f64::from(x)).collect::<Vec<f64>>();
    let mesh = ours.meshes.first().cloned().unwrap_or_default();
    let texels = mesh.texture_texels.first().unwrap_or(&mesh.surface_texels);
    let ours = [
        wide(mesh.positions.as_flattened()),
        wide(mesh.colors.as_flattened()),
        wide(texels.as_flattened()),
        wide(mesh.uvs.as_flattened()),
        ours.cameras.first().map_or_else(Vec::new, |c| c.twist.to_vec()),
        ours.background_color.to_vec(),
        vec![ours.sigma],
        vec![ours.gamma],
        vec![ours.epsilon],
    ];
    groups_of(case, reference).into_iter().zip(ours).map(|((name, reference), ours)| (name, ours, reference)).collect()
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn relative(ours: &[f64], reference: &[f64], floor: f64) -> f64 {
    if ours.len() != reference.len() {
        return f64::INFINITY;
    }
    let difference = norm(&ours.iter().zip(reference).map(|(a, b)| a - b).collect::<Vec<_>>());
    if difference == 0.0 { 0.0 } else { difference / norm(reference).max(floor) }
}

/// The floor of the divisor of a gradient's error, for upstream weights of the given norm.
fn least(case: &Case, name: &str, weights: f64) -> f64 {
    let nothing = 1e-3 * weights * unit(case, name);
    let composited = case.settings.background == Background::Composite && case.settings.outputs.color;
    // Over a composite background, colours are multiplied by A = 1 - Π(1 - D), whose absolute error in single precision is
    // the last bit of 1.
    if composited && matches!(name, "colors" | "texels") {
        nothing.max(weights * f64::from(f32::EPSILON) / 2.0 / GRADIENT)
    } else {
        nothing
    }
}

/// The size of a gradient when an image changes by its whole range: log weights are ζ / γ, and distances are in units of
/// √σ.
fn unit(case: &Case, name: &str) -> f64 {
    let s = &case.settings;
    let deepest = if s.outputs.depth { s.far.min(10.0) } else { 1.0 };
    deepest
        * match name {
            "positions" | "twist" => 1.0 / ((s.far - s.near) * s.gamma) + 1.0 / s.sigma.sqrt(),
            "sigma" => 1.0 / s.sigma,
            "gamma" | "epsilon" => 1.0 / s.gamma,
            _ => 1e-6,
        }
}

fn flat(upstream: &ImageGradient) -> Vec<f64> {
    let images = [&upstream.color, &upstream.silhouette, &upstream.depth, &upstream.normal];
    images.into_iter().flatten().flat_map(|image| &image.data).map(|&x| f64::from(x)).collect()
}

fn with_signs(upstream: &ImageGradient, seed: u64) -> ImageGradient {
    let random = &mut Random::new(seed);
    let mut flipped = upstream.clone();
    let images = [&mut flipped.color, &mut flipped.silhouette, &mut flipped.depth, &mut flipped.normal];
    for image in images.into_iter().flatten() {
        image.data.iter_mut().filter(|_| random.chance(0.5)).for_each(|x| *x = -*x);
    }
    flipped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_values_are_far_off() {
        let image = |data: Vec<f32>| Image { batch: 1, height: 1, width: data.len(), channels: 1, data };
        assert_eq!(worst(Some(&image(vec![0.5, 0.25])), &[0.5, 0.75], &[1.0; 2]), 0.5);
        assert_eq!(worst(Some(&image(vec![0.5, 0.25])), &[0.5, 0.75], &[1.0, 1e-6]), 0.0);
        assert_eq!(worst_in(Some(&image(vec![0.5, 0.25])), &[0.5, 0.75], &[1.0; 2], |i| 2.0 * i as f64), 0.25);
        assert_eq!(worst(Some(&image(vec![f32::NAN])), &[0.5], &[1.0]), f64::INFINITY);
        assert_eq!(worst(Some(&image(vec![0.5])), &[], &[1.0]), f64::INFINITY);
        assert_eq!(relative(&[1.0, 0.0], &[0.0, 1.0], 0.0), 2f64.sqrt());
        assert_eq!(relative(&[1.0], &[], 0.0), f64::INFINITY);
        assert_eq!(most([("a", 1.0), ("b", 2.0)].into_iter()), ("b", 2.0));
    }
}
