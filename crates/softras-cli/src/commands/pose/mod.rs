//! `softras pose`: finds the rotation and translation of a mesh from a picture.

pub mod args;
mod benchmark;
mod landscape;

use super::color::encoded;
use super::fit::targets;
use super::memory::Budget;
use super::outputs::Outputs;
use super::render::framing::{Bounds, View};
use super::{Failure, say};
use args::PoseArgs;
use glam::DVec3;
use serde_json::json;
use softras::fit::{Pose, PoseFit, PoseOptions, PoseTarget, Schedule, rotations};
use softras::internals::fit::is_closed;
use softras::scene::Faces;
use softras::{Camera, Image, Mesh, Renderer, Result, Scene, Settings};

/// Poses farther than this from the best one, in degrees, count as other answers.
const OTHER: f64 = 10.0;
/// The σ and γ of the final comparison of poses.
const SHARP: (f64, f64) = (1e-5, 1e-3);

/// Runs the command.
pub fn run(args: &PoseArgs) -> Result<(), Failure> {
    let outputs = Outputs::new(&args.landscape, &args.out)?;
    let mut renderer = super::open_device(args.device.as_deref(), args.read.memory.memory)?;
    match (&args.mesh, &args.image) {
        (Some(mesh), Some(image)) => {
            let budget = Budget::new(&args.read.memory);
            let (width, height, pixels) = targets::read_picture(image, &budget, bytes_per_pixel(args))?;
            outputs.spare([image])?;
            let mesh = args.read.read(mesh, true, &outputs, &budget)?.mesh;
            find(args, &mesh, &Target::new(width, height, &pixels), &mut renderer)
        }
        _ => benchmark::run(args, &mut renderer),
    }
}

/// Bytes of a pixel of the picture: what it is read to, and for each start the target, the rendered images, their gradients
/// and what the device keeps of them.
fn bytes_per_pixel(args: &PoseArgs) -> u64 {
    64 + 96 * u64::from(args.starts)
}

/// A target picture.
struct Target {
    color: Image,
    silhouette: Image,
}

impl Target {
    /// From pixels of linear colour over black, and alpha.
    fn new(width: usize, height: usize, pixels: &[[f64; 4]]) -> Self {
        let image = |channels: std::ops::Range<usize>| Image {
            batch: 1,
            height,
            width,
            channels: channels.len(),
            data: pixels.iter().flat_map(|p| p[channels.clone()].iter().map(|&x| x as f32)).collect(),
        };
        Self { color: image(0..3), silhouette: image(3..4) }
    }

    /// The same picture for each of several poses.
    fn repeated(&self, count: usize) -> Result<PoseTarget> {
        let one = |image: &Image| Image { batch: count, data: image.data.repeat(count), ..*image };
        PoseTarget::new(one(&self.color), one(&self.silhouette))
    }
}

/// What all fits of a mesh to a picture have in common.
struct Search {
    scene: Scene,
    camera: Camera,
    center: DVec3,
    settings: Settings,
}

impl Search {
    fn fit(&self, options: PoseOptions, poses: Vec<Pose>) -> Result<PoseFit> {
        PoseFit::new(self.scene.clone(), self.camera, self.center, self.settings.clone(), options, poses)
    }

    /// A fit from all starts, after its last step.
    fn run(
        &self,
        args: &PoseArgs,
        options: PoseOptions,
        target: &PoseTarget,
        renderer: &mut Renderer,
    ) -> Result<PoseFit> {
        let mut fit = self.fit(options, starts(args))?;
        let progress = super::progress::Progress::counted("step", args.iterations as usize);
        for _ in 0..args.iterations {
            fit.step(renderer, target)?;
            progress.step();
        }
        Ok(fit)
    }
}

/// The poses to start from: one that is refined, or some that are spread over all rotations.
fn starts(args: &PoseArgs) -> Vec<Pose> {
    match args.init {
        Some(pose) => vec![pose],
        None => {
            let rotations = rotations(args.starts as usize).into_iter();
            rotations.map(|rotation| Pose { rotation, ..Pose::IDENTITY }).collect()
        }
    }
}

/// The options that refine a pose: small steps and little blur, which do not lead away from it.
fn refining(options: PoseOptions) -> PoseOptions {
    PoseOptions {
        sigma: Schedule::Exponential { from: 5e-4, to: 1e-5 },
        gamma: Schedule::Exponential { from: 1e-1, to: 3e-2 },
        blur: Schedule::Exponential { from: 0.05, to: 0.005 },
        silhouette: Schedule::Exponential { from: 0.3, to: 1.0 },
        rate: Schedule::Exponential { from: 0.03, to: 0.002 },
        ..options
    }
}

fn find(args: &PoseArgs, mesh: &Mesh, target: &Target, renderer: &mut Renderer) -> Result<(), Failure> {
    let bounds = Bounds::of(mesh);
    let (height, width) = (target.color.height, target.color.width);
    let view = View::new(&args.camera, bounds, width as f64 / height as f64, 0.0);
    // The depth range has room for translations.
    let reach = view.far - view.near;
    let (near, far) = ((view.near - 0.2 * reach).max(0.2 * view.near), view.far + 0.2 * reach);
    let (faces, base) = match is_solid(mesh)? {
        true => (Faces::Front, PoseOptions::default()),
        false => (Faces::Both, PoseOptions::both_sides()),
    };
    let settings = Settings { width: width as u32, height: height as u32, near, far, faces, ..Settings::default() };
    let search = Search { scene: Scene::new(mesh.clone()), camera: view.camera()?, center: bounds.center, settings };
    let translation_rate = if args.no_translation { 0.0 } else { 0.15 * bounds.radius };
    let options = PoseOptions { iterations: args.iterations as usize, translation_rate, ..base };
    let options = if args.init.is_some() { refining(options) } else { options };
    let repeated = target.repeated(starts(args).len())?;
    // The reported loss is that of plain colours, which is easier to interpret.
    let plain = repeated.clone().plain();
    let fit = search.run(args, options.clone(), &repeated, renderer)?;
    let losses = fit.losses(renderer, fit.poses(), SHARP, &plain)?;
    let Some((best, loss)) = least(fit.poses(), &losses, |_| true) else { return Err(Failure::Told) };
    let other = least(fit.poses(), &losses, |pose| pose.degrees_to(&best) > OTHER);
    let confidence = other.map(|(_, other)| (1.0 - loss / other.max(1e-12)).clamp(0.0, 1.0));
    let agreeing = fit.poses().iter().filter(|pose| pose.degrees_to(&best) <= OTHER).count();
    if let Some(path) = &args.out {
        softras::obj::write_obj(&encoded(&posed(mesh, &best, bounds)?)?, path)?;
    }
    let mut baselines = Vec::new();
    for (name, options) in benchmark::baselines(&options).into_iter().filter(|_| args.baselines) {
        let fit = search.run(args, options, &repeated, renderer)?;
        // Baselines are compared by the same loss as the pose itself, whatever they were fitted with.
        let soft = search.fit(PoseOptions::default(), fit.poses().to_vec())?;
        let losses = soft.losses(renderer, fit.poses(), SHARP, &plain)?;
        if let Some((pose, loss)) = least(fit.poses(), &losses, |_| true) {
            baselines.push(Baseline { name, loss, degrees: pose.degrees_to(&best) });
        }
    }
    if let Some(path) = &args.landscape {
        let settings = Settings { faces: Faces::Both, ..search.settings.clone() };
        let fit = Search { settings, ..search }.fit(options, vec![best])?;
        landscape::write(path, &fit, &best, target, renderer)?;
    }
    tell(args, &Answer { pose: best, loss, confidence, agreeing, baselines })
}

/// The result of the fit.
struct Answer {
    pose: Pose,
    loss: f64,
    /// `None` where no start ended at another answer.
    confidence: Option<f64>,
    agreeing: usize,
    baselines: Vec<Baseline>,
}

/// The result of a baseline.
struct Baseline {
    name: &'static str,
    loss: f64,
    /// The angle from the answer.
    degrees: f64,
}

/// The pose of least loss among those that the predicate selects.
fn least(poses: &[Pose], losses: &[f64], among: impl Fn(&Pose) -> bool) -> Option<(Pose, f64)> {
    let pairs = poses.iter().copied().zip(losses.iter().copied()).filter(|(pose, _)| among(pose));
    pairs.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Whether a mesh is closed and its triangles face outwards, so that none is seen from behind.
fn is_solid(mesh: &Mesh) -> Result<bool> {
    let corner = |i: u32| glam::DVec3::from(mesh.positions()[i as usize].map(f64::from));
    let volume: f64 = mesh.triangles().iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum();
    Ok(is_closed(mesh)? && volume > 0.0)
}

fn posed(mesh: &Mesh, pose: &Pose, bounds: Bounds) -> Result<Mesh> {
    let place = |p: &[f32; 3]| {
        let from = glam::DVec3::from(p.map(f64::from)) - bounds.center;
        (pose.rotation * from + bounds.center + pose.translation).as_vec3().to_array()
    };
    let mut posed = mesh.clone();
    posed.set_positions(mesh.positions().iter().map(place).collect())?;
    Ok(posed)
}

fn tell(args: &PoseArgs, answer: &Answer) -> Result<(), Failure> {
    let Answer { pose, loss, confidence, agreeing, baselines } = answer;
    // Of the two quaternions of a rotation the one whose angle is at most 180 degrees.
    let rotation = if pose.rotation.w < 0.0 { -pose.rotation } else { pose.rotation };
    let (axis, angle) = rotation.to_axis_angle();
    let starts = starts(args).len();
    let translation = pose.translation.to_array();
    if args.json {
        let report = json!({
            "quaternion_xyzw": rotation.to_array(),
            "axis": axis.to_array(),
            "degrees": angle.to_degrees(),
            "translation": translation,
            "loss": loss,
            "confidence": confidence,
            "starts": starts,
            "starts_that_agree": agreeing,
            "baselines": baselines
                .iter()
                .map(|b| json!({ "method": b.name, "loss": b.loss, "degrees_from_the_answer": b.degrees }))
                .collect::<Vec<_>>(),
        });
        return say(&report.to_string());
    }
    let confidence = confidence.map_or("unknown (no start ended elsewhere)".into(), |c| format!("{c:.3}"));
    say(&format!(
        "turned by {:.2} degrees about ({:.4}, {:.4}, {:.4}), moved by ({:.4}, {:.4}, {:.4}); loss {loss:.6}, confidence \
         {confidence}, {agreeing} of {starts} starts agree",
        angle.to_degrees(),
        axis.x,
        axis.y,
        axis.z,
        translation[0],
        translation[1],
        translation[2],
    ))?;
    baselines
        .iter()
        .try_for_each(|b| say(&format!("{}: loss {:.6}, {:.2} degrees from this", b.name, b.loss, b.degrees)))
}
