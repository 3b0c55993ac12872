//! Tests that parts which are left out change nothing, or only what they are promised to.

use super::*;
use softras_check::random::Random;

pub fn culled(scene: &Scene, settings: &Settings) -> ReferenceFrame {
    render_culled(scene, &[Camera::screen()], settings).unwrap()
}

fn share(random: &mut Random) -> f32 {
    random.range(0.0, 1.0) as f32
}

/// Triangles of all sizes, beyond the image, the near and the far plane too; some without area.
fn random_scene(random: &mut Random, triangles: usize) -> Scene {
    let mut positions = Vec::new();
    for t in 0..triangles {
        let size = [0.05, 0.3, 2.0, 0.0][t % 4];
        let centre = [3.0 * share(random) - 1.5, 3.0 * share(random) - 1.5];
        let z = 0.5 + 5.0 * share(random);
        for _ in 0..3 {
            let [x, y] = centre.map(|c| c + size * (share(random) - 0.5));
            positions.push([x, y, z + size * share(random)]);
        }
    }
    let colors: Vec<[f32; 3]> = positions.iter().map(|_| random.color()).collect();
    colored(&positions, &colors)
}

#[test]
fn culling_changes_nothing() {
    let mut random = Random::new(7);
    let scene = random_scene(&mut random, 60);
    let base = Settings { width: 37, height: 26, near: 0.8, far: 5.0, outputs: Outputs::ALL, ..Settings::default() };
    let mut checked = 0;
    for (sigma, gamma) in [(1e-5, 1e-4), (1e-3, 1e-2), (0.1, 1.0)] {
        for distance in [Distance::Euclidean, Distance::Barycentric, Distance::Hard] {
            for parity in [Parity::Model, Parity::Official] {
                for color in [ColorAggregation::Softmax, ColorAggregation::Hard] {
                    let settings = Settings { sigma, gamma, distance, parity, color, ..base.clone() };
                    let worst = difference(&on_screen(&scene, &settings), &culled(&scene, &settings));
                    assert!(worst < 1e-12, "{worst:e} for {settings:?}");
                    checked += 1;
                }
            }
        }
    }
    assert_eq!(checked, 36);
}

/// A smaller γ and σ leave fewer pairs that weigh anything, larger ones all of them.
#[test]
fn leaving_out_what_weighs_nothing_changes_nothing() {
    let mut random = Random::new(11);
    let scene = random_scene(&mut random, 60);
    let base = Settings { width: 37, height: 26, near: 0.8, far: 5.0, outputs: Outputs::ALL, ..Settings::default() };
    for (sigma, gamma) in [(1e-5, 1e-4), (1e-4, 1e-2), (1e-3, 1e-2), (0.1, 1.0)] {
        for (background, epsilon) in
            [(Background::Weighted, 1e-3), (Background::Weighted, 0.7), (Background::Composite, 0.0)]
        {
            for parity in [Parity::Model, Parity::Official] {
                for faces in [Faces::Both, Faces::Front] {
                    for distance in [Distance::Euclidean, Distance::Barycentric] {
                        let settings =
                            Settings { sigma, gamma, background, epsilon, parity, faces, distance, ..base.clone() };
                        let camera = [Camera::screen()];
                        let mut all = render(&scene, &camera, &settings, Truncation::None).unwrap();
                        let few = render_untruncated(&scene, &camera, &settings).unwrap();
                        // A margin is a pixel's nearness to any pair's jump, those that weigh nothing included.
                        all.margin.clone_from(&few.margin);
                        // Depths reach 5, and 60 triangles lose 1e-16 each.
                        let worst = difference(&all, &few);
                        assert!(worst < 1e-12, "{worst:e} for {settings:?}");
                    }
                }
            }
        }
    }
}

/// Two pixels a unit: a triangle that covers 10 centres, and one that its radius adds to beyond each side.
#[test]
fn pairs_are_counted() {
    let corners = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]];
    let scene = colored(&corners, &[[1.0; 3]; 3]);
    let count = |blur: f64| {
        let settings = Settings { width: 8, height: 4, ..Settings::default() }.with_blur_pixels(blur);
        let pairs = pairs(&scene, &[Camera::screen()], &settings).unwrap();
        (pairs.pieces, pairs.total(), pairs.needed, pairs.boxed)
    };
    // The slanted edge runs through the centres of its four pixels, which count as inside.
    let (pieces, total, needed, boxed) = count(1e-3);
    assert_eq!((pieces, total, boxed), (1, 10, 16));
    assert_eq!(needed[..8], [0, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(needed[24..], [0, 0, 1, 1, 1, 1, 0, 0]);
    // 0.6 pixels beyond the left side lies the next column, at 0.5, for all four rows; and beyond the slanted side
    // none, at 0.71.
    assert_eq!(count(0.6).1, 14);
    // 0.8 reaches those too, one beside each of the four.
    assert_eq!(count(0.8).1, 14 + 4);
    assert_eq!(count(0.8).3, 24);
}

#[test]
fn extreme_scenes_stay_finite() {
    let scenes = [
        colored(&[[1e20, 0.0, 2.0], [0.0, 1e20, 2.0], [-1e20, -1e20, 2.0]], &[[1.0; 3]; 3]),
        colored(&[[1e25, 0.0, 1e25], [0.0, 1e25, 2.0], [-1e25, -1e25, 0.0]], &[[1.0; 3]; 3]),
        colored(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[1.0; 3]; 3]),
        colored(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1e-30, 0.0, 1.0]], &[[1.0; 3]; 3]),
    ];
    for scene in &scenes {
        for (sigma, gamma, epsilon) in [(1e-12, 1e-10, 1e3), (1e3, 1e6, -1e3), (1e-5, 1e-8, 1e-3)] {
            for parity in [Parity::Model, Parity::Official] {
                let settings = Settings { width: 5, height: 4, sigma, gamma, epsilon, parity, ..one_pixel() };
                let frame = on_screen(scene, &settings);
                let images = [frame.color, frame.silhouette, frame.depth, frame.normal];
                assert!(images.iter().flatten().all(|x| x.is_finite()), "{settings:?}: {images:?}");
            }
        }
    }
}
