//! Whether a frame's meshes may cross its near and far planes, on which its kernels depend.

use super::INSIDE;
use crate::frame::plan::DepthSpan;
use crate::frame::shape::FrameShape;
use crate::{Camera, Projection, Scene, Settings, shapes};
use glam::DVec3;

/// A box crosses a plane where one of its eight corners lies beyond it, or so near that rounding may have it there.
#[test]
fn a_box_crosses_where_a_corner_does() {
    let (near, far) = (3.0, 7.0);
    let settings = Settings { near, far, ..Settings::default() };
    let projection = Projection::Perspective { fov_y: 0.5 };
    let mut seen = [0; 4];
    for i in 0..400 {
        let way = |k: f64| (f64::from(i) * k).sin();
        let eye = DVec3::new(5.0 * way(0.7), 4.0 * way(1.3), 5.0 * way(2.1)) + DVec3::ONE;
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, projection).unwrap();
        let size = [0.9, 1.1, 0.4].map(|x: f32| x * (1.0 + way(0.3) as f32));
        let low = [way(0.9) as f32, -0.5, -0.3];
        let high = [0, 1, 2].map(|k| low[k] + size[k]);
        let depth = |corner: usize| {
            let p = [0, 1, 2].map(|k| f64::from(if corner >> k & 1 == 1 { high[k] } else { low[k] }));
            let row = camera.view()[2];
            row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]
        };
        let depths: Vec<f64> = (0..8).map(depth).collect();
        let [crosses_near, crosses_far] = [depths.iter().any(|z| *z < near), depths.iter().any(|z| *z > far)];
        let span = DepthSpan::of(Some((low, high)), &camera, &settings);
        assert_eq!(span, DepthSpan { crosses_near, crosses_far }, "{depths:?}");
        seen[usize::from(crosses_near) + 2 * usize::from(crosses_far)] += 1;
    }
    assert!(seen[..3].iter().all(|&n| n > 20), "{seen:?}");
    // Without a mesh nothing crosses; a box that touches a plane crosses it.
    let camera = Camera::from_matrix(glam::DMat4::IDENTITY, projection).unwrap();
    assert_eq!(DepthSpan::of(None, &camera, &settings), INSIDE);
    let touching = |low: f32, high: f32| DepthSpan::of(Some(([0.0, 0.0, low], [0.0, 0.0, high])), &camera, &settings);
    let [nearer, farther] = [true, false].map(|near| DepthSpan { crosses_near: near, crosses_far: !near });
    assert_eq!([touching(3.0, 4.0), touching(4.0, 7.0), touching(3.1, 6.9)], [nearer, farther, INSIDE]);
    assert_eq!([nearer.or(INSIDE), INSIDE.or(farther)], [nearer, farther]);
    assert_eq!(nearer.or(farther), DepthSpan { crosses_near: true, crosses_far: true });
}

/// The corners of a ball's box lie beyond planes that are close around the ball; the ball does not.
#[test]
fn a_mesh_crosses_where_a_vertex_does() {
    let scene = Scene::new(shapes::icosphere(3).unwrap());
    let camera =
        Camera::look_at(DVec3::new(2.0, 2.0, 2.0), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.5 });
    let camera = camera.unwrap();
    let middle = 12f64.sqrt();
    let span = |near: f64, far: f64| {
        let settings = Settings { near: middle - near, far: middle + far, ..Settings::default() };
        FrameShape::of(&scene, &[camera], &settings).unwrap().depth_span
    };
    assert_eq!(span(1.01, 1.01), INSIDE);
    assert_eq!(span(0.9, 1.01), DepthSpan { crosses_near: true, crosses_far: false });
    assert_eq!(span(1.01, 0.9), DepthSpan { crosses_near: false, crosses_far: true });
    assert_eq!(span(0.9, 0.9), DepthSpan { crosses_near: true, crosses_far: true });
}
