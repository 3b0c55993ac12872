//! Fifty scenes drawn to hurt: `softras stress`, short. Every one is refused with a typed error, or is finite, in
//! range, the same again, and where it is promised what the model in f64 says.

use crate::common::{case_count, tier, validates};
use glam::{DMat4, DVec3};
use softras::scene::{Distance, Outputs, SilhouetteAggregation};
use softras::{Camera, GradientMode, Mesh, Projection, RendererOptions, Scene, Settings};
use softras_check::stress::{Case, Kind, Promise, Stress, batch};

/// The combinations of modes that time allows to compile here; all of them run in `softras stress`.
const ONE: Kind = Kind { forms: 1, realistic: false };

fn stress() -> Stress {
    Stress::new(&RendererOptions { validation: validates(), ..RendererOptions::default() }).expect("a Vulkan device")
}

/// A case of which the images are promised.
fn promised() -> Case {
    let mut cases = (0..).flat_map(|seed| batch(seed, ONE, 1)).flatten();
    cases.find(|case| case.promise == Promise::Images).unwrap()
}

#[test]
fn nothing_breaks_it() {
    let drawn_from = Kind { forms: tier(1, 3), ..ONE };
    let mut stress = stress();
    let (mut drawn, mut refused, mut images, mut gradients) = (0, 0, 0, 0);
    for seed in 0..case_count(50, 300) {
        let outcome = stress.seed(seed, drawn_from).unwrap();
        assert_eq!(outcome.findings, [], "seed {seed} of {drawn_from:?}");
        drawn += 1;
        refused += u32::from(outcome.refused.is_some());
        images += u32::from(outcome.image_error.is_some());
        gradients += u32::from(outcome.gradient_error.is_some());
    }
    // A suite that refuses or spares everything would find nothing either.
    assert!(refused * 4 < drawn && images * 4 > drawn && gradients > 0, "{refused}, {images}, {gradients} of {drawn}");
}

/// A settings' value that must be refused, and one that must not.
#[test]
fn what_cannot_work_is_refused_by_kind() {
    let mut stress = stress();
    let mut case = promised();
    assert_eq!(stress.run(&case).unwrap().refused, None);
    case.settings.far = case.settings.near;
    assert_eq!(stress.run(&case).unwrap().refused, Some("settings"));
}

/// An image that is not the case's is a finding: the promise is not of air.
#[test]
fn a_wrong_scene_is_far_from_the_reference() {
    let mut stress = stress();
    let case = promised();
    let frame = stress.renderer().render(&case.scene, &case.cameras, &case.settings).unwrap();
    assert!(softras_check::stress::image_error(&frame, &case).unwrap() < 1e-3);
    let mut other = case.clone();
    other.settings.background_color = case.settings.background_color.map(|c| 1.0 - c);
    assert!(softras_check::stress::image_error(&frame, &other).unwrap() > 1e-3);
}

#[test]
fn the_same_seed_is_the_same_case() {
    for seed in 0..200 {
        let text = || format!("{:?}", batch(seed, Kind::default(), 1));
        assert_eq!(text(), text());
    }
}

/// A case of one triangle whose images and gradients are compared with the reference's.
fn compared(positions: [[f32; 3]; 3], camera: Camera, settings: Settings) -> Case {
    let scene = Scene::new(Mesh::new(positions.to_vec(), vec![[0, 1, 2]]).unwrap());
    let (promise, gradient) = (Promise::Gradients, GradientMode::Exact);
    Case { seed: 0, promise, scene, cameras: vec![camera], settings, gradient }
}

#[track_caller]
fn keeps_its_promise(stress: &mut Stress, case: &Case) {
    let outcome = stress.run(case).unwrap();
    assert_eq!(outcome.findings, [], "{:?}", case.settings);
    assert!(outcome.image_error.is_some() && outcome.gradient_error.is_some());
}

/// A triangle of which near cuts off one corner: what is left are two pieces, and a pixel in the one is near the other too.
#[test]
fn the_pieces_of_a_cut_triangle_add_up_to_no_more_than_it() {
    let mut stress = stress();
    let camera = Camera::from_matrix(DMat4::IDENTITY, Projection::Perspective { fov_y: 1.5 }).unwrap();
    for distance in [Distance::Barycentric, Distance::Euclidean] {
        let settings = Settings {
            width: 24,
            height: 24,
            sigma: 1e-2,
            gamma: 0.1,
            near: 1.0,
            far: 10.0,
            silhouette: SilhouetteAggregation::Sum,
            distance,
            save: true,
            ..Settings::default()
        };
        let case = compared([[-1.5, -1.0, 3.0], [1.5, -0.9, 2.0], [0.1, 0.8, 0.5]], camera, settings);
        keeps_its_promise(&mut stress, &case);
        let frame = stress.renderer().render(&case.scene, &case.cameras, &case.settings).unwrap();
        let silhouette = &frame.silhouette().unwrap().data;
        assert!(silhouette.iter().all(|&x| x <= 1.0) && silhouette.contains(&1.0), "{distance:?}: {silhouette:?}");
    }
}

/// Far from the origin a depth has fewer digits in single precision than near has. Forward asks in two floats whether a corner
/// is cut, and backward must find the same: it took pieces for what was whole, and gradients were 2 % off.
#[test]
fn a_corner_that_near_just_leaves_is_whole_in_backward_too() {
    let mut stress = stress();
    let lens = Projection::Perspective { fov_y: 0.9 };
    let centre = DVec3::new(31.0, -17.0, 23.0);
    let camera = Camera::look_at(centre + DVec3::new(1.1, 0.7, -2.3), centre, DVec3::Y, lens).unwrap();
    let positions = [[31.31, -16.78, 22.17], [30.45, -17.35, 23.4], [31.6, -17.5, 23.3]];
    let depth = camera.to_view(DVec3::from(positions[0].map(f64::from))).z;
    for share in [-5e-8, -2e-8, 1e-5] {
        let settings = Settings {
            width: 40,
            height: 32,
            sigma: 1e-2,
            near: depth * (1.0 + share),
            far: 10.0,
            outputs: Outputs::SILHOUETTE,
            save: true,
            ..Settings::default()
        };
        keeps_its_promise(&mut stress, &compared(positions, camera, settings));
    }
}

/// An edge so long that a point of it is far off in single precision meets near where near is.
#[test]
fn a_long_edge_is_cut_at_near() {
    let mut stress = stress();
    let camera = Camera::from_matrix(DMat4::IDENTITY, Projection::Perspective { fov_y: 1.2 }).unwrap();
    let outputs = Outputs { normal: false, ..Outputs::ALL };
    for behind in [-10.0, -1e8] {
        let positions = [[0.3, -0.4, 2.0], [-0.4, 0.3, 1.5], [0.1, 0.6, behind]];
        let (near, far, width, height) = (0.5, 10.0, 24, 20);
        let settings =
            Settings { width, height, sigma: 1e-2, gamma: 0.1, near, far, outputs, save: true, ..Settings::default() };
        keeps_its_promise(&mut stress, &compared(positions, camera, settings));
    }
}

/// A batch finds what its scenes find by themselves.
#[test]
fn batches_are_held_to_the_same() {
    let mut stress = stress();
    let (mut all, mut refused) = (0, 0);
    for seed in (0..tier(32, 320)).step_by(16) {
        let outcomes = stress.batch(seed, ONE, 16).unwrap();
        assert!(outcomes.iter().all(|outcome| outcome.findings.is_empty()), "seed {seed}: {outcomes:?}");
        all += outcomes.len();
        refused += outcomes.iter().filter(|outcome| outcome.refused.is_some()).count();
    }
    assert!(all >= 32 && refused * 2 < all, "{refused} of {all}");
}
