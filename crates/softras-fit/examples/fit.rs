//! Fits a mesh to silhouettes: `cargo run --release --example fit`.
//!
//! The silhouettes here are of a cube that the library makes; yours would be masks of photographs, with the cameras that took
//! them. Writes the fitted mesh to `fitted.obj` in the working folder, or to the file that is given as argument.

use softras::{Camera, Lights, Projection, Renderer, Scene, Settings, shapes};
use softras_fit::{Schedule, ShapeFit, ShapeOptions, ShapeRun, mask_iou};
use softras_io::Views;
use std::path::PathBuf;

const STEPS: usize = 150;
const VIEWS: u32 = 12;

fn main() -> softras::Result<()> {
    let out = PathBuf::from(std::env::args_os().nth(1).unwrap_or_else(|| "fitted.obj".into()));
    let mut renderer = Renderer::new()?;

    // What to reach: the silhouettes of a cube. Near and far have room for a mesh that moves.
    let goal = Scene::new(shapes::cube()?);
    let projection = Projection::Perspective { fov_y: 0.6 };
    let around = |i: u32| {
        let elevation = if i.is_multiple_of(2) { 30.0 } else { -20.0 };
        Camera::from_angles(4.0, elevation, 360.0 * f64::from(i) / f64::from(VIEWS), projection)
    };
    let cameras: Vec<Camera> = (0..VIEWS).map(around).collect::<softras::Result<_>>()?;
    let settings = Settings { width: 64, height: 64, ..Settings::default() }.with_depths_of(&goal, &cameras, 0.5);
    let silhouette = Some(renderer.render(&goal, &cameras, &settings)?.silhouette()?.clone());
    let targets = Views { cameras: cameras.clone(), silhouette, ..Views::default() };

    // A sphere, moved by the method of the command `softras fit`, with softness and steps that shrink.
    let shape = ShapeFit::new(shapes::icosphere(3)?, Lights::unlit(), ShapeOptions::smooth())?;
    let mut fit = ShapeRun::new(shape, &targets);
    let rate = Schedule::Exponential { from: 0.04, to: 0.007 };
    let sigma = Schedule::Exponential { from: 3e-4, to: 1e-5 };
    for step in 0..STEPS {
        let settings = Settings { sigma: sigma.at_step(step, STEPS), ..settings.clone() };
        let found = fit.step(&mut renderer, &settings, rate.at_step(step, STEPS), 0.0)?;
        if step.is_multiple_of(25) {
            println!("step {step}: loss {:.4}", found.loss);
        }
    }

    let Some((mesh, step)) = fit.best() else { return Ok(()) };
    let seen = renderer.render(&Scene::new(mesh.clone()), &cameras, &settings)?;
    if let Some(wanted) = &targets.silhouette {
        let ious = mask_iou(seen.silhouette()?, wanted)?;
        println!("best at step {step}: mean mask IoU {:.3}", ious.iter().sum::<f64>() / ious.len() as f64);
    }
    softras_io::save(mesh, &out)?;
    println!("{}", out.display());
    Ok(())
}
