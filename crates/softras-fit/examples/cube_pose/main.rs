//! The rigid pose experiment of the SoftRas paper: `cargo run --release -p softras-fit --example cube_pose -- [SEED] [TRIALS] [LANDSCAPE.png]`.
//!
//! Finds random rotations of a cube with a colour on each face, from other random rotations, and prints for each method how many
//! degrees are left. The picture shows the loss over two angles around the first rotation.

mod landscape;

use softras::glam::DVec3;
use softras::scene::{Background, Faces};
use softras::{Camera, Image, Projection, Renderer, Result, Scene, Settings, shapes};
use softras_check::random::Random;
use softras_fit::{Pose, PoseFit, PoseOptions, PoseTarget, Schedule, rotations};
use std::path::Path;

const SIZE: u32 = 32;
const DISTANCE: f64 = 5.0;
/// The length of the first steps in radians, the best of several on other seeds. Such long
/// steps make a fit try many rotations before it converges.
const FIRST_STEP: f64 = 1.3;
/// The starts of the methods with several: the trial's own, and others spread over all rotations from there.
const STARTS: usize = 4;
/// Trials whose starts are fitted together.
const TOGETHER: usize = 20;
/// The σ and γ of the comparison of starts.
const SHARP: (f64, f64) = (1e-5, 1e-3);

struct Method {
    name: &'static str,
    options: PoseOptions,
    starts: usize,
    /// Whether colours are compared plainly, as in the paper, and not whitened.
    plain: bool,
}

fn methods() -> Vec<Method> {
    let rate = Schedule::Exponential { from: FIRST_STEP, to: 0.01 };
    let fine = PoseOptions { rate, ..PoseOptions::default() };
    // The best constant softness of several on other seeds: the sigma at the end of the schedule, the gamma at its beginning.
    let constant = PoseOptions {
        sigma: Schedule::Constant(1e-4),
        gamma: Schedule::Constant(fine.gamma.at(0.0)),
        blur: Schedule::Constant(0.0),
        ..fine.clone()
    };
    let scheduled = PoseOptions {
        sigma: Schedule::Exponential { from: 3e-2, to: 1e-4 },
        gamma: Schedule::Exponential { from: 3.0, to: 1e-1 },
        ..constant.clone()
    };
    let method = |name, options: &PoseOptions, starts, plain| Method { name, options: options.clone(), starts, plain };
    vec![
        method("soft, no schedule", &constant, 1, true),
        method("soft, sigma-gamma schedule", &scheduled, 1, true),
        method("soft, sigma-gamma schedule, coarse to fine", &fine, 1, true),
        method("soft, no schedule, whitened colours", &constant, 1, false),
        method("soft, scheduled, coarse to fine, whitened", &fine, 1, false),
        method("soft, no schedule, whitened", &constant, STARTS, false),
        method("soft, scheduled, coarse to fine, whitened", &fine, STARTS, false),
    ]
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default| arguments.next().and_then(|text| text.parse().ok()).unwrap_or(default);
    let (seed, trials) = (number(1), number(100));
    let mut random = Random::new(seed);
    let mut pose = || Pose { rotation: random.rotation(), ..Pose::IDENTITY };
    let (truth, start): (Vec<Pose>, Vec<Pose>) = (0..trials).map(|_| (pose(), pose())).unzip();
    let mut renderer = Renderer::new()?;
    let cube = Cube::new(&truth, &mut renderer)?;
    println!("{:<44} {:>6} {:>8} {:>8} {:>8}", "method", "starts", "mean", "median", "< 5 deg");
    tell("no optimisation", 1, &start, &truth);
    for method in methods() {
        let found = cube.find(&method, &start, &mut renderer)?;
        tell(method.name, method.starts, &found, &truth);
    }
    if let Some(path) = arguments.next() {
        // Both faces are drawn: a front face that disappears as it turns away would be a step in the loss, even when blurred.
        let fit = cube.fit(Faces::Both, &PoseOptions::default(), vec![truth[0]])?;
        landscape::write(Path::new(&path), &fit, &truth[0], |count| cube.target(&vec![0; count]), &mut renderer)?;
    }
    Ok(())
}

/// Prints the errors of the poses found, in degrees.
fn tell(method: &str, starts: usize, found: &[Pose], truth: &[Pose]) {
    let mut errors: Vec<f64> = found.iter().zip(truth).map(|(a, b)| a.degrees_to(b)).collect();
    errors.sort_by(f64::total_cmp);
    let n = errors.len();
    let (mean, median) = (errors.iter().sum::<f64>() / n as f64, 0.5 * (errors[n / 2] + errors[(n - 1) / 2]));
    let within = errors.iter().filter(|e| **e < 5.0).count();
    println!("{method:<44} {starts:>6} {mean:>8.2} {median:>8.2} {within:>8}");
}

struct Cube {
    scene: Scene,
    camera: Camera,
    settings: Settings,
    color: Image,
    silhouette: Image,
}

impl Cube {
    fn new(truth: &[Pose], renderer: &mut Renderer) -> Result<Self> {
        let projection = Projection::Perspective { fov_y: 30f64.to_radians() };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, DISTANCE), DVec3::ZERO, DVec3::Y, projection)?;
        let (near, far) = (DISTANCE - 1.2, DISTANCE + 1.2);
        let settings = Settings { width: SIZE, height: SIZE, near, far, ..Settings::default() };
        let scene = Scene::new(shapes::cube()?);
        let empty = Image { batch: 0, height: 0, width: 0, channels: 1, data: Vec::new() };
        let mut cube = Self { scene, camera, settings, color: empty.clone(), silhouette: empty };
        let fit = cube.fit(Faces::Front, &PoseOptions::default(), truth.to_vec())?;
        let cameras = truth.iter().map(|pose| fit.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let (background, faces) = (Background::Composite, Faces::Front);
        let sharp = Settings { sigma: 1e-7, gamma: 1e-5, background, faces, ..cube.settings.clone() };
        let frame = renderer.render(&cube.scene, &cameras, &sharp)?;
        (cube.color, cube.silhouette) = (frame.color()?.clone(), frame.silhouette()?.clone());
        Ok(cube)
    }

    fn fit(&self, faces: Faces, options: &PoseOptions, poses: Vec<Pose>) -> Result<PoseFit> {
        let settings = Settings { faces, ..self.settings.clone() };
        PoseFit::new(self.scene.clone(), self.camera, DVec3::ZERO, settings, options.clone(), poses)
    }

    /// The pictures of some trials.
    fn target(&self, trials: &[usize]) -> Result<PoseTarget> {
        let some = |image: &Image| Image {
            batch: trials.len(),
            data: trials.iter().flat_map(|&trial| image.view(trial)).copied().collect(),
            ..*image
        };
        PoseTarget::new(some(&self.color), some(&self.silhouette))
    }

    /// Finds the pose of least loss for each trial.
    fn find(&self, method: &Method, start: &[Pose], renderer: &mut Renderer) -> Result<Vec<Pose>> {
        let spread = rotations(method.starts);
        // The trial's own start comes first, and the others are turned from it.
        let first = spread[0].inverse();
        let all: Vec<usize> = (0..start.len()).collect();
        let mut found = Vec::with_capacity(start.len());
        for trials in all.chunks(TOGETHER) {
            let turned = |&trial: &usize| {
                let own = start[trial].rotation;
                spread.iter().map(move |turn| Pose { rotation: *turn * first * own, ..Pose::IDENTITY })
            };
            let poses = trials.iter().flat_map(turned).collect();
            let repeated: Vec<usize> = trials.iter().flat_map(|trial| vec![*trial; method.starts]).collect();
            let target = self.target(&repeated)?;
            let target = if method.plain { target.plain() } else { target };
            let mut fit = self.fit(Faces::Front, &method.options, poses)?;
            for _ in 0..method.options.iterations {
                fit.step(renderer, &target)?;
            }
            let losses = fit.losses(renderer, fit.poses(), SHARP, &target)?;
            for (poses, losses) in fit.poses().chunks(method.starts).zip(losses.chunks(method.starts)) {
                let best = poses.iter().zip(losses).min_by(|a, b| a.1.total_cmp(b.1));
                found.extend(best.map(|(pose, _)| *pose));
            }
        }
        Ok(found)
    }
}
