//! Fits to photographs: views that are held out, and cameras that are off.

use crate::common::renderer;
use crate::doubt::{around, solid, views};
use crate::meshes::{PERSPECTIVE, mapped};
use glam::{DMat4, DVec3};
use softras::{Camera, Mesh, Projection, Renderer, Scene, Settings, scene::Appearance, shapes};
use softras_fit::{Event, Film, Fit, FitOptions, Fitted, Preset, Stage, Told, Voxels};
use softras_io::{PictureFile, Views};
use std::ops::ControlFlow;

fn fitted(views: &Views, hold_out: Option<usize>, renderer: &mut Renderer) -> Fitted {
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
    assert_eq!(fitted(&good, None, &mut renderer).scores.held_out, [8]);
    let first = fitted(&good, Some(2), &mut renderer);
    // View 12 looks from the opposite side of view 4.
    assert_eq!(first.scores.held_out, [4, 11]);
    let mut other = good.clone();
    let pixels = 48 * 48;
    let mask = &mut other.silhouette.as_mut().unwrap().data[4 * pixels..5 * pixels];
    // Within the mask, which tells how large the object is.
    (20..27).for_each(|row| mask[48 * row + 19..48 * row + 29].fill(0.0));
    let judged = fitted(&other, Some(2), &mut renderer);
    assert!(judged.mesh.positions() == first.mesh.positions());
    let [before, after] = [&first, &judged].map(|fitted| fitted.scores.held_out_mask_iou().unwrap());
    assert!(before > 0.7 && after < before - 0.02, "{after}, {before}");
    assert_eq!(judged.scores.fitted, first.scores.fitted);
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

/// Coloured views of a solid from some cameras.
fn colored(renderer: &mut Renderer, cameras: Vec<Camera>, side: u32, color: impl Fn([f32; 3]) -> [f32; 3]) -> Views {
    let mesh = shapes::icosphere(5).unwrap();
    let mesh = mapped(&mesh, |p| [0.6 * p[0], 0.8 * p[1], 0.5 * p[2] + 0.2 * p[0]]);
    colored_mesh(renderer, mesh, cameras, side, color)
}

fn colored_mesh(
    renderer: &mut Renderer,
    mesh: Mesh,
    cameras: Vec<Camera>,
    side: u32,
    color: impl Fn([f32; 3]) -> [f32; 3],
) -> Views {
    let colors = mesh.positions().iter().map(|p| color(*p)).collect();
    let scene = Scene::new(mesh.with_appearance(Appearance::VertexColors(colors)).unwrap());
    let settings = Settings { width: side, height: side, sigma: 1e-7, gamma: 1e-5, ..Settings::default() };
    let settings = settings.with_depths_of(&scene, &cameras, 0.1);
    let frame = renderer.render(&scene, &cameras, &settings).unwrap();
    let (silhouette, color) = (frame.silhouette().unwrap().clone(), frame.color().unwrap().clone());
    Views { cameras, silhouette: Some(silhouette), color: Some(color), ..Views::default() }
}

fn run(views: &Views, steps: usize, change: impl Fn(&mut FitOptions), renderer: &mut Renderer) -> Fitted {
    let mut fit = Fit::new(views.clone()).unwrap().color();
    fit.options.iterations = Some(steps);
    change(&mut fit.options);
    fit.run(renderer, |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn large_pictures_are_cropped_and_give_sharp_textures() {
    let mut renderer = renderer();
    let stripes = |p: [f32; 3]| if (6.0 * p[1]).rem_euclid(2.0) < 1.0 { [0.9; 3] } else { [0.1; 3] };
    // The object takes a quarter of the picture's sides, and is not in its middle.
    let far = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / 8.0;
        let eye = DVec3::new(9.0 * angle.sin(), 2.0, 9.0 * angle.cos());
        Camera::look_at(eye, DVec3::new(0.3, 0.2, 0.0), DVec3::Y, Projection::Perspective { fov_y: 0.6 }).unwrap()
    };
    let mut fitted = |side: u32| {
        let views = colored(&mut renderer, (0..8).map(far).collect(), side, stripes);
        run(&views, 4, |options| (options.crop, options.texture) = (48, Some(512)), &mut renderer)
    };
    let sharp = fitted(256);
    assert_eq!(sharp.notes[0], "pictures of 256×256 pixels are cropped to the object, 48×48 pixels each");
    let volume = Voxels::new(&sharp.mesh, [-1.0; 3], 2.0, 48).unwrap().volume();
    assert!((0.95..1.2).contains(&volume), "{volume}, and of the solid 1.0");
    // The share of painted texels that are as bright as a stripe.
    let pure = |fitted: &Fitted| {
        let Appearance::Textured { textures, .. } = fitted.mesh.appearance() else { unreachable!() };
        let painted = textures[0].texels().iter().filter(|texel| texel[0] > 0.02);
        painted.clone().filter(|texel| (texel[0] - 0.5).abs() > 0.3).count() as f64 / painted.count() as f64
    };
    let (sharp, blurred) = (pure(&sharp), pure(&fitted(64)));
    assert!(sharp > blurred + 0.1, "{sharp} from large pictures, {blurred} from small ones");
}

#[test]
fn cameras_in_pixels_are_those_with_an_angle() {
    let mut renderer = renderer();
    let angles = colored(&mut renderer, around(8), 32, |p| p.map(|x| 0.4 + 0.3 * x));
    let mut pixels = angles.clone();
    for camera in &mut pixels.cameras {
        let Projection::Perspective { fov_y } = *camera.projection() else { unreachable!() };
        let f = 16.0 / (0.5 * fov_y).tan();
        *camera =
            Camera::from_matrix(camera.matrix(), Projection::Pinhole { fx: f, fy: f, cx: 16.0, cy: 16.0 }).unwrap();
    }
    let mut made = |views: &Views| {
        let mut fit = Fit::new(views.clone()).unwrap().color();
        (fit.options.iterations, fit.options.samples, fit.options.texture) = (Some(3), 2, Some(256));
        let told: &mut Told = &mut |_| ControlFlow::Continue(());
        let mut fitting = fit.begin(&mut renderer, told).unwrap();
        let mut film = Film::new(&fitting).unwrap();
        film.add(&fitting.mesh().clone(), &mut renderer).unwrap();
        while fitting.step(&mut renderer, told).unwrap() {}
        let painted = fitting.paint(&mut renderer, told).unwrap();
        let path = std::env::temp_dir().join(format!("softras_film_{}.gif", std::process::id()));
        film.write(&path).unwrap();
        let shown = PictureFile::open(&path).unwrap().decode(&path).unwrap().into_rgb8();
        std::fs::remove_file(&path).unwrap();
        let film =
            shown.pixels().map(|pixel| f64::from(pixel[1])).sum::<f64>() / f64::from(shown.width() * shown.height());
        let texture = painted.as_ref().unwrap().errors[1];
        let scores = fitting.finish(painted, &mut renderer, &mut |_| ControlFlow::Continue(())).unwrap().scores;
        [scores.color.unwrap(), scores.covered[0], texture.unwrap(), film / 255.0]
    };
    let (by_angle, by_pixel) = (made(&angles), made(&pixels));
    let differ = by_angle.iter().zip(&by_pixel).any(|(a, b)| (a - b).abs() > 1e-3);
    assert!(!differ && by_angle[1] > 0.8, "{by_angle:?} {by_pixel:?}");
}

#[test]
fn exposures_that_differ_are_leveled() {
    let mut renderer = renderer();
    let color = |p: [f32; 3]| p.map(|x| 0.35 + 0.2 * x);
    let good = colored(&mut renderer, around(8), 48, color);
    let mut off = good.clone();
    let data = &mut off.color.as_mut().unwrap().data;
    for (view, pixels) in data.chunks_exact_mut(48 * 48 * 3).enumerate() {
        let gain = 1.5f32.powf(2.0 * (3 * view % 8) as f32 / 7.0 - 1.0);
        pixels.iter_mut().for_each(|x| *x *= gain);
    }
    let mut found = |views: &Views, keep: bool| {
        let fitted = run(views, 25, |options| options.keep_exposure = keep, &mut renderer);
        (fitted.scores.color.unwrap(), fitted.notes.iter().any(|note| note.contains("exposures differ")))
    };
    let (clean, kept, leveled) = (found(&good, false), found(&off, true), found(&off, false));
    assert!(!clean.1 && !kept.1 && leveled.1);
    assert!(leveled.0 < 1.2 * clean.0 && kept.0 > 2.0 * clean.0, "{clean:?} {kept:?} {leveled:?}");
}

/// Half of the views are so bright that most of their pixels are white.
#[test]
fn colours_that_are_at_their_end_in_some_views_come_from_the_others() {
    let mut renderer = renderer();
    let good = colored(&mut renderer, around(12), 48, |p| p.map(|x| 0.75 + 0.25 * x));
    let mut off = good.clone();
    for (view, pixels) in off.color.as_mut().unwrap().data.chunks_exact_mut(48 * 48 * 3).enumerate() {
        let gain = [0.7f32, 1.45][view % 2];
        pixels.iter_mut().for_each(|x| *x = (gain * *x).min(1.0));
    }
    let mut mean = |views: &Views| {
        let fitted = run(views, 40, |_| (), &mut renderer);
        let Appearance::VertexColors(colors) = fitted.mesh.appearance() else { panic!("no colours") };
        let sum: f32 = colors.as_flattened().iter().sum();
        (sum / colors.as_flattened().len() as f32, fitted.notes)
    };
    let ((right, _), (found, notes)) = (mean(&good), mean(&off));
    // The gains are relative to their mean.
    assert!((found / right - (0.7f32 * 1.45).sqrt()).abs() < 0.02, "{found}, {right}: {notes:?}");
}

#[test]
fn cameras_that_are_turned_about_the_object_are_refined_by_colours() {
    let mut renderer = renderer();
    let squares = |p: [f32; 3]| p.map(|x| if (9.0 * x).rem_euclid(2.0) < 1.0 { 0.8 } else { 0.2 });
    let good = colored_mesh(&mut renderer, solid(), around(12), 64, squares);
    let turn = |i: usize| DMat4::from_axis_angle(DVec3::new(1.0, 0.5, 0.0).normalize(), [0.06, -0.06][i % 2]);
    let mut off = good.clone();
    let turned = |(i, camera): (usize, &Camera)| Camera::from_matrix(camera.matrix() * turn(i), *camera.projection());
    off.cameras = good.cameras.iter().enumerate().map(turned).collect::<Result<_, _>>().unwrap();
    let fitted = run(&off, 1, |_| (), &mut renderer);
    let mean = |cameras: &[Camera]| {
        let angles = cameras.iter().zip(&good.cameras).map(|(a, b)| a.axes()[0].angle_between(b.axes()[0]));
        angles.sum::<f64>() / 12.0
    };
    let (before, after) = (mean(&off.cameras), mean(&fitted.views.cameras));
    assert!(after < 0.5 * before, "{after} radians, before {before}: {:?}", fitted.notes);
}

#[test]
fn a_quick_fit_is_near_after_a_few_steps() {
    let mut renderer = renderer();
    let halves = |p: [f32; 3]| if p[1] > 0.0 { [0.8, 0.2, 0.2] } else { [0.2, 0.2, 0.8] };
    let views = colored(&mut renderer, around(12), 160, halves);
    let quick = Fit::new(views).unwrap().color().options(FitOptions {
        preset: Preset::Quick,
        color: true,
        ..FitOptions::default()
    });
    let fitted = quick.run(&mut renderer, |_| ControlFlow::Continue(())).unwrap();
    assert_eq!((fitted.steps.len(), fitted.views.size().unwrap()), (20, (96, 96)));
    let (iou, error) = (fitted.scores.held_out_mask_iou().unwrap(), fitted.scores.color.unwrap());
    assert!(iou > 0.97 && error < 0.1, "{iou} {error}");
}

#[test]
fn masks_that_are_wider_than_the_object_are_narrowed_by_colours() {
    let mut renderer = renderer();
    let squares = |p: [f32; 3]| p.map(|x| if (9.0 * x).rem_euclid(2.0) < 1.0 { 0.8 } else { 0.2 });
    let good = colored(&mut renderer, around(12), 96, squares);
    let mut wide = good.clone();
    let distances = softras_fit::signed_distance(good.silhouette.as_ref().unwrap()).unwrap();
    let (mask, color) = (wide.silhouette.as_mut().unwrap(), wide.color.as_mut().unwrap());
    for (pixel, _) in distances.data.iter().enumerate().filter(|(_, d)| (-2.5 / 48.0..0.0).contains(*d)) {
        mask.data[pixel] = 1.0;
        color.data[3 * pixel..3 * pixel + 3].copy_from_slice(&[0.3; 3]);
    }
    let mut found = |views: &Views| {
        let fitted = run(views, 5, |_| (), &mut renderer);
        let volume = Voxels::new(&fitted.mesh, [-1.0; 3], 2.0, 64).unwrap().volume();
        (volume, fitted.notes.iter().any(|note| note.contains("wider than the object")))
    };
    let (clean, narrowed) = (found(&good), found(&wide));
    assert!(!clean.1 && narrowed.1 && (narrowed.0 / clean.0 - 1.0).abs() < 0.05, "{clean:?} {narrowed:?}");
}

#[test]
fn a_fit_tells_what_it_does_from_the_first_second_on_and_can_be_ended_there() {
    let mut renderer = renderer();
    let squares = |p: [f32; 3]| p.map(|x| if (9.0 * x).rem_euclid(2.0) < 1.0 { 0.8 } else { 0.2 });
    let mut views = colored(&mut renderer, around(9), 48, squares);
    views.silhouette.as_mut().unwrap().data[2 * 48 * 48..3 * 48 * 48].fill(0.0);
    let fit = Fit::new(views).unwrap().color().options(FitOptions { texture: Some(256), ..FitOptions::default() });
    let (mut stages, mut notes, mut plans) = (Vec::new(), Vec::new(), Vec::new());
    let mut hear = |event: Event<'_>| {
        match event {
            Event::Progress(at) => stages.push(at.stage),
            Event::Note(text) => notes.push((stages.last().copied(), text.to_string())),
            Event::Plan(text) => plans.push(text.to_string()),
        }
        ControlFlow::Continue(())
    };
    let mut all = fit.clone();
    all.options.iterations = Some(2);
    let fitted = all.run(&mut renderer, &mut hear).unwrap();
    let given: Vec<&String> = notes.iter().map(|(_, text)| text).collect();
    assert!(given.len() > 1 && given.into_iter().eq(&fitted.notes), "{notes:?} {:?}", fitted.notes);
    assert_eq!(notes[0], (Some(Stage::Views), "view 2 shows nothing of the object: it is left out".into()));
    let plan = "9 views of 48×48 pixels are fitted: 2 steps from their hull, then a texture; about ";
    let refined = plans[0].starts_with(plan) && plans[0].ends_with(" more if its cameras are off");
    assert!(plans.len() == 1 && refined, "{plans:?}");
    stages.dedup();
    let order = [Stage::Views, Stage::Masks, Stage::Cameras, Stage::Start, Stage::Shape, Stage::Texture];
    assert_eq!(stages, [&order[..], &[Stage::Scores]].concat());
    for last in order {
        let mut hear = |event: Event<'_>| match event {
            Event::Progress(at) if at.stage == last => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        };
        let mut ended = fit.clone();
        ended.options.iterations = Some(if last == Stage::Texture { 1 } else { 1_000_000 });
        match (ended.run(&mut renderer, &mut hear), last) {
            (Ok(fitted), Stage::Shape) => assert!(!fitted.is_complete && fitted.steps.len() == 1, "{:?}", fitted.steps),
            (Ok(fitted), Stage::Texture) => assert!(!fitted.is_complete && fitted.painted.unwrap().losses.len() < 2),
            (ended, _) => assert!(ended.is_err_and(|error| error.to_string().contains("stopped")), "{last}"),
        }
    }
}

#[test]
fn what_no_view_sees_has_the_colour_beside_it() {
    let mut renderer = renderer();
    let front = |i: usize| Camera::from_angles(4.0, 25.0 * (i % 3) as f64 - 25.0, 14.0 * i as f64 - 49.0, PERSPECTIVE);
    let cameras = (0..8).map(front).collect::<softras::Result<_>>().unwrap();
    let views = colored(&mut renderer, cameras, 48, |_| [0.8, 0.2, 0.1]);
    let fitted = run(&views, 25, |_| (), &mut renderer);
    let Appearance::VertexColors(colors) = fitted.mesh.appearance() else { unreachable!() };
    let behind = fitted.mesh.positions().iter().zip(colors).filter(|(p, _)| p[2] > 0.2 || p[2] < -0.2);
    let off = behind.map(|(_, c)| (c[0] - 0.8).abs().max((c[1] - 0.2).abs())).fold(0.0, f32::max);
    assert!(off < 0.2, "a colour is off by {off}");
}

#[test]
fn a_report_shows_the_worst_view_first_and_loads_nothing() {
    let mut renderer = renderer();
    let mut bad = views(&mut renderer, &solid(), around(12), (48, 48));
    bad.names = (0..12).map(|view| format!("<{view}>.png")).collect();
    let pixels = 48 * 48;
    bad.silhouette.as_mut().unwrap().data[4 * pixels..5 * pixels].fill(0.0);
    let fitted = fitted(&bad, Some(2), &mut renderer);
    let page = fitted.report("a & b", &mut renderer).unwrap();
    let at = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
    let held_out = fitted.scores.held_out.len();
    assert!((0..12).all(|view| view == 4 || at("&lt;4&gt;.png: mask IoU 0.0000") < at(&format!("&lt;{view}&gt;.png"))));
    assert_eq!((page.matches("<img").count(), page.matches(">held out<").count()), (12, held_out));
    assert!(page.contains("<h1>a &amp; b</h1>") && !page.contains("<!--") && !page.contains("/*SCENE*/null"));
    assert!(!page.contains("src=\"http") && !page.contains("<link"));
    // One camera of the page is that of the worst view.
    assert_eq!((page.matches("\"eye\"").count(), page.matches("\"worst\": true").count()), (12, 1));
}
