//! Official parity: the f64 reference against the official renderer's equations, which `tests/official` recomputes without any
//! code of the reference, in every mode that the official renderer has. The kernels are compared with the reference.
//!
//! `cargo test --test parity` compares those equations, the reference and the kernels with recorded outputs of
//! the official kernels where these are at hand.

use crate::common::{random::Random, tolerance::GRADIENT};
use crate::official::{
    compare::{axes, max_difference, relative_l2, unmasked},
    equations,
    scenes::{every_mode, mesh, random_triangles},
};
use softras::scene::{Camera, Scene};
use softras_reference::{GradientMode, Upstream, gradient, render_culled};

const SIZE: [u32; 2] = [20, 16];

/// The reference's f64 against other f64: some hundred roundings of numbers around 1, times 1 / γ and 1 / σ.
const SAME_EQUATIONS: f64 = 1e-10;

#[test]
fn the_reference_is_the_official_equations_in_every_mode() {
    let (mut compared, mut failures) = (0, Vec::new());
    for (seed, mode) in (0..).zip(every_mode()) {
        let settings = mode.settings(SIZE[0], SIZE[1]);
        let triangles = random_triangles(seed, 10, mode.resolution);
        let (scene, camera) = (Scene::new(mesh(&triangles)), [Camera::screen()]);
        let frame = render_culled(&scene, &camera, &settings).unwrap();
        let expected = equations::image(&triangles, &settings);
        let undecided = &expected.undecided;
        compared += undecided.iter().filter(|undecided| !**undecided).count();
        let decided = |color: &[f64]| unmasked(color, undecided);
        let color = max_difference(&decided(&frame.color), &decided(&expected.color));
        let silhouette = max_difference(&frame.silhouette, &expected.silhouette);

        let random = &mut Random::new(seed);
        let counts = |pixel: usize| frame.margin[pixel] >= GRADIENT.margin && !undecided[pixel];
        let mut weights = |channels: usize| -> Vec<f64> {
            let weight = |i: usize| if counts(i / channels) { random.range(-1.0, 1.0) } else { 0.0 };
            (0..channels * undecided.len()).map(weight).collect()
        };
        let (d_color, d_silhouette) = (weights(3), weights(1));
        let theirs = equations::gradient(&triangles, &settings, &d_color, &d_silhouette);
        let upstream = Upstream { d_color: Some(d_color), d_silhouette: Some(d_silhouette), ..Upstream::default() };
        let ours = gradient(&scene, &camera, &settings, &upstream, GradientMode::Paper).unwrap();
        let corners = theirs.corners.as_flattened().as_flattened();
        let [xy, z] = [&[0, 1][..], &[2]].map(|k| relative_l2(&axes(ours.positions(0), k), &axes(corners, k)));
        let colors = [ours.colors(0), ours.surface_texels(0)].concat();
        let colors = relative_l2(&colors, theirs.colors.as_flattened());
        if color.max(silhouette) > SAME_EQUATIONS || xy.max(z).max(colors) > 100.0 * SAME_EQUATIONS {
            let image = format!("colour {color:e}, silhouette {silhouette:e}");
            failures.push(format!("{mode:?}: {image}, gradient x, y {xy:e}, z {z:e}, colours {colors:e}"));
        }
    }
    assert!(failures.is_empty(), "{} modes\n{}", failures.len(), failures.join("\n"));
    // Few pixels may be left out as undecided.
    assert!(compared > every_mode().len() * (SIZE[0] * SIZE[1]) as usize / 2, "{compared} pixels");
}
