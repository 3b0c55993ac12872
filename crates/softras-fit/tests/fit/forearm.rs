//! The example `forearm`: gradients to angles, and a limb that is found behind the body.
#![allow(dead_code, reason = "the example prints and draws too")]

#[path = "../../examples/forearm/figure.rs"]
mod figure;
#[path = "../../examples/forearm/mannequin.rs"]
mod mannequin;
#[path = "../../examples/forearm/skeleton.rs"]
mod skeleton;
#[path = "../../examples/forearm/trial.rs"]
mod trial;

use crate::common::tier;
use glam::DVec3;
use skeleton::SkeletonPose;
use softras_check::random::Random;

/// The largest difference between the pulled gradient of Σ w·x and central differences, in parts of the largest.
fn pull_error(seed: u64, factor: f64) -> f64 {
    let figure = mannequin::mannequin().unwrap();
    let mut random = Random::new(seed);
    let mut pose = figure.skeleton.rest();
    pose.angles.iter_mut().for_each(|angle| *angle = random.range(-1.5, 1.5));
    let mut vector = || DVec3::from([0; 3].map(|_| random.range(-1.0, 1.0)));
    pose.shift = vector();
    let weights: Vec<DVec3> = figure.mesh.positions().iter().map(|_| vector()).collect();
    let loss =
        |pose: &SkeletonPose| -> f64 { figure.positions(pose).iter().zip(&weights).map(|(x, w)| x.dot(*w)).sum() };
    let slope = |step: &dyn Fn(&mut SkeletonPose, f64)| {
        let at = |by: f64| {
            let mut moved = pose.clone();
            step(&mut moved, by);
            loss(&moved)
        };
        (at(1e-5) - at(-1e-5)) / 2e-5
    };
    let pulled = figure.pull(&pose, &weights);
    let by_shift = (0..3).map(|k| (pulled.shift[k], slope(&|pose, by| pose.shift[k] += by)));
    let by_angle = pulled.angles.iter().enumerate().map(|(i, g)| (*g, slope(&|pose, by| pose.angles[i] += by)));
    let pairs: Vec<(f64, f64)> = by_shift.chain(by_angle).collect();
    let largest = pairs.iter().fold(0.0f64, |most, (g, _)| most.max(g.abs()));
    pairs.iter().map(|(g, expected)| (factor * g - expected).abs() / largest).fold(0.0, f64::max)
}

#[test]
fn gradients_reach_every_angle() {
    for seed in 1..4 {
        assert!(pull_error(seed, 1.0) < 1e-7, "seed {seed}: {}", pull_error(seed, 1.0));
        assert!(pull_error(seed, 1.01) > 1e-3, "a wrong gradient is not seen");
    }
}

#[test]
fn a_hidden_forearm_is_found_by_soft_gradients_alone() {
    let (stage, mut renderer) = (trial::Stage::new().unwrap(), crate::common::renderer());
    let trial = stage.draw(&mut Random::new(1), &mut renderer).unwrap().unwrap();
    let mut error = |method: usize| {
        let pose = stage.fit(&trial, &trial::methods()[method], tier(100, trial::STEPS), &mut renderer).unwrap();
        stage.errors(&pose, &trial.truth)[0]
    };
    let (visible, soft) = (error(0), error(3));
    assert!(soft < 10.0 && visible > 30.0, "soft {soft}, visible only {visible}");
}
