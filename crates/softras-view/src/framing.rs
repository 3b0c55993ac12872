//! The camera and the lights of a picture, from the options and the mesh's bounds.

use crate::{
    bounds::Bounds,
    options::{CameraOptions, HalfHeight, LightOptions},
};
use glam::{DQuat, DVec3};
use softras::{Camera, Lights, Mesh, Projection, Result, scene::DirectionalLight};

/// The share of the image's smaller side that the mesh's bounding sphere fills.
const FILL: f64 = 0.85;
/// Near and far lie this many radii before and behind the mesh's centre: a little more than the sphere.
const DEPTH_MARGIN: f64 = 1.05;
/// Near is at least this share of far, for a camera inside the sphere. The depth order is linear in depth, so that a small near
/// costs it no digits.
const NEAREST: f64 = 1e-5;

/// The lights of the studio: where each comes from, in camera axes (right, up, towards the viewer), and its intensity.
const KEY: ([f64; 3], f64) = ([-0.65, 0.7, 0.5], 0.66);
const FILL_LIGHT: ([f64; 3], f64) = ([0.9, 0.1, 0.5], 0.11);
const RIM: ([f64; 3], f64) = ([0.4, 0.6, -0.8], 0.22);
/// Light from below and from above.
const HEMISPHERE: [f64; 2] = [0.05, 0.22];
/// Ambient light beside lights that are given.
const AMBIENT: f64 = 0.12;

/// Where a camera stands, where it looks, and what it draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// The camera's position.
    pub eye: DVec3,
    /// The point looked at.
    pub target: DVec3,
    /// Up in the picture.
    pub up: DVec3,
    /// The projection.
    pub projection: Projection,
    /// Nearest depth drawn.
    pub near: f64,
    /// Farthest depth drawn.
    pub far: f64,
}

impl Viewpoint {
    /// The view that the options ask for.
    pub fn new(options: &CameraOptions, bounds: Bounds, aspect: f64) -> Self {
        let target = options.target.map_or(bounds.center, DVec3::from);
        let screen_radius = FILL * aspect.min(1.0);
        let projection = match options.orthographic {
            None => Projection::Perspective { fov_y: options.fov.to_radians() },
            Some(HalfHeight::Given(half_height)) => Projection::Orthographic { half_height },
            Some(HalfHeight::Fit) => Projection::Orthographic { half_height: bounds.radius / screen_radius },
        };
        // Solves f · tan(asin(R / d)) = screen radius, the sphere's outline on the screen, for the distance d.
        let slope = match projection {
            Projection::Perspective { fov_y } => screen_radius * (fov_y / 2.0).tan(),
            _ => screen_radius * 15f64.to_radians().tan(),
        };
        let distance = options.distance.unwrap_or_else(|| bounds.radius / slope.atan().sin());
        let (eye, up) = match options.eye {
            Some(eye) => (DVec3::from(eye), DVec3::from(options.vertical())),
            None => orbit(options, target, distance),
        };
        let (near, far) = depth_range(options, bounds, eye, target);
        Self { eye, target, up, projection, near, far }
    }

    /// The view, `turn` degrees further around the vertical axis through the point that the options look at.
    pub fn turned(&self, options: &CameraOptions, bounds: Bounds, turn: f64) -> Self {
        if turn == 0.0 {
            return *self;
        }
        let (turn, pivot) = (turned(vertical(options), turn), options.target.map_or(bounds.center, DVec3::from));
        let [eye, target] = [self.eye, self.target].map(|p| pivot + turn * (p - pivot));
        let (near, far) = depth_range(options, bounds, eye, target);
        Self { eye, target, up: turn * self.up, near, far, ..*self }
    }

    /// The camera.
    ///
    /// # Errors
    /// As [`Camera::look_at`].
    pub fn camera(&self) -> Result<Camera> {
        Camera::look_at(self.eye, self.target, self.up, self.projection)
    }

    /// Whether the mesh lies behind the camera, or wholly before near or beyond far.
    pub fn misses(&self, bounds: Bounds) -> bool {
        let depth = (bounds.center - self.eye).dot((self.target - self.eye).normalize_or_zero());
        depth + bounds.radius < self.near || depth - bounds.radius > self.far
    }

    /// The number of triangles in front of the eye of which the near plane cuts something off.
    pub fn cut(&self, mesh: &Mesh) -> usize {
        let forward = (self.target - self.eye).normalize_or_zero();
        let depth = |v: &u32| (DVec3::from(mesh.positions()[*v as usize].map(f64::from)) - self.eye).dot(forward);
        let depths = mesh.triangles().iter().map(|t| t.each_ref().map(depth).into_iter().fold(f64::INFINITY, f64::min));
        depths.filter(|least| *least > 0.0 && *least < self.near).count()
    }
}

/// The rotation from the frame whose vertical axis is y to the one whose vertical axis is `up`, which must not be zero.
fn upright(up: DVec3) -> DQuat {
    DQuat::from_rotation_arc(DVec3::Y, up.try_normalize().unwrap_or(DVec3::Y))
}

/// The vertical axis, of length 1.
pub fn vertical(options: &CameraOptions) -> DVec3 {
    upright(DVec3::from(options.vertical())) * DVec3::Y
}

/// The rotation of a camera whose azimuth grows by some degrees: a negative one around the vertical axis.
pub fn turned(axis: DVec3, degrees: f64) -> DQuat {
    DQuat::from_axis_angle(axis, -degrees.to_radians())
}

/// The eye on its sphere around the target, as in [`Camera::from_angles`] but for any vertical axis, and an up vector that
/// is valid at the poles too.
fn orbit(options: &CameraOptions, target: DVec3, distance: f64) -> (DVec3, DVec3) {
    let (e, a) = (options.elevation.to_radians(), options.azimuth.to_radians());
    let rotation = upright(DVec3::from(options.vertical()));
    let outward = rotation * DVec3::new(a.sin(), 0.0, -a.cos());
    let up = rotation * DVec3::Y;
    let direction = e.cos() * outward + e.sin() * up;
    let at_pole = up.cross(direction).length() < 1e-6;
    (target + distance * direction, if at_pole { -e.sin().signum() * outward } else { up })
}

/// Near and far: those given, or those close around the bounds.
pub fn depth_range(options: &CameraOptions, bounds: Bounds, eye: DVec3, target: DVec3) -> (f64, f64) {
    let depth = (bounds.center - eye).dot((target - eye).normalize_or_zero());
    let reach = DEPTH_MARGIN * bounds.radius;
    let far = options.far.unwrap_or_else(|| {
        let sphere = depth + reach;
        let least = options.near.unwrap_or(0.0) + bounds.radius * NEAREST;
        if sphere > least { sphere } else { least + 2.0 * reach }
    });
    let near = options.near.unwrap_or_else(|| (depth - reach).max(far * NEAREST));
    (near, far)
}

/// The lights that the options ask for, as this view's camera sees them.
///
/// The default rig, in camera axes (right, up, towards the viewer): a key light from the upper left, a weaker one from the
/// right and a rim light from behind above, and light from all directions that is stronger from above.
///
/// # Errors
/// As [`Camera::look_at`].
pub fn lights(options: &LightOptions, view: &Viewpoint) -> Result<Lights> {
    let shading = options.shading;
    if options.unlit {
        return Ok(Lights { shading, ..Lights::unlit() });
    }
    let camera = view.camera()?;
    let [right, up, forward] = camera.axes();
    let white = |direction: DVec3, intensity: f64| DirectionalLight {
        direction: direction.to_array(),
        color: [1.0; 3],
        intensity,
    };
    let rig = |[x, y, z]: [f64; 3], intensity: f64| white(x * right + y * up - z * forward, intensity);
    let mut directional = match options.lights.is_empty() {
        true => [KEY, FILL_LIGHT, RIM].map(|(from, intensity)| rig(from, intensity)).into(),
        false => options.lights.clone(),
    };
    let [ground, sky] = HEMISPHERE;
    if options.ambient.is_none() && options.lights.is_empty() {
        // ground + (sky - ground) (1 + n · up) / 2, of which the term with n · up is two lights, one of them negative.
        let half = (sky - ground) / 2.0;
        directional.extend([white(view.up, half), white(-view.up, -half)]);
    }
    let even = if options.lights.is_empty() { (sky + ground) / 2.0 } else { AMBIENT };
    let ambient_color = options.ambient.unwrap_or([even; 3]);
    Ok(Lights { ambient_color, ambient_intensity: 1.0, directional, shading })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn unit() -> Bounds {
        Bounds { center: DVec3::ZERO, radius: 1.0 }
    }

    fn view(options: CameraOptions) -> Viewpoint {
        Viewpoint::new(&options, unit(), 1.0)
    }

    fn screen_radius(view: &Viewpoint, bounds: Bounds) -> f64 {
        let distance = view.eye.distance(bounds.center);
        match view.projection {
            Projection::Perspective { fov_y } => (bounds.radius / distance).asin().tan() / (fov_y / 2.0).tan(),
            Projection::Orthographic { half_height } => bounds.radius / half_height,
            _ => f64::NAN,
        }
    }

    #[test]
    fn the_sphere_fills_85_percent_wherever_the_mesh_is() {
        let bounds = Bounds { center: DVec3::new(100.0, -20.0, 700.0), radius: 250.0 };
        let usual = CameraOptions::default();
        let ways = [
            usual,
            CameraOptions { fov: 90.0, elevation: -30.0, ..usual },
            CameraOptions { orthographic: Some(HalfHeight::Fit), ..usual },
            CameraOptions { up: Some([0.0, 0.0, 1.0]), azimuth: -170.0, ..usual },
        ];
        for way in ways {
            for aspect in [0.5, 1.0, 2.0] {
                let view = Viewpoint::new(&way, bounds, aspect).turned(&way, bounds, 40.0);
                let expected = 0.85 * aspect.min(1.0);
                assert!((screen_radius(&view, bounds) - expected).abs() < 1e-9, "{way:?} {aspect} {view:?}");
                assert!(view.near > 0.0 && view.near < view.eye.distance(bounds.center) - bounds.radius);
                assert!((view.far - view.eye.distance(bounds.center) - 1.05 * bounds.radius).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_poles_have_an_up() {
        for elevation in [90.0, -90.0] {
            let view = view(CameraOptions { elevation, azimuth: 30.0, ..CameraOptions::default() });
            assert!(view.camera().is_ok());
        }
    }

    #[test]
    fn a_turn_is_an_azimuth_for_both_kinds_of_camera() {
        let bounds = Bounds { center: DVec3::new(1.0, 2.0, 3.0), radius: 1.0 };
        let turned = |options: CameraOptions| Viewpoint::new(&options, bounds, 1.0).turned(&options, bounds, 70.0);
        let usual = CameraOptions::default();
        let by_angle = turned(usual);
        let by_eye = turned(CameraOptions { eye: Some(Viewpoint::new(&usual, bounds, 1.0).eye.to_array()), ..usual });
        assert!(by_angle.eye.distance(by_eye.eye) < 1e-9, "{by_angle:?} {by_eye:?}");
        let azimuth = Viewpoint::new(&CameraOptions { azimuth: 215.0, ..usual }, bounds, 1.0);
        assert!(by_angle.eye.distance(azimuth.eye) < 1e-9);
    }

    #[test]
    fn angles_are_the_librarys() {
        let view = view(CameraOptions { azimuth: 40.0, elevation: 30.0, ..CameraOptions::default() });
        let library = Camera::from_angles(view.eye.length(), 30.0, 40.0, view.projection).unwrap();
        let ours = view.camera().unwrap();
        let pairs = ours.view().as_flattened().iter().zip(library.view().as_flattened());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn a_camera_within_the_mesh_has_a_near_plane_and_one_that_looks_away_is_noticed() {
        let usual = CameraOptions::default();
        let inside = view(CameraOptions { eye: Some([0.0, 0.0, 0.1]), ..usual });
        assert!(inside.near > 0.0 && inside.far > inside.near && !inside.misses(unit()));
        // In a scene of 10 km a house 6 m away is in view.
        let (large, eye) = (Bounds { radius: 7071.0, ..unit() }, DVec3::new(0.0, 5.0, 6.0));
        let (near, _) = depth_range(&usual, large, eye, DVec3::new(0.0, 5.0, 0.0));
        assert!(near < 1.0, "{near}");
        let mesh = Mesh::new(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 2.0]], vec![[0, 1, 2]]).unwrap();
        let cut = |near| view(CameraOptions { eye: Some([0.0, 0.0, -4.0]), near: Some(near), ..usual }).cut(&mesh);
        assert_eq!([cut(3.9), cut(4.1)], [0, 1]);
        let away = view(CameraOptions { eye: Some([0.0, 0.0, 5.0]), target: Some([0.0, 0.0, 9.0]), ..usual });
        assert!(away.far > away.near && away.misses(unit()));
    }
}
