//! A figure's pose from one image.

use super::figure::Figure;
use super::skeleton::SkeletonPose;
use super::visible::visible_triangles;
use softras::glam::DVec3;
use softras::scene::{Appearance, Background, Outputs};
use softras::{Camera, Frame, GradientRequest, ImageGradient, Mesh, Renderer, Result, Scene, Settings};
use softras_fit::{Method, Optimizer, PoseTarget, Schedule};

/// Which triangles may pull at the pose.
#[derive(Clone, Copy)]
pub enum Sight {
    /// All that weigh in the soft image, hidden ones too.
    Soft,
    /// Only those that a hard rasterization shows: the baseline that hidden ones are held against.
    VisibleOnly,
}

/// How a figure is fitted.
#[derive(Clone)]
pub struct FigureOptions {
    /// Steps.
    pub iterations: usize,
    /// Softness of edges.
    pub sigma: Schedule,
    /// Softness of the depth order, in units of far - near.
    pub gamma: Schedule,
    /// Standard deviation of the Gaussian that blurs what is compared, as a part of the image's height.
    pub blur: Schedule,
    /// Length of a step of every angle, radians.
    pub rate: Schedule,
    /// Length of a step of the shift, world units, as a part of that.
    pub shift_rate: f64,
    /// Weights of colour and of silhouette in the loss of [`PoseTarget`].
    pub weights: [f64; 2],
    /// Weight of half the sum of the squares of how far the angles have gone from where they began, radians²: what the
    /// image does not tell stays.
    pub stiffness: f64,
    /// Which triangles pull.
    pub sight: Sight,
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self {
            iterations: 300,
            sigma: Schedule::Exponential { from: 3e-4, to: 3e-6 },
            // Held: what is hidden must still be felt when the outline says exactly where it is.
            gamma: Schedule::Constant(1e-1),
            blur: Schedule::Exponential { from: 0.03, to: 0.003 },
            rate: Schedule::Exponential { from: 0.04, to: 0.003 },
            shift_rate: 0.1,
            weights: [1.0, 20.0],
            stiffness: 3e-3,
            sight: Sight::Soft,
        }
    }
}

/// A figure whose pose is being fitted.
pub struct FigureFit<'a> {
    figure: &'a Figure,
    camera: Camera,
    settings: Settings,
    options: FigureOptions,
    start: SkeletonPose,
    /// The pose as it is now.
    pub pose: SkeletonPose,
    angles: Optimizer,
    shift: Optimizer,
    step: usize,
}

impl<'a> FigureFit<'a> {
    /// Begins at a pose. Of the settings size, depths and background colour count.
    pub fn new(
        figure: &'a Figure,
        camera: Camera,
        settings: Settings,
        options: FigureOptions,
        pose: SkeletonPose,
    ) -> Self {
        // Angles that nothing in the image tells must not be moved by rounding: ε is a part of a usual gradient.
        let method = Method::Adam { betas: [0.8, 0.95], epsilon: 3e-4 };
        let (angles, shift) = (Optimizer::new(method, pose.angles.len()), Optimizer::new(method, 3));
        Self { figure, camera, settings, options, start: pose.clone(), pose, angles, shift, step: 0 }
    }

    /// How the present step is rendered.
    fn settings(&self) -> Settings {
        let (step, steps) = (self.step, self.options.iterations);
        Settings {
            sigma: self.options.sigma.at_step(step, steps),
            gamma: self.options.gamma.at_step(step, steps),
            // As for rigid poses: a triangle that is dropped while it outweighs others makes the colour jump.
            tau: self.settings.tau.min(1e-6),
            background: Background::Composite,
            outputs: Outputs { color: true, silhouette: true, depth: false, normal: false },
            save: true,
            ..self.settings.clone()
        }
    }

    /// Renders the pose, compares it with an image of one view, and moves it.
    pub fn step(&mut self, renderer: &mut Renderer, target: &PoseTarget) -> Result<()> {
        let gradient = self.gradient(renderer, target)?;
        let rate = self.options.rate.at_step(self.step, self.options.iterations);
        self.angles.step(&mut self.pose.angles, &gradient.angles, rate);
        let mut shift = self.pose.shift.to_array();
        self.shift.step(&mut shift, &gradient.shift.to_array(), rate * self.options.shift_rate);
        self.pose.shift = DVec3::from_array(shift);
        self.step += 1;
        Ok(())
    }

    /// The gradient of the loss by the pose.
    fn gradient(&self, renderer: &mut Renderer, target: &PoseTarget) -> Result<SkeletonPose> {
        let settings = self.settings();
        let mesh = self.figure.posed(&self.pose)?;
        let (mesh, visible) = match self.options.sight {
            Sight::Soft => (mesh, None),
            Sight::VisibleOnly => {
                let visible = visible_triangles(renderer, &mesh, &self.camera, &settings)?;
                (apart(&mesh)?, Some(visible))
            }
        };
        let frame = renderer.render(&Scene::new(mesh), &[self.camera], &settings)?;
        let blur = self.options.blur.at_step(self.step, self.options.iterations) * f64::from(settings.height);
        let (_, upstream) = target.compare(&frame, blur, self.options.weights)?;
        let by_corner = by_position(renderer, &frame, &upstream)?;
        let by_vertex = match visible {
            None => by_corner,
            Some(visible) => self.gathered(&by_corner, &visible),
        };
        let mut gradient = self.figure.pull(&self.pose, &by_vertex);
        let stiffness = self.options.stiffness;
        for ((slope, now), start) in gradient.angles.iter_mut().zip(&self.pose.angles).zip(&self.start.angles) {
            *slope += stiffness * (now - start);
        }
        Ok(gradient)
    }

    /// By vertex from by corner of every triangle, those of the visible ones alone.
    fn gathered(&self, by_corner: &[DVec3], visible: &[bool]) -> Vec<DVec3> {
        let mut by_vertex = vec![DVec3::ZERO; self.figure.mesh.positions().len()];
        let corners = self.figure.mesh.triangles().iter().zip(by_corner.chunks_exact(3)).zip(visible);
        for ((triangle, gradients), _) in corners.filter(|(_, visible)| **visible) {
            triangle.iter().zip(gradients).for_each(|(&i, g)| by_vertex[i as usize] += *g);
        }
        by_vertex
    }
}

fn by_position(renderer: &mut Renderer, frame: &Frame, upstream: &ImageGradient) -> Result<Vec<DVec3>> {
    let gradients = renderer.backward(frame, upstream, &GradientRequest::default())?;
    let positions = gradients.meshes.first().map_or(&[][..], |mesh| &mesh.positions);
    Ok(positions.iter().map(|g| DVec3::from(g.map(f64::from))).collect())
}

/// The same mesh, each triangle with corners of its own.
fn apart(mesh: &Mesh) -> Result<Mesh> {
    let each = |values: &[[f32; 3]]| mesh.triangles().iter().flatten().map(|&i| values[i as usize]).collect::<Vec<_>>();
    let triangles = (0..mesh.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let apart = Mesh::new(each(mesh.positions()), triangles)?;
    match mesh.appearance() {
        Appearance::VertexColors(colors) => apart.with_appearance(Appearance::VertexColors(each(colors))),
        other => apart.with_appearance(other.clone()),
    }
}
