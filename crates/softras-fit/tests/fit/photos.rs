//! Fits to photographs: views that are held out, and cameras that are off.

use crate::common::renderer;
use crate::doubt::{around, solid, views};
use glam::{DMat4, DVec3};
use softras::Camera;
use softras_fit::{Fit, Fitted};
use softras_io::Views;
use std::ops::ControlFlow;

fn fitted(views: &Views, hold_out: Option<usize>, renderer: &mut softras::Renderer) -> Fitted {
    let mut fit = Fit::new(views.clone()).unwrap();
    fit.options.iterations = Some(4);
    fit.options.keep_views = true;
    fit.options.keep_cameras = true;
    fit.options.hold_out = hold_out;
    fit.run(renderer, |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn views_that_are_held_out_judge_and_change_nothing() {
    let mut renderer = renderer();
    let good = views(&mut renderer, &solid(), around(16), (48, 48));
    let by_default = fitted(&good, None, &mut renderer);
    assert_eq!(by_default.scores.held_out, [4, 12]);
    let mut other = good.clone();
    let pixels = 48 * 48;
    let mask = &mut other.silhouette.as_mut().unwrap().data[4 * pixels..5 * pixels];
    // Within the mask, which tells how large the object is.
    (20..27).for_each(|row| mask[48 * row + 19..48 * row + 29].fill(0.0));
    let judged = fitted(&other, None, &mut renderer);
    assert!(judged.mesh.positions() == by_default.mesh.positions());
    let [before, after] = [&by_default, &judged].map(|fitted| fitted.scores.held_out_mask_iou().unwrap());
    assert!(before > 0.7 && after < before - 0.02, "{after}, {before}");
    assert_eq!(judged.scores.fitted, by_default.scores.fitted);
    assert!(judged.scores.sentence().contains("over the fitted views"), "{}", judged.scores.sentence());
    // Without them the changed view carves the object.
    let all = fitted(&other, Some(0), &mut renderer).scores;
    assert!(all.held_out.is_empty() && all.held_out_mask_iou().is_none() && all.fitted < before - 0.05, "{all:?}");
    // At least one view is fitted.
    assert_eq!(fitted(&good, Some(99), &mut renderer).scores.held_out.len(), 15);
}

#[test]
fn cameras_that_point_aside_are_refined_and_right_ones_stay() {
    let mut renderer = renderer();
    let good = views(&mut renderer, &solid(), around(12), (64, 64));
    let mut off = good.clone();
    // By 2.2 pixels of 0.0096 radians, each another way.
    let aside = |(i, camera): (usize, &Camera)| {
        let way = 2.4 * i as f64;
        let turn = DMat4::from_axis_angle(DVec3::new(way.cos(), way.sin(), 0.0), 0.021);
        Camera::from_matrix(turn * camera.matrix(), *camera.projection()).unwrap()
    };
    off.cameras = off.cameras.iter().enumerate().map(aside).collect();
    let mut found = |views: &Views, refine: bool| {
        let mut fit = Fit::new(views.clone()).unwrap();
        fit.options.iterations = Some(20);
        fit.options.keep_views = true;
        fit.options.keep_cameras = !refine;
        let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
        let is_noted = fitted.notes.iter().any(|note| note.starts_with("the cameras were off"));
        (fitted.mesh, fitted.scores.fitted, is_noted)
    };
    let ((_, refined, noted), (_, kept, _)) = (found(&off, true), found(&off, false));
    assert!(noted && refined > kept + 0.02, "{refined} with refined cameras, {kept} with those given");
    let ((mesh, _, noted), (same, ..)) = (found(&good, true), found(&good, false));
    assert!(!noted && mesh.positions() == same.positions());
}
