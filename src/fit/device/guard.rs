//! The box within which vertices may move without changing the frame's plan. Vertices before near or beyond far need
//! other kernels, and the host does not know where the device has moved the vertices.

use crate::error::{Error, Result};
use crate::frame::plan::DepthSpan;
use crate::scene::{Camera, Settings};

/// Sizes of the box relative to the mesh's bounding box, tried in turn.
const ROOM: [f32; 6] = [8.0, 4.0, 2.0, 1.5, 1.2, 1.05];
/// Half the side of the box that does not limit vertices: larger coordinates overflow in the frame.
const EVERYWHERE: f32 = 1e30;

/// A box around the mesh, and which of the planes near and far a mesh inside it may cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guard {
    pub span: DepthSpan,
    pub bounds: [[f32; 3]; 2],
    /// The planes near and far that it was computed for.
    planes: [f64; 2],
}

impl Guard {
    /// The largest box that crosses no other planes than the vertices themselves, as these cameras see them.
    ///
    /// # Errors
    /// [`Error::NotFinite`] where a vertex is not finite.
    pub fn new(positions: &[[f32; 3]], cameras: &[Camera], settings: &Settings) -> Result<Self> {
        if positions.as_flattened().iter().any(|x| x.is_nan() || x.abs() >= EVERYWHERE) {
            let fix = "use a smaller step size (rate), or smaller regularizer weights".into();
            return Err(Error::NotFinite { stage: "optimizer", fix });
        }
        let planes = [settings.near, settings.far];
        let span_of = |bounds: [[f32; 3]; 2]| {
            let inside = DepthSpan { crosses_near: false, crosses_far: false };
            let of = |camera| DepthSpan::of(Some((bounds[0], bounds[1])), camera, settings);
            cameras.iter().fold(inside, |span, camera| span.or(of(camera)))
        };
        let tight = positions.iter().fold([[f32::MAX; 3], [f32::MIN; 3]], |[low, high], p| {
            [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))]
        });
        let span = span_of(tight);
        for room in ROOM {
            let end = |k: usize, side: f32| {
                let (middle, half) = (0.5 * (tight[0][k] + tight[1][k]), 0.5 * (tight[1][k] - tight[0][k]));
                middle + side * room * half.max(1e-6)
            };
            let bounds = [-1.0, 1.0].map(|side| [0, 1, 2].map(|k| end(k, side)));
            if span_of(bounds) == span {
                return Ok(Self { span, bounds, planes });
            }
        }
        let span = DepthSpan { crosses_near: true, crosses_far: true };
        Ok(Self { span, bounds: [[-EVERYWHERE; 3], [EVERYWHERE; 3]], planes })
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
}
