//! Official parity: the f64 reference and the kernels against the official renderer's equations, which
//! `tests/official` recomputes without any code of `src`, in every mode that the official renderer has.
//!
//! `cargo test --test parity` compares those equations, the reference and the kernels with recorded outputs of the official
//! kernels where these are at hand.

use crate::common::{
    compare::compare,
    random::Random,
    renderer, tier,
    tolerance::{GRADIENT, IMAGE, Tolerance},
};
use crate::official::{
    equations::{self, Triangles},
    scenes::{Mode, every_mode, mesh, random_triangles},
};
use softras::scene::{Camera, ColorAggregation, Distance, Scene, Settings, SilhouetteAggregation};
use softras::{GradientRequest, Image, ImageGradient};
use softras_reference::{GradientMode, Upstream, gradient, render_culled};

const SIZE: [u32; 2] = [20, 16];

/// The reference's f64 against other f64: some hundred roundings of numbers around 1, times 1 / γ and 1 / σ.
const SAME_EQUATIONS: f64 = 1e-10;

/// Random weights of the images' values, 0 at pixels where the model jumps or the official renderer is undecided.
struct Weights {
    color: Vec<f64>,
    silhouette: Vec<f64>,
}

/// A scene in a mode, with the official answer.
struct Case {
    mode: Mode,
    triangles: Triangles,
    scene: Scene,
    settings: Settings,
    expected: equations::Image,
    /// The reference's distance to jumps of the model; 0 where the official renderer is undecided.
    margin: Vec<f64>,
    weights: Weights,
    expected_gradient: equations::Gradient,
}

impl Case {
    fn new(seed: u64, mode: Mode, settings: Settings) -> Self {
        let triangles = random_triangles(seed, 10, mode.resolution);
        let scene = Scene::new(mesh(&triangles));
        let expected = equations::image(&triangles, &settings);
        let mut margin = render_culled(&scene, &[Camera::screen()], &settings).unwrap().margin;
        margin.iter_mut().zip(&expected.undecided).filter(|(_, undecided)| **undecided).for_each(|(m, _)| *m = 0.0);
        let random = &mut Random::new(seed);
        let mut weight = |pixel: usize| if margin[pixel] < GRADIENT.margin { 0.0 } else { random.range(-1.0, 1.0) };
        // As f32 has them, so that the kernels get the same.
        let color: Vec<f64> = (0..3 * margin.len()).map(|i| f64::from(weight(i / 3) as f32)).collect();
        let silhouette: Vec<f64> = (0..margin.len()).map(|i| f64::from(weight(i) as f32)).collect();
        let expected_gradient = equations::gradient(&triangles, &settings, &color, &silhouette);
        let weights = Weights { color, silhouette };
        Self { mode, triangles, scene, settings, expected, margin, weights, expected_gradient }
    }
}

/// The largest |a - b| of the pixels that are decided; infinite for different lengths and what is not a number.
fn worst(a: &[f64], b: &[f64], channels: usize, undecided: &[bool]) -> f64 {
    if a.len() != b.len() || a.len() != channels * undecided.len() {
        return f64::INFINITY;
    }
    let differences = (0..a.len()).filter(|i| !undecided[i / channels]).map(|i| (a[i] - b[i]).abs());
    differences.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// |a - b| / |b|, or |a - b| where b is nearly 0; infinite for different lengths and what is not a number.
fn relative(a: &[f64], b: &[f64]) -> f64 {
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let difference = norm(&mut a.iter().zip(b).map(|(a, b)| a - b));
    let size = norm(&mut b.iter().copied());
    match (a.len() == b.len() && difference.is_finite(), size < 1e-12) {
        (false, _) => f64::INFINITY,
        (true, true) => difference,
        (true, false) => difference / size,
    }
}

/// x and y of each corner, and z.
fn axes(corners: &[f64]) -> [Vec<f64>; 2] {
    let of = |wanted: &[usize]| corners.chunks(3).flat_map(|c| wanted.iter().map(|&k| c[k])).collect();
    [of(&[0, 1]), of(&[2])]
}

/// The relative errors of a gradient by x and y, by z and by the colours.
fn gradient_errors(corners: &[f64], colors: &[f64], expected: &equations::Gradient) -> [f64; 3] {
    let [xy, z] = axes(corners);
    let [expected_xy, expected_z] = axes(expected.corners.as_flattened().as_flattened());
    [relative(&xy, &expected_xy), relative(&z, &expected_z), relative(colors, expected.colors.as_flattened())]
}

#[test]
fn comparisons_with_the_equations_see_wrong_answers() {
    assert_eq!(worst(&[1.0, 2.0], &[1.0, 2.5], 1, &[false, false]), 0.5);
    assert_eq!(worst(&[1.0, 2.0], &[1.0, 2.5], 1, &[false, true]), 0.0);
    assert_eq!(worst(&[1.0], &[1.0, 2.0], 1, &[false]), f64::INFINITY);
    assert_eq!(worst(&[f64::NAN], &[1.0], 1, &[false]), f64::INFINITY);
    assert_eq!((relative(&[2.0], &[1.0]), relative(&[1e-3], &[0.0])), (1.0, 1e-3));
    assert_eq!((relative(&[f64::NAN], &[1.0]), relative(&[1.0], &[])), (f64::INFINITY, f64::INFINITY));
    let case = Case::new(1, every_mode()[0], every_mode()[0].settings(SIZE[0], SIZE[1]));
    let right = case.expected_gradient.corners.as_flattened().as_flattened();
    let colors = case.expected_gradient.colors.as_flattened();
    assert_eq!(gradient_errors(right, colors, &case.expected_gradient), [0.0; 3]);
    let mut wrong = right.to_vec();
    wrong.chunks_mut(3).for_each(|c| c[2] *= 1.01);
    let [xy, z, _] = gradient_errors(&wrong, colors, &case.expected_gradient);
    assert!(xy == 0.0 && (z - 0.01).abs() < 1e-9);
}

/// The written-out derivatives are those of the equations' own image where the official code drops no path: the colours',
/// and the silhouette's by x and y.
#[test]
fn the_equations_gradient_is_that_of_their_image() {
    for mode in every_mode().into_iter().filter(|mode| mode.silhouette != SilhouetteAggregation::Hard && !mode.narrow) {
        let case = Case::new(5, mode, mode.settings(SIZE[0], SIZE[1]));
        let none = vec![0.0; case.weights.color.len()];
        let colors = equations::gradient(&case.triangles, &case.settings, &case.weights.color, &none[..none.len() / 3]);
        let corners = equations::gradient(&case.triangles, &case.settings, &none, &case.weights.silhouette);
        let loss = |triangles: &Triangles| {
            let image = equations::image(triangles, &case.settings);
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            [dot(&image.color, &case.weights.color), dot(&image.silhouette, &case.weights.silhouette)]
        };
        const STEP: f64 = 1e-6;
        for triangle in 0..3 {
            let difference = |change: &dyn Fn(&mut Triangles, f64)| {
                let [up, down] = [STEP, -STEP].map(|step| {
                    let mut moved = case.triangles.clone();
                    change(&mut moved, step);
                    loss(&moved)
                });
                [0, 1].map(|k| (up[k] - down[k]) / (2.0 * STEP))
            };
            for axis in 0..2 {
                let [_, found] = difference(&|t, step| t.corners[triangle][1][axis] += step);
                let expected = corners.corners[triangle][1][axis];
                // The damping of 1 - D below 1e-6 is no derivative.
                assert!((found - expected).abs() < 1e-5 * expected.abs().max(1.0), "{mode:?}: {found} {expected}");
            }
            // A lookup that leaves its triangle has no gradient in the official renderer.
            if mode.resolution.is_some() {
                continue;
            }
            let [found, _] = difference(&|t, step| t.colors[triangle][0] += step);
            let expected = colors.colors[triangle][0];
            assert!((found - expected).abs() < 1e-7, "{mode:?}: colour {found} {expected}");
        }
    }
}

#[test]
fn the_reference_is_the_official_equations_in_every_mode() {
    let (mut compared, mut failures) = (0, Vec::new());
    for (i, mode) in every_mode().into_iter().enumerate() {
        let case = Case::new(i as u64, mode, mode.settings(SIZE[0], SIZE[1]));
        let frame = render_culled(&case.scene, &[Camera::screen()], &case.settings).unwrap();
        let undecided = &case.expected.undecided;
        let decided = vec![false; undecided.len()];
        compared += undecided.iter().filter(|u| !**u).count();
        let image = [
            worst(&frame.color, &case.expected.color, 3, undecided),
            worst(&frame.silhouette, &case.expected.silhouette, 1, &decided),
        ];
        let upstream = Upstream {
            d_color: Some(case.weights.color.clone()),
            d_silhouette: Some(case.weights.silhouette.clone()),
            ..Upstream::default()
        };
        let ours = gradient(&case.scene, &[Camera::screen()], &case.settings, &upstream, GradientMode::Paper).unwrap();
        let colors = [ours.colors(0), ours.surface_texels(0)].concat();
        let errors = gradient_errors(ours.positions(0), &colors, &case.expected_gradient);
        if image.iter().any(|e| *e > SAME_EQUATIONS) || errors.iter().any(|e| *e > 100.0 * SAME_EQUATIONS) {
            failures.push(format!("{mode:?}: image {image:?}, gradient {errors:?}"));
        }
    }
    assert!(failures.is_empty(), "{} modes\n{}", failures.len(), failures.join("\n"));
    // Few pixels may be left out as undecided.
    assert!(compared > every_mode().len() * (SIZE[0] * SIZE[1]) as usize / 2, "{compared} pixels");
}

/// Modes that between them have every pair of a distance and a silhouette, and every other choice.
fn modes_of_the_kernels() -> Vec<Mode> {
    let chosen = |(i, _): &(usize, Mode)| i % 12 == [0, 3, 5, 6, 9, 10, 7][i / 12 % 7];
    every_mode().into_iter().enumerate().filter(chosen).map(|(_, mode)| mode).collect()
}

#[test]
fn the_kernels_modes_have_every_choice() {
    let modes = modes_of_the_kernels();
    let any = |what: &str, of: &dyn Fn(&Mode) -> bool| assert!(modes.iter().any(of), "no mode has {what}: {modes:?}");
    for distance in [Distance::Euclidean, Distance::Barycentric, Distance::Hard] {
        for silhouette in [SilhouetteAggregation::Product, SilhouetteAggregation::Sum, SilhouetteAggregation::Hard] {
            any("the pair", &|m| m.distance == distance && m.silhouette == silhouette);
        }
    }
    for color in [ColorAggregation::Softmax, ColorAggregation::Hard] {
        any("the colour", &|m| m.color == color);
    }
    for resolution in [None, Some(1), Some(4)] {
        any("the texture", &|m| m.resolution == resolution);
    }
    any("a narrow range", &|m| m.narrow);
    any("a wide range", &|m| !m.narrow);
    any("front faces", &|m| m.faces == softras::scene::Faces::Front);
    any("both faces", &|m| m.faces == softras::scene::Faces::Both);
}

fn as_image(values: &[f64], channels: usize) -> Image {
    let [width, height] = SIZE.map(|n| n as usize);
    Image { batch: 1, height, width, channels, data: values.iter().map(|&x| x as f32).collect() }
}

#[test]
fn the_kernels_are_the_official_equations() {
    let (mut renderer, mut failures) = (renderer(), Vec::new());
    for (i, mode) in modes_of_the_kernels().into_iter().enumerate().step_by(tier(4, 1)) {
        let settings = Settings { save: true, ..mode.settings(SIZE[0], SIZE[1]) };
        let case = Case::new(100 + i as u64, mode, settings);
        let frame = renderer.render(&case.scene, &[Camera::screen()], &case.settings).unwrap();
        let tolerance = Tolerance { left_out: 0.5, ..IMAGE };
        for (name, image, expected) in [
            ("colour", frame.color().unwrap(), &case.expected.color),
            ("silhouette", frame.silhouette().unwrap(), &case.expected.silhouette),
        ] {
            if let Err(error) = compare(name, image, expected, &case.margin, &tolerance) {
                failures.push(format!("{:?}: {error}", case.mode));
            }
        }
        let upstream = ImageGradient {
            color: Some(as_image(&case.weights.color, 3)),
            silhouette: Some(as_image(&case.weights.silhouette, 1)),
            ..ImageGradient::default()
        };
        let wanted = GradientRequest { mode: softras::GradientMode::Paper, ..GradientRequest::ALL };
        let ours = renderer.backward(&frame, &upstream, &wanted).unwrap().meshes.remove(0);
        let wide = |rows: &[[f32; 3]]| rows.as_flattened().iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        let colors = [wide(&ours.colors), wide(&ours.surface_texels)].concat();
        let errors = gradient_errors(&wide(&ours.positions), &colors, &case.expected_gradient);
        if errors.iter().any(|e| *e > GRADIENT.usual) {
            failures.push(format!("{:?}: gradient {errors:?}", case.mode));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
