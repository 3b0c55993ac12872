//! Properties of every camera, whatever the numbers: proptest shrinks the case that breaks one.

use glam::DVec3;
use proptest::prelude::*;
use softras::{Camera, Projection};

fn double() -> impl Strategy<Value = f64> {
    prop_oneof![3 => -10f64..10.0, 1 => any::<f64>(), 1 => Just(f64::NAN)]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A camera that is not refused is a rigid motion that keeps its target before it, in the middle.
    #[test]
    fn cameras_look_at_their_targets(
        eye in [double(), double(), double()], target in [double(), double(), double()],
        up in [double(), double(), double()], fov_y in 0.01f64..3.0,
    ) {
        let (eye, target, up) = (DVec3::from(eye), DVec3::from(target), DVec3::from(up));
        let Ok(camera) = Camera::look_at(eye, target, up, Projection::Perspective { fov_y }) else { return Ok(()) };
        let (distance, size) = ((target - eye).length(), eye.length().max(target.length()).max(1.0));
        let p = camera.to_view(target);
        prop_assert!((p - DVec3::new(0.0, 0.0, distance)).length() <= 1e-12 * size, "{p} at {distance}");
        prop_assert!(camera.to_view(eye).length() <= 1e-12 * size);
        let rows = camera.axes();
        // x right, y up, z forward: not mirrored is x × y = -z.
        prop_assert!((rows[0].cross(rows[1]) + rows[2]).length() < 1e-9, "{rows:?}");
    }
}
