//! `softras pose`: finds the rotation and translation of a mesh from a picture.

mod agreement;
pub mod args;
mod benchmark;
mod landscape;
mod trials;

use super::fit::targets;
use super::outputs::Outputs;
use super::steps::{Loop, each};
use super::{Failure, note, say};
use agreement::Agreement;
use args::PoseArgs;
use glam::{DQuat, DVec3};
use serde_json::json;
use softras::scene::{Background, Faces, Interpolation};
use softras::{Camera, Image, Mesh, Renderer, Result, Scene, Settings};
use softras_fit::{Pose, PoseFit, PoseOptions, PoseSearch, PoseTarget};
use softras_fit::{pooled, rotations};
use softras_io::Budget;
use softras_view::{Bounds, Viewpoint};

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
            let budget = Budget::new(args.read.memory.memory);
            let (width, height, pixels) = targets::read_picture(image, &budget, bytes_per_pixel(args))?;
            outputs.spare([image])?;
            let mesh = args.read.read(mesh, true, &outputs, &budget)?.mesh;
            find(args, &mesh, &Target::new(width, height, &pixels), &mut renderer)
        }
        _ => match args.benchmark.as_deref() {
            Some(meshes @ [_, ..]) if args.landscape.is_some() => {
                let what = format!("--landscape is not drawn for {} meshes", meshes.len());
                Err(Failure::Usage(what + ": leave it out, or leave the meshes out for the cube's"))
            }
            Some(meshes @ [_, ..]) => trials::run(args, meshes, &mut renderer),
            _ => benchmark::run(args, &mut renderer),
        },
    }
}

/// Bytes of a pixel of the picture: what it is read to, and for each start of a baseline the target, the rendered images, their
/// gradients and what the device keeps of them.
fn bytes_per_pixel(args: &PoseArgs) -> u64 {
    64 + if args.baselines { 96 * u64::from(args.starts) } else { 0 }
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

/// What the search, the baselines and the landscape have in common.
struct View {
    scene: Scene,
    camera: Camera,
    center: DVec3,
    settings: Settings,
}

impl View {
    /// The mesh in pictures of that size as the command's camera sees it, and the mesh's bounds.
    fn around(args: &PoseArgs, mesh: &Mesh, width: usize, height: usize) -> Result<(Self, Bounds), Failure> {
        let bounds = Bounds::of(mesh);
        let framed = Viewpoint::new(&args.camera.options(), bounds, width as f64 / height as f64, 0.0);
        args.camera.check_depths(&framed)?;
        // The depth range has room for translations.
        let reach = framed.far - framed.near;
        let (near, far) = ((framed.near - 0.2 * reach).max(0.2 * framed.near), framed.far + 0.2 * reach);
        let settings = Settings { width: width as u32, height: height as u32, near, far, ..Settings::default() };
        let view = Self { scene: Scene::new(mesh.clone()), camera: framed.camera()?, center: bounds.center, settings };
        Ok((view, bounds))
    }

    /// The mesh in a pose: sharp, without light, every pixel the mean of so many samples along each side.
    fn picture(&self, pose: &Pose, samples: u32, renderer: &mut Renderer) -> Result<Option<Target>> {
        let s = &self.settings;
        let settings = Settings {
            width: s.width * samples,
            height: s.height * samples,
            sigma: 1e-7,
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            ..s.clone()
        };
        let camera = self.fit(PoseOptions::default(), vec![*pose])?.posed_camera(pose)?;
        let frame = renderer.render(&self.scene, &[camera], &settings)?;
        let (Some(color), Some(silhouette)) = (frame.color(), frame.silhouette()) else { return Ok(None) };
        let [color, silhouette] = [pooled(color, samples as usize)?, pooled(silhouette, samples as usize)?];
        Ok(Some(Target { color, silhouette }))
    }

    fn fit(&self, options: PoseOptions, poses: Vec<Pose>) -> Result<PoseFit> {
        PoseFit::new(self.scene.clone(), self.camera, self.center, self.settings.clone(), options, poses)
    }

    fn search(&self, args: &PoseArgs, target: &Target) -> Result<PoseSearch> {
        let (settings, mesh) = (self.settings.clone(), self.scene.meshes[0].clone());
        let (color, silhouette) = (target.color.clone(), target.silhouette.clone());
        let search = PoseSearch::new(mesh, self.camera, self.center, settings, color, silhouette)?
            .with(args.starts as usize, args.iterations as usize);
        let search = if args.no_translation { search.without_translation() } else { search };
        match args.init {
            Some(pose) => search.refining(pose),
            None => Ok(search),
        }
    }

    /// The best pose of a baseline, from rotations that are spread evenly, by the same loss as the search's.
    fn baseline(
        &self,
        args: &PoseArgs,
        options: PoseOptions,
        target: &Target,
        renderer: &mut Renderer,
    ) -> Result<Option<(Pose, f64)>, Failure> {
        let starts = rotations(args.starts as usize).into_iter().map(|rotation| Pose { rotation, ..Pose::IDENTITY });
        let poses: Vec<Pose> = args.init.map_or_else(|| starts.collect(), |pose| vec![pose]);
        let target = target.repeated(poses.len())?;
        let mut fit = self.fit(options, poses)?;
        let mut steps = each(|_, renderer| fit.step(renderer, &target));
        Loop::over(0..args.iterations as usize).run(&mut steps, renderer)?;
        let soft = self.fit(PoseOptions::default(), fit.poses().to_vec())?;
        let losses = soft.losses(renderer, fit.poses(), SHARP, &target.plain())?;
        Ok(least(fit.poses(), &losses, |_| true))
    }
}

fn find(args: &PoseArgs, mesh: &Mesh, target: &Target, renderer: &mut Renderer) -> Result<(), Failure> {
    let (view, bounds) = View::around(args, mesh, target.color.width, target.color.height)?;
    let mut search = view.search(args, target)?;
    let steps = Loop::over(0..search.step_count()).with_bar("step");
    steps.run(&mut each(|_, renderer| search.step(renderer)), renderer)?;
    let Some(&(best, loss)) = search.found().first() else { return Err(Failure::Told) };
    if let Some(path) = &args.out {
        softras_io::save(&posed(mesh, &best, bounds)?, path)?;
    }
    let both = View { settings: Settings { faces: Faces::Both, ..view.settings.clone() }, ..view };
    let translation_rate = if args.no_translation { 0.0 } else { 0.15 * bounds.radius };
    let options = PoseOptions { iterations: args.iterations as usize, translation_rate, ..PoseOptions::both_sides() };
    let agreement = Agreement::of(&both, &best, target, renderer)?;
    let mut baselines = Vec::new();
    for (name, options) in benchmark::baselines(&options).into_iter().filter(|_| args.baselines) {
        if let Some((pose, loss)) = both.baseline(args, options, target, renderer)? {
            baselines.push(Baseline { name, loss, degrees: pose.degrees_to(&best) });
        }
    }
    if let Some(path) = &args.landscape {
        landscape::write(path, &both.fit(options, vec![best])?, &best, target, renderer)?;
    }
    let other = search.found().iter().find(|(pose, _)| pose.degrees_to(&best) > OTHER);
    let confidence = other.map(|(_, other)| (1.0 - loss / other.max(1e-12)).clamp(0.0, 1.0));
    // Of poses that do not explain the picture none is good.
    let good = if agreement.is_near() { search.equally_good() } else { 1 };
    let equally_good = search.found()[..good].to_vec();
    tell(args, &Answer { equally_good, confidence, agreement, baselines })
}

/// The result of the fit.
struct Answer {
    /// The best pose and those that explain the picture as well, with their losses.
    equally_good: Vec<(Pose, f64)>,
    /// `None` where no start ended at another answer.
    confidence: Option<f64>,
    agreement: Agreement,
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

fn posed(mesh: &Mesh, pose: &Pose, bounds: Bounds) -> Result<Mesh> {
    let place = |p: &[f32; 3]| {
        let from = glam::DVec3::from(p.map(f64::from)) - bounds.center;
        (pose.rotation * from + bounds.center + pose.translation).as_vec3().to_array()
    };
    let mut posed = mesh.clone();
    posed.set_positions(mesh.positions().iter().map(place).collect())?;
    Ok(posed)
}

/// The rotation as the one of its two quaternions whose angle is at most 180 degrees.
fn rotation_of(pose: &Pose) -> DQuat {
    if pose.rotation.w < 0.0 { -pose.rotation } else { pose.rotation }
}

fn tell(args: &PoseArgs, answer: &Answer) -> Result<(), Failure> {
    answer.agreement.doubt().into_iter().for_each(|text| note(&text));
    if args.json { say(&json_of(answer).to_string()) } else { tell_in_words(answer) }
}

fn json_of(answer: &Answer) -> serde_json::Value {
    let pose = |(pose, loss): &(Pose, f64)| {
        let (axis, angle) = rotation_of(pose).to_axis_angle();
        json!({
            "quaternion_xyzw": rotation_of(pose).to_array(),
            "axis": axis.to_array(),
            "degrees": angle.to_degrees(),
            "translation": pose.translation.to_array(),
            "loss": loss,
        })
    };
    let mut report = pose(&answer.equally_good[0]);
    report["confidence"] = json!(answer.confidence);
    report["silhouette_iou"] = json!(answer.agreement.iou);
    report["color_difference"] = json!(answer.agreement.color);
    report["equally_good"] = answer.equally_good.iter().map(pose).collect();
    report["baselines"] = answer
        .baselines
        .iter()
        .map(|b| json!({ "method": b.name, "loss": b.loss, "degrees_from_the_answer": b.degrees }))
        .collect();
    report
}

fn tell_in_words(answer: &Answer) -> Result<(), Failure> {
    let words = |pose: &Pose| {
        let (axis, angle) = rotation_of(pose).to_axis_angle();
        let [x, y, z] = pose.translation.to_array();
        format!(
            "turned by {:.2} degrees about ({:.4}, {:.4}, {:.4}), moved by ({x:.4}, {y:.4}, {z:.4})",
            angle.to_degrees(),
            axis.x,
            axis.y,
            axis.z,
        )
    };
    let (best, loss) = &answer.equally_good[0];
    let confidence = answer.confidence.map_or("unknown (no start ended elsewhere)".into(), |c| format!("{c:.3}"));
    say(&format!("{}; loss {loss:.6}, confidence {confidence}", words(best)))?;
    say(&answer.agreement.sentence())?;
    let others = &answer.equally_good[1..];
    if !others.is_empty() {
        say(&format!(
            "{} equally good poses, by the object's symmetry or for want of detail; the others:",
            others.len() + 1
        ))?;
    }
    others.iter().try_for_each(|(pose, loss)| say(&format!("{}; loss {loss:.6}", words(pose))))?;
    let baselines = &answer.baselines;
    baselines
        .iter()
        .try_for_each(|b| say(&format!("{}: loss {:.6}, {:.2} degrees from this", b.name, b.loss, b.degrees)))
}
