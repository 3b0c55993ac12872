//! The rigid pose experiment of the SoftRas paper: finds random rotations of a cube with a colour on each face.

use super::{PoseArgs, SHARP, Target, landscape, least};
use crate::commands::steps::{Loop, each};
use crate::commands::{Failure, say};
use glam::DVec3;
use serde_json::json;
use softras::scene::{Background, Faces};
use softras::{Camera, Image, Projection, Renderer, Result, Scene, Settings, shapes};
use softras_fit::rotations;
use softras_fit::{Differentiation, Pose, PoseFit, PoseOptions, PoseTarget, Schedule};
use softras_lab::random::Random;
use std::time::Instant;

const SIZE: u32 = 32;
const DISTANCE: f64 = 5.0;
/// Trials whose starts are fitted together.
const TOGETHER: usize = 20;

/// A method of finding a pose.
struct Method {
    name: &'static str,
    options: PoseOptions,
    /// Number of poses to start from for each trial: its own, and others spread over all rotations from there.
    starts: usize,
    /// Whether colours are compared plainly, as in the paper, and not whitened.
    plain: bool,
}

/// The length of the first steps in radians, the best of several on other seeds for both hard and soft fits. Such long
/// steps make a fit try many rotations before it converges.
const FIRST_STEP: f64 = 1.3;

/// The same fit with constant softness, and with a hard renderer's gradients. The constant softness is the best of several
/// on other seeds: the sigma at the end of the schedule with the gamma at its beginning.
pub fn baselines(base: &PoseOptions) -> [(&'static str, PoseOptions); 2] {
    let plain = PoseOptions {
        sigma: Schedule::Constant(1e-4),
        gamma: Schedule::Constant(base.gamma.at(0.0)),
        blur: Schedule::Constant(0.0),
        ..base.clone()
    };
    let hard = PoseOptions { differentiation: Differentiation::ImageFlow, ..plain.clone() };
    [("soft, no schedule", plain), ("hard, image-space finite differences", hard)]
}

fn methods(args: &PoseArgs) -> Vec<Method> {
    let rate = Schedule::Exponential { from: FIRST_STEP, to: 0.01 };
    let base = PoseOptions { iterations: args.iterations as usize, rate, ..PoseOptions::default() };
    let [(_, plain), (_, hard)] = baselines(&base);
    let scheduled = PoseOptions {
        sigma: Schedule::Exponential { from: 3e-2, to: 1e-4 },
        gamma: Schedule::Exponential { from: 3.0, to: 1e-1 },
        ..plain.clone()
    };
    let method = |name, options: &PoseOptions, starts, plain| Method { name, options: options.clone(), starts, plain };
    let starts = args.starts as usize;
    vec![
        method("hard, image-space finite differences", &hard, 1, true),
        method("soft, no schedule", &plain, 1, true),
        method("soft, sigma-gamma schedule", &scheduled, 1, true),
        method("soft, sigma-gamma schedule, coarse to fine", &base, 1, true),
        method("hard, whitened colours", &hard, 1, false),
        method("soft, no schedule, whitened colours", &plain, 1, false),
        method("soft, scheduled, coarse to fine, whitened", &base, 1, false),
        method("hard, whitened, several starts", &hard, starts, false),
        method("soft, no schedule, whitened, several", &plain, starts, false),
        method("soft, scheduled, to fine, whitened, several", &base, starts, false),
    ]
}

/// Runs the benchmark.
pub fn run(args: &PoseArgs, renderer: &mut Renderer) -> Result<(), Failure> {
    let trials = args.trials.unwrap_or(100) as usize;
    let mut random = Random::new(args.seed);
    let mut pose = || Pose { rotation: random.rotation(), ..Pose::IDENTITY };
    let pairs: Vec<[Pose; 2]> = (0..trials).map(|_| [pose(), pose()]).collect();
    let (truth, start): (Vec<Pose>, Vec<Pose>) = pairs.into_iter().map(|[a, b]| (a, b)).unzip();
    let bench = Bench::new(&truth, renderer)?;
    let errors = |poses: &[Pose]| poses.iter().zip(&truth).map(|(a, b)| a.degrees_to(b)).collect::<Vec<f64>>();
    let mut rows = vec![("no optimisation", 1, 0.0, errors(&start))];
    for method in methods(args) {
        let before = Instant::now();
        let found = bench.find(&method, &start, renderer)?;
        rows.push((method.name, method.starts, before.elapsed().as_secs_f64(), errors(&found)));
    }
    if let Some(path) = &args.landscape {
        let fit = bench.fit_seeing(Faces::Both, &PoseOptions::default(), vec![truth[0]])?;
        landscape::write(path, &fit, &truth[0], &bench.target(0), renderer)?;
    }
    let report: Vec<_> = rows
        .into_iter()
        .map(|(name, starts, seconds, mut errors)| {
            errors.sort_by(f64::total_cmp);
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            let within = errors.iter().filter(|e| **e < 5.0).count();
            json!({
                "method": name, "starts": starts, "mean_degrees": mean, "median_degrees": median(&errors),
                "within_5_degrees": within, "seconds": seconds,
            })
        })
        .collect();
    if args.json {
        let whole = json!({
            "trials": trials, "seed": args.seed, "iterations": args.iterations, "size": SIZE,
            "device": renderer.device_name(), "methods": report,
        });
        return say(&whole.to_string());
    }
    say(&format!("{:<44} {:>6} {:>8} {:>8} {:>8} {:>8}", "method", "starts", "mean", "median", "< 5 deg", "seconds"))?;
    report.iter().try_for_each(|row| {
        let number = |key: &str| row[key].as_f64().unwrap_or(0.0);
        say(&format!(
            "{:<44} {:>6} {:>8.2} {:>8.2} {:>8} {:>8.1}",
            row["method"].as_str().unwrap_or(""),
            number("starts"),
            number("mean_degrees"),
            number("median_degrees"),
            number("within_5_degrees"),
            number("seconds"),
        ))
    })
}

/// The median: the middle one of the sorted numbers, or the mean of the two in the middle.
pub fn median(sorted: &[f64]) -> f64 {
    let n = sorted.len();
    if n == 0 { 0.0 } else { 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]) }
}

/// The cube and its pictures.
struct Bench {
    scene: Scene,
    camera: Camera,
    settings: Settings,
    color: Image,
    silhouette: Image,
}

impl Bench {
    fn new(truth: &[Pose], renderer: &mut Renderer) -> Result<Self> {
        let projection = Projection::Perspective { fov_y: 30f64.to_radians() };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, DISTANCE), DVec3::ZERO, DVec3::Y, projection)?;
        let (near, far) = (DISTANCE - 1.2, DISTANCE + 1.2);
        let settings = Settings { width: SIZE, height: SIZE, near, far, faces: Faces::Front, ..Settings::default() };
        let scene = Scene::new(shapes::cube()?);
        let empty = Image { batch: 0, height: 0, width: 0, channels: 1, data: Vec::new() };
        let mut bench = Self { scene, camera, settings, color: empty.clone(), silhouette: empty };
        let fit = bench.fit(&PoseOptions::default(), truth.to_vec())?;
        let cameras = truth.iter().map(|pose| fit.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let sharp = Settings { sigma: 1e-7, gamma: 1e-5, background: Background::Composite, ..bench.settings.clone() };
        let frame = renderer.render(&bench.scene, &cameras, &sharp)?;
        if let (Some(color), Some(silhouette)) = (frame.color(), frame.silhouette()) {
            (bench.color, bench.silhouette) = (color.clone(), silhouette.clone());
        }
        Ok(bench)
    }

    fn fit(&self, options: &PoseOptions, poses: Vec<Pose>) -> Result<PoseFit> {
        self.fit_seeing(self.settings.faces, options, poses)
    }

    fn fit_seeing(&self, faces: Faces, options: &PoseOptions, poses: Vec<Pose>) -> Result<PoseFit> {
        let settings = Settings { faces, ..self.settings.clone() };
        PoseFit::new(self.scene.clone(), self.camera, DVec3::ZERO, settings, options.clone(), poses)
    }

    /// The picture of a trial.
    fn target(&self, trial: usize) -> Target {
        let one = |image: &Image| Image { batch: 1, data: image.view(trial).to_vec(), ..*image };
        Target { color: one(&self.color), silhouette: one(&self.silhouette) }
    }

    /// Finds the pose of least loss for each trial.
    fn find(&self, method: &Method, start: &[Pose], renderer: &mut Renderer) -> Result<Vec<Pose>, Failure> {
        let spread = rotations(method.starts);
        // The trial's own start comes first, and the others are turned from it.
        let first = spread[0].inverse();
        let mut found = Vec::with_capacity(start.len());
        for (chunk, some) in start.chunks(TOGETHER).enumerate() {
            let around = |pose: &Pose| {
                let own = pose.rotation;
                spread
                    .iter()
                    .map(move |turn| Pose { rotation: *turn * first * own, ..Pose::IDENTITY })
                    .collect::<Vec<_>>()
            };
            let poses: Vec<Pose> = some.iter().flat_map(around).collect();
            let repeat = |image: &Image| Image {
                batch: poses.len(),
                data: (0..poses.len())
                    .flat_map(|i| image.view(chunk * TOGETHER + i / method.starts))
                    .copied()
                    .collect(),
                ..*image
            };
            let target = PoseTarget::new(repeat(&self.color), repeat(&self.silhouette))?;
            let target = if method.plain { target.plain() } else { target };
            let mut fit = self.fit(&method.options, poses)?;
            let mut steps = each(|_, renderer| fit.step(renderer, &target));
            Loop::over(0..method.options.iterations).run(&mut steps, renderer)?;
            let soft = method.options.differentiation == Differentiation::Soft;
            let losses = if method.starts > 1 || soft {
                fit.losses(renderer, fit.poses(), SHARP, &target)?
            } else {
                vec![0.0; fit.poses().len()]
            };
            let each = fit.poses().chunks(method.starts).zip(losses.chunks(method.starts));
            found.extend(each.filter_map(|(poses, losses)| least(poses, losses, |_| true)).map(|(pose, _)| pose));
        }
        Ok(found)
    }
}
