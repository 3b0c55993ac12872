//! The box and the ball within which vertices may move without changing the frame's plan. Vertices before near or beyond far need
//! other kernels, which make two records for each triangle, and the host does not know where the device has moved the vertices.
//!
//! Cameras all around an object have their planes near and far close to a sphere around it. The corners of its box cross them
//! where the object does not, and the ball does not either. Of a flat mesh before one camera the box is the better limit.

use crate::error::{Error, Result};
use crate::frame::plan::DepthSpan;
use crate::scene::{Camera, Settings};
use glam::DVec3;

/// Sizes of the box and of the ball relative to those that just hold the mesh, tried in turn.
const ROOM: [f32; 7] = [8.0, 4.0, 2.0, 1.5, 1.35, 1.2, 1.05];
/// The share of the ball that the device allows: it compares in single precision.
const ROUNDED: f64 = 1.0 - 1e-5;
/// Half the side of the box that does not limit vertices: larger coordinates overflow in the frame.
const EVERYWHERE: f32 = 1e30;

/// A box and a ball around the mesh, and which of the planes near and far a mesh inside both may cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    pub span: DepthSpan,
    pub bounds: [[f32; 3]; 2],
    /// The centre of the ball.
    pub center: [f32; 3],
    /// 1 over its radius; 0 where it limits nothing.
    pub inverse_radius: f32,
    /// The planes near and far that it was computed for.
    planes: [f64; 2],
}

impl Guard {
    /// The largest box and ball in which nothing crosses other planes than in those that just hold the vertices, as these cameras
    /// see them.
    ///
    /// # Errors
    /// [`Error::NotFinite`] where a vertex is not finite.
    pub fn new(positions: &[[f32; 3]], cameras: &[Camera], settings: &Settings) -> Result<Self> {
        if positions.as_flattened().iter().any(|x| x.is_nan() || x.abs() >= EVERYWHERE) {
            let fix = "use a smaller step size (rate), or smaller regularizer weights".into();
            return Err(Error::NotFinite { stage: "optimizer", fix });
        }
        let planes = [settings.near, settings.far];
        let tight = positions.iter().fold([[f32::MAX; 3], [f32::MIN; 3]], |[low, high], p| {
            [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
        });
        let center = [0, 1, 2].map(|k| 0.5 * (tight[0][k] + tight[1][k]));
        let distance = |p: &[f32; 3]| DVec3::from(p.map(f64::from)).distance(DVec3::from(center.map(f64::from)));
        let reach = positions.iter().map(distance).fold(1e-6, f64::max);
        let span_of = |bounds: [[f32; 3]; 2], radius: f64| {
            let inside = DepthSpan { crosses_near: false, crosses_far: false };
            let of = |camera| {
                let of_box = DepthSpan::of(Some((bounds[0], bounds[1])), camera, settings);
                of_box.and(DepthSpan::of_ball(center, radius, camera, settings))
            };
            cameras.iter().fold(inside, |span, camera| span.or(of(camera)))
        };
        let span = span_of(tight, reach);
        for room in ROOM {
            let end = |k: usize, side: f32| center[k] + side * room * (0.5 * (tight[1][k] - tight[0][k])).max(1e-6);
            let bounds = [-1.0, 1.0].map(|side| [0, 1, 2].map(|k| end(k, side)));
            let radius = f64::from(room) * reach;
            if span_of(bounds, radius) == span {
                let inverse_radius = (1.0 / (ROUNDED * radius)) as f32;
                return Ok(Self { span, bounds, center, inverse_radius, planes });
            }
        }
        let span = DepthSpan { crosses_near: true, crosses_far: true };
        Ok(Self { span, bounds: [[-EVERYWHERE; 3], [EVERYWHERE; 3]], center, inverse_radius: 0.0, planes })
    }

    /// Whether it was computed for the planes of these settings.
    pub fn fits(&self, settings: &Settings) -> bool {
        self.planes == [settings.near, settings.far]
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::scene::Projection;
    use glam::DVec3;

    #[test]
    fn a_box_keeps_its_distance_from_near_and_far() {
        let projection = Projection::Perspective { fov_y: 1.0 };
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, projection).unwrap();
        let positions = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]];
        let of = |near: f64, far: f64| {
            let settings = Settings { near, far, ..Settings::default() };
            Guard::new(&positions, &[camera], &settings).unwrap()
        };
        let inside = of(1.0, 100.0);
        assert!(!inside.span.crosses_near && !inside.span.crosses_far && inside.bounds[1][2] == 2.0);
        // With near so close to the mesh, every larger box crosses it, so the box is unlimited.
        let close = of(3.99, 100.0);
        assert!(close.span.crosses_near && close.bounds[1][2] == EVERYWHERE);
        // A mesh that crosses near already is planned for that.
        assert!(of(5.0, 100.0).span.crosses_near && !of(5.0, 100.0).span.crosses_far);
        assert!(Guard::new(&[[f32::NAN; 3]], &[camera], &Settings::default()).is_err());
    }

    #[test]
    fn a_flat_ring_seen_from_all_sides_is_kept_in_a_ball_and_a_plate_before_one_camera_in_a_box() {
        let projection = Projection::Orthographic { half_height: 1.0 };
        let camera = |azimuth: f64| Camera::from_angles(5.0, 0.0, azimuth, projection).unwrap();
        let around: Vec<Camera> = (0..8).map(|i| camera(45.0 * f64::from(i))).collect();
        let ring: Vec<[f32; 3]> =
            (0..16).map(|i| (i as f32 * std::f32::consts::FRAC_PI_8).sin_cos()).map(|(x, z)| [x, 0.0, z]).collect();
        let near_and_far = |reach: f64| Settings { near: 5.0 - reach, far: 5.0 + reach, ..Settings::default() };
        let none = DepthSpan { crosses_near: false, crosses_far: false };
        // The corners of the ring's box are 1.41 from its centre.
        let guard = Guard::new(&ring, &around, &near_and_far(1.3)).unwrap();
        assert_eq!((guard.span, guard.bounds[1][0]), (none, 1.2));
        assert!((guard.inverse_radius * 1.2 - 1.0).abs() < 1e-4, "{guard:?}");
        let plate = [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]];
        let guard = Guard::new(&plate, &[camera(0.0)], &near_and_far(0.1)).unwrap();
        assert_eq!((guard.span, guard.bounds[1][0]), (none, 8.0));
    }
}
