//! Jointed figures: gradients to angles and lengths, what is visible, and a limb that is found behind the body.

use crate::common::tier;
use glam::DVec3;
use softras::{Camera, Mesh, Projection, Renderer, Scene, Settings};
use softras_fit::{PoseTarget, Schedule};
use softras_lab::articulated::{
    Bone, Figure, FigureFit, FigureOptions, Sight, Skeleton, SkeletonPose, mannequin, visible_triangles,
};
use softras_lab::random::Random;
use std::collections::HashSet;

fn random_pose(figure: &Figure, seed: u64, spread: f64) -> SkeletonPose {
    let mut random = Random::new(seed);
    let mut pose = figure.skeleton().rest();
    pose.angles.iter_mut().for_each(|angle| *angle = random.range(-spread, spread));
    pose.lengths.iter_mut().for_each(|length| *length = random.range(0.8, 1.2));
    pose.shift = DVec3::from([0; 3].map(|_| random.range(-0.1, 0.1)));
    pose
}

fn flat(pose: &SkeletonPose) -> Vec<f64> {
    pose.shift.to_array().into_iter().chain(pose.angles.iter().copied()).chain(pose.lengths.iter().copied()).collect()
}

fn moved(pose: &SkeletonPose, parameter: usize, by: f64) -> SkeletonPose {
    let mut pose = pose.clone();
    let (angles, lengths) = (3, 3 + pose.angles.len());
    match parameter {
        0..3 => pose.shift[parameter] += by,
        _ if parameter < lengths => pose.angles[parameter - angles] += by,
        _ => pose.lengths[parameter - lengths] += by,
    }
    pose
}

/// The largest difference between the pulled gradient of Σ w·x and central differences, in parts of the largest.
fn pull_error(seed: u64, factor: f64) -> f64 {
    let figure = mannequin().unwrap();
    let pose = random_pose(&figure, seed, 1.5);
    let mut random = Random::new(seed + 100);
    let weights: Vec<DVec3> =
        figure.mesh().positions().iter().map(|_| DVec3::from([0; 3].map(|_| random.range(-1.0, 1.0)))).collect();
    let loss = |pose: &SkeletonPose| -> f64 {
        figure.positions(pose).unwrap().iter().zip(&weights).map(|(x, w)| x.dot(*w)).sum()
    };
    let pulled = flat(&figure.pull(&pose, &weights).unwrap());
    let largest = pulled.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let one = |i: usize| (loss(&moved(&pose, i, 1e-5)) - loss(&moved(&pose, i, -1e-5))) / 2e-5;
    (0..pulled.len()).map(|i| (factor * pulled[i] - one(i)).abs() / largest).fold(0.0, f64::max)
}

#[test]
fn gradients_reach_every_angle_and_length() {
    for seed in 1..4 {
        assert!(pull_error(seed, 1.0) < 1e-7, "seed {seed}: {}", pull_error(seed, 1.0));
        assert!(pull_error(seed, 1.01) > 1e-3, "a wrong gradient is not seen");
    }
}

#[test]
fn a_bent_and_stretched_arm_is_where_it_must_be() {
    let bone = |name, parent, from: f64| Bone {
        name,
        parent,
        head: DVec3::new(from, 0.0, 0.0),
        tail: DVec3::new(from + 1.0, 0.0, 0.0),
        axes: vec![DVec3::Z],
    };
    let skeleton = Skeleton::new(vec![bone("upper", None, 0.0), bone("lower", Some(0), 1.0)]).unwrap();
    let mesh = Mesh::new(vec![[0.5, 0.1, 0.0], [2.0, 0.0, 0.0], [1.0, 0.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    let weights = vec![vec![(0, 1.0)], vec![(1, 1.0)], vec![(0, 0.5), (1, 0.5)]];
    let figure = Figure::new(mesh, skeleton, weights).unwrap();
    let quarter = std::f64::consts::FRAC_PI_2;
    let pose = SkeletonPose { shift: DVec3::Z, angles: vec![quarter, -quarter], lengths: vec![2.0, 3.0] };
    let expected = [DVec3::new(-0.1, 1.0, 1.0), DVec3::new(3.0, 2.0, 1.0), DVec3::new(0.0, 2.0, 1.0)];
    let positions = figure.positions(&pose).unwrap();
    assert!(positions.iter().zip(expected).all(|(a, b)| a.distance(b) < 1e-6), "{positions:?}");
    let skeleton = figure.skeleton();
    assert!((skeleton.degrees_between(&pose, &skeleton.rest(), 1) - 90.0).abs() < 1e-6);
    assert!(skeleton.direction(&pose, 0).distance(DVec3::Y) < 1e-9);
}

#[test]
fn what_makes_no_figure_is_refused() {
    let bone = |parent, axis| Bone { name: "b", parent, head: DVec3::ZERO, tail: DVec3::Y, axes: vec![axis] };
    assert!(Skeleton::new(vec![bone(Some(0), DVec3::X)]).is_err_and(|e| e.to_string().contains("before its parent")));
    assert!(Skeleton::new(vec![bone(None, DVec3::splat(1.0))]).is_err());
    let skeleton = Skeleton::new(vec![bone(None, DVec3::X)]).unwrap();
    let mesh = Mesh::new(vec![[0.0; 3]], Vec::new()).unwrap();
    for weights in [vec![], vec![vec![(0, 0.5)]], vec![vec![(1, 1.0)]], vec![vec![(0, 2.0), (0, -1.0)]]] {
        assert!(Figure::new(mesh.clone(), skeleton.clone(), weights).is_err());
    }
    let figure = Figure::new(mesh, skeleton, vec![vec![(0, 1.0)]]).unwrap();
    let rest = figure.skeleton().rest();
    let nan = SkeletonPose { angles: vec![f64::NAN], ..rest.clone() };
    let other = SkeletonPose { lengths: vec![1.0; 2], ..rest.clone() };
    assert!(figure.positions(&nan).is_err() && figure.positions(&other).is_err() && figure.pull(&rest, &[]).is_err());
}

#[test]
fn the_mannequin_is_closed_and_faces_outwards() {
    let figure = mannequin().unwrap();
    let mesh = figure.mesh();
    assert_eq!([mesh.triangles().len(), figure.skeleton().rest().angles.len()], [1120, 19]);
    let mut edges = HashSet::new();
    for &[a, b, c] in mesh.triangles() {
        assert!([(a, b), (b, c), (c, a)].into_iter().all(|edge| edges.insert(edge)));
    }
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
    // Six spheres: 2 for each.
    assert_eq!(mesh.positions().len() as i64 - edges.len() as i64 / 2 + mesh.triangles().len() as i64, 12);
    let corner = |i: u32| DVec3::from(mesh.positions()[i as usize].map(f64::from));
    let volume: f64 = mesh.triangles().iter().map(|&[a, b, c]| corner(a).cross(corner(b)).dot(corner(c)) / 6.0).sum();
    assert!(volume > 0.05, "{volume}");
    assert!(
        figure
            .positions(&figure.skeleton().rest())
            .unwrap()
            .iter()
            .zip(mesh.positions())
            .all(|(a, b)| { a.distance(DVec3::from(b.map(f64::from))) < 1e-9 })
    );
}

fn stage() -> (Camera, Settings) {
    let projection = Projection::Perspective { fov_y: 27f64.to_radians() };
    let camera = Camera::look_at(DVec3::new(0.0, 0.25, 5.0), DVec3::ZERO, DVec3::Y, projection).unwrap();
    (camera, Settings { width: 64, height: 64, near: 4.0, far: 6.0, ..Settings::default() })
}

fn look(renderer: &mut Renderer, figure: &Figure, pose: &SkeletonPose) -> PoseTarget {
    let (camera, settings) = stage();
    let settings = Settings { sigma: 1e-7, gamma: 1e-5, background: softras::scene::Background::Composite, ..settings };
    let frame = renderer.render(&Scene::new(figure.posed(pose).unwrap()), &[camera], &settings).unwrap();
    PoseTarget::new(frame.color().unwrap().clone(), frame.silhouette().unwrap().clone()).unwrap()
}

/// The left arm behind the back, its elbow bent by some degrees.
fn behind_the_back(figure: &Figure, elbow: f64) -> SkeletonPose {
    let mut pose = figure.skeleton().rest();
    let mut set = |name: &str, degrees: &[f64]| {
        let range = figure.skeleton().angles_of(figure.skeleton().find(name).unwrap());
        pose.angles[range].iter_mut().zip(degrees).for_each(|(angle, d)| *angle = d.to_radians());
    };
    set("right upper arm", &[0.0, -50.0, -80.0]);
    set("left upper arm", &[36.0, -32.0, 90.0]);
    set("left forearm", &[elbow]);
    pose
}

#[test]
fn what_is_hidden_is_not_visible() {
    let figure = mannequin().unwrap();
    let (camera, settings) = stage();
    let mut renderer = crate::common::renderer();
    let forearm = figure.skeleton().find("left forearm").unwrap();
    let bones = figure.bone_of_triangle();
    let mut seen = |elbow: f64| {
        let mesh = figure.posed(&behind_the_back(&figure, elbow)).unwrap();
        let visible = visible_triangles(&mut renderer, &mesh, &camera, &settings).unwrap();
        assert!(visible.iter().filter(|v| **v).count() > 100);
        bones.iter().zip(visible).filter(|(bone, visible)| **bone == forearm && *visible).count()
    };
    let (hidden, peeking) = (seen(95.0), seen(58.0));
    assert!(hidden <= 2 && peeking >= 8, "{hidden} and {peeking}");
    // A large triangle before a small one, and a small one beside both.
    let at = |x: f32, z: f32, size: f32| [[x - size, -size, z], [x + size, -size, z], [x, size, z]];
    let positions = [at(-0.4, 0.5, 0.4), at(-0.4, -0.5, 0.1), at(0.6, 0.0, 0.1)].concat();
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]]).unwrap();
    let visible = visible_triangles(&mut renderer, &mesh, &camera, &settings).unwrap();
    assert_eq!(visible, [true, false, true]);
}

#[test]
fn a_hidden_forearm_is_found_by_soft_gradients_alone() {
    let figure = mannequin().unwrap();
    let (camera, settings) = stage();
    let mut renderer = crate::common::renderer();
    let (truth, start) = (behind_the_back(&figure, 58.0), behind_the_back(&figure, 95.0));
    let target = look(&mut renderer, &figure, &truth);
    let forearm = figure.skeleton().find("left forearm").unwrap();
    let mut error = |sight: Sight| {
        let options = FigureOptions { iterations: tier(100, 150), sight, ..FigureOptions::default() };
        let iterations = options.iterations;
        let mut fit = FigureFit::new(figure.clone(), camera, settings.clone(), options, start.clone()).unwrap();
        for _ in 0..iterations {
            fit.step(&mut renderer, &target).unwrap();
        }
        figure.skeleton().degrees_between(fit.pose(), &truth, forearm)
    };
    let (soft, visible) = (error(Sight::Soft), error(Sight::VisibleOnly));
    assert!(soft < 10.0 && visible > 30.0, "soft {soft}, visible only {visible}");
}

/// The largest difference between the fit's gradient by angles and differences of its loss, in parts of the gradient; and
/// the same of the gradient times -1.
fn gradient_errors(renderer: &mut Renderer, seed: u64) -> [f64; 2] {
    let figure = mannequin().unwrap();
    let (camera, settings) = stage();
    let target = look(renderer, &figure, &random_pose(&figure, seed, 0.3));
    let options =
        FigureOptions { sigma: Schedule::Constant(3e-3), gamma: Schedule::Constant(3e-1), ..FigureOptions::default() };
    let pose = random_pose(&figure, seed + 7, 0.3);
    let mut at = |pose: SkeletonPose| {
        let fit = FigureFit::new(figure.clone(), camera, settings.clone(), options.clone(), pose).unwrap();
        fit.differentiate(renderer, &target).unwrap()
    };
    let gradient = at(pose.clone()).1.angles;
    let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
    let h = 3e-3;
    let mut worst = [0.0f64; 2];
    for (i, slope) in gradient.iter().enumerate() {
        // Stiffness is measured from where a fit begins, so it is 0 in all of these.
        let difference = (at(moved(&pose, 3 + i, h)).0 - at(moved(&pose, 3 + i, -h)).0) / (2.0 * h);
        for (worst, factor) in worst.iter_mut().zip([1.0, -1.0]) {
            *worst = worst.max((factor * slope - difference).abs() / length);
        }
    }
    worst
}

#[test]
fn the_gradient_of_a_pose_is_that_of_its_loss() {
    let mut renderer = crate::common::renderer();
    let mut errors: Vec<[f64; 2]> = (1..=tier(1, 3)).map(|seed| gradient_errors(&mut renderer, seed)).collect();
    errors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert!(errors[errors.len() / 2][0] < 0.02, "{errors:?}");
    assert!(errors[errors.len() / 2][1] > 0.5, "a wrong sign is not seen: {errors:?}");
}
