//! The announcement of a fit: what it is going to do, and about how long that takes.

use super::{
    begin::takes_hull,
    options::{FitOptions, Preset, Template},
    setup::{FEW_UNTIL, iterations, views_per_step},
};
use crate::{
    ShapeFit, ShapeOptions,
    photographs::{
        refine::{settings, views_of_steps},
        subject::Subject,
    },
    work::Work,
};
use softras::{Error, Mesh, Renderer, Result, scene::Appearance, shapes};
use std::time::Instant;

/// Views of the steps that are timed, at most.
const TIMED: usize = 4;
/// The whole fit's time as a multiple of that of its steps by a sphere, about: a hull has more triangles, and comes first.
const WHOLE: f64 = 4.0;

/// Tells what the fit is going to do, and about how long that takes, by a step that is timed.
pub fn tell(options: &FitOptions, subject: &Subject, work: &mut Work) -> Result<()> {
    let (height, width) = subject.views.size()?;
    let mut fitted = options.fitted(subject);
    let held_out = options.held_out(subject);
    fitted.retain(|view| !held_out.contains(view));
    let judges = held_out.len();
    let judges = if judges == 0 { String::new() } else { format!(", {judges} judge the result") };
    let hull = takes_hull(options, fitted.len());
    let steps = iterations(options, hull);
    let start = match options.template {
        Template::Mesh(_) => "the given mesh",
        _ if hull => "their hull",
        _ => "a sphere",
    };
    let texture = if options.texture.is_some() && !options.keeps_shape() { ", then a texture" } else { "" };
    let per_step = views_per_step(options, hull, fitted.len()).map(|views| match views {
        0 => fitted.len() as f64,
        some => some.min(fitted.len()) as f64,
    });
    let views = FEW_UNTIL * per_step[0] + (1.0 - FEW_UNTIL) * per_step[1];
    let about = match seconds(options, subject, &fitted, work.renderer) {
        // The sphere that is timed may need more than the fit does.
        Err(Error::OutOfMemory { .. } | Error::Limit { .. }) => String::new(),
        each => {
            let each = WHOLE * each?;
            let [trial, rest] = refined(options, subject.views.cameras.len(), height * width).map(|views| each * views);
            let more =
                if rest > 0.0 { format!(", and {} more if its cameras are off", lasting(rest)) } else { String::new() };
            format!("; about {}{more}", lasting(each * views * steps as f64 + trial))
        }
    };
    let count = fitted.len();
    work.plan(&format!(
        "{count} views of {width}×{height} pixels are fitted{judges}: {steps} steps from {start}{texture}{about}"
    ))
}

/// The views of all steps that refine cameras: of the trial, and of what may follow.
fn refined(options: &FitOptions, count: usize, pixels: usize) -> [f64; 2] {
    let keeps = options.keep_cameras || options.preset == Preset::Quick || options.keeps_shape();
    views_of_steps(count, pixels).filter(|_| !keeps).unwrap_or_default()
}

fn lasting(seconds: f64) -> String {
    if seconds < 90.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) }
}

/// The seconds of a view in a step, by those of a sphere in some views.
fn seconds(options: &FitOptions, subject: &Subject, fitted: &[usize], renderer: &mut Renderer) -> Result<f64> {
    let some = subject.views.some(&fitted[..fitted.len().min(TIMED)]);
    let sphere = shapes::icosphere(4)?;
    let radius = 0.65 * subject.bounds.radius as f32;
    let center = subject.bounds.center.as_vec3().to_array();
    let place = |p: &[f32; 3]| std::array::from_fn(|k| radius * p[k] + center[k]);
    let mesh = Mesh::new(sphere.positions().iter().map(place).collect(), sphere.triangles().to_vec())?;
    let grey = Appearance::VertexColors(vec![[0.5; 3]; mesh.positions().len()]);
    let shape = ShapeOptions { fit_colors: some.color.is_some(), samples: options.samples, ..ShapeOptions::smooth() };
    let mut fit = ShapeFit::new(mesh.with_appearance(grey)?, subject.lights.clone(), shape)?;
    let mut seconds = 0.0;
    // The first step compiles the kernels.
    for _ in 0..2 {
        let began = Instant::now();
        fit.step(renderer, &settings(subject), &some, 0.0, 0.0)?;
        seconds = began.elapsed().as_secs_f64();
    }
    Ok(seconds / some.cameras.len().max(1) as f64)
}
