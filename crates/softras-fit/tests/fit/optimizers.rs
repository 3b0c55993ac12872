//! Optimisers and schedules.

use softras_fit::{Method, Optimizer, Schedule};

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
    // Again without a gradient: 0.9 of the mean over 1 - 0.9², and the larger mean square alike.
    uniform.step(&mut x, &[0.0, 0.0], 0.1);
    let root = (0.999 * 0.001 * 16.0 / (1.0 - 0.999f64.powi(2))).sqrt();
    assert!((x[1] - 0.1 - 0.1 * 0.9 * 0.4 / 0.19 / root).abs() < 1e-9, "{x:?}");
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
    let mut second = Optimizer::new(Method::ADAM, 2);
    assert!(second.restore(&first.state()));
    for lengths in [[3, 3], [2, 3], [3, 2]] {
        assert!(!second.restore(&(1, vec![0.0; lengths[0]], vec![0.0; lengths[1]])));
    }
    (5..10).for_each(|i| second.step(&mut y, &gradient(i), 0.1));
    assert_eq!(x, y);
}

#[test]
fn schedules_go_from_one_end_to_the_other() {
    let schedule = Schedule::from((2.0, 8.0));
    let at = [-1.0, 0.0, 0.5, 1.0, 2.0].map(|t| schedule.at(t));
    assert!(at.iter().zip([2.0, 2.0, 4.0, 8.0, 8.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{at:?}");
    assert!((schedule.at_step(2, 5) - 4.0).abs() < 1e-12);
    assert_eq!([schedule.at_step(0, 1), schedule.at_step(0, 5), schedule.at_step(4, 5)], [at[1], at[1], at[3]]);
    assert_eq!(Schedule::from((3.0, 3.0)), Schedule::Constant(3.0));
    assert_eq!(Schedule::Constant(3.0).at(0.7), 3.0);
}
