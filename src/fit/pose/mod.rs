//! The rotation and translation of a rigid mesh from an image of it.
//!
//! Many poses are tried at once, as many cameras on one mesh. σ and γ shrink while they are fitted: where the image is
//! blurred, the loss has few hollows besides the right one (section 4.3 of the SoftRas paper). Lights, where a scene
//! has them, turn with the mesh; images are best compared unlit.

mod flow;

pub use flow::flow_gradient;

use super::bad;
use super::image_loss::{add_pooled_gradient, pooled};
use super::optimizer::{Method, Optimizer};
use super::schedule::Schedule;
use crate::error::Result;
use crate::gradients::{ImageGradient, Wanted};
use crate::image::Image;
use crate::renderer::{Frame, Renderer};
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
    /// Side of the squares whose means are compared, as a part of the image's height; below a pixel every pixel is
    /// compared. A coarse image has fewer hollows still in its loss.
    pub coarseness: Schedule,
    /// Length of a step of the rotation, radians.
    pub rate: Schedule,
    /// Length of a step of the translation as a part of that; 0 keeps the mesh in its place.
    pub translation_rate: f64,
    /// Soft, or a hard renderer's.
    pub differentiation: Differentiation,
}

impl Default for PoseOptions {
    /// From quarters of the image to its pixels, in 150 steps; the mesh stays in its place.
    fn default() -> Self {
        Self {
            iterations: 150,
            sigma: Schedule::Exponential { from: 1e-3, to: 1e-5 },
            gamma: Schedule::Exponential { from: 1e-1, to: 3e-2 },
            coarseness: Schedule::Exponential { from: 0.5, to: 0.01 },
            rate: Schedule::Exponential { from: 0.15, to: 0.005 },
            translation_rate: 0.0,
            differentiation: Differentiation::Soft,
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
    /// Begins at some poses of a scene of one mesh, seen by one camera. Of the settings size, depths and background
    /// colour count; `center` is what rotations turn about.
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
    /// moved comes back: the mean over pixels of the squared differences of colour and silhouette.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] for targets that are not one for each pose; otherwise as [`Renderer::render`] and
    /// [`Renderer::backward`].
    pub fn step(&mut self, renderer: &mut Renderer, color: &Image, silhouette: &Image) -> Result<Vec<f64>> {
        let (losses, gradients) = self.differentiate(renderer, color, silhouette)?;
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
    pub fn differentiate(
        &self,
        renderer: &mut Renderer,
        color: &Image,
        silhouette: &Image,
    ) -> Result<(Vec<f64>, Vec<[DVec3; 2]>)> {
        let cameras = self.poses.iter().map(|pose| self.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let frame = renderer.render(&self.scene, &cameras, &self.settings_at(self.step))?;
        let part = self.options.coarseness.at_step(self.step, self.options.iterations);
        let pooling = (part * f64::from(self.settings.height)).round().max(1.0) as usize;
        let (losses, upstream) = compare(&frame, color, silhouette, pooling, [1.0; 2])?;
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
        color: &Image,
        silhouette: &Image,
    ) -> Result<Vec<f64>> {
        let cameras = poses.iter().map(|pose| self.posed_camera(pose)).collect::<Result<Vec<_>>>()?;
        let settings = Settings { sigma, gamma, save: false, ..self.settings_at(0) };
        let frame = renderer.render(&self.scene, &cameras, &settings)?;
        compare(&frame, color, silhouette, 1, [1.0; 2]).map(|(losses, _)| losses)
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

/// Each view's loss, and the gradient of their sum: squared differences of colour and silhouette, weighed and added, in
/// means of `pooling` × `pooling` pixels.
pub(in crate::fit) fn compare(
    frame: &Frame,
    color: &Image,
    silhouette: &Image,
    pooling: usize,
    weights: [f64; 2],
) -> Result<(Vec<f64>, ImageGradient)> {
    let (Some(our_color), Some(our_silhouette)) = (frame.color(), frame.silhouette()) else {
        return bad("a frame without colour or silhouette", "ask for both");
    };
    let mut losses = vec![0.0; our_color.batch];
    let mut one = |ours: &Image, target: &Image, weight: f64| {
        let shape = |i: &Image| [i.batch, i.height, i.width, i.channels];
        if shape(ours) != shape(target) || ours.data.len() != target.data.len() {
            let what = format!("a target of shape {:?} for images of shape {:?}", shape(target), shape(ours));
            return bad(what, "give one target for each pose");
        }
        let mut difference = ours.clone();
        difference.data.iter_mut().zip(&target.data).for_each(|(p, t)| *p -= t);
        let mut coarse = if pooling > 1 { pooled(&difference, pooling)? } else { difference };
        let size = coarse.height * coarse.width;
        for (i, d) in coarse.data.iter_mut().enumerate() {
            let wide = f64::from(*d);
            losses[i / (size * ours.channels)] += weight * wide * wide / size as f64;
            *d = (2.0 * weight * wide / size as f64) as f32;
        }
        if pooling == 1 {
            return Ok(coarse);
        }
        let mut gradient = Image { data: vec![0.0; ours.data.len()], ..*ours };
        add_pooled_gradient(&mut gradient, &coarse, pooling, 1.0);
        Ok(gradient)
    };
    let color = Some(one(our_color, color, weights[0])?);
    let silhouette = Some(one(our_silhouette, silhouette, weights[1])?);
    Ok((losses, ImageGradient { color, silhouette, ..ImageGradient::default() }))
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
