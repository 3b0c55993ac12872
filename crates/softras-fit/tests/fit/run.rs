//! Shape fits, their presets, and a loss of one's own.

use crate::common;
use crate::meshes::{PERSPECTIVE, both, cameras, cube, mapped, moved};
use softras::scene::{Appearance, Outputs};
use softras::{Error, Frame, Image, ImageGradient, Lights, Mesh, Renderer, RendererOptions, Scene, Settings, shapes};
use softras_fit::{
    Event, Fit, FitOptions, ImageLoss, Regularizer, ShapeFit, ShapeOptions, ShapeRun, Stage, ViewsOfMesh,
};
use softras_io::Views;
use std::ops::ControlFlow;

const SIDE: u32 = 32;

/// A renderer, the silhouettes of a cube from four sides, and settings for fits to them.
fn goal() -> (common::Loan, Views, Settings) {
    goal_of(shapes::cube().unwrap(), 4)
}

/// A renderer, the silhouettes of a mesh from a number of sides, and settings for fits to them.
fn goal_of(mesh: Mesh, sides: u32) -> (common::Loan, Views, Settings) {
    let mut renderer = common::renderer();
    let scene = Scene::new(mesh);
    let angles = (0..sides).map(|i| [20.0, 360.0 / f64::from(sides) * f64::from(i) + 10.0]);
    let cameras = cameras(PERSPECTIVE, 4.0, angles);
    let settings = Settings { width: SIDE, height: SIDE, sigma: 1e-4, ..Settings::default() }
        .with_depths_of(&scene, &cameras, 0.5);
    let silhouette = renderer.render(&scene, &cameras, &settings).unwrap().silhouette().ok().cloned();
    (renderer, Views { cameras, silhouette, ..Views::default() }, settings)
}

/// The losses of some steps, and the step and mesh of the least.
fn fitted(mut fit: ShapeRun, renderer: &mut Renderer, settings: &Settings, rate: f64) -> (Vec<f64>, (Mesh, usize)) {
    assert!(fit.best().is_none());
    let losses = (0..30).map(|_| fit.step(renderer, settings, rate, 0.0).unwrap().loss).collect();
    let (mesh, step) = fit.best().unwrap();
    (losses, (mesh.clone(), step))
}

#[test]
fn both_presets_fit_the_crates_own_sphere() {
    // Each with its start, its rate, and the share of the loss that 30 steps leave at most: they left 0.59 and 0.76.
    let presets = [(ShapeOptions::smooth(), 1.0, 0.02, 0.7), (ShapeOptions::official(), 0.5, 0.03, 0.85)];
    for (options, start, rate, most) in presets {
        let (mut renderer, targets, settings) = goal();
        let shape = ShapeFit::new(shapes::icosphere(3).unwrap(), Lights::unlit(), options.clone()).unwrap();
        // The official sphere begins at half its size, the other one as it is.
        let reach = shape.mesh().positions().as_flattened().iter().fold(0.0f32, |most, x| most.max(x.abs()));
        assert_eq!(reach, start);
        let (losses, (mesh, step)) = fitted(ShapeRun::new(shape, &targets), &mut renderer, &settings, rate);
        assert_eq!(losses.len(), 30);
        assert!(losses[29] < most * losses[0], "{start} {losses:?}");
        let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(losses[step] == least && mesh.positions().len() == 642, "{step} {losses:?}");
    }
    // A mesh that is larger than the box by more than rounding has other units.
    let large = moved(&shapes::icosphere(1).unwrap(), 3.0, [0.0; 3]);
    let error = ShapeFit::new(large, Lights::unlit(), ShapeOptions::official()).unwrap_err();
    assert!(error.to_string().contains("ShapeOptions::smooth()"), "{error}");
}

#[test]
fn a_loss_of_ones_own_moves_what_the_fit_moves() {
    let (mut renderer, targets, settings) = goal();
    let ball = shapes::icosphere(2).unwrap();
    let gray = Appearance::VertexColors(vec![[0.5; 3]; ball.positions().len()]);
    let options = ShapeOptions { fit_colors: true, ..ShapeOptions::smooth() };
    let shape = |options: &ShapeOptions| {
        let mesh = ball.clone().with_appearance(gray.clone()).unwrap();
        ShapeFit::new(mesh, Lights::unlit(), options.clone()).unwrap()
    };
    let (mut fit, mut own) = (shape(&options), shape(&options));
    let step = fit.step(&mut renderer, &settings, &targets, 0.02, 0.01).unwrap();
    let seen = Settings { outputs: Outputs { color: false, ..settings.outputs }, save: true, ..settings };
    let target = targets.silhouette.as_ref().unwrap();
    let by_iou = |frame: &Frame| {
        let loss = ImageLoss::NegativeIou.evaluate(frame.silhouette().unwrap(), target, None)?;
        Ok((loss.value, ImageGradient::silhouette(loss.gradient)))
    };
    let value = own.step_by(&mut renderer, &seen, &targets.cameras, by_iou, (0.02, 0.01)).unwrap();
    assert_eq!(value, step.silhouette);
    assert!(own.mesh() == fit.mesh() && own.state() == fit.state() && own.mesh().positions() != ball.positions());
    // Values that are not fitted stay, whatever the loss is.
    let mut still = shape(&ShapeOptions { fit_positions: false, ..options });
    let by_color = |frame: &Frame| {
        let color = frame.color()?;
        let ones = Image { data: vec![1.0; color.data.len()], ..*color };
        Ok((0.0, ImageGradient { color: Some(ones), ..by_iou(frame)?.1 }))
    };
    let colored = Settings { outputs: Outputs { color: true, ..seen.outputs }, ..seen };
    still.step_by(&mut renderer, &colored, &targets.cameras, by_color, (0.02, 0.01)).unwrap();
    assert!(still.mesh().positions() == ball.positions() && *still.mesh().appearance() != gray);
}

/// Where the device does not hold all views at once they are rendered in parts: the same losses but for the order of sums.
#[test]
fn views_are_fitted_in_parts_where_memory_is_short() {
    let (mut renderer, targets, settings) = goal();
    let shape = || ShapeFit::new(shapes::icosphere(3).unwrap(), Lights::unlit(), ShapeOptions::smooth()).unwrap();
    let steps = |fit: &mut ShapeFit, renderer: &mut Renderer| -> Vec<f64> {
        (0..4).map(|_| fit.step(renderer, &settings, &targets, 0.01, 0.0).unwrap().loss).collect()
    };
    let expected = steps(&mut shape(), &mut renderer);
    let within = |memory| common::renderer_with(RendererOptions { memory: Some(memory), ..Default::default() });
    let held = {
        let mut fresh = common::renderer_with(RendererOptions::default());
        steps(&mut shape(), &mut fresh);
        fresh.device_bytes()
    };
    let mut tight = within(held * 2 / 3);
    let refused = tight.render_saved(&Scene::new(shape().mesh().clone()), &targets.cameras, &settings);
    assert!(matches!(refused, Err(Error::OutOfMemory { .. })), "{refused:?}");
    let losses = steps(&mut shape(), &mut tight);
    let worst = losses.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-4, "{worst} {losses:?} {expected:?}");
    // A view that does not fit alone is an error.
    let step = shape().step(&mut within(1000), &settings, &targets, 0.01, 0.0);
    assert!(matches!(step, Err(Error::OutOfMemory { .. })));
}

/// A step that compares some of the views has their loss alone, a fit that is resumed takes the views that the other would have
/// taken, and the best mesh is the one of the least mean over a turn of the views.
#[test]
fn steps_of_some_of_the_views_take_them_in_turn() {
    // Each side of a bar has another loss.
    let bar = mapped(&cube(), |[x, y, z]| [1.8 * x, 0.7 * y, 0.6 * z + 0.2 * x]);
    let (mut renderer, targets, settings) = goal_of(bar, 6);
    let options = ShapeOptions { regularizers: vec![], views_per_step: 2, ..ShapeOptions::smooth() };
    let shape = || ShapeFit::new(shapes::icosphere(2).unwrap(), Lights::unlit(), options.clone()).unwrap();
    let mut fit = ShapeRun::new(shape(), &targets);
    // The last of these steps has the views of the largest loss.
    let losses: Vec<f64> = (0..29).map(|_| fit.step(&mut renderer, &settings, 0.02, 0.0).unwrap().loss).collect();
    let (_, best) = fit.best().unwrap();
    let turns: Vec<f64> = losses.windows(3).map(|turn| turn.iter().sum()).collect();
    let least = |values: &[f64]| (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap();
    assert!(turns[26] < 0.85 * turns[0], "{losses:?}");
    assert_eq!(best, least(&turns) + 2, "{losses:?}");
    assert_ne!(best, least(&losses), "the least loss of a step is of other views: {losses:?}");

    // Without a step's length nothing moves, so that its loss is that of its views at the start.
    let mut still = shape();
    let mut of_steps = Vec::new();
    for _ in 0..3 {
        of_steps.push(still.step(&mut renderer, &settings, &targets, 0.0, 0.0).unwrap().loss);
    }
    let one_by_one = |view: usize| {
        let picture = targets.silhouette.as_ref().unwrap();
        let alone = Image { batch: 1, data: picture.view(view).to_vec(), ..*picture };
        let alone = Views { cameras: vec![targets.cameras[view]], silhouette: Some(alone), ..Views::default() };
        let all = ShapeOptions { views_per_step: 0, ..options.clone() };
        let mut fit = ShapeFit::new(shapes::icosphere(2).unwrap(), Lights::unlit(), all).unwrap();
        fit.step(&mut renderer, &settings, &alone, 0.0, 0.0).unwrap().loss
    };
    let each: Vec<f64> = (0..6).map(one_by_one).collect();
    let pairs = |a: usize| (0..a).map(move |b| (a, b));
    let is_pair = |loss: f64| (0..6).flat_map(pairs).any(|(a, b)| (loss - 0.5 * (each[a] + each[b])).abs() < 1e-5);
    assert!(of_steps.iter().all(|&loss| is_pair(loss)), "{of_steps:?} {each:?}");
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    assert!((mean(&of_steps) - mean(&each)).abs() < 1e-5, "{of_steps:?} {each:?}");

    let (mut whole, mut first, mut second) = (shape(), shape(), shape());
    for step in 0..3 {
        whole.step(&mut renderer, &settings, &targets, 0.02, 0.0).unwrap();
        let resumed = if step < 1 { &mut first } else { &mut second };
        resumed.step(&mut renderer, &settings, &targets, 0.02, 0.0).unwrap();
        if step == 0 {
            second.restore(first.state()).unwrap();
        }
    }
    assert_eq!(second.mesh().positions(), whole.mesh().positions());
}

/// The first 0.6 of the steps from a hull of 24 views compare twelve of them, and the other steps all; with 23 views each step compares all.
#[test]
fn large_steps_compare_half_of_many_views() {
    let mut renderer = common::renderer();
    let mut losses = |count: usize, views_per_step: usize| -> Vec<f64> {
        let views = ViewsOfMesh { count, size: (SIDE, SIDE), ..ViewsOfMesh::default() };
        let mut fit = Fit::of_mesh(shapes::torus(0.7, 0.3, 24, 12).unwrap(), &views, &mut renderer).unwrap();
        fit.options = FitOptions { iterations: Some(5), keep_topology: true, views_per_step, ..fit.options };
        let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
        fitted.steps.iter().map(|step| step.losses.loss).collect()
    };
    let [of_itself, few, all] = [0, 12, 24].map(|views_per_step| losses(24, views_per_step));
    assert_eq!(of_itself[..3], few[..3]);
    assert_ne!(of_itself[0], all[0]);
    assert_ne!(of_itself[3], few[3], "all views from the fourth step on");
    assert_eq!(losses(23, 0), losses(23, 23));
}

#[test]
fn the_sum_over_the_edges_of_a_large_mesh_weighs_less() {
    let mut renderer = common::renderer();
    let mut of = |edge: f64, flatten: Option<f64>| {
        let views = ViewsOfMesh { count: 12, size: (SIDE, SIDE), ..ViewsOfMesh::default() };
        let mut fit = Fit::of_mesh(shapes::icosphere(3).unwrap(), &views, &mut renderer).unwrap();
        fit.options = FitOptions { iterations: Some(1), edge: Some((edge, edge)), flatten, ..fit.options };
        let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
        (fitted.mesh.triangles().len() as f64, fitted.options.regularizers)
    };
    let (laplacian, flatten) = ((Regularizer::Laplacian, 0.01), 3e-5);
    let (triangles, weights) = of(2.0, None);
    assert!(triangles < 6000.0 && weights == [laplacian, (Regularizer::Flatten, flatten)], "{triangles} {weights:?}");
    let (triangles, weights) = of(0.3, None);
    let share = 6000.0 / triangles;
    assert!(share < 0.9 && weights == [laplacian, (Regularizer::Flatten, flatten * share)], "{triangles} {weights:?}");
    // A weight that is given is the weight.
    assert_eq!(of(0.3, Some(flatten)).1, [laplacian, (Regularizer::Flatten, flatten)]);
}

/// A part of a hull that few pixels show is left out with a note, and a larger one stays.
#[test]
fn specks_of_a_hull_are_left_out() {
    let mut renderer = common::renderer();
    let ball = shapes::icosphere(2).unwrap();
    let mut of = |radius: f32| {
        let views = ViewsOfMesh { count: 12, size: (SIDE, SIDE), ..ViewsOfMesh::default() };
        let two = both(&ball, &moved(&ball, radius, [1.5, 0.0, 0.0]));
        let mut fit = Fit::of_mesh(two, &views, &mut renderer).unwrap();
        fit.options = FitOptions { iterations: Some(1), keep_topology: true, ..fit.options };
        let fitted = fit.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
        (fitted.scores.parts, fitted.notes.iter().filter(|note| note.contains("1 part(s) of the hull")).count())
    };
    assert_eq!([of(0.2), of(0.4)], [(1, 1), (2, 0)]);
}

#[test]
fn a_fit_can_be_broken_while_its_hull_is_made_and_while_it_is_judged() {
    let mut renderer = common::renderer();
    let views = ViewsOfMesh { count: 12, size: (SIDE, SIDE), ..ViewsOfMesh::default() };
    let mut fit = Fit::of_mesh(shapes::icosphere(3).unwrap(), &views, &mut renderer).unwrap();
    fit.options.iterations = Some(1);
    // The events of each stage until one is the last, and what comes of it.
    let mut broken_at = |stage: Stage, most: usize| {
        let mut heard = 0;
        let outcome = fit.clone().run(&mut renderer, |event| {
            heard += usize::from(matches!(event, Event::Progress(at) if at.stage == stage));
            if heard == most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (heard, outcome)
    };
    let (heard, whole) = broken_at(Stage::Start, usize::MAX);
    assert!(heard > 10 && whole.unwrap().is_complete, "{heard}");
    let (_, outcome) = broken_at(Stage::Start, heard / 2);
    assert!(outcome.unwrap_err().to_string().contains("a fit that was stopped"));
    let (heard, _) = broken_at(Stage::Scores, usize::MAX);
    assert!(heard > 12, "{heard}");
    let fitted = broken_at(Stage::Scores, heard / 2).1.unwrap();
    assert!(!fitted.is_complete && fitted.scores.masks.is_empty() && !fitted.mesh.triangles().is_empty());
    assert_eq!(fitted.scores.sentence(), "not judged, 1 part of genus 0");
}
