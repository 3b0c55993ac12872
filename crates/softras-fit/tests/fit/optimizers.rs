//! Optimisers, schedules and the smoothed parametrisation.

use glam::DVec3;
use softras::shapes;
use softras_fit::{Method, Optimizer, Schedule};
use softras_fit::{Smoothing, Topology};

/// Steps until (x - 1)² + 10 (y + 2)² is below 1e-6; `None` after 5000.
fn steps_to_the_bottom(method: Method, rate: f64) -> Option<usize> {
    let (mut x, mut optimizer) = ([0.0, 0.0], Optimizer::new(method, 2));
    (0..5000).find(|_| {
        let gradient = [2.0 * (x[0] - 1.0), 20.0 * (x[1] + 2.0)];
        optimizer.step(&mut x, &gradient, rate);
        (x[0] - 1.0).powi(2) + 10.0 * (x[1] + 2.0).powi(2) < 1e-6
    })
}

#[test]
fn every_method_finds_the_bottom() {
    let uniform = Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-8 };
    for (method, rate) in [(Method::Sgd { momentum: 0.5 }, 0.02), (Method::ADAM, 0.05), (uniform, 0.5)] {
        assert!(steps_to_the_bottom(method, rate).is_some(), "{method:?}");
        assert!(steps_to_the_bottom(method, -rate).is_none(), "{method:?} uphill");
    }
}

#[test]
fn steps_are_those_of_the_formulas() {
    // Adam's first step is the rate, whatever the gradient's size.
    let mut x = [0.0, 0.0];
    let mut adam = Optimizer::new(Method::ADAM, 2);
    adam.step(&mut x, &[1e-3, -1e3], 0.1);
    assert!((x[0] + 0.1).abs() < 1e-5 && (x[1] - 0.1).abs() < 1e-9, "{x:?}");
    // The second, by hand: m = 0.1 · 0.9 g + 0.1 h, v alike.
    adam.step(&mut x, &[0.0, 0.0], 0.1);
    let (m, v) = (0.9 * 0.1 * 1e3 / (1.0 - 0.81), 0.999 * 0.001 * 1e6 / (1.0 - 0.999f64.powi(2)));
    assert!((x[1] - (0.1 + 0.1 * m / v.sqrt())).abs() < 1e-9, "{x:?}");
    let mut x = [0.0, 0.0];
    let mut uniform = Optimizer::new(Method::UniformAdam { betas: [0.9, 0.999], epsilon: 0.0 }, 2);
    uniform.step(&mut x, &[3.0, -4.0], 0.1);
    assert!((x[0] + 0.075).abs() < 1e-9 && (x[1] - 0.1).abs() < 1e-9, "{x:?}");
    // ε is added to the root: where it is as large, half a step.
    for method in [Method::ADAM, Method::UniformAdam { betas: [0.9, 0.999], epsilon: 1e-8 }] {
        let mut x = [0.0];
        Optimizer::new(method, 1).step(&mut x, &[1e-8], 0.1);
        assert!((x[0] + 0.05).abs() < 1e-9, "{method:?}: {x:?}");
    }
    let mut x = [0.0];
    let mut sgd = Optimizer::new(Method::Sgd { momentum: 0.5 }, 1);
    sgd.step(&mut x, &[1.0], 0.1);
    sgd.step(&mut x, &[1.0], 0.1);
    assert!((x[0] + 0.25).abs() < 1e-12, "{x:?}");
}

#[test]
fn a_saved_optimizer_goes_on_as_if_nothing_had_happened() {
    let gradient = |i: i32| [f64::from(i).sin(), f64::from(i).cos()];
    let (mut x, mut whole) = ([0.0; 2], Optimizer::new(Method::ADAM, 2));
    (0..10).for_each(|i| whole.step(&mut x, &gradient(i), 0.1));
    let (mut y, mut first) = ([0.0; 2], Optimizer::new(Method::ADAM, 2));
    (0..5).for_each(|i| first.step(&mut y, &gradient(i), 0.1));
    let (steps, mean, square) = first.state();
    let mut second = Optimizer::new(Method::ADAM, 2);
    assert!(second.restore(steps, mean, square) && !second.restore(1, &[0.0; 3], &[0.0; 3]));
    assert!(!second.restore(1, &[0.0; 2], &[0.0; 3]) && !second.restore(1, &[0.0; 3], &[0.0; 2]));
    (5..10).for_each(|i| second.step(&mut y, &gradient(i), 0.1));
    assert_eq!(x, y);
}

#[test]
fn schedules_go_from_one_end_to_the_other() {
    for (schedule, middle) in
        [(Schedule::Linear { from: 2.0, to: 8.0 }, 5.0), (Schedule::Exponential { from: 2.0, to: 8.0 }, 4.0)]
    {
        let at = [-1.0, 0.0, 0.5, 1.0, 2.0].map(|t| schedule.at(t));
        let expected = [2.0, 2.0, middle, 8.0, 8.0];
        assert!(at.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{schedule:?}: {at:?}");
        assert!((schedule.at_step(2, 5) - middle).abs() < 1e-12);
        assert_eq!([schedule.at_step(0, 1), schedule.at_step(0, 5), schedule.at_step(4, 5)], [at[1], at[1], at[3]]);
    }
    assert_eq!(Schedule::Constant(3.0).at(0.7), 3.0);
}

#[test]
fn smoothing_solves_its_system() {
    let mesh = shapes::icosphere(3).unwrap();
    // An isolated vertex is a component of its own.
    let topology = Topology::new(mesh.positions().len() + 1, mesh.triangles()).unwrap();
    let mut positions: Vec<DVec3> = mesh.positions().iter().map(|p| DVec3::from(p.map(f64::from))).collect();
    positions.push(DVec3::new(3.0, 4.0, 5.0));
    let smoothing = Smoothing::new(&topology, 19.0).unwrap();
    assert_eq!(smoothing.lambda(), 19.0);
    let mut solved = smoothing.undo(&positions).unwrap();
    let distance = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(distance(&solved, &positions) > 0.1, "a smoothing of 19 does something");
    smoothing.apply(&mut solved).unwrap();
    assert!(distance(&solved, &positions) < 1e-10, "{}", distance(&solved, &positions));
    // A step of one vertex moves its surroundings, and the sum of all steps stays.
    let mut step = vec![DVec3::ZERO; positions.len()];
    step[100] = DVec3::X;
    smoothing.apply(&mut step).unwrap();
    let neighbor = topology.neighbors(100)[0] as usize;
    assert!(step[100].x < 0.5 && step[neighbor].x > 0.2 * step[100].x && step[neighbor].x < step[100].x);
    assert!((step.iter().map(|s| s.x).sum::<f64>() - 1.0).abs() < 1e-10);
    assert!(Smoothing::new(&topology, f64::NAN).is_err() && smoothing.apply(&mut [DVec3::ZERO; 3]).is_err());
}
