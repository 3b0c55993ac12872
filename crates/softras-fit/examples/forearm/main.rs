//! Finds a limb that is hidden: `cargo run --release -p softras-fit --example forearm -- [TRIALS] [SEED] [PICTURE.png]`.
//!
//! A doll of ten bones is posed at random with its left arm behind its back, so that at most its hand is visible. It is fitted to
//! one picture of itself, from a pose in which the whole forearm is hidden. A hard renderer has no gradient for it; `visible only`
//! is the same soft fit without the gradients of triangles that a hard rasterization does not show. Soft gradients reach the
//! forearm, because hidden triangles weigh something too (section 4.3 of the SoftRas paper).
//!
//! Prints the error of the hidden elbow. The picture shows the first trial, from the camera and from behind.

mod figure;
mod mannequin;
mod skeleton;
mod trial;

use skeleton::SkeletonPose;
use softras::{Error, Renderer, Result};
use softras_check::random::Random;
use softras_fit::pooled;
use softras_io::{Curve, Picture};
use softras_view::sheet;
use std::path::Path;
use trial::{STEPS, Stage, Trial, methods};

/// Pixels of each panel of the picture, and samples along each side of a pixel.
const PANEL: [usize; 2] = [216, 240];
const SAMPLES: usize = 3;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (trials, seed) = (number(1), number(1));
    let picture = arguments.next();
    let (mut renderer, stage, mut random) = (Renderer::new()?, Stage::new()?, Random::new(seed));
    let methods = methods();
    let mut rows = vec![("no optimisation", Vec::new())];
    rows.extend(methods.iter().map(|method| (method.name, Vec::new())));
    for index in 0..trials {
        let Some(trial) = stage.draw(&mut random, &mut renderer)? else {
            let what = "no pose was drawn in which the arm is hidden at first and not quite at last";
            return Err(Error::Fit { what: what.into(), fix: "use another seed".into() });
        };
        let mut poses = vec![trial.start.clone()];
        for method in &methods {
            poses.push(stage.fit(&trial, method, STEPS, &mut renderer)?);
        }
        let errors = poses.iter().map(|pose| stage.errors(pose, &trial.truth));
        rows.iter_mut().zip(errors).for_each(|((_, all), errors)| all.push(errors));
        if let Some(path) = picture.as_ref().filter(|_| index == 0) {
            draw(Path::new(path), &stage, &trial, [&poses[1], &poses[4]], &mut renderer)?;
        }
    }
    println!("{:<24}   median  <= 10 deg  > 30 deg   others", "hidden elbow, degrees");
    for (name, errors) in &rows {
        let mut hidden: Vec<f64> = errors.iter().map(|e| e[0]).collect();
        hidden.sort_by(f64::total_cmp);
        let count = |right: fn(f64) -> bool| hidden.iter().filter(|e| right(**e)).count();
        let (within, beyond) = (count(|e| e <= 10.0), count(|e| e > 30.0));
        let others = errors.iter().map(|e| e[1]).sum::<f64>() / errors.len() as f64;
        println!("{name:<24} {:>8.2} {within:>10} {beyond:>9} {others:>8.2}", median(&hidden));
    }
    Ok(())
}

/// The middle one of sorted numbers, or the mean of the two in the middle.
fn median(sorted: &[f64]) -> f64 {
    let n = sorted.len();
    if n == 0 { f64::NAN } else { 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]) }
}

/// Writes the picture of target, start and two fits, from the camera and from behind.
fn draw(path: &Path, stage: &Stage, trial: &Trial, fits: [&SkeletonPose; 2], renderer: &mut Renderer) -> Result<()> {
    let poses = [("target", &trial.truth), ("start", &trial.start), ("visible only", fits[0]), ("soft", fits[1])];
    let [width, height] = PANEL;
    let mut panels = Vec::new();
    for (behind, (name, pose)) in [false, true].into_iter().flat_map(|behind| poses.map(|pose| (behind, pose))) {
        let size = ((SAMPLES * width) as u32, (SAMPLES * height) as u32);
        let frame = stage.look(renderer, &stage.figure.posed(pose)?, behind, size)?;
        let (color, alpha) = (pooled(frame.color()?, SAMPLES)?, pooled(frame.silhouette()?, SAMPLES)?);
        let byte = |c: f32, a: f32| (Curve::Srgb.encode(f64::from(c + 1.0 - a)) * 255.0).round() as u8;
        let pixel = |(c, &a): (&[f32], &f32)| [byte(c[0], a), byte(c[1], a), byte(c[2], a), 255];
        let pixels = color.data.chunks_exact(3).zip(&alpha.data).map(pixel).collect();
        let label = match (behind, name) {
            (false, _) => name.into(),
            (true, "target") => "from behind".into(),
            (true, _) => format!("hidden elbow {:.1}", stage.errors(pose, &trial.truth)[0]),
        };
        panels.push((Picture { width, height, pixels }, label));
    }
    sheet(&panels, [255; 3]).save(path)
}
