//! The support of a triangle: the distance beyond which its fragments are dropped.

use super::{Background, Camera, ColorAggregation, Scene, Settings, Support};
use glam::DVec3;

impl Settings {
    /// The squared culling radius in units of σ for what these cameras see: fragments with d² ≥ σ · cutoff are dropped.
    ///
    /// With [`Support::Probability`] it is c(τ) = ln(1/τ - 1) = [`Settings::cutoff`]. With [`Support::Guaranteed`] and
    /// images that the softmax mixes by depth (hard images and silhouettes are within τ anyway) it is
    ///
    /// - [`Background::Weighted`]: c(τ) + Δζ/γ with Δζ = max(0, ζ of the nearest vertex - ε). The background is always
    ///   part of the softmax, so a dropped fragment weighs w ≤ D exp((ζ - ε)/γ), which is below τ.
    /// - [`Background::Composite`]: c(τ/2) + Δζ/γ with Δζ the difference of the depth scores of the nearest and the
    ///   farthest vertex. Since A ≤ ΣD, a dropped fragment's part A w' of the mixture is at most D exp(Δζ/γ), below
    ///   τ/2; the other half bounds the change of A.
    ///
    /// Vertices nearer than `near` count as at `near`, those beyond `far` as at `far`. So the radius
    /// of [`Support::Probability`] grows by the factor √(1 + Δζ / (γ c)): keep near and far close around the scene, and
    /// γ large.
    pub fn cutoff_of(&self, scene: &Scene, cameras: &[Camera]) -> f64 {
        let mixed = self.outputs.color || self.outputs.depth || self.outputs.normal || self.outputs.features;
        if self.support == Support::Probability || !mixed || self.color == ColorAggregation::Hard {
            return self.cutoff();
        }
        let spread = |(view, camera): (usize, &Camera)| {
            let [nearest, farthest] = self.depth_scores(scene, view, camera)?;
            Some(match self.background {
                Background::Weighted => nearest - self.epsilon,
                Background::Composite => nearest - farthest,
            })
        };
        let most = cameras.iter().enumerate().filter_map(spread).fold(0.0, f64::max);
        let tau = match self.background {
            Background::Weighted => self.tau,
            Background::Composite => self.tau / 2.0,
        };
        // The factor keeps rounding from making the radius too small.
        (1.0 / tau - 1.0).ln() + most * (1.0 + 1e-9) / self.gamma
    }

    /// The depth scores ζ of the nearest and the farthest vertex in a view, clamped to [near, far]; `None` where the
    /// mesh lies outside that range.
    fn depth_scores(&self, scene: &Scene, view: usize, camera: &Camera) -> Option<[f64; 2]> {
        let [nearest, farthest] = depths(scene, view, camera)?;
        let score = |z: f64| (self.far - z.clamp(self.near, self.far)) / (self.far - self.near);
        (farthest >= self.near && nearest <= self.far).then(|| [score(nearest), score(farthest)])
    }

    /// Sets near and far close around what the cameras see of the scene, so that γ means about the same softness for every
    /// scene: `margin` is the room on both sides as a share of the depths that the vertices span. 0.05 is for a
    /// picture, 0.5 for a mesh that will move. Vertices behind a camera count as near as a thousandth of the farthest.
    /// If no camera looks at the scene, the settings stay as they are.
    pub fn with_depths_of(mut self, scene: &Scene, cameras: &[Camera], margin: f64) -> Self {
        let spans = cameras.iter().enumerate().filter_map(|(view, camera)| depths(scene, view, camera));
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        let [nearest, farthest] = spans.fold(start, |[low, high], span| [low.min(span[0]), high.max(span[1])]);
        if farthest > 0.0 {
            // A flat mesh has the room of a tenth of its distance.
            let room = margin.max(0.0) * (farthest - nearest).max(0.1 * farthest) + 1e-3 * farthest;
            self.far = farthest + room;
            self.near = (nearest - room).max(1e-3 * self.far);
        }
        self
    }
}

/// The least and greatest view depth of a view's mesh; `None` without vertices.
fn depths(scene: &Scene, view: usize, camera: &Camera) -> Option<[f64; 2]> {
    let depth = |p: &[f32; 3]| camera.to_view(DVec3::from(p.map(f64::from))).z;
    let positions = scene.meshes.get(scene.mesh_of_view(view))?.positions();
    let around = |[low, high]: [f64; 2], z: f64| [low.min(z), high.max(z)];
    let span = positions.iter().map(depth).fold([f64::INFINITY, f64::NEG_INFINITY], around);
    (!positions.is_empty()).then_some(span)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::{Projection, shapes};

    #[test]
    fn near_and_far_are_close_around_what_is_seen() {
        let scene = Scene::new(shapes::icosphere(2).unwrap());
        let projection = Projection::Perspective { fov_y: 0.6 };
        let at = |distance: f64| Camera::from_angles(distance, 20.0, 30.0, projection).unwrap();
        let depths_of = |cameras: &[Camera], margin: f64| {
            let settings = Settings::default().with_depths_of(&scene, cameras, margin);
            assert!(settings.validate().is_ok(), "{settings:?}");
            (settings.near, settings.far)
        };
        let is_about = |(near, far): (f64, f64), a: f64, b: f64| (near - a).abs() < 0.05 && (far - b).abs() < 0.05;
        assert!(is_about(depths_of(&[at(5.0)], 0.0), 4.0, 6.0));
        assert!(is_about(depths_of(&[at(5.0)], 0.5), 3.0, 7.0));
        assert!(is_about(depths_of(&[at(5.0), at(8.0)], 0.0), 4.0, 9.0));
        // Within the mesh near stays above 0, and a camera that looks away changes nothing.
        assert!(depths_of(&[at(0.5)], 0.1).0 > 0.0);
        let away = Camera::look_at(DVec3::Z * 5.0, DVec3::Z * 9.0, DVec3::Y, projection).unwrap();
        assert_eq!(depths_of(&[away], 0.1), (1.0, 100.0));
        let empty = Scene::new(crate::Mesh::new(Vec::new(), Vec::new()).unwrap());
        assert_eq!(Settings::default().with_depths_of(&empty, &[at(5.0)], 0.1), Settings::default());
    }
}
