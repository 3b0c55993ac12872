//! Poses that follow gradients, many at once.

use super::target::PoseTarget;
use crate::bad;
use crate::optimize::optimizer::{Method, Optimizer};
use crate::optimize::schedule::Schedule;
use glam::{DMat3, DMat4, DQuat, DVec3};
use softras::{
    Error, Frame, GradientRequest, ImageGradient, Renderer, Result,
    scene::{Background, Camera, ColorAggregation, Outputs, Scene, Settings, SilhouetteAggregation},
};
use std::ops::Range;

/// The rotation of a mesh about a point, and its translation after that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// About the fit's centre, in world axes.
    pub rotation: DQuat,
    /// World units.
    pub translation: DVec3,
}

impl Pose {
    /// The mesh as it is given.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Degrees between two poses' rotations, 0 to 180.
    pub fn degrees_to(&self, other: &Self) -> f64 {
        let cosine = self.rotation.normalize().dot(other.rotation.normalize()).abs().min(1.0);
        2.0 * cosine.acos().to_degrees()
    }
}

/// How poses are fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseOptions {
    /// Number of steps.
    pub iterations: usize,
    /// Softness of edges, screen units².
    pub sigma: Schedule,
    /// Softness of the depth order, as a fraction of far - near.
    pub gamma: Schedule,
    /// Standard deviation of the Gaussian that blurs both images before they are compared, as a fraction of the image's
    /// height. The loss of blurred images has fewer local minima.
    pub blur: Schedule,
    /// Weight of the silhouette in the loss of [`PoseTarget`], relative to 1 for the colour. It should be small at
    /// first, since many wrong rotations have a similar outline, and grow, since the outline determines the distance
    /// best.
    pub silhouette: Schedule,
    /// Step size of the rotation in radians.
    pub rate: Schedule,
    /// Step size of the translation in world units, divided by that of the rotation; 0 fits the rotation only.
    pub translation_rate: f64,
}

impl Default for PoseOptions {
    /// 150 steps of rotation only, from a strong blur to none. For closed meshes of which only front faces are drawn.
    fn default() -> Self {
        Self {
            iterations: 150,
            sigma: Schedule::Exponential { from: 3e-3, to: 3e-5 },
            gamma: Schedule::Exponential { from: 1.0, to: 3e-2 },
            blur: Schedule::Exponential { from: 0.15, to: 0.01 },
            silhouette: Schedule::Exponential { from: 0.03, to: 1.0 },
            rate: Schedule::Exponential { from: 0.3, to: 0.01 },
            translation_rate: 0.0,
        }
    }
}

impl PoseOptions {
    /// For meshes whose back faces are drawn as well: γ starts small enough that hidden surfaces do not show through.
    pub fn both_sides() -> Self {
        Self {
            sigma: Schedule::Exponential { from: 1e-3, to: 1e-5 },
            gamma: Schedule::Exponential { from: 1e-1, to: 3e-2 },
            rate: Schedule::Exponential { from: 0.15, to: 0.005 },
            ..Self::default()
        }
    }
}

/// A fit of several poses side by side, each to its own target.
#[derive(Clone, Debug)]
pub struct PoseFit {
    scene: Scene,
    pub(super) camera: Camera,
    center: DVec3,
    settings: Settings,
    options: PoseOptions,
    poses: Vec<Pose>,
    optimizers: Vec<Optimizer>,
    step: usize,
    /// The most poses that the device was seen to hold at once.
    pub(super) at_once: usize,
}

impl PoseFit {
    /// Starts from given poses of a scene of one mesh, seen by one camera. `center` is the point that rotations turn
    /// about, in world units. The fit sets softness, aggregation and outputs of the settings itself; size, near, far
    /// and faces are used as they are. For a closed mesh, draw front faces only: then γ may start so large that no face
    /// hides another without the back showing through.
    ///
    /// # Errors
    /// [`softras::Error::Fit`] without poses or with several meshes.
    pub fn new(
        scene: Scene,
        camera: Camera,
        center: DVec3,
        settings: Settings,
        options: PoseOptions,
        poses: Vec<Pose>,
    ) -> Result<Self> {
        if poses.is_empty() || scene.meshes.len() != 1 {
            let what = format!("{} poses of {} meshes", poses.len(), scene.meshes.len());
            return bad(what, "give one mesh and at least one pose to begin at");
        }
        let (betas, epsilon) = ([0.8, 0.95], 1e-12);
        // A translation has step sizes of its own along the camera's axes, because its depth changes the image much less.
        let turns = Optimizer::new(Method::UniformAdam { betas, epsilon }, 3);
        let shifts = Optimizer::new(Method::Adam { betas, epsilon }, 3);
        let optimizers = poses.iter().flat_map(|_| [turns.clone(), shifts.clone()]).collect();
        Ok(Self { scene, camera, center, settings, options, poses, optimizers, step: 0, at_once: usize::MAX })
    }

    /// The poses as they are now.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The settings that a step is rendered with.
    pub(super) fn settings_at(&self, step: usize) -> Settings {
        Settings {
            sigma: self.options.sigma.at_step(step, self.options.iterations),
            gamma: self.options.gamma.at_step(step, self.options.iterations),
            // Dropping a fragment that is nearer than all others makes the colour jump, and a jump has no gradient.
            tau: self.settings.tau.min(1e-8),
            background: Background::Composite,
            outputs: Outputs { color: true, silhouette: true, ..Outputs::NOTHING },
            color: ColorAggregation::Softmax,
            silhouette: SilhouetteAggregation::Product,
            save: true,
            ..self.settings.clone()
        }
    }

    /// The camera that sees the unmoved mesh as the fit's camera sees the posed one.
    ///
    /// # Errors
    /// [`softras::Error::Camera`] for a pose that is not finite.
    pub fn posed_camera(&self, pose: &Pose) -> Result<Camera> {
        let moved = DMat4::from_translation(self.center + pose.translation)
            * DMat4::from_quat(pose.rotation)
            * DMat4::from_translation(-self.center);
        Camera::from_affine(self.camera.matrix() * moved, *self.camera.projection())
    }

    /// Renders all poses with the current step's softness, compares them with the targets and moves each. Returns each
    /// pose's loss before the move, see [`PoseTarget`].
    ///
    /// # Errors
    /// [`softras::Error::Fit`] for targets that are not one for each pose; otherwise as [`Renderer::render`] and
    /// [`Renderer::backward`].
    pub fn step(&mut self, renderer: &mut Renderer, target: &PoseTarget) -> Result<Vec<f64>> {
        let (losses, gradients) = self.differentiate(renderer, target)?;
        let rate = self.options.rate.at_step(self.step, self.options.iterations);
        for (i, [by_turn, by_shift]) in gradients.into_iter().enumerate() {
            let (mut turn, mut shift) = ([0.0; 3], [0.0; 3]);
            self.optimizers[2 * i].step(&mut turn, &by_turn.to_array(), rate);
            let rotation = self.poses[i].rotation;
            self.poses[i].rotation = (DQuat::from_scaled_axis(DVec3::from_array(turn)) * rotation).normalize();
            if self.options.translation_rate > 0.0 {
                let axes = DMat3::from_mat4(self.camera.matrix());
                let rate = rate * self.options.translation_rate;
                self.optimizers[2 * i + 1].step(&mut shift, &(axes * by_shift).to_array(), rate);
                self.poses[i].translation += axes.transpose() * DVec3::from_array(shift);
            }
        }
        self.step += 1;
        Ok(losses)
    }

    /// The loss of each pose, and its gradient by a rotation (radians, about world axes through the mesh's centre) and
    /// by a translation (world units).
    ///
    /// # Errors
    /// As [`PoseFit::step`].
    pub fn differentiate(
        &mut self,
        renderer: &mut Renderer,
        target: &PoseTarget,
    ) -> Result<(Vec<f64>, Vec<[DVec3; 2]>)> {
        target.validate(self.poses.len())?;
        let settings = self.settings_at(self.step);
        let of_poses = |poses: Range<usize>| {
            let frame = self.frame(renderer, &self.poses[poses.clone()], &settings)?;
            let (losses, upstream) = self.compare(&frame, &target.part(poses.clone()))?;
            let wanted = GradientRequest { camera: true, ..GradientRequest::NOTHING };
            let by_cameras = renderer.backward(&frame, &upstream, &wanted)?.cameras;
            let gradients = self.poses[poses].iter().zip(&by_cameras).map(|(pose, by)| self.by_pose(pose, &by.twist));
            Ok(losses.into_iter().zip(gradients).collect())
        };
        let mut at_once = self.at_once;
        let all = of_each(self.poses.len(), &mut at_once, of_poses)?;
        self.at_once = at_once;
        Ok(all.into_iter().unzip())
    }

    /// The losses of any poses at a given σ and γ; the fit does not change.
    ///
    /// # Errors
    /// As [`PoseFit::step`].
    pub fn losses(
        &self,
        renderer: &mut Renderer,
        poses: &[Pose],
        (sigma, gamma): (f64, f64),
        target: &PoseTarget,
    ) -> Result<Vec<f64>> {
        target.validate(poses.len())?;
        let settings = Settings { sigma, gamma, save: false, ..self.settings_at(0) };
        of_each(poses.len(), &mut { self.at_once }, |part| {
            let frame = self.frame(renderer, &poses[part.clone()], &settings)?;
            target.part(part).compare(&frame, 0.0, [1.0; 2]).map(|(losses, _)| losses)
        })
    }

    /// The losses of any poses as the present step compares them; the fit does not change.
    pub(super) fn losses_of_step(
        &self,
        renderer: &mut Renderer,
        poses: &[Pose],
        target: &PoseTarget,
    ) -> Result<Vec<f64>> {
        target.validate(poses.len())?;
        let settings = Settings { save: false, ..self.settings_at(self.step) };
        of_each(poses.len(), &mut { self.at_once }, |part| {
            let frame = self.frame(renderer, &poses[part.clone()], &settings)?;
            self.compare(&frame, &target.part(part)).map(|(losses, _)| losses)
        })
    }

    /// The mesh in each of some poses.
    pub(super) fn frame(&self, renderer: &mut Renderer, poses: &[Pose], settings: &Settings) -> Result<Frame> {
        let cameras = poses.iter().map(|pose| self.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        renderer.render(&self.scene, &cameras, settings)
    }

    /// The losses of a frame with the present step's blur and weights, and their gradient.
    fn compare(&self, frame: &Frame, target: &PoseTarget) -> Result<(Vec<f64>, ImageGradient)> {
        let blur = self.options.blur.at_step(self.step, self.options.iterations) * target.height() as f64;
        let silhouette = self.options.silhouette.at_step(self.step, self.options.iterations);
        target.compare(frame, blur, [1.0, silhouette])
    }

    /// Converts dL/dtwist of a view to dL by rotation and translation of its pose.
    fn by_pose(&self, pose: &Pose, twist: &[f64; 6]) -> [DVec3; 2] {
        let view = self.camera.matrix();
        let axes = DMat3::from_mat4(view);
        let (by_v, by_w) = (DVec3::from_slice(&twist[..3]), DVec3::from_slice(&twist[3..]));
        // Moves the rotation's centre from the camera to the mesh's, then from view axes, which may be left-handed, to
        // world axes.
        let center = view.transform_point3(self.center + pose.translation);
        let by_w = axes.determinant().signum() * (axes.transpose() * (by_w + by_v.cross(center)));
        [by_w, axes.transpose() * by_v]
    }
}

/// A value for each of `count` poses. `make` makes those of a range of at most `at_once` poses; if the device cannot hold that many,
/// `at_once` is lowered to the number that it holds.
pub fn of_each<T>(
    count: usize,
    at_once: &mut usize,
    make: impl FnMut(Range<usize>) -> Result<Vec<T>>,
) -> Result<Vec<T>> {
    let mut all = Vec::with_capacity(count);
    softras::parts::in_parts(count, at_once, make, |_, part| {
        all.extend(part);
        Ok::<_, Error>(())
    })?;
    Ok(all)
}

/// `count` rotations spread evenly over all rotations, to start [`PoseFit`] from: the super-Fibonacci spiral (Alexa
/// 2022).
pub fn rotations(count: usize) -> Vec<DQuat> {
    const PHI: f64 = std::f64::consts::SQRT_2;
    const PSI: f64 = 1.533_751_168_755_204_3;
    let one = |i: usize| {
        let s = i as f64 + 0.5;
        let t = s / count as f64;
        let (a, b) = (std::f64::consts::TAU * s / PHI, std::f64::consts::TAU * s / PSI);
        let (r, q) = (t.sqrt(), (1.0 - t).sqrt());
        DQuat::from_xyzw(r * a.sin(), r * a.cos(), q * b.sin(), q * b.cos())
    };
    (0..count).map(one).collect()
}
