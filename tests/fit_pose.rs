//! Poses: gradients against differences of the loss, and a cube that is found again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::random::Random;
use glam::{DQuat, DVec3};
use softras::fit::pose::{Differentiation, Pose, PoseFit, PoseOptions, PoseTarget, rotations};
use softras::fit::schedule::Schedule;
use softras::scene::Background;
use softras::{Camera, Image, Projection, Renderer, Scene, Settings, shapes};

const SETTINGS: Settings = Settings { width: 48, height: 48, near: 3.5, far: 6.5, ..DEFAULT };
const DEFAULT: Settings = Settings {
    width: 0,
    height: 0,
    sigma: 1e-7,
    gamma: 1e-5,
    epsilon: 1e-3,
    tau: 1e-8,
    support: softras::scene::Support::Probability,
    near: 1.0,
    far: 100.0,
    outputs: softras::scene::Outputs { color: true, silhouette: true, depth: false, normal: false },
    color: softras::scene::ColorAggregation::Softmax,
    silhouette: softras::scene::SilhouetteAggregation::Product,
    distance: softras::scene::Distance::Euclidean,
    background: Background::Composite,
    background_color: [0.0; 3],
    faces: softras::scene::Faces::Front,
    front_face: softras::scene::FrontFace::CounterClockwise,
    interpolation: softras::scene::Interpolation::Affine,
    parity: softras::scene::Parity::Model,
    save: false,
};

fn begin(options: PoseOptions, poses: Vec<Pose>) -> PoseFit {
    begin_seeing(softras::scene::Faces::Front, options, poses)
}

fn begin_seeing(faces: softras::scene::Faces, options: PoseOptions, poses: Vec<Pose>) -> PoseFit {
    let settings = Settings { faces, ..SETTINGS };
    let projection = Projection::Perspective { fov_y: 30f64.to_radians() };
    let eye = DVec3::new(1.0, 2.0, 4.5);
    let camera = Camera::look_at(eye, DVec3::new(0.1, 0.0, 0.0), DVec3::Y, projection).unwrap();
    PoseFit::new(Scene::new(shapes::cube().unwrap()), camera, DVec3::ZERO, settings, options, poses).unwrap()
}

/// The cube as it looks in some poses.
fn targets(fit: &PoseFit, renderer: &mut Renderer, poses: &[Pose]) -> PoseTarget {
    let cameras: Vec<Camera> = poses.iter().map(|pose| fit.posed_camera(pose).unwrap()).collect();
    let frame = renderer.render(&Scene::new(shapes::cube().unwrap()), &cameras, &SETTINGS).unwrap();
    PoseTarget::new(frame.color().unwrap().clone(), frame.silhouette().unwrap().clone()).unwrap()
}

fn random_pose(random: &mut Random, degrees: f64, shift: f64) -> Pose {
    let vector = |random: &mut Random| DVec3::from([0; 3].map(|_| random.range(-1.0, 1.0)));
    let axis = vector(random).normalize();
    let rotation = DQuat::from_axis_angle(axis, degrees.to_radians());
    Pose { rotation, translation: shift * vector(random) }
}

/// The largest difference between the pose's gradient and central differences of the loss, in parts of the gradient;
/// `sign` turns the shift's gradient around.
fn gradient_error(seed: u64, sign: f64, blur: f64) -> f64 {
    let both = softras::scene::Faces::Both;
    let softness = (3e-3, 1e-1);
    let options = PoseOptions {
        sigma: Schedule::Constant(softness.0),
        gamma: Schedule::Constant(softness.1),
        blur: Schedule::Constant(blur),
        ..PoseOptions::default()
    };
    let mut random = Random::new(seed);
    let (truth, pose) = (random_pose(&mut random, 50.0, 0.1), random_pose(&mut random, 120.0, 0.1));
    let mut renderer = common::renderer();
    let fit = begin_seeing(both, options.clone(), vec![pose]);
    let target = targets(&fit, &mut renderer, &[truth]);
    let (_, gradients) = fit.differentiate(&mut renderer, &target).unwrap();
    let [by_turn, by_shift] = gradients[0];
    let mut loss = |turn: DVec3, shift: DVec3| {
        let rotation = DQuat::from_scaled_axis(turn) * pose.rotation;
        let moved = Pose { rotation, translation: pose.translation + shift };
        begin_seeing(both, options.clone(), vec![moved]).differentiate(&mut renderer, &target).unwrap().0[0]
    };
    let h = 2e-3;
    let mut worst = 0.0f64;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let turn = (loss(h * axis, DVec3::ZERO) - loss(-h * axis, DVec3::ZERO)) / (2.0 * h);
        let shift = (loss(DVec3::ZERO, h * axis) - loss(DVec3::ZERO, -h * axis)) / (2.0 * h);
        worst = worst.max((by_turn.dot(axis) - turn).abs() / by_turn.length());
        worst = worst.max((sign * by_shift.dot(axis) - shift).abs() / by_shift.length());
    }
    worst
}

#[test]
fn the_gradient_of_a_pose_is_that_of_its_loss() {
    // The middle one of several poses: where a face is seen from its edge, the model itself jumps.
    let median = |sign: f64, blur: f64| {
        let mut errors: Vec<f64> = (1..6).map(|seed| gradient_error(seed, sign, blur)).collect();
        errors.sort_by(f64::total_cmp);
        errors[2]
    };
    for blur in [0.0, 0.02, 0.15] {
        assert!(median(1.0, blur) < 0.02, "{} at {blur}", median(1.0, blur));
    }
    assert!(median(-1.0, 0.0) > 0.5, "a wrong sign is not seen");
}

#[test]
fn a_cube_a_little_turned_is_found() {
    let mut random = Random::new(5);
    let truth: Vec<Pose> = (0..6).map(|_| random_pose(&mut random, 100.0, 0.05)).collect();
    let mut away = || Pose { ..random_pose(&mut random, 25.0, 0.0) };
    let start: Vec<Pose> =
        truth.iter().map(|t| Pose { rotation: away().rotation * t.rotation, translation: DVec3::ZERO }).collect();
    let mut renderer = common::renderer();
    let options = PoseOptions { iterations: 80, translation_rate: 0.3, ..PoseOptions::default() };
    let mut fit = begin(options, start.clone());
    let target = targets(&fit, &mut renderer, &truth);
    for _ in 0..80 {
        fit.step(&mut renderer, &target).unwrap();
    }
    let errors: Vec<f64> = fit.poses().iter().zip(&truth).map(|(a, b)| a.degrees_to(b)).collect();
    let shifts: Vec<f64> = fit.poses().iter().zip(&truth).map(|(a, b)| a.translation.distance(b.translation)).collect();
    assert!(errors.iter().all(|e| *e < 3.0), "{errors:?}");
    assert!(shifts.iter().all(|s| *s < 0.05), "{shifts:?}");
    assert!(start.iter().zip(&truth).all(|(a, b)| a.degrees_to(b) > 20.0));
}

#[test]
fn the_hard_images_flow_points_downhill() {
    // Translation across the image is what flow sees best.
    let shifted = Pose { translation: DVec3::new(0.08, 0.0, 0.0), ..Pose::IDENTITY };
    let options = PoseOptions { differentiation: Differentiation::ImageFlow, ..PoseOptions::default() };
    let fit = begin(options, vec![shifted]);
    let mut renderer = common::renderer();
    let target = targets(&fit, &mut renderer, &[Pose::IDENTITY]);
    let (losses, gradients) = fit.differentiate(&mut renderer, &target).unwrap();
    assert!(losses[0] > 0.0 && gradients[0][1].x > 0.0, "{gradients:?}");
}

#[test]
fn a_single_start_finds_a_cube_by_whitened_colours_and_a_schedule() {
    let far = rotations(24);
    let pose = |rotation: &DQuat| Pose { rotation: *rotation, ..Pose::IDENTITY };
    let truth: Vec<Pose> = far.iter().map(pose).collect();
    let start: Vec<Pose> = (0..24).map(|i| pose(&far[(i * 7 + 5) % 24])).collect();
    let mut renderer = common::renderer();
    let mut found = |plain: bool, options: PoseOptions| {
        let mut fit = begin(options, start.clone());
        let target = targets(&fit, &mut renderer, &truth);
        let target = if plain { target.plain() } else { target };
        (0..150).for_each(|_| drop(fit.step(&mut renderer, &target).unwrap()));
        fit.poses().iter().zip(&truth).filter(|(a, b)| a.degrees_to(b) < 5.0).count()
    };
    let constant = PoseOptions {
        sigma: Schedule::Constant(1e-4),
        gamma: Schedule::Constant(3e-2),
        blur: Schedule::Constant(0.0),
        ..PoseOptions::default()
    };
    let (scheduled, constant) = (found(false, PoseOptions::default()), found(true, constant));
    let before = start.iter().zip(&truth).filter(|(a, b)| a.degrees_to(b) < 30.0).count();
    assert!(scheduled >= 10 && constant <= 6 && before <= 2, "{scheduled}, {constant} plain, {before} before");
}

#[test]
fn targets_are_judged() {
    let image = |channels: usize, batch: usize| Image {
        batch,
        height: 2,
        width: 2,
        channels,
        data: vec![0.5; 4 * channels * batch],
    };
    assert!(PoseTarget::new(image(3, 1), image(1, 1)).is_ok());
    for (color, silhouette) in [(image(3, 2), image(1, 1)), (image(1, 1), image(1, 1)), (image(3, 0), image(1, 0))] {
        assert!(PoseTarget::new(color, silhouette).is_err_and(|e| e.to_string().contains("one size for each pose")));
    }
}

#[test]
fn angles_and_spirals_are_right() {
    let quarter = Pose { rotation: DQuat::from_rotation_y(0.5 * std::f64::consts::PI), ..Pose::IDENTITY };
    assert!((quarter.degrees_to(&Pose::IDENTITY) - 90.0).abs() < 1e-9);
    let negative = Pose { rotation: -quarter.rotation, ..quarter };
    assert!(negative.degrees_to(&quarter) < 1e-5);
    let spread = rotations(200);
    let nearest = |q: &DQuat| spread.iter().filter(|p| *p != q).map(|p| p.dot(*q).abs()).fold(0.0, f64::max);
    assert!(spread.iter().all(|q| (q.length() - 1.0).abs() < 1e-9 && nearest(q) < 0.995));
}
