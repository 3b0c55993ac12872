//! Trials of `softras articulate`: a pose to find, a pose to start from, and the methods of fitting.

use super::args::ArticulateArgs;
use crate::commands::Failure;
use crate::commands::steps::{Loop, each};
use glam::DVec3;
use softras::scene::Background;
use softras::{Camera, Frame, Mesh, Projection, Renderer, Result, Scene, Settings};
use softras_fit::{PoseTarget, Schedule};
use softras_lab::articulated::{Figure, FigureFit, FigureOptions, Sight, SkeletonPose, visible_triangles};
use softras_lab::random::Random;
use std::time::Instant;

/// The joint that is hidden, and the bones that it carries.
pub const HIDDEN: &str = "left forearm";
const DISTANCE: f64 = 5.0;
/// The most draws of a pose until the limb is hidden at the start and partly visible in the target.
const DRAWS: usize = 500;
/// The least and the largest share of the limb's triangles that a target may show.
const LEAST_SEEN: f64 = 0.03;
const MOST_SEEN: f64 = 0.3;

/// A method of fitting.
pub struct Method {
    /// Its name.
    pub name: &'static str,
    /// Its options.
    pub options: FigureOptions,
}

/// All methods, the baselines first.
pub fn methods(args: &ArticulateArgs) -> Vec<Method> {
    let soft = FigureOptions { iterations: args.iterations as usize, ..FigureOptions::default() };
    let visible = FigureOptions { sight: Sight::VisibleOnly, ..soft.clone() };
    let silhouette = FigureOptions { weights: [0.0, soft.weights[1]], ..soft.clone() };
    // The same gamma, and the best of three sigmas on other seeds.
    let constant = FigureOptions { sigma: Schedule::Constant(1e-4), blur: Schedule::Constant(0.0), ..soft.clone() };
    let method = |name, options| Method { name, options };
    vec![
        method("visible only", visible),
        method("soft, silhouette only", silhouette),
        method("soft, no schedule", constant),
        method("soft", soft),
    ]
}

/// The figure, its camera and the image size.
pub struct Stage {
    /// The figure.
    pub figure: Figure,
    /// A camera in front of the figure.
    pub camera: Camera,
    /// The image size, near and far.
    pub settings: Settings,
}

/// One pose to find.
pub struct Trial {
    /// The pose to find.
    pub truth: SkeletonPose,
    /// The pose that the fits start from.
    pub start: SkeletonPose,
    /// The share of the limb's triangles that the target shows.
    pub seen: f64,
    target: PoseTarget,
}

/// The result of a method.
pub struct Found {
    /// The pose that was found.
    pub pose: SkeletonPose,
    /// The time of the whole fit.
    pub seconds: f64,
}

impl Stage {
    /// The mannequin, and a camera at the height of its chest.
    pub fn new(size: u32) -> Result<Self> {
        let settings =
            Settings { width: size, height: size, near: DISTANCE - 1.0, far: DISTANCE + 1.0, ..Settings::default() };
        Ok(Self { figure: softras_lab::articulated::mannequin()?, camera: camera(1.0)?, settings })
    }

    /// Renders a mesh sharply, seen by the camera or by one behind the figure.
    pub fn look(
        &self,
        renderer: &mut Renderer,
        mesh: &Mesh,
        behind: bool,
        (width, height): (u32, u32),
    ) -> Result<Frame> {
        let camera = if behind { camera(-1.0)? } else { self.camera };
        let settings = Settings {
            width,
            height,
            sigma: 1e-7,
            gamma: 1e-5,
            background: Background::Composite,
            ..self.settings.clone()
        };
        renderer.render(&Scene::new(mesh.clone()), &[camera], &settings)
    }

    /// The share of the hidden limb's triangles that are visible in a pose.
    fn seen(&self, renderer: &mut Renderer, pose: &SkeletonPose) -> Result<f64> {
        let mesh = self.figure.posed(pose)?;
        let visible = visible_triangles(renderer, &mesh, &self.camera, &self.settings)?;
        let limb = self.figure.skeleton().find(HIDDEN);
        let bones = self.figure.bone_of_triangle();
        let (mut seen, mut all) = (0, 0);
        for (bone, visible) in bones.into_iter().zip(visible) {
            if Some(bone) == limb {
                (seen, all) = (seen + usize::from(visible), all + 1);
            }
        }
        Ok(seen as f64 / f64::from(all.max(1)))
    }

    /// Draws the next trial, repeatedly until the limb is wholly hidden at the start and partly visible in the target;
    /// `None` if no draw is such.
    pub fn draw(&self, random: &mut Random, renderer: &mut Renderer) -> Result<Option<Trial>> {
        for _ in 0..DRAWS {
            let (truth, start) = self.poses(random);
            let seen = self.seen(renderer, &truth)?;
            if !(LEAST_SEEN..MOST_SEEN).contains(&seen) || self.seen(renderer, &start)? > 0.0 {
                continue;
            }
            let size = (self.settings.width, self.settings.height);
            let frame = self.look(renderer, &self.figure.posed(&truth)?, false, size)?;
            if let (Some(color), Some(silhouette)) = (frame.color(), frame.silhouette()) {
                let target = PoseTarget::new(color.clone(), silhouette.clone())?;
                return Ok(Some(Trial { truth, start, seen, target }));
            }
        }
        Ok(None)
    }

    /// Draws target and start; the start is within 7 degrees of the target in every angle but the hidden elbow.
    fn poses(&self, random: &mut Random) -> (SkeletonPose, SkeletonPose) {
        let skeleton = self.figure.skeleton();
        let (mut truth, mut start) = (skeleton.rest(), skeleton.rest());
        // Middle and spread of every angle in degrees, as `mannequin` lists them.
        let ranges: [&[(f64, f64)]; 10] = [
            &[(0.0, 6.0), (0.0, 10.0), (0.0, 6.0)],
            &[(0.0, 12.0), (0.0, 12.0)],
            &[(0.0, 15.0), (-50.0, 25.0), (-80.0, 10.0)],
            &[(45.0, 25.0)],
            &[(36.0, 5.0), (-32.0, 4.0), (90.0, 8.0)],
            &[(58.0, 8.0)],
            &[(-10.0, 15.0), (-14.0, 8.0)],
            &[(15.0, 15.0)],
            &[(-10.0, 15.0), (14.0, 8.0)],
            &[(15.0, 15.0)],
        ];
        let hidden = skeleton.find(HIDDEN).map_or(0..0, |bone| skeleton.angles_of(bone));
        for (i, &(middle, spread)) in ranges.into_iter().flatten().enumerate() {
            let angle = middle + random.range(-spread, spread);
            // The elbow starts bent further, with the hand higher up behind the back.
            let away = if hidden.contains(&i) { random.range(34.0, 40.0) } else { random.range(-7.0, 7.0) };
            truth.angles[i] = angle.to_radians();
            start.angles[i] = (angle + away).to_radians();
        }
        let mut within = |part: f64| random.range(-part, part);
        start.shift = 0.03 * DVec3::new(within(1.0), within(1.0), 0.0);
        (truth, start)
    }

    /// Fits a trial with one method.
    pub fn fit(&self, trial: &Trial, method: &Method, renderer: &mut Renderer) -> Result<Found, Failure> {
        let before = Instant::now();
        let (figure, start) = (self.figure.clone(), trial.start.clone());
        let mut fit = FigureFit::new(figure, self.camera, self.settings.clone(), method.options.clone(), start)?;
        let mut steps = each(|_, renderer| fit.step(renderer, &trial.target));
        Loop::over(0..method.options.iterations).run(&mut steps, renderer)?;
        Ok(Found { pose: fit.pose().clone(), seconds: before.elapsed().as_secs_f64() })
    }

    /// The error of the hidden joint in degrees, and the mean error of all others.
    pub fn errors(&self, pose: &SkeletonPose, truth: &SkeletonPose) -> [f64; 2] {
        let skeleton = self.figure.skeleton();
        let hidden = skeleton.find(HIDDEN).unwrap_or(0);
        let of =
            |bone: usize| skeleton.direction(pose, bone).angle_between(skeleton.direction(truth, bone)).to_degrees();
        let others: Vec<f64> = (0..skeleton.bones().len()).filter(|&bone| bone != hidden).map(of).collect();
        [skeleton.degrees_between(pose, truth, hidden), others.iter().sum::<f64>() / others.len().max(1) as f64]
    }
}

fn camera(side: f64) -> Result<Camera> {
    let projection = Projection::Perspective { fov_y: 27f64.to_radians() };
    Camera::look_at(DVec3::new(0.0, 0.25, side * DISTANCE), DVec3::new(0.0, 0.0, 0.0), DVec3::Y, projection)
}
