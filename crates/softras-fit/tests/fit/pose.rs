//! Poses: gradients against differences of the loss, and a cube that is found again.

use crate::common::{renderer_with, tier};
use glam::{DQuat, DVec3};
use softras::scene::{Appearance, Background, Faces};
use softras::{Camera, Image, Mesh, Projection, Renderer, RendererOptions, Scene, Settings, shapes};
use softras_check::random::Random;
use softras_fit::{Pose, PoseFit, PoseOptions, PoseSearch, PoseTarget, Schedule, pooled, rotations};

fn settings() -> Settings {
    let (background, faces) = (Background::Composite, Faces::Front);
    let sharp = Settings { sigma: 1e-7, gamma: 1e-5, tau: 1e-8, background, faces, ..Settings::default() };
    Settings { width: 48, height: 48, near: 3.5, far: 6.5, ..sharp }
}

fn begin(options: PoseOptions, poses: Vec<Pose>) -> PoseFit {
    begin_seeing(Faces::Front, options, poses)
}

fn begin_seeing(faces: Faces, options: PoseOptions, poses: Vec<Pose>) -> PoseFit {
    let settings = Settings { faces, ..settings() };
    let projection = Projection::Perspective { fov_y: 30f64.to_radians() };
    let eye = DVec3::new(1.0, 2.0, 4.5);
    let camera = Camera::look_at(eye, DVec3::new(0.1, 0.0, 0.0), DVec3::Y, projection).unwrap();
    PoseFit::new(Scene::new(shapes::cube().unwrap()), camera, DVec3::ZERO, settings, options, poses).unwrap()
}

fn cameras(fit: &PoseFit, poses: &[Pose]) -> Vec<Camera> {
    poses.iter().map(|pose| fit.posed_camera(pose).unwrap()).collect()
}

/// The cube as it looks in some poses.
fn targets(fit: &PoseFit, renderer: &mut Renderer, poses: &[Pose]) -> PoseTarget {
    pooled_targets(fit, renderer, poses, 1)
}

/// The cube as it looks in some poses, in pictures whose pixels are means of `samples` by `samples` rendered ones.
fn pooled_targets(fit: &PoseFit, renderer: &mut Renderer, poses: &[Pose], samples: usize) -> PoseTarget {
    let frame = renderer.render(&Scene::new(shapes::cube().unwrap()), &cameras(fit, poses), &settings()).unwrap();
    let [color, silhouette] = [frame.color(), frame.silhouette()].map(|image| pooled(image.unwrap(), samples).unwrap());
    PoseTarget::new(color, silhouette).unwrap()
}

fn random_pose(random: &mut Random, degrees: f64, shift: f64) -> Pose {
    let vector = |random: &mut Random| DVec3::from([0; 3].map(|_| random.range(-1.0, 1.0)));
    let axis = vector(random).normalize();
    let rotation = DQuat::from_axis_angle(axis, degrees.to_radians());
    Pose { rotation, translation: shift * vector(random) }
}

/// The largest difference between the pose's gradient and central differences of the loss, in parts of the gradient;
/// `sign` turns the shift's gradient around. The targets have a pixel for `samples`² of the fit's.
fn gradient_error(renderer: &mut Renderer, seed: u64, sign: f64, blur: f64, samples: usize) -> f64 {
    let both = Faces::Both;
    let softness = (3e-3, 1e-1);
    let options = PoseOptions {
        sigma: Schedule::Constant(softness.0),
        gamma: Schedule::Constant(softness.1),
        blur: Schedule::Constant(blur),
        ..PoseOptions::default()
    };
    let mut random = Random::new(seed);
    let (truth, pose) = (random_pose(&mut random, 50.0, 0.1), random_pose(&mut random, 120.0, 0.1));
    let mut fit = begin_seeing(both, options.clone(), vec![pose]);
    let target = pooled_targets(&fit, renderer, &[truth], samples);
    let (_, gradients) = fit.differentiate(renderer, &target).unwrap();
    let [by_turn, by_shift] = gradients[0];
    let mut loss = |turn: DVec3, shift: DVec3| {
        let rotation = DQuat::from_scaled_axis(turn) * pose.rotation;
        let moved = Pose { rotation, translation: pose.translation + shift };
        begin_seeing(both, options.clone(), vec![moved]).differentiate(renderer, &target).unwrap().0[0]
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
    let mut renderer = crate::common::renderer();
    let mut median = |sign: f64, blur: f64, samples: usize| {
        let mut error = |seed| gradient_error(&mut renderer, seed, sign, blur, samples);
        let mut errors: Vec<f64> = (1..6).map(&mut error).collect();
        errors.sort_by(f64::total_cmp);
        errors[2]
    };
    for (blur, samples) in [(0.0, 1), (0.02, 1), (0.15, 1), (0.0, 2), (0.1, 3)] {
        let error = median(1.0, blur, samples);
        assert!(error < 0.02, "{error} at {blur}, {samples}");
    }
    assert!(median(-1.0, 0.0, 1) > 0.5, "a wrong sign is not seen");
}

#[test]
fn a_single_start_finds_a_cube_by_whitened_colours_and_a_schedule() {
    let far = rotations(24);
    let pose = |rotation: &DQuat| Pose { rotation: *rotation, ..Pose::IDENTITY };
    let truth: Vec<Pose> = far.iter().map(pose).collect();
    let start: Vec<Pose> = (0..24).map(|i| pose(&far[(i * 7 + 5) % 24])).collect();
    let mut renderer = crate::common::renderer();
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
fn targets_are_validated() {
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

/// A search for a mesh in a picture of it in some pose, by a camera that is given in pixels.
fn search(renderer: &mut Renderer, mesh: &Mesh, truth: &Pose, size: u32) -> PoseSearch {
    let (side, focal) = (f64::from(size), 1.9 * f64::from(size));
    let projection = Projection::Pinhole { fx: focal, fy: focal, cx: 0.5 * side, cy: 0.5 * side };
    let camera = Camera::look_at(DVec3::new(1.0, 2.0, 4.5), DVec3::ZERO, DVec3::Y, projection).unwrap();
    let settings = Settings { width: size, height: size, ..settings() };
    let fit = PoseFit::new(
        Scene::new(mesh.clone()),
        camera,
        DVec3::ZERO,
        settings.clone(),
        PoseOptions::default(),
        vec![Pose::IDENTITY],
    );
    let seen = fit.unwrap().posed_camera(truth).unwrap();
    let frame = renderer.render(&Scene::new(mesh.clone()), &[seen], &settings).unwrap();
    let (color, silhouette) = (frame.color().unwrap().clone(), frame.silhouette().unwrap().clone());
    PoseSearch::new(mesh.clone(), camera, DVec3::ZERO, settings, color, silhouette).unwrap()
}

fn finish(mut search: PoseSearch, renderer: &mut Renderer) -> PoseSearch {
    let wanted = search.step_count();
    let mut taken = 0;
    while search.step(renderer).unwrap().is_some() {
        taken += 1;
        assert_eq!(search.found().is_empty(), taken < wanted);
    }
    assert_eq!((taken, search.step_count()), (wanted, 0));
    search
}

#[test]
fn a_search_finds_a_cube_wherever_it_is() {
    let (mut random, mut renderer) = (Random::new(17), crate::common::renderer());
    let cube = shapes::cube().unwrap();
    // A picture that is reduced for all stages, and one that is not.
    for size in tier(vec![150], vec![150, 48]) {
        let truth = random_pose(&mut random, 160.0, 0.25);
        let found = finish(search(&mut renderer, &cube, &truth, size).with(15, 60), &mut renderer);
        let (pose, loss) = found.found()[0];
        let shift = pose.translation.distance(truth.translation);
        assert!(pose.degrees_to(&truth) < 2.0 && shift < 0.03, "{} degrees, {shift}", pose.degrees_to(&truth));
        assert!(found.found().iter().all(|(_, other)| *other >= loss) && found.equally_good() == 1);
        // Where fits ended that were too bad to be refined is known as well: in the larger picture one more than was refined.
        assert!(found.found().len() >= if size == 150 { 3 } else { 2 }, "{:?}", found.found());
        let away = Pose { rotation: DQuat::from_rotation_x(0.1) * truth.rotation, ..truth };
        let refining = search(&mut renderer, &cube, &truth, size).with(1, 60).refining(away).unwrap();
        assert_eq!(refining.step_count(), 60);
        let refined = finish(refining, &mut renderer).found()[0].0;
        assert!(refined.degrees_to(&truth) < 1.0, "{} degrees after refining", refined.degrees_to(&truth));
    }
}

#[test]
fn a_box_of_one_colour_has_four_poses() {
    let mut cube = shapes::cube().unwrap().with_appearance(Appearance::Uniform([1.0; 3])).unwrap();
    let place = |p: &[f32; 3]| [0.6 * p[0], p[1], 1.4 * p[2]];
    cube.set_positions(cube.positions().iter().map(place).collect()).unwrap();
    let (mut random, mut renderer) = (Random::new(3), crate::common::renderer());
    let truth = random_pose(&mut random, 100.0, 0.0);
    let found = finish(search(&mut renderer, &cube, &truth, 64).with(16, 60).without_translation(), &mut renderer);
    assert_eq!(found.equally_good(), 4, "{:?}", found.found());
    for (pose, _) in &found.found()[..4] {
        let turn = truth.rotation.inverse() * pose.rotation;
        let half = Pose { rotation: turn * turn, ..Pose::IDENTITY };
        assert!(half.degrees_to(&Pose::IDENTITY) < 4.0, "{} degrees", half.degrees_to(&Pose::IDENTITY));
        assert!(pose.translation == DVec3::ZERO);
    }
}

#[test]
fn a_search_takes_one_picture_of_something() {
    let image = |batch, channels| Image { batch, height: 2, width: 2, channels, data: vec![0.5; 4 * channels * batch] };
    let camera = Camera::from_angles(4.0, 0.0, 0.0, Projection::Perspective { fov_y: 0.6 }).unwrap();
    let begin = |mesh: Mesh, batch: usize, channels: usize| {
        let begun = PoseSearch::new(mesh, camera, DVec3::ZERO, settings(), image(batch, channels), image(batch, 1));
        begun.map(|_| ()).map_err(|error| error.to_string())
    };
    let cube = || shapes::cube().unwrap();
    assert_eq!(begin(cube(), 1, 3), Ok(()));
    assert!(begin(cube(), 2, 3).unwrap_err().contains("2 pictures"));
    assert!(begin(cube(), 1, 1).unwrap_err().contains("one size"));
    let point = Mesh::new(vec![[0.0; 3]; 3], vec![[0, 1, 2]]).unwrap();
    assert!(begin(point, 1, 3).unwrap_err().contains("without extent"));
    // Without anything in it every pose is as far from the picture as the object is large, and none is NaN.
    let mut renderer = crate::common::renderer();
    let empty = |channels| Image { data: vec![0.0; 4 * channels], ..image(1, channels) };
    let search = PoseSearch::new(cube(), camera, DVec3::ZERO, settings(), empty(3), empty(1)).unwrap();
    let found = finish(search.with(2, 1), &mut renderer);
    assert!(found.found().iter().all(|(pose, loss)| loss.is_finite() && pose.translation.is_finite()));
}

/// Poses that do not fit into memory at once are rendered in parts, with the same bits.
#[test]
fn poses_are_fitted_in_parts_where_memory_is_short() {
    let mut random = Random::new(9);
    let poses: Vec<Pose> = (0..24).map(|_| random_pose(&mut random, 30.0, 0.1)).collect();
    let mut fit = begin(PoseOptions { translation_rate: 0.1, ..PoseOptions::default() }, poses.clone());
    let target = targets(&fit, &mut crate::common::renderer(), &vec![Pose::IDENTITY; poses.len()]);
    let mut roomy = renderer_with(RendererOptions::default());
    let whole = fit.differentiate(&mut roomy, &target).unwrap();
    let memory = Some(roomy.device_bytes() / 4);
    let mut tight = renderer_with(RendererOptions { memory, ..Default::default() });
    let at_once = tight.render_saved(&Scene::new(shapes::cube().unwrap()), &cameras(&fit, &poses), &settings());
    assert!(at_once.is_err(), "the memory is enough for all at once");
    assert_eq!(fit.differentiate(&mut tight, &target).unwrap(), whole);
    // Views for other poses are still refused.
    let few = targets(&fit, &mut crate::common::renderer(), &poses[..5]);
    let refused = fit.differentiate(&mut crate::common::renderer(), &few).unwrap_err().to_string();
    assert!(refused.contains("5 targets for 24 poses"), "{refused}");
}
