//! Depths and normals as targets: their gradients, what they teach that outlines do not, and what is refused.

use crate::common::{self, tier};
use crate::meshes::{self, PERSPECTIVE, euler, mapped, scaled};
use softras::scene::{Background, Outputs};
use softras::{Camera, Image, Lights, Mesh, Renderer, Scene, Settings, shapes};
use softras_check::random::Random;
use softras_fit::{ImageLoss, Method, Parametrization, ShapeFit, ShapeOptions, pooled, voxel_iou};
use softras_io::Views;

const SIDE: u32 = 24;
const ALL: Outputs = Outputs { color: false, ..Outputs::ALL };

fn cameras(count: u32) -> Vec<Camera> {
    meshes::cameras(PERSPECTIVE, 4.0, (0..count).map(|i| [75.0 - 30.0 * f64::from(i % 4), 70.0 * f64::from(i)]))
}

fn settings() -> Settings {
    let (sigma, background) = (1e-3, Background::Composite);
    Settings { width: SIDE, height: SIDE, sigma, gamma: 3e-2, near: 2.0, far: 6.0, background, ..Settings::default() }
}

/// A mesh as some views show it, each pixel the mean of `samples` by `samples` rendered ones.
fn targets(renderer: &mut Renderer, mesh: &Mesh, cameras: Vec<Camera>, samples: u32) -> Views {
    let side = SIDE * samples;
    let sharp = Settings { width: side, height: side, sigma: 1e-7, gamma: 1e-4, outputs: ALL, ..settings() };
    let frame = renderer.render(&Scene::new(mesh.clone()), &cameras, &sharp).unwrap();
    let image = |image: softras::Result<&Image>| Some(pooled(image.unwrap(), samples as usize).unwrap());
    let (silhouette, depth, normal) = (image(frame.silhouette()), image(frame.depth()), image(frame.normal()));
    Views { cameras, silhouette, depth, normal, ..Views::default() }
}

/// Vertices that move by the gradient alone.
fn plain() -> ShapeOptions {
    ShapeOptions {
        parametrization: Parametrization::Vertices,
        method: Method::Sgd { momentum: 0.0 },
        silhouette: (ImageLoss::L2, 0.0),
        depth: (ImageLoss::L2, 0.0),
        normal: (ImageLoss::L2, 0.0),
        regularizers: vec![],
        ..ShapeOptions::smooth()
    }
}

/// The derivative of the loss along a direction of all vertices: by the gradient, and by differences of the loss.
fn slopes(renderer: &mut Renderer, options: &ShapeOptions, seed: u64) -> [f64; 2] {
    let goal = scaled(&shapes::icosphere(2).unwrap(), [0.7, 0.9, 0.8]);
    let targets = targets(renderer, &goal, cameras(2), 1);
    let start = scaled(&shapes::icosphere(1).unwrap(), [0.9, 0.8, 0.75]);
    let mut random = Random::new(seed);
    let direction: Vec<f32> = (0..3 * start.positions().len()).map(|_| random.range(-1.0, 1.0) as f32).collect();
    let mut stepped = |by: f32, rate: f64| {
        let flat = start.positions().as_flattened().iter().zip(&direction).map(|(x, d)| x + by * d);
        let positions = flat.collect::<Vec<f32>>().chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let mesh = Mesh::new(positions, start.triangles().to_vec()).unwrap();
        let mut fit = ShapeFit::new(mesh, Lights::unlit(), options.clone()).unwrap();
        let loss = fit.step(renderer, &settings(), &targets, rate, 0.0).unwrap().loss;
        (loss, fit.mesh().positions().as_flattened().to_vec())
    };
    let moved = stepped(0.0, 1.0).1;
    let flat = start.positions().as_flattened().iter().zip(&moved).zip(&direction);
    let by_gradient = flat.map(|((before, after), d)| f64::from(before - after) * f64::from(*d)).sum();
    let h = 5e-4;
    [by_gradient, (stepped(h, 0.0).0 - stepped(-h, 0.0).0) / (2.0 * f64::from(h))]
}

#[test]
fn gradients_are_those_of_the_losses() {
    let cases = [
        ("depth", ShapeOptions { depth: (ImageLoss::L2, 3.0), ..plain() }),
        ("normal", ShapeOptions { normal: (ImageLoss::L2, 3.0), ..plain() }),
        ("depth, with samples", ShapeOptions { depth: (ImageLoss::L2, 2.0), samples: 2, ..plain() }),
        (
            "both, with silhouettes",
            ShapeOptions {
                depth: (ImageLoss::L2, 2.0),
                normal: (ImageLoss::L2, 1.0),
                silhouette: (ImageLoss::L2, 1.0),
                ..plain()
            },
        ),
    ];
    let mut renderer = common::renderer();
    for (name, options) in cases {
        // The middle one of several directions: where a face is seen from its edge, the model itself jumps.
        let mut errors: Vec<[f64; 2]> = (1..6)
            .map(|seed| {
                let [by_gradient, by_difference] = slopes(&mut renderer, &options, seed);
                [1.0, -1.0].map(|sign| (sign * by_gradient - by_difference).abs() / by_difference.abs())
            })
            .collect();
        errors.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(errors[2][0] < 0.02, "{name}: {errors:?}");
        assert!(errors[2][1] > 1.0, "{name}: a wrong sign is not seen");
    }
}

#[test]
fn depths_and_normals_show_what_outlines_hide() {
    let mut renderer = common::renderer();
    let (subdivisions, views, count, rate) = tier((3, 4, 130, 0.04), (4, 8, 160, 0.02));
    // A ball with a deep hollow that its outlines do not show.
    let ball = shapes::icosphere(subdivisions).unwrap();
    let hollow = |p: [f32; 3]| {
        let by = 1.0 - 0.5 * (1.0 - (p[0] * p[0] + p[2] * p[2]) / 0.16).max(0.0) * f32::from(u8::from(p[1] > 0.0));
        p.map(|x| by * x)
    };
    let goal = mapped(&ball, hollow);
    let all = targets(&mut renderer, &goal, cameras(views), 2);
    let mut reached = |targets: &Views| {
        let options =
            ShapeOptions { depth: (ImageLoss::L1, 20.0), normal: (ImageLoss::L1, 1.0), ..ShapeOptions::smooth() };
        let mut fit = ShapeFit::new(shapes::icosphere(subdivisions).unwrap(), Lights::unlit(), options).unwrap();
        let soft = Settings { sigma: 1e-4, ..settings() };
        let steps: Vec<_> = (0..count).map(|_| fit.step(&mut renderer, &soft, targets, rate, 0.0).unwrap()).collect();
        let mesh = fit.mesh();
        // The top's height on the axis, where the hollow is deepest.
        let inner = mesh.positions().iter().filter(|p| p[0].hypot(p[2]) < 0.12 && p[1] > 0.0);
        (inner.map(|p| p[1]).fold(f32::INFINITY, f32::min), steps)
    };
    let outlines = Views { depth: None, normal: None, ..all.clone() };
    let (height, steps) = reached(&outlines);
    assert!(height > 0.85, "{height}");
    assert!(steps.iter().all(|step| step.depth == 0.0 && step.normal == 0.0));
    for targets in tier(vec![all.clone()], vec![Views { normal: None, ..all.clone() }, all]) {
        let (height, steps) = reached(&targets);
        assert!(height < 0.7, "{height}");
        let (first, last) = (steps[0].depth, steps[count - 1].depth);
        assert!(last < 0.5 * first, "{last} of {first}");
    }
}

#[test]
fn depths_carve_a_hull() {
    let mut renderer = common::renderer();
    let mug = softras::shapes::by_name("mug").unwrap();
    let all = targets(&mut renderer, &mug, cameras(16), 2);
    let iou =
        |targets: &Views| voxel_iou(&softras_fit::visual_hull(targets, [0.0; 3], 3.0, 64).unwrap(), &mug, 48).unwrap();
    let (outlines, depths) = (iou(&Views { depth: None, ..all.clone() }), iou(&all));
    assert!(outlines < 0.65 && depths > outlines + 0.15, "{outlines} by outlines, {depths} by depths");
    // One solid of one handle, with nothing around it and no bubbles in it.
    let hull = softras_fit::visual_hull(&all, [0.0; 3], 3.0, 64).unwrap();
    assert_eq!(euler(&hull), 0);
}

#[test]
fn what_is_no_depth_is_not_known() {
    let mut renderer = common::renderer();
    let ball = shapes::icosphere(2).unwrap();
    let good = targets(&mut renderer, &ball, cameras(2), 1);
    let outlines = Views { depth: None, normal: None, ..good.clone() };
    let by_outlines = softras_fit::visual_hull(&outlines, [0.0; 3], 3.0, 32).unwrap();
    assert_ne!(softras_fit::visual_hull(&good, [0.0; 3], 3.0, 32).unwrap(), by_outlines);
    let options = ShapeOptions { depth: (ImageLoss::L1, 1.0), normal: (ImageLoss::L1, 1.0), ..plain() };
    for value in [0.0, -4.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let all =
            |image: &Option<Image>| image.clone().map(|image| Image { data: vec![value; image.data.len()], ..image });
        let unknown = Views { depth: all(&good.depth), normal: None, ..good.clone() };
        assert_eq!(softras_fit::visual_hull(&unknown, [0.0; 3], 3.0, 32).unwrap(), by_outlines, "{value}");
        // A negative number may well be a part of a normal.
        let normal = if value == -4.0 { None } else { all(&good.normal) };
        let unknown = Views { normal, ..unknown };
        let mut fit = ShapeFit::new(ball.clone(), Lights::unlit(), options.clone()).unwrap();
        let step = fit.step(&mut renderer, &settings(), &unknown, 1.0, 0.0).unwrap();
        assert!(step.depth == 0.0 && step.normal == 0.0 && fit.mesh().positions() == ball.positions(), "{value}");
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let mut renderer = common::renderer();
    let ball = shapes::icosphere(1).unwrap();
    let good = targets(&mut renderer, &ball, cameras(2), 1);
    let fit = |options| ShapeFit::new(ball.clone(), Lights::unlit(), options);
    for options in [
        ShapeOptions { depth: (ImageLoss::NegativeIou, 1.0), ..plain() },
        ShapeOptions { normal: (ImageLoss::NegativeIou, 1.0), ..plain() },
    ] {
        assert!(fit(options).is_err_and(|e| e.to_string().contains("IoU of depths or normals")));
    }
    let one_channel = Views { normal: good.depth.clone(), ..good.clone() };
    assert!(one_channel.size().is_err_and(|e| e.to_string().contains("normals of shape [2, 24, 24, 1]")));
    let one_view = targets(&mut renderer, &ball, cameras(1), 1);
    let of_one_view = Views { depth: one_view.depth, ..good.clone() };
    assert!(
        softras_fit::visual_hull(&of_one_view, [0.0; 3], 3.0, 32)
            .is_err_and(|e| e.to_string().contains("depths of shape [1, 24, 24, 1]"))
    );
    // Nothing known is nothing to learn from.
    let unknown = Views { depth: good.depth.clone().map(|d| Image { data: vec![0.0; d.data.len()], ..d }), ..good };
    let unknown = Views { normal: None, silhouette: None, ..unknown };
    let mut shape = fit(ShapeOptions { depth: (ImageLoss::L1, 1.0), ..plain() }).unwrap();
    let step = shape.step(&mut renderer, &settings(), &unknown, 1.0, 0.0).unwrap();
    assert!(step.loss == 0.0 && shape.mesh().positions() == ball.positions());
}
