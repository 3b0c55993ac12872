//! The rotation and translation of a rigid mesh from an image of it.
//!
//! Many poses are tried at once, as many cameras on one mesh. σ and γ shrink while they are fitted: where the image is
//! blurred, the loss has few hollows besides the right one (section 4.3 of the SoftRas paper). Lights, where a scene
//! has them, turn with the mesh; images are best compared unlit.

mod flow;
mod target;

pub use flow::{flow_by_vertex, flow_gradient};
pub use target::PoseTarget;

use super::bad;
use super::optimizer::{Method, Optimizer};
use super::schedule::Schedule;
use crate::error::Result;
use crate::gradients::Wanted;
use crate::renderer::Renderer;
use crate::scene::{Background, Camera, ColorAggregation, Outputs, Scene, Settings, SilhouetteAggregation};
use glam::{DMat3, DMat4, DQuat, DVec3};

/// Where a mesh is: turned about a point, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// About the fit's centre, in world axes.
    pub rotation: DQuat,
    /// World units.
    pub translation: DVec3,
}

impl Pose {
    /// As the mesh is.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Degrees between two poses' rotations, 0 to 180.
    pub fn degrees_to(&self, other: &Self) -> f64 {
        let cosine = self.rotation.normalize().dot(other.rotation.normalize()).abs().min(1.0);
        2.0 * cosine.acos().to_degrees()
    }
}

/// Where the gradient comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Differentiation {
    /// The soft image's own.
    #[default]
    Soft,
    /// A hard image's, from how its colours change from pixel to pixel: [`flow_gradient`].
    ImageFlow,
}

/// How poses are fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseOptions {
    /// Steps.
    pub iterations: usize,
    /// Softness of edges.
    pub sigma: Schedule,
    /// Softness of the depth order.
    pub gamma: Schedule,
    /// Standard deviation of the Gaussian that blurs what is compared, as a part of the image's height. A blurred image has
    /// fewer hollows still in its loss.
    pub blur: Schedule,
    /// Weight of the silhouette in the loss of [`PoseTarget`], that of the colour being 1: little at first, when the outline
    /// of many a wrong rotation fits, more at last, when it says best how far away the mesh is.
    pub silhouette: Schedule,
    /// Length of a step of the rotation, radians.
    pub rate: Schedule,
    /// Length of a step of the translation as a part of that; 0 keeps the mesh in its place.
    pub translation_rate: f64,
    /// Soft, or a hard renderer's.
    pub differentiation: Differentiation,
}

impl Default for PoseOptions {
    /// From an image blurred beyond recognition to its pixels, in 150 steps; the mesh stays in its place. For closed meshes,
    /// of which front faces alone are drawn.
    fn default() -> Self {
        Self {
            iterations: 150,
            sigma: Schedule::Exponential { from: 3e-3, to: 3e-5 },
            gamma: Schedule::Exponential { from: 1.0, to: 3e-2 },
            blur: Schedule::Exponential { from: 0.15, to: 0.01 },
            silhouette: Schedule::Exponential { from: 0.03, to: 1.0 },
            rate: Schedule::Exponential { from: 0.3, to: 0.01 },
            translation_rate: 0.0,
            differentiation: Differentiation::Soft,
        }
    }
}

impl PoseOptions {
    /// For meshes that are seen from both sides: γ begins where what is behind does not shine through.
    pub fn both_sides() -> Self {
        Self {
            sigma: Schedule::Exponential { from: 1e-3, to: 1e-5 },
            gamma: Schedule::Exponential { from: 1e-1, to: 3e-2 },
            rate: Schedule::Exponential { from: 0.15, to: 0.005 },
            ..Self::default()
        }
    }
}

/// Poses that are fitted side by side, each to its own target.
#[derive(Clone, Debug)]
pub struct PoseFit {
    scene: Scene,
    camera: Camera,
    center: DVec3,
    settings: Settings,
    options: PoseOptions,
    poses: Vec<Pose>,
    optimizers: Vec<Optimizer>,
    step: usize,
}

impl PoseFit {
    /// Begins at some poses of a scene of one mesh, seen by one camera. Of the settings size, depths and which faces are
    /// drawn count; `center` is what rotations turn about. A closed mesh is best seen by its front faces alone: then γ may
    /// begin so large that no face hides another, and its back does not shine through.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] without poses or with several meshes.
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
        let optimizers =
            vec![Optimizer::new(Method::UniformAdam { betas: [0.8, 0.95], epsilon: 1e-12 }, 3); 2 * poses.len()];
        Ok(Self { scene, camera, center, settings, options, poses, optimizers, step: 0 })
    }

    /// The poses as they are now.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// How a step is rendered.
    fn settings_at(&self, step: usize) -> Settings {
        let soft = self.options.differentiation == Differentiation::Soft;
        Settings {
            sigma: self.options.sigma.at_step(step, self.options.iterations),
            gamma: self.options.gamma.at_step(step, self.options.iterations),
            // A triangle that is dropped while it is still nearer than all others makes the colour jump, and a jump has
            // no gradient.
            tau: self.settings.tau.min(1e-8),
            background: Background::Composite,
            outputs: Outputs { color: true, silhouette: true, depth: !soft, normal: false },
            color: if soft { ColorAggregation::Softmax } else { ColorAggregation::Hard },
            silhouette: if soft { SilhouetteAggregation::Product } else { SilhouetteAggregation::Hard },
            save: soft,
            ..self.settings.clone()
        }
    }

    /// The camera that sees the mesh where it is as the fit's camera sees it in a pose.
    ///
    /// # Errors
    /// [`crate::Error::Camera`] for a pose that is not finite.
    pub fn posed_camera(&self, pose: &Pose) -> Result<Camera> {
        let moved = DMat4::from_translation(self.center + pose.translation)
            * DMat4::from_quat(pose.rotation)
            * DMat4::from_translation(-self.center);
        Camera::from_matrix(self.view() * moved, *self.camera.projection())
    }

    fn view(&self) -> DMat4 {
        let [a, b, c] = *self.camera.view();
        DMat4::from_cols_array_2d(&[a, b, c, [0.0, 0.0, 0.0, 1.0]]).transpose()
    }

    /// Renders all poses with the softness of the present step, compares and moves each; the loss of each before it
    /// moved comes back, as [`PoseTarget`] says.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets that are not one for each pose; otherwise as [`Renderer::render`] and
    /// [`Renderer::backward`].
    pub fn step(&mut self, renderer: &mut Renderer, target: &PoseTarget) -> Result<Vec<f64>> {
        let (losses, gradients) = self.differentiate(renderer, target)?;
        let rate = self.options.rate.at_step(self.step, self.options.iterations);
        for (i, [by_turn, by_shift]) in gradients.into_iter().enumerate() {
            let (mut turn, mut shift) = ([0.0; 3], [0.0; 3]);
            self.optimizers[2 * i].step(&mut turn, &by_turn.to_array(), rate);
            let pose = &mut self.poses[i];
            pose.rotation = (DQuat::from_scaled_axis(DVec3::from_array(turn)) * pose.rotation).normalize();
            if self.options.translation_rate > 0.0 {
                let rate = rate * self.options.translation_rate;
                self.optimizers[2 * i + 1].step(&mut shift, &by_shift.to_array(), rate);
                pose.translation += DVec3::from_array(shift);
            }
        }
        self.step += 1;
        Ok(losses)
    }

    /// The loss of each pose, and its gradient by a turn (radians, in world axes about the mesh's centre) and a shift.
    ///
    /// # Errors
    /// As [`PoseFit::step`].
    pub fn differentiate(&self, renderer: &mut Renderer, target: &PoseTarget) -> Result<(Vec<f64>, Vec<[DVec3; 2]>)> {
        let cameras = self.poses.iter().map(|pose| self.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let frame = renderer.render(&self.scene, &cameras, &self.settings_at(self.step))?;
        let blur = self.options.blur.at_step(self.step, self.options.iterations) * f64::from(self.settings.height);
        let silhouette = self.options.silhouette.at_step(self.step, self.options.iterations);
        let (losses, upstream) = target.compare(&frame, blur, [1.0, silhouette])?;
        let twists: Vec<[f64; 6]> = match self.options.differentiation {
            Differentiation::Soft => {
                let wanted = Wanted { camera: true, ..Wanted::NOTHING };
                renderer.backward(&frame, &upstream, &wanted)?.cameras.iter().map(|c| c.twist).collect()
            }
            Differentiation::ImageFlow => flow_gradient(&frame, &upstream, &self.camera)?,
        };
        let gradients = self.poses.iter().zip(&twists).map(|(pose, twist)| self.by_pose(pose, twist));
        Ok((losses, gradients.collect()))
    }

    /// The losses of any poses at a σ and a γ; nothing moves.
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
        let cameras = poses.iter().map(|pose| self.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let settings = Settings { sigma, gamma, save: false, ..self.settings_at(0) };
        let frame = renderer.render(&self.scene, &cameras, &settings)?;
        target.compare(&frame, 0.0, [1.0; 2]).map(|(losses, _)| losses)
    }

    /// From dL/dtwist of a view to dL by turn and shift of its pose.
    fn by_pose(&self, pose: &Pose, twist: &[f64; 6]) -> [DVec3; 2] {
        let view = self.view();
        let axes = DMat3::from_mat4(view);
        let (by_v, by_w) = (DVec3::from_slice(&twist[..3]), DVec3::from_slice(&twist[3..]));
        // About the mesh's centre rather than the camera; then from view axes, which may be left-handed, to the world's.
        let center = view.transform_point3(self.center + pose.translation);
        let by_w = axes.determinant().signum() * (axes.transpose() * (by_w + by_v.cross(center)));
        [by_w, axes.transpose() * by_v]
    }
}

/// `count` rotations far from each other: the super-Fibonacci spiral (Alexa 2022).
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
