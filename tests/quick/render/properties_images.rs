//! Properties of every image, whatever the triangles, by proptest: no pair of pixel and triangle within the radius is missing
//! from the tiles' lists and none is there twice; the near plane leaves of a triangle what the brute-force reference leaves.

use crate::common::{compare::compare_frames, renderer, scenes::separate, tolerance::Tolerance};
use glam::DMat4;
use proptest::{
    prelude::*,
    test_runner::{RngAlgorithm, TestError, TestRng, TestRunner},
};
use softras::{
    Camera, Projection, Renderer, Scene, Settings,
    scene::{Outputs, SilhouetteAggregation},
};
use softras_reference::{Truncation, render};
use std::cell::RefCell;

/// A few more than the lists' words have bits, so that several words come up.
const MOST: usize = 70;

fn corner(reach: f32, depths: std::ops::Range<f32>) -> impl Strategy<Value = [f32; 3]> {
    (-reach..reach, -reach..reach, depths).prop_map(|(x, y, z)| [x, y, z])
}

/// Runs a property on one renderer, and shows the least case that breaks it.
#[track_caller]
fn check<S: Strategy>(cases: u32, strategy: S, property: impl Fn(&mut Renderer, &S::Value) -> Result<(), String>) {
    let renderer = RefCell::new(renderer());
    let config =
        ProptestConfig { cases, failure_persistence: None, max_shrink_iters: 400, ..ProptestConfig::default() };
    let outcome = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
        .run(&strategy, |value| property(&mut renderer.borrow_mut(), &value).map_err(TestCaseError::fail));
    match outcome {
        Ok(()) => {}
        Err(TestError::Fail(why, least)) => panic!("{why}\nof {least:?}"),
        Err(TestError::Abort(why)) => panic!("{why}"),
    }
}

/// Σ D over the triangles, where one pair too few or too many is τ / count or more: a hundred times the tolerance.
fn summed(width: u32, height: u32, sigma: f64) -> Settings {
    Settings {
        width,
        height,
        sigma,
        tau: 0.3,
        silhouette: SilhouetteAggregation::Sum,
        outputs: Outputs::SILHOUETTE,
        ..Settings::default()
    }
}

fn agrees(renderer: &mut Renderer, scene: &Scene, camera: Camera, settings: &Settings) -> Result<(), String> {
    let frame = renderer.render(scene, &[camera], settings).map_err(|error| error.to_string())?;
    let reference = render(scene, &[camera], settings, Truncation::Tau).map_err(|error| error.to_string())?;
    let tolerance = Tolerance { value: 4e-5, margin: 1e-3, left_out: 1.0 };
    compare_frames(&frame, &reference, &tolerance).map(|_| ())
}

#[test]
fn bins_hold_every_pair_within_the_radius_once() {
    let triangle = [corner(2.0, 2.0..9.0), corner(2.0, 2.0..9.0), corner(2.0, 2.0..9.0)];
    let triangles = prop_oneof![
        3 => prop::collection::vec(triangle, 1..MOST),
        // Small ones about a place: lists of very different length side by side.
        1 => prop::collection::vec((corner(1.0, 2.0..9.0), [corner(0.05, 0.0..0.1), corner(0.05, 0.0..0.1)]), 1..MOST)
            .prop_map(|all| {
                let add = |a: [f32; 3], b: [f32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
                all.into_iter().map(|(p, [q, r])| [p, add(p, q), add(p, r)]).collect()
            }),
    ];
    // From one pixel to several bins of 64×32 along each axis; radii from a hundredth of a pixel to the whole image.
    let strategy = (triangles, 1u32..200, 1u32..120, -6f64..0.5);
    check(60, strategy, |renderer, (triangles, width, height, sigma)| {
        agrees(
            renderer,
            &Scene::new(separate(triangles)),
            Camera::screen(),
            &summed(*width, *height, 10f64.powf(*sigma)),
        )
    });
}

#[test]
fn what_near_cuts_is_what_is_left_of_it() {
    let triangle = [corner(3.0, -3.0..6.0), corner(3.0, -3.0..6.0), corner(3.0, -3.0..6.0)];
    let strategy = (prop::collection::vec(triangle, 1..8), 0.3f64..2.0, -4f64..-2.0);
    let lens = Projection::Perspective { fov_y: 1.2 };
    let camera = Camera::from_matrix(DMat4::IDENTITY, lens).unwrap();
    check(60, strategy, |renderer, (triangles, near, sigma)| {
        let settings = Settings { near: *near, far: 20.0, ..summed(40, 30, 10f64.powf(*sigma)) };
        agrees(renderer, &Scene::new(separate(triangles)), camera, &settings)
    });
}
