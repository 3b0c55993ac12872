//! The kernels' gradients against the reference's.

use super::{
    compare::{compare_frames, same_bits, view_of},
    scenes::{Case, Kind, random_case},
    tier,
    tolerance::{GradientTolerance, IMAGE},
};
use softras::{
    Camera, Frame, GradientMode, GradientRequest, Gradients, Image, ImageGradient, Renderer, Scene, Settings,
    scene::Outputs,
};
use softras_check::agreement;
pub use softras_check::agreement::{Group, norm, numbers, relative_error};
use softras_reference::{ReferenceGradients, render_culled};

/// The result of one comparison: each gradient's relative error.
pub type Errors = Vec<(&'static str, f64)>;

pub const ALL_OUTPUTS: Outputs = Outputs::ALL;

/// A case made by hand, without a seed.
pub fn made_case(scene: Scene, cameras: Vec<Camera>, settings: Settings) -> Case {
    Case { seed: 0, kind: Kind::Plain, scene, cameras, settings }
}

/// A random case whose gradient the reference finds in a second: few triangles and pixels.
pub fn small_case(seed: u64, kind: Kind) -> Case {
    let triangles = |case: &Case| case.scene.meshes.iter().map(|mesh| mesh.triangles().len()).max();
    let seeds = (0..).map(|i| seed + 1_000_000 * i).map(|seed| random_case(seed, kind));
    let mut case = seeds.into_iter().find(|case| triangles(case) <= Some(100)).unwrap();
    case.settings.width = case.settings.width.clamp(12, 40);
    case.settings.height = case.settings.height.clamp(12, 40);
    case.settings.save = true;
    case
}

/// A random signed weight for every value of the images, 0 where the model jumps within the kernels' rounding.
pub fn random_upstream(case: &Case, images: Outputs) -> ImageGradient {
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    agreement::random_upstream(case.subject(), case.seed, images, Some(&reference.margin))
}

/// The weights that `weight` gives for an image's name, row and column, the same in every view; the first where an image
/// has one channel.
pub fn upstream_of(case: &Case, weight: impl Fn(&str, usize, usize) -> [f32; 3]) -> ImageGradient {
    let [batch, height, width] = case.subject().shape();
    agreement::upstream_of(Outputs::ALL, [batch, height, width], |name, channels, i| {
        let pixel = i / channels;
        weight(name, pixel / width % height, pixel % width)[i % channels]
    })
}

/// The upstream gradient of one pixel, counted over the batch; zero elsewhere.
pub fn only_pixel(upstream: &ImageGradient, pixel: usize) -> ImageGradient {
    each_image(upstream, |image| {
        let mut data = vec![0.0; image.data.len()];
        let range = pixel * image.channels..(pixel + 1) * image.channels;
        data[range.clone()].copy_from_slice(&image.data[range]);
        Image { data, ..*image }
    })
}

/// The upstream gradient of one view.
pub fn of_view(upstream: &ImageGradient, view: usize) -> ImageGradient {
    each_image(upstream, |image| view_of(image, view))
}

fn each_image(upstream: &ImageGradient, change: impl Fn(&Image) -> Image) -> ImageGradient {
    let one = |image: &Option<Image>| image.as_ref().map(&change);
    ImageGradient {
        color: one(&upstream.color),
        silhouette: one(&upstream.silhouette),
        depth: one(&upstream.depth),
        normal: one(&upstream.normal),
        features: one(&upstream.features),
    }
}

pub fn reference_gradient(case: &Case, upstream: &ImageGradient, mode: GradientMode) -> ReferenceGradients {
    agreement::reference_gradient(case.subject(), upstream, mode).unwrap()
}

/// The gradient modes that the tier looks at.
pub fn modes() -> &'static [GradientMode] {
    tier(&[GradientMode::Exact], &[GradientMode::Exact, GradientMode::Paper])
}

/// A frame and its gradients.
pub type Made = (Frame, Gradients);

/// Renders and goes backward.
///
/// # Errors
/// The renderer's error in words.
pub fn made(
    renderer: &mut Renderer,
    case: &Case,
    upstream: &ImageGradient,
    wanted: &GradientRequest,
) -> Result<Made, String> {
    let settings = Settings { save: true, ..case.settings.clone() };
    let frame = renderer.render(&case.scene, &case.cameras, &settings).map_err(|e| e.to_string())?;
    let gradients = renderer.backward(&frame, upstream, wanted).map_err(|e| e.to_string())?;
    Ok((frame, gradients))
}

/// The gradients alone.
///
/// # Errors
/// As [`made`].
pub fn backward(
    renderer: &mut Renderer,
    case: &Case,
    upstream: &ImageGradient,
    wanted: &GradientRequest,
) -> Result<Gradients, String> {
    made(renderer, case, upstream, wanted).map(|(_, gradients)| gradients)
}

type Numbers = (&'static str, Vec<f64>);

/// The gradients that `some` has, each with what `all` says.
pub fn matching(some: &Gradients, all: &Gradients) -> Vec<(Numbers, Numbers)> {
    let empty = |values: &[f64]| values.iter().all(|&x| x == 0.0);
    let (some, all) = (numbers(some), numbers(all));
    let find = |name: &str, nth: usize| all.iter().filter(|(n, _)| *n == name).nth(nth).cloned();
    let place = |i: usize| some[..i].iter().filter(|(n, _)| *n == some[i].0).count();
    let pairs = (0..some.len()).filter(|&i| !empty(&some[i].1));
    pairs.map(|i| (some[i].clone(), find(some[i].0, place(i)).expect("all has it"))).collect()
}

/// A message that names the number that is farthest off.
pub fn worst_number(group: &Group) -> String {
    let off = |i: usize| (group.ours[i] - group.reference[i]).abs();
    let worst = (0..group.ours.len()).max_by(|&a, &b| off(a).total_cmp(&off(b)));
    worst.map_or(String::new(), |i| {
        let size = norm(&group.reference);
        format!("number {i} is {:e}, should be {:e}, |reference| {size:e}", group.ours[i], group.reference[i])
    })
}

/// Renders, goes backward and compares everything, each gradient within `tolerance.worst`.
///
/// # Errors
/// The gradients that are wrong, and by how much.
pub fn check(
    renderer: &mut Renderer,
    case: &Case,
    upstream: &ImageGradient,
    mode: GradientMode,
    tolerance: &GradientTolerance,
) -> Result<Errors, String> {
    let ours = backward(renderer, case, upstream, &GradientRequest { mode, ..GradientRequest::ALL })?;
    let errors = agreement::errors(case.subject(), upstream, mode, &ours, (tolerance.usual, tolerance))?;
    let wrong: Vec<usize> = (0..errors.len()).filter(|&i| errors[i].1 > tolerance.worst).collect();
    if wrong.is_empty() {
        // A gradient on which nothing depends is 0 in both, and says nothing about accuracy.
        let some = errors.iter().filter(|(group, error)| *error > 0.0 || norm(&group.reference) > 0.0);
        return Ok(some.map(|(group, error)| (group.name, *error)).collect());
    }
    let describe =
        |&i: &usize| format!("{mode:?} {}: {:.1e}, {}", errors[i].0.name, errors[i].1, worst_number(&errors[i].0));
    let mut report: Vec<String> = wrong.iter().map(describe).collect();
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).map_err(|e| e.to_string())?;
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).map_err(|e| e.to_string())?;
    if let Err(error) = compare_frames(&frame, &reference, &IMAGE) {
        report.push(format!("the images are wrong already: {error}"));
    }
    Err(report.join("\n"))
}

/// Images and gradients of the same bits.
///
/// # Errors
/// The first of them that differs.
pub fn same_made_bits(a: &Made, b: &Made) -> Result<(), String> {
    same_bits(&a.0, &b.0).and(same_gradient_bits(&a.1, &b.1))
}

/// Every number the same bits.
///
/// # Errors
/// The first gradient that differs.
pub fn same_gradient_bits(a: &Gradients, b: &Gradients) -> Result<(), String> {
    let (a, b) = (numbers(a), numbers(b));
    if a.len() != b.len() {
        return Err(format!("{} and {} gradients", a.len(), b.len()));
    }
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        let differing = a.iter().zip(b).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        if a.len() != b.len() || differing > 0 {
            return Err(format!("{name}: {differing} of {} and {} numbers differ", a.len(), b.len()));
        }
    }
    Ok(())
}

/// That every number is finite.
///
/// # Errors
/// The first that is not.
pub fn all_finite(gradients: &Gradients) -> Result<(), String> {
    agreement::not_finite(gradients).map_or(Ok(()), Err)
}
