//! Trials: a pose to find, a pose to start from, and the methods of fitting.

use super::figure::Figure;
use super::mannequin::{LEFT_FOREARM, mannequin};
use super::skeleton::SkeletonPose;
use softras::glam::DVec3;
use softras::scene::{Appearance, Background, ColorAggregation, Outputs};
use softras::{Camera, Frame, GradientRequest, Mesh, Projection, Renderer, Result, Scene, Settings};
use softras_check::random::Random;
use softras_fit::{Optimizer, PoseTarget, Schedule};

/// Side of the fitted picture in pixels.
const SIZE: u32 = 64;
const DISTANCE: f64 = 5.0;
/// The most draws of a pose until the limb is hidden at the start and partly visible in the target.
const DRAWS: usize = 500;
/// The least and the largest share of the limb's triangles that a target may show.
const LEAST_SEEN: f64 = 0.03;
const MOST_SEEN: f64 = 0.3;

/// Steps of a fit.
pub const STEPS: usize = 300;
/// Softness of the depth order, the same in all steps: hidden triangles must have gradients also when σ has become small.
const GAMMA: f64 = 1e-1;
/// Length of a step of every angle, radians; times `SHIFT_RATE`, that of the shift, world units.
const RATE: Schedule = Schedule::Exponential { from: 0.04, to: 0.003 };
const SHIFT_RATE: f64 = 0.1;
/// Weight of the silhouette in the loss of [`PoseTarget`].
const SILHOUETTE: f64 = 20.0;
/// Weight of a penalty that holds angles that the image does not determine: half the sum of the squares of their distances
/// from the start, radians².
const STIFFNESS: f64 = 3e-3;

/// How a figure is fitted.
#[derive(Clone, Copy)]
pub struct Method {
    pub name: &'static str,
    /// Softness of edges.
    sigma: Schedule,
    /// Standard deviation of the Gaussian that blurs what is compared, as a part of the image's height.
    blur: Schedule,
    /// Weight of colour in the loss of [`PoseTarget`].
    color: f64,
    /// Whether only the triangles that a hard rasterization shows have gradients: the baseline.
    visible_only: bool,
}

/// All methods, the baselines first.
pub fn methods() -> [Method; 4] {
    let sigma = Schedule::Exponential { from: 3e-4, to: 3e-6 };
    let blur = Schedule::Exponential { from: 0.03, to: 0.003 };
    let soft = Method { name: "soft", sigma, blur, color: 1.0, visible_only: false };
    // A baseline with the γ of the others, and the best of three σ on other seeds.
    let (sigma, blur) = (Schedule::Constant(1e-4), Schedule::Constant(0.0));
    [
        Method { name: "visible only", visible_only: true, ..soft },
        Method { name: "soft, silhouette only", color: 0.0, ..soft },
        Method { name: "soft, no schedule", sigma, blur, ..soft },
        soft,
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
        let visible = self.visible(renderer, &mesh, &self.settings)?;
        let bones = self.figure.bone_of_triangle();
        let (mut seen, mut all) = (0, 0);
        for (bone, visible) in bones.into_iter().zip(visible) {
            if bone == LEFT_FOREARM {
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
        let hidden = skeleton.angles_of(LEFT_FOREARM);
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

    /// For each triangle whether a hard rasterization of the settings' size shows it at the centre of a pixel or more.
    fn visible(&self, renderer: &mut Renderer, mesh: &Mesh, settings: &Settings) -> Result<Vec<bool>> {
        let count = mesh.triangles().len();
        // Every triangle in a colour of its own: its number, counted from 1.
        let texels = (1..=count).map(|t| [t as f32, 0.0, 0.0]).collect();
        let numbered = mesh.clone().with_appearance(Appearance::Surface { resolution: 1, texels })?;
        let settings = Settings {
            color: ColorAggregation::Hard,
            sigma: 1e-7,
            background_color: [0.0; 3],
            outputs: Outputs { color: true, ..Outputs::NOTHING },
            save: false,
            ..settings.clone()
        };
        let frame = renderer.render(&Scene::new(numbered), &[self.camera], &settings)?;
        let mut visible = vec![false; count];
        for number in frame.color()?.data.iter().step_by(3) {
            if let Some(seen) = (number.round() as usize).checked_sub(1).and_then(|t| visible.get_mut(t)) {
                *seen = true;
            }
        }
        Ok(visible)
    }

    /// The pose that a trial's fit ends with after `steps` steps.
    pub fn fit(&self, trial: &Trial, method: &Method, steps: usize, renderer: &mut Renderer) -> Result<SkeletonPose> {
        // Adam divides by the gradient's size, so rounding alone would move angles that the image does not determine. This ε is
        // a fraction of a usual gradient and prevents that.
        let adam = softras_fit::Method::Adam { betas: [0.8, 0.95], epsilon: 3e-4 };
        let mut pose = trial.start.clone();
        let (mut angles, mut shift) = (Optimizer::new(adam, pose.angles.len()), Optimizer::new(adam, 3));
        for step in 0..steps {
            let settings = Settings {
                sigma: method.sigma.at_step(step, steps),
                gamma: GAMMA,
                // As for rigid poses: with a larger τ a triangle is dropped while it still outweighs others, and the colour jumps.
                tau: self.settings.tau.min(1e-6),
                background: Background::Composite,
                save: true,
                ..self.settings.clone()
            };
            let blur = method.blur.at_step(step, steps) * f64::from(SIZE);
            let by_vertex = self.gradient(trial, &pose, (&settings, blur, method), renderer)?;
            let mut gradient = self.figure.pull(&pose, &by_vertex);
            for ((slope, now), start) in gradient.angles.iter_mut().zip(&pose.angles).zip(&trial.start.angles) {
                *slope += STIFFNESS * (now - start);
            }
            let rate = RATE.at_step(step, steps);
            angles.step(&mut pose.angles, &gradient.angles, rate);
            let mut moved = pose.shift.to_array();
            shift.step(&mut moved, &gradient.shift.to_array(), rate * SHIFT_RATE);
            pose.shift = DVec3::from_array(moved);
        }
        Ok(pose)
    }

    /// The gradient of the loss by every vertex.
    fn gradient(
        &self,
        trial: &Trial,
        pose: &SkeletonPose,
        (settings, blur, method): (&Settings, f64, &Method),
        renderer: &mut Renderer,
    ) -> Result<Vec<DVec3>> {
        let whole = self.figure.posed(pose)?;
        let by_mesh = |mesh: Mesh, renderer: &mut Renderer| -> Result<Vec<DVec3>> {
            let frame = renderer.render(&Scene::new(mesh), &[self.camera], settings)?;
            let (_, upstream) = trial.target.compare(&frame, blur, [method.color, SILHOUETTE])?;
            let gradients = renderer.backward(&frame, &upstream, &GradientRequest::default())?;
            Ok(gradients.meshes[0].positions.iter().map(|g| DVec3::from(g.map(f64::from))).collect())
        };
        if !method.visible_only {
            return by_mesh(whole, renderer);
        }
        let visible = self.visible(renderer, &whole, settings)?;
        let by_corner = by_mesh(apart(&whole)?, renderer)?;
        let mut by_vertex = vec![DVec3::ZERO; whole.positions().len()];
        let corners = whole.triangles().iter().zip(by_corner.chunks_exact(3)).zip(visible);
        for ((triangle, gradients), _) in corners.filter(|(_, visible)| *visible) {
            triangle.iter().zip(gradients).for_each(|(&i, g)| by_vertex[i as usize] += *g);
        }
        Ok(by_vertex)
    }

    /// The error of the hidden joint in degrees, and the mean error of all others.
    pub fn errors(&self, pose: &SkeletonPose, truth: &SkeletonPose) -> [f64; 2] {
        let skeleton = &self.figure.skeleton;
        let pairs = skeleton.directions(pose).into_iter().zip(skeleton.directions(truth)).enumerate();
        let others = pairs.filter(|(bone, _)| *bone != LEFT_FOREARM).map(|(_, (a, b))| a.angle_between(b).to_degrees());
        let mean = others.sum::<f64>() / (skeleton.bones.len() - 1) as f64;
        [skeleton.degrees_between(pose, truth, LEFT_FOREARM), mean]
    }
}

fn camera(side: f64) -> Result<Camera> {
    let projection = Projection::Perspective { fov_y: 27f64.to_radians() };
    Camera::look_at(DVec3::new(0.0, 0.25, side * DISTANCE), DVec3::new(0.0, 0.0, 0.0), DVec3::Y, projection)
}

/// The mesh taken apart: each triangle has vertices of its own.
fn apart(mesh: &Mesh) -> Result<Mesh> {
    let each = |values: &[[f32; 3]]| mesh.triangles().iter().flatten().map(|&i| values[i as usize]).collect::<Vec<_>>();
    let triangles = (0..mesh.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let appearance = match mesh.appearance() {
        Appearance::VertexColors(colors) => Appearance::VertexColors(each(colors)),
        other => other.clone(),
    };
    Mesh::new(each(mesh.positions()), triangles)?.with_appearance(appearance)
}
