//! `softras pose`: finds the rotation and translation of a mesh from a picture.

mod agreement;
pub mod args;

use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, note, say};
use agreement::Agreement;
use args::PoseArgs;
use glam::{DQuat, DVec3};
use serde_json::json;
use softras::scene::{Background, Interpolation};
use softras::{Camera, Image, Mesh, Renderer, Result, Scene, Settings};
use softras_fit::{Pose, PoseSearch, pooled};
use softras_io::{Budget, SaveOptions, read_picture};
use softras_view::Bounds;

/// Poses farther than this from the best one, in degrees, count as other answers.
const OTHER: f64 = 10.0;
/// Bytes of a pixel of the picture that is read.
const BYTES_PER_PIXEL: u64 = 64;

pub fn run(args: &PoseArgs) -> Result<(), Failure> {
    let outputs = Outputs::new([], &args.out)?;
    let mut renderer = super::open_device(args.device.as_deref(), args.read.memory)?;
    let budget = Budget::new(args.read.memory);
    let (width, height, pixels, about) = read_picture(&args.image, &budget, BYTES_PER_PIXEL)?;
    about.iter().for_each(|text| note(text));
    outputs.spare([&args.image])?;
    let loaded = args.read.read(&args.mesh, true, &outputs, &budget)?;
    let (origin, mesh) = (loaded.origin, super::held(loaded.mesh, &renderer)?);
    find(args, &mesh, origin, &PoseTarget::new(width, height, &pixels), &mut renderer)
}

struct PoseTarget {
    color: Image,
    silhouette: Image,
}

impl PoseTarget {
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
}

/// How the mesh is seen, by the search and by the comparison after it.
struct View {
    camera: Camera,
    settings: Settings,
}

impl View {
    /// The view of the command's camera in pictures of that size.
    fn around(args: &PoseArgs, bounds: Bounds, origin: [f64; 3], width: usize, height: usize) -> Result<Self, Failure> {
        let framed = args.camera.view(bounds, origin, (width, height))?;
        // The depth range has room for translations.
        let reach = framed.far - framed.near;
        let (near, far) = ((framed.near - 0.2 * reach).max(0.2 * framed.near), framed.far + 0.2 * reach);
        let settings = Settings { width: width as u32, height: height as u32, near, far, ..Settings::default() };
        Ok(Self { camera: framed.camera()?, settings })
    }

    /// A posed mesh: sharp, without light, every pixel the mean of `samples` samples along each side.
    fn picture(&self, posed: &Mesh, samples: u32, renderer: &mut Renderer) -> Result<PoseTarget> {
        let settings = Settings {
            width: self.settings.width * samples,
            height: self.settings.height * samples,
            sigma: 1e-7,
            background: Background::Composite,
            interpolation: Interpolation::Perspective,
            ..self.settings.clone()
        };
        let frame = renderer.render(&Scene::new(posed.clone()), &[self.camera], &settings)?;
        let samples = samples as usize;
        Ok(PoseTarget { color: pooled(frame.color()?, samples)?, silhouette: pooled(frame.silhouette()?, samples)? })
    }

    fn search(&self, args: &PoseArgs, mesh: &Mesh, center: DVec3, target: &PoseTarget) -> Result<PoseSearch> {
        let (color, silhouette) = (target.color.clone(), target.silhouette.clone());
        let search = PoseSearch::new(mesh.clone(), self.camera, center, self.settings.clone(), color, silhouette)?
            .with(args.starts as usize, args.iterations as usize);
        let search = if args.no_translation { search.without_translation() } else { search };
        match args.init {
            Some(pose) => search.refining(pose),
            None => Ok(search),
        }
    }
}

fn find(
    args: &PoseArgs,
    mesh: &Mesh,
    origin: [f64; 3],
    target: &PoseTarget,
    renderer: &mut Renderer,
) -> Result<(), Failure> {
    let bounds = Bounds::of(mesh);
    let view = View::around(args, bounds, origin, target.color.width, target.color.height)?;
    let mut search = view.search(args, mesh, bounds.center, target)?;
    let progress = Progress::counted("step", search.step_count());
    for _ in 0..search.step_count() {
        search.step(renderer)?;
        progress.step();
    }
    drop(progress);
    let Some(&(best, loss)) = search.found().first() else { return Err(Failure::Told) };
    let posed = posed(mesh, &best, bounds.center)?;
    if let Some(path) = &args.out {
        softras_io::save_with(&posed, path, &SaveOptions { origin, ..SaveOptions::default() })?;
    }
    let agreement = Agreement::of(&view, &posed, target, renderer)?;
    let other = search.found().iter().find(|(pose, _)| pose.degrees_to(&best) > OTHER);
    let confidence = other.map(|(_, other)| (1.0 - loss / other.max(1e-12)).clamp(0.0, 1.0));
    // If the best pose does not explain the picture, others are not listed as equally good.
    let good = if agreement.is_near() { search.equally_good() } else { 1 };
    let equally_good = search.found()[..good].to_vec();
    tell(args, &Answer { equally_good, confidence, agreement })
}

struct Answer {
    /// The best pose and those that explain the picture as well, with their losses.
    equally_good: Vec<(Pose, f64)>,
    /// `None` where no start ended at another answer.
    confidence: Option<f64>,
    agreement: Agreement,
}

fn posed(mesh: &Mesh, pose: &Pose, center: DVec3) -> Result<Mesh> {
    let place = |p: &[f32; 3]| {
        let from = DVec3::from(p.map(f64::from)) - center;
        (pose.rotation * from + center + pose.translation).as_vec3().to_array()
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
    others.iter().try_for_each(|(pose, loss)| say(&format!("{}; loss {loss:.6}", words(pose))))
}
