//! The kernels' gradients against the reference's.

use super::{
    blame::blame,
    compare::compare_frames,
    random::Random,
    scenes::{Case, Kind, random_case},
    tolerance::{GradientTolerance, IMAGE},
};
use softras::{
    Camera, GradientMode, Gradients, Image, ImageGradient, Renderer, Scene, Settings, Wanted, scene::Outputs,
};
use softras_lab::gradients;
use softras_reference::{ReferenceGradients, render_culled};
use std::collections::BTreeMap;

/// One gradient of a scene, ours and the reference's.
#[derive(Clone, Debug)]
pub struct Group {
    pub name: &'static str,
    pub ours: Vec<f64>,
    pub reference: Vec<f64>,
}

/// What one comparison found: each gradient's relative error.
pub type Errors = Vec<(&'static str, f64)>;

pub const ALL_OUTPUTS: Outputs = Outputs { color: true, silhouette: true, depth: true, normal: true };

/// A case that no seed has made.
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
pub fn random_upstream(case: &Case, images: Outputs, tolerance: &GradientTolerance) -> ImageGradient {
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    let (batch, height, width) = (reference.batch, reference.height, reference.width);
    let random = &mut Random::new(case.seed ^ 0x5eed);
    let mut weights = |wanted: bool, channels: usize| {
        wanted.then(|| {
            let weight =
                |i: usize, w: f64| if reference.margin[i / channels] < tolerance.margin { 0.0 } else { w as f32 };
            let data = (0..reference.margin.len() * channels).map(|i| weight(i, random.range(-1.0, 1.0))).collect();
            Image { batch, height, width, channels, data }
        })
    };
    ImageGradient {
        color: weights(images.color, 3),
        silhouette: weights(images.silhouette, 1),
        depth: weights(images.depth, 1),
        normal: weights(images.normal, 3),
    }
}

/// The weights that `weight` gives for an image's name, row and column, the same in every view; the first where an image
/// has one channel.
pub fn upstream_of(case: &Case, weight: impl Fn(&str, usize, usize) -> [f32; 3]) -> ImageGradient {
    let (height, width) = (case.settings.height as usize, case.settings.width as usize);
    let batch = case.cameras.len();
    let image = |name: &str, channels: usize| {
        let pixels = (0..batch * height * width).map(|pixel| weight(name, pixel / width % height, pixel % width));
        let data = pixels.flat_map(|w| w.into_iter().take(channels)).collect();
        Some(Image { batch, height, width, channels, data })
    };
    ImageGradient {
        color: image("color", 3),
        silhouette: image("silhouette", 1),
        depth: image("depth", 1),
        normal: image("normal", 3),
    }
}

pub fn reference_gradient(case: &Case, upstream: &ImageGradient, mode: GradientMode) -> ReferenceGradients {
    softras_reference::gradient(&case.scene, &case.cameras, &case.settings, &gradients::upstream(upstream), mode)
        .unwrap()
}

/// Renders and goes backward.
///
/// # Errors
/// What the renderer says.
pub fn backward(
    renderer: &mut Renderer,
    case: &Case,
    upstream: &ImageGradient,
    wanted: &Wanted,
) -> Result<Gradients, String> {
    let settings = softras::Settings { save: true, ..case.settings.clone() };
    let frame = renderer.render(&case.scene, &case.cameras, &settings).map_err(|e| e.to_string())?;
    renderer.backward(&frame, upstream, wanted).map_err(|e| e.to_string())
}

fn flat<const N: usize>(rows: &[[f32; N]]) -> Vec<f64> {
    rows.iter().flatten().map(|&x| f64::from(x)).collect()
}

/// Every number of a result by the gradient it belongs to, a mesh's and a view's by themselves.
pub fn numbers(g: &Gradients) -> Vec<(&'static str, Vec<f64>)> {
    let mut all = Vec::new();
    for mesh in &g.meshes {
        all.push(("positions", flat(&mesh.positions)));
        all.push(("colors", flat(&mesh.colors)));
        all.push(("surface texels", flat(&mesh.surface_texels)));
        all.push(("UVs", flat(&mesh.uvs)));
        mesh.texture_texels.iter().for_each(|t| all.push(("texture texels", flat(t))));
        let alphas = mesh.texture_alphas.iter().map(|alpha| alpha.iter().map(|&a| f64::from(a)).collect());
        all.extend(alphas.map(|alpha| ("texture alpha", alpha)));
    }
    for camera in &g.cameras {
        all.push(("twist", camera.twist.to_vec()));
        all.push(("projection", camera.projection.to_vec()));
    }
    if let Some(lights) = &g.lights {
        all.push(("ambient", [&lights.ambient_color[..], &[lights.ambient_intensity]].concat()));
        for (direction, color, intensity) in &lights.directional {
            all.push(("light direction", direction.to_vec()));
            all.push(("light color", [&color[..], &[*intensity]].concat()));
        }
    }
    all.push(("background", g.background_color.to_vec()));
    all.extend([("epsilon", vec![g.epsilon]), ("sigma", vec![g.sigma]), ("gamma", vec![g.gamma])]);
    all
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

/// The reference's, in the same order and shapes.
pub fn reference_numbers(case: &Case, g: &ReferenceGradients) -> Vec<(&'static str, Vec<f64>)> {
    let mut all = Vec::new();
    for (i, mesh) in case.scene.meshes.iter().enumerate() {
        all.push(("positions", g.positions(i).to_vec()));
        all.push(("colors", g.colors(i).to_vec()));
        all.push(("surface texels", g.surface_texels(i).to_vec()));
        all.push(("UVs", g.uvs(i).to_vec()));
        if let softras::scene::Appearance::Textured { textures, .. } = mesh.appearance() {
            (0..textures.len()).for_each(|t| all.push(("texture texels", g.texture_texels(i, t).to_vec())));
            (0..textures.len()).for_each(|t| all.push(("texture alpha", g.texture_alpha(i, t).to_vec())));
        }
    }
    for i in 0..case.cameras.len() {
        all.push(("twist", g.twist(i).to_vec()));
        let mut projection = g.projection(i).to_vec();
        projection.resize(4, 0.0);
        all.push(("projection", projection));
    }
    all.push(("ambient", [g.ambient_color(), &[g.ambient_intensity()]].concat()));
    for i in 0..case.scene.lights.directional.len() {
        all.push(("light direction", g.light_direction(i).to_vec()));
        all.push(("light color", [g.light_color(i), &[g.light_intensity(i)]].concat()));
    }
    all.push(("background", g.background().to_vec()));
    all.extend([("epsilon", vec![g.epsilon()]), ("sigma", vec![g.sigma()]), ("gamma", vec![g.gamma()])]);
    all
}

/// Both side by side.
///
/// # Errors
/// Where the shapes differ.
pub fn groups(case: &Case, ours: &Gradients, reference: &ReferenceGradients) -> Result<Vec<Group>, String> {
    let (ours, reference) = (numbers(ours), reference_numbers(case, reference));
    let shape = |all: &[(&'static str, Vec<f64>)]| all.iter().map(|(name, v)| (*name, v.len())).collect::<Vec<_>>();
    if shape(&ours) != shape(&reference) {
        return Err(format!("the gradient has {:?}, the reference's {:?}", shape(&ours), shape(&reference)));
    }
    Ok(ours.into_iter().zip(reference).map(|((name, ours), (_, reference))| Group { name, ours, reference }).collect())
}

pub fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// |ours - reference| / max(|reference|, floor), 0 where both are 0.
///
/// # Errors
/// The first number that is not finite.
pub fn relative_error(group: &Group, floor: f64) -> Result<f64, String> {
    let Group { name, ours, reference } = group;
    if ours.len() != reference.len() {
        return Err(format!("{name}: {} numbers, {} of the reference's", ours.len(), reference.len()));
    }
    if let Some(i) = ours.iter().zip(reference).position(|(a, b)| !a.is_finite() || !b.is_finite()) {
        return Err(format!("{name}: number {i} is {}, the reference's {}", ours[i], reference[i]));
    }
    let difference = norm(&ours.iter().zip(reference).map(|(a, b)| a - b).collect::<Vec<_>>());
    let size = norm(reference).max(floor);
    Ok(if difference == 0.0 { 0.0 } else { difference / size })
}

/// The number that is farthest off, for people.
pub fn worst_number(group: &Group) -> String {
    let off = |i: usize| (group.ours[i] - group.reference[i]).abs();
    let worst = (0..group.ours.len()).max_by(|&a, &b| off(a).total_cmp(&off(b)));
    worst.map_or(String::new(), |i| {
        let size = norm(&group.reference);
        format!("number {i} is {:e}, should be {:e}, |reference| {size:e}", group.ours[i], group.reference[i])
    })
}

/// Each gradient's error; the floor of a gradient is `tolerance.floor` of the same gradient's root mean square over other
/// signs of the upstream weights, so that numbers that cancel by chance are not held to their accidental size; and `tolerance.nothing` of the weights.
///
/// # Errors
/// Shapes that differ, a number that is not finite.
pub fn errors(
    case: &Case,
    upstream: &ImageGradient,
    mode: GradientMode,
    ours: &Gradients,
    tolerance: &GradientTolerance,
) -> Result<Vec<(Group, f64)>, String> {
    let reference = reference_gradient(case, upstream, mode);
    let groups = groups(case, ours, &reference)?;
    let strict: Result<Vec<(Group, f64)>, String> =
        groups.into_iter().map(|g| relative_error(&g, 0.0).map(|e| (g, e))).collect();
    let mut strict = strict?;
    if strict.iter().all(|(_, error)| *error <= tolerance.usual) {
        return Ok(strict);
    }
    let usual = usual_sizes(case, upstream, mode);
    let weights = upstream_norm(upstream);
    for ((group, error), size) in strict.iter_mut().zip(usual) {
        *error =
            relative_error(group, (tolerance.floor * size).max(tolerance.nothing * weights * unit(case, group.name)))?;
    }
    Ok(strict)
}

/// What a gradient is of, when all of an image changes by as much as it may: the size that rounding has to be seen
/// against. log weights are ζ / γ, distances are in units of √σ.
fn unit(case: &Case, name: &str) -> f64 {
    let s = &case.settings;
    let deepest = if s.outputs.depth { s.far.min(10.0) } else { 1.0 };
    let positions = 1.0 / ((s.far - s.near) * s.gamma) + 1.0 / s.sigma.sqrt();
    // View space is as large as its matrix makes it.
    let matrix = case.cameras.iter().flat_map(|c| c.view().as_flattened()).fold(1.0, |m: f64, x| m.max(x.abs()));
    deepest
        * match name {
            "positions" => positions,
            "twist" | "projection" => positions * matrix,
            "sigma" => 1.0 / s.sigma,
            "gamma" | "epsilon" => 1.0 / s.gamma,
            _ => 1e-6,
        }
}

/// The norm of all weights together.
pub fn upstream_norm(upstream: &ImageGradient) -> f64 {
    let images = [&upstream.color, &upstream.silhouette, &upstream.depth, &upstream.normal];
    let squares = images.into_iter().flatten().flat_map(|image| &image.data).map(|&x| f64::from(x).powi(2));
    squares.sum::<f64>().sqrt()
}

/// The root mean square of each gradient's norm over random signs of the pixels' weights.
fn usual_sizes(case: &Case, upstream: &ImageGradient, mode: GradientMode) -> Vec<f64> {
    const SIGNS: usize = 4;
    let mut squares: Vec<f64> = Vec::new();
    for round in 0..SIGNS {
        let flipped = with_random_signs(upstream, round as u64);
        let gradient = reference_numbers(case, &reference_gradient(case, &flipped, mode));
        squares.resize(gradient.len(), 0.0);
        for (sum, (_, values)) in squares.iter_mut().zip(&gradient) {
            *sum += norm(values).powi(2) / SIGNS as f64;
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}

pub fn with_random_signs(upstream: &ImageGradient, seed: u64) -> ImageGradient {
    let random = &mut Random::new(seed);
    let mut flipped = upstream.clone();
    let images = [&mut flipped.color, &mut flipped.silhouette, &mut flipped.depth, &mut flipped.normal];
    for image in images.into_iter().flatten() {
        image.data.iter_mut().filter(|_| random.chance(0.5)).for_each(|x| *x = -*x);
    }
    flipped
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
    let ours = backward(renderer, case, upstream, &Wanted { mode, ..Wanted::ALL })?;
    let errors = errors(case, upstream, mode, &ours, tolerance)?;
    let wrong: Vec<usize> = (0..errors.len()).filter(|&i| errors[i].1 > tolerance.worst).collect();
    if wrong.is_empty() {
        // What nothing depends on is 0 in both, and says nothing.
        let some = errors.iter().filter(|(group, error)| *error > 0.0 || norm(&group.reference) > 0.0);
        return Ok(some.map(|(group, error)| (group.name, *error)).collect());
    }
    let describe =
        |&i: &usize| format!("{mode:?} {}: {:.1e}, {}", errors[i].0.name, errors[i].1, worst_number(&errors[i].0));
    let mut report: Vec<String> = wrong.iter().map(describe).collect();
    report.push(blame(renderer, case, upstream, mode, wrong[0]));
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).map_err(|e| e.to_string())?;
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).map_err(|e| e.to_string())?;
    if let Err(error) = compare_frames(&frame, &reference, &IMAGE) {
        report.push(format!("the images are wrong already: {error}"));
    }
    Err(report.join("\n"))
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
    for (name, values) in numbers(gradients) {
        if let Some(i) = values.iter().position(|x| !x.is_finite()) {
            return Err(format!("{name}: number {i} is {}", values[i]));
        }
    }
    Ok(())
}

/// Errors of many scenes by mode and gradient.
#[derive(Default)]
pub struct Table(BTreeMap<(String, &'static str), Vec<(f64, u64)>>);

impl Table {
    pub fn add(&mut self, mode: GradientMode, seed: u64, errors: &Errors) {
        let mut worst: BTreeMap<&'static str, f64> = BTreeMap::new();
        for &(name, error) in errors {
            let entry = worst.entry(name).or_default();
            *entry = entry.max(error);
        }
        for (name, error) in worst {
            self.0.entry((format!("{mode:?}"), name)).or_default().push((error, seed));
        }
    }

    /// That all but `tolerance.share` of the scenes are within `usual` in each gradient, and all within `worst`.
    ///
    /// # Errors
    /// The gradients of which this is not so.
    pub fn verdict(&self, tolerance: &GradientTolerance) -> Result<(), String> {
        let mut wrong = Vec::new();
        for ((mode, name), errors) in &self.0 {
            let beyond: Vec<_> = errors.iter().filter(|(e, _)| *e > tolerance.usual).collect();
            let most = (errors.len() as f64 * tolerance.share).ceil() as usize;
            if beyond.len() > most || beyond.iter().any(|(e, _)| *e > tolerance.worst) {
                wrong.push(format!(
                    "{mode} {name}: {} of {} scenes, (error, seed) {beyond:?}",
                    beyond.len(),
                    errors.len()
                ));
            }
        }
        if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        for ((mode, name), errors) in &self.0 {
            let mut sorted = errors.clone();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize].0;
            let (worst, seed) = sorted[sorted.len() - 1];
            let (median, high, count) = (at(0.5), at(0.99), sorted.len());
            writeln!(
                f,
                "{mode} {name:16} {count:4} median {median:.1e}, 99% {high:.1e}, worst {worst:.1e} (seed {seed})"
            )?;
        }
        Ok(())
    }
}
