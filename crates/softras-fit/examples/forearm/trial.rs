//! Trials: a pose to find, a pose to start from, and the methods of fitting.

use super::figure::Figure;
use super::fit::{FigureFit, FigureOptions, Sight};
use super::mannequin::mannequin;
use super::skeleton::SkeletonPose;
use super::visible::visible_triangles;
use softras::glam::DVec3;
use softras::scene::Background;
use softras::{Camera, Frame, Mesh, Projection, Renderer, Result, Scene, Settings};
use softras_fit::{PoseTarget, Schedule};
use softras_lab::random::Random;

/// The joint that is hidden, and the bones that it carries.
pub const HIDDEN: &str = "left forearm";
/// Side of the fitted picture in pixels.
const SIZE: u32 = 64;
const DISTANCE: f64 = 5.0;
/// The most draws of a pose until the limb is hidden at the start and partly visible in the target.
const DRAWS: usize = 500;
/// The least and the largest share of the limb's triangles that a target may show.
const LEAST_SEEN: f64 = 0.03;
const MOST_SEEN: f64 = 0.3;

/// All methods by name, the baselines first.
pub fn methods() -> [(&'static str, FigureOptions); 4] {
    let soft = FigureOptions::default();
    let visible = FigureOptions { sight: Sight::VisibleOnly, ..soft.clone() };
    let silhouette = FigureOptions { weights: [0.0, soft.weights[1]], ..soft.clone() };
    // The same gamma, and the best of three sigmas on other seeds.
    let constant = FigureOptions { sigma: Schedule::Constant(1e-4), blur: Schedule::Constant(0.0), ..soft.clone() };
    [("visible only", visible), ("soft, silhouette only", silhouette), ("soft, no schedule", constant), ("soft", soft)]
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
    target: PoseTarget,
}

impl Stage {
    /// The mannequin, and a camera at the height of its chest.
    pub fn new() -> Result<Self> {
        let (near, far) = (DISTANCE - 1.0, DISTANCE + 1.0);
        let settings = Settings { width: SIZE, height: SIZE, near, far, ..Settings::default() };
        Ok(Self { figure: mannequin()?, camera: camera(1.0)?, settings })
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
        let limb = self.figure.skeleton.find(HIDDEN);
        let bones = self.figure.bone_of_triangle();
        let (mut seen, mut all) = (0, 0);
        for (bone, visible) in bones.into_iter().zip(visible) {
            if bone == limb {
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
            let target = PoseTarget::new(frame.color()?.clone(), frame.silhouette()?.clone())?;
            return Ok(Some(Trial { truth, start, target }));
        }
        Ok(None)
    }

    /// Draws target and start; the start is within 7 degrees of the target in every angle but the hidden elbow.
    fn poses(&self, random: &mut Random) -> (SkeletonPose, SkeletonPose) {
        let skeleton = &self.figure.skeleton;
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
        let hidden = skeleton.angles_of(skeleton.find(HIDDEN));
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

    /// The pose that a trial's fit ends with.
    pub fn fit(&self, trial: &Trial, options: &FigureOptions, renderer: &mut Renderer) -> Result<SkeletonPose> {
        let (settings, start) = (self.settings.clone(), trial.start.clone());
        let mut fit = FigureFit::new(&self.figure, self.camera, settings, options.clone(), start);
        for _ in 0..options.iterations {
            fit.step(renderer, &trial.target)?;
        }
        Ok(fit.pose)
    }

    /// The error of the hidden joint in degrees, and the mean error of all others.
    pub fn errors(&self, pose: &SkeletonPose, truth: &SkeletonPose) -> [f64; 2] {
        let skeleton = &self.figure.skeleton;
        let hidden = skeleton.find(HIDDEN);
        let pairs = skeleton.directions(pose).into_iter().zip(skeleton.directions(truth)).enumerate();
        let others = pairs.filter(|(bone, _)| *bone != hidden).map(|(_, (a, b))| a.angle_between(b).to_degrees());
        let mean = others.sum::<f64>() / (skeleton.bones.len() - 1) as f64;
        [skeleton.degrees_between(pose, truth, hidden), mean]
    }
}

fn camera(side: f64) -> Result<Camera> {
    let projection = Projection::Perspective { fov_y: 27f64.to_radians() };
    Camera::look_at(DVec3::new(0.0, 0.25, side * DISTANCE), DVec3::new(0.0, 0.0, 0.0), DVec3::Y, projection)
}
