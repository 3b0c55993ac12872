//! How far a device's images and gradients are from the reference's, and how far gradients may be.

use crate::gradients;
use crate::random::Random;
use softras::scene::{Appearance, Background, Outputs};
use softras::{Camera, GradientMode, Gradients, Image, ImageGradient, Scene, Settings};
use softras_reference::ReferenceGradients;

/// How far a gradient may be from the reference's, as a share of its L2 norm.
#[derive(Clone, Copy, Debug)]
pub struct GradientTolerance {
    /// In all scenes but the share `share`.
    pub usual: f64,
    /// In the others.
    pub worst: f64,
    /// The largest share of scenes with an error above `usual`.
    pub share: f64,
    /// Pixels with a smaller margin have no upstream gradient: there the model jumps within the kernels' rounding.
    pub margin: f64,
    /// A gradient that is smaller than this share of its usual size, over random signs of the upstream weights, has
    /// cancelled by chance and is held to that share of the usual size.
    pub floor: f64,
    /// The divisor of an error is at least this share of the upstream weights, in the gradient's natural unit: a gradient from
    /// differences of nearly equal colours is no more accurate than f32 colours, whose errors are 1e-7.
    pub nothing: f64,
}

/// The main promise of backward. At sigma 1e-6 the soft edge is 1e-3 wide and screen positions in f32 are off by 6e-8, so that
/// no better relative error than about 1e-4 is possible.
pub const GRADIENT: GradientTolerance =
    GradientTolerance { usual: 1e-4, worst: 1e-3, share: 0.01, margin: 1e-3, floor: 0.1, nothing: 1e-3 };

impl GradientTolerance {
    /// For scenes that are built and not random: all of them must be within `usual`.
    pub fn without_exceptions(self) -> Self {
        Self { worst: self.usual, ..self }
    }
}

/// Pixels with a smaller [`ReferenceFrame::margin`](softras_reference::ReferenceFrame::margin) are not compared: within the
/// kernels' rounding the model is discontinuous there.
pub const IMAGE_MARGIN: f64 = 1e-4;

/// The index of every value of an image whose pixel counts, and how far it is from what is expected: infinitely far where it is
/// a NaN, and once where the image has another size.
pub fn differences<'a>(
    image: &'a Image,
    expected: &'a [f64],
    counts: impl Fn(usize) -> bool + 'a,
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let fits = image.data.len() == expected.len();
    let pairs = image.data.iter().zip(expected).enumerate().filter(move |(i, _)| fits && counts(i / image.channels));
    let far = |(i, (&ours, expected)): (usize, (&f32, &f64))| {
        let difference = (f64::from(ours) - expected).abs();
        (i, if difference.is_nan() { f64::INFINITY } else { difference })
    };
    (!fits).then_some((0, f64::INFINITY)).into_iter().chain(pairs.map(far))
}

/// The inputs of a frame that was rendered and differentiated.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// The meshes and lights.
    pub scene: &'a Scene,
    /// One camera a view.
    pub cameras: &'a [Camera],
    /// The settings.
    pub settings: &'a Settings,
}

impl Subject<'_> {
    /// Batch, height and width of its images.
    pub fn shape(&self) -> [usize; 3] {
        [self.cameras.len(), self.settings.height as usize, self.settings.width as usize]
    }
}

/// One gradient of a scene, ours and the reference's.
#[derive(Clone, Debug)]
pub struct Group {
    /// The input that it is a gradient by.
    pub name: &'static str,
    /// The device's numbers.
    pub ours: Vec<f64>,
    /// The reference's.
    pub reference: Vec<f64>,
}

/// The reference's gradient.
///
/// # Errors
/// As [`softras_reference::gradient`].
pub fn reference_gradient(
    of: Subject<'_>,
    upstream: &ImageGradient,
    mode: GradientMode,
) -> softras::Result<ReferenceGradients> {
    softras_reference::gradient(of.scene, of.cameras, of.settings, &gradients::upstream(upstream), mode)
}

/// An upstream gradient of `images`, of [batch, height, width] pixels, whose weights are given by an image's name, its channels
/// and the index of a value.
pub fn upstream_of(
    images: Outputs,
    [batch, height, width]: [usize; 3],
    mut weight: impl FnMut(&'static str, usize, usize) -> f32,
) -> ImageGradient {
    let mut image = |wanted: bool, name, channels: usize| {
        let mut data = || (0..batch * height * width * channels).map(|i| weight(name, channels, i)).collect();
        wanted.then(|| Image { batch, height, width, channels, data: data() })
    };
    ImageGradient {
        color: image(images.color, "color", 3),
        silhouette: image(images.silhouette, "silhouette", 1),
        depth: image(images.depth, "depth", 1),
        normal: image(images.normal, "normal", 3),
        features: None,
    }
}

/// A random weight in [-1, 1) for every value of `images`, 0 where the margin is below [`GradientTolerance::margin`] of
/// [`GRADIENT`].
pub fn random_upstream(of: Subject<'_>, seed: u64, images: Outputs, margin: Option<&[f64]>) -> ImageGradient {
    let random = &mut Random::new(seed ^ 0x5eed);
    let jumps = |pixel: usize| margin.is_some_and(|m| m.get(pixel).is_none_or(|m| *m < GRADIENT.margin));
    upstream_of(images, of.shape(), |_, channels, i| {
        let weight = random.range(-1.0, 1.0) as f32;
        if jumps(i / channels) { 0.0 } else { weight }
    })
}

fn flat<const N: usize>(rows: &[[f32; N]]) -> Vec<f64> {
    rows.iter().flatten().map(|&x| f64::from(x)).collect()
}

/// Numbers by the gradient that they belong to, a mesh's and a view's by themselves.
pub type Numbers = Vec<(&'static str, Vec<f64>)>;

/// Every number of a result.
pub fn numbers(g: &Gradients) -> Numbers {
    let mut all = Vec::new();
    for mesh in &g.meshes {
        all.push(("positions", flat(&mesh.positions)));
        all.push(("colors", flat(&mesh.colors)));
        all.push(("features", mesh.features.iter().map(|&x| f64::from(x)).collect()));
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

/// Names the first number of a gradient that is not finite.
pub fn not_finite(gradients: &Gradients) -> Option<String> {
    numbers(gradients).into_iter().find_map(|(name, values)| {
        let i = values.iter().position(|x| !x.is_finite())?;
        Some(format!("{name}: number {i} is {}", values[i]))
    })
}

/// The reference's numbers, in the same order and shapes.
pub fn reference_numbers(of: Subject<'_>, g: &ReferenceGradients) -> Numbers {
    let mut all = Vec::new();
    for (i, mesh) in of.scene.meshes.iter().enumerate() {
        all.push(("positions", g.positions(i).to_vec()));
        all.push(("colors", g.colors(i).to_vec()));
        all.push(("features", Vec::new()));
        all.push(("surface texels", g.surface_texels(i).to_vec()));
        all.push(("UVs", g.uvs(i).to_vec()));
        if let Appearance::Textured { textures, .. } = mesh.appearance() {
            (0..textures.len()).for_each(|t| all.push(("texture texels", g.texture_texels(i, t).to_vec())));
            (0..textures.len()).for_each(|t| all.push(("texture alpha", g.texture_alpha(i, t).to_vec())));
        }
    }
    for i in 0..of.cameras.len() {
        all.push(("twist", g.twist(i).to_vec()));
        let mut projection = g.projection(i).to_vec();
        projection.resize(4, 0.0);
        all.push(("projection", projection));
    }
    all.push(("ambient", [g.ambient_color(), &[g.ambient_intensity()]].concat()));
    for i in 0..of.scene.lights.directional.len() {
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
pub fn groups(of: Subject<'_>, ours: &Gradients, reference: &ReferenceGradients) -> Result<Vec<Group>, String> {
    let (ours, reference) = (numbers(ours), reference_numbers(of, reference));
    let shape = |all: &Numbers| all.iter().map(|(name, v)| (*name, v.len())).collect::<Vec<_>>();
    if shape(&ours) != shape(&reference) {
        return Err(format!("the gradient has {:?}, the reference's {:?}", shape(&ours), shape(&reference)));
    }
    Ok(ours.into_iter().zip(reference).map(|((name, ours), (_, reference))| Group { name, ours, reference }).collect())
}

/// The L2 norm.
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

/// Each gradient's error. Where one is above `usual`, the divisors have a floor: [`GradientTolerance::floor`] of the same
/// gradient's root mean square over other signs of the upstream weights, so that numbers that cancel by chance are not held to
/// their accidental size; and [`GradientTolerance::nothing`] of the weights.
///
/// # Errors
/// Shapes that differ, a number that is not finite, and those of [`softras_reference::gradient`].
pub fn errors(
    of: Subject<'_>,
    upstream: &ImageGradient,
    mode: GradientMode,
    ours: &Gradients,
    (usual, tolerance): (f64, &GradientTolerance),
) -> Result<Vec<(Group, f64)>, String> {
    let reference = |upstream: &ImageGradient| reference_gradient(of, upstream, mode).map_err(|e| e.to_string());
    let with_error = |group: Group| relative_error(&group, 0.0).map(|error| (group, error));
    let groups = groups(of, ours, &reference(upstream)?)?;
    let mut found = groups.into_iter().map(with_error).collect::<Result<Vec<_>, String>>()?;
    if found.iter().all(|(_, error)| *error <= usual) {
        return Ok(found);
    }
    let mut squares = vec![0.0; found.len()];
    for round in 0..SIGNS {
        let other = reference_numbers(of, &reference(&with_random_signs(upstream, round))?);
        squares.iter_mut().zip(&other).for_each(|(sum, (_, values))| *sum += norm(values).powi(2) / SIGNS as f64);
    }
    let weights = upstream_norm(upstream);
    for ((group, error), square) in found.iter_mut().zip(squares) {
        let least = tolerance.nothing * unit(of, group.name) + composited(of, group.name) / tolerance.worst;
        *error = relative_error(group, (tolerance.floor * square.sqrt()).max(weights * least))?;
    }
    Ok(found)
}

/// Random signs of the upstream weights, over which a gradient's usual size is taken.
const SIGNS: u64 = 4;

/// The natural unit of a gradient: its size where images change as fast as the model can make them. Rounding errors are compared
/// with it. Log weights are ζ / γ, and distances are in units of √σ.
pub fn unit(of: Subject<'_>, name: &str) -> f64 {
    let s = of.settings;
    let deepest = if s.outputs.depth { s.far.min(10.0) } else { 1.0 };
    let positions = 1.0 / ((s.far - s.near) * s.gamma) + 1.0 / s.sigma.sqrt();
    // View space is as large as its matrix makes it.
    let matrix = of.cameras.iter().flat_map(|c| c.view().as_flattened()).fold(1.0, |m: f64, x| m.max(x.abs()));
    deepest
        * match name {
            "positions" => positions,
            "twist" | "projection" => positions * matrix,
            "sigma" => 1.0 / s.sigma,
            "gamma" | "epsilon" => 1.0 / s.gamma,
            _ => 1e-6,
        }
}

/// The error of a gradient by colours over a composite background, as a share of the weights. Colours are multiplied by
/// A = 1 - Π(1 - D), whose absolute error in single precision is the last bit of 1.
fn composited(of: Subject<'_>, name: &str) -> f64 {
    let colors = matches!(name, "colors" | "surface texels" | "texture texels");
    let composited = of.settings.background == Background::Composite && of.settings.outputs.color;
    if colors && composited { f64::from(f32::EPSILON) / 2.0 } else { 0.0 }
}

/// The norm of all weights together.
pub fn upstream_norm(upstream: &ImageGradient) -> f64 {
    let images = [&upstream.color, &upstream.silhouette, &upstream.depth, &upstream.normal, &upstream.features];
    let squares = images.into_iter().flatten().flat_map(|image| &image.data).map(|&x| f64::from(x).powi(2));
    squares.sum::<f64>().sqrt()
}

/// The weights with the signs of a half of them turned.
fn with_random_signs(upstream: &ImageGradient, seed: u64) -> ImageGradient {
    let random = &mut Random::new(seed);
    let mut flipped = upstream.clone();
    let images = [&mut flipped.color, &mut flipped.silhouette, &mut flipped.depth, &mut flipped.normal];
    for image in images.into_iter().flatten() {
        image.data.iter_mut().filter(|_| random.chance(0.5)).for_each(|x| *x = -*x);
    }
    flipped
}
