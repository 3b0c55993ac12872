//! By hand what random scenes seldom meet.

use super::*;

/// The lookup of the official code at a corner itself: another row, or the next triangle's first cell, or nothing.
#[test]
fn official_cells_at_corners() {
    let (a, b, c) = ([0.0, 0.1, 2.0], [2.0, 2.0, 2.0], [-2.0, 2.0, 2.0]);
    let far = [[50.0, 50.0, 2.0], [51.0, 50.0, 2.0], [50.0, 51.0, 2.0]];
    let at_corner = |triangles: [[[f32; 3]; 3]; 2], parity| {
        let texels = (1..=8).map(|i| [i as f32, 0.0, 0.0]).collect();
        let mesh = screen_mesh(&triangles.concat()).with_appearance(Appearance::Surface { resolution: 2, texels });
        let settings = Settings { parity, background: Background::Composite, ..one_pixel() };
        let frame = on_screen(&Scene::new(mesh.unwrap()), &settings);
        frame.color[0] / frame.silhouette[0]
    };
    // The pixel lies below corner a of the first triangle, clipped onto it: b₀ = 1, or b₁ = 1.
    let [first, second] = [[a, b, c], [c, a, b]];
    assert!(close(at_corner([first, far], Parity::Model), 2.0) && close(at_corner([second, far], Parity::Model), 3.0));
    assert!(close(at_corner([first, far], Parity::Official), 3.0));
    assert!(close(at_corner([second, far], Parity::Official), 5.0));
    assert!(close(at_corner([far, second], Parity::Official), 0.0));
}

/// Where a triangle is near but does not cover, the hard colour is the background's, not mixed with it.
#[test]
fn a_hard_colour_beside_a_triangle_is_the_background() {
    let settings = Settings {
        color: ColorAggregation::Hard,
        background: Background::Composite,
        background_color: [0.2, 0.4, 0.6],
        ..one_pixel()
    };
    let frame = on_screen(&Scene::new(screen_mesh(&triangle_above(-0.05, 2.0))), &settings);
    assert!(frame.silhouette[0] > 0.3, "the triangle is near: {:?}", frame.silhouette);
    assert_close("colour", &frame.color, &[0.2, 0.4, 0.6]);
}

/// D is ½ on the edge, and the hard silhouette is 1 where D is above ½.
#[test]
fn a_hard_silhouette_ends_before_the_edge() {
    let settings = Settings { silhouette: SilhouetteAggregation::Hard, ..one_pixel() };
    let silhouette =
        |below: f32| on_screen(&Scene::new(screen_mesh(&triangle_above(below, 2.0))), &settings).silhouette[0];
    assert_eq!([0.01, 0.0, -0.01].map(silhouette), [1.0, 0.0, 0.0]);
}

/// An image does not depend on the others that are made: lights need normals whether or not there is an image of them.
#[test]
fn images_do_not_depend_on_each_other() {
    for shading in [Shading::Flat, Shading::Smooth] {
        let scene = Scene::new(screen_mesh(&triangle_above(0.1, 2.0)));
        let light = DirectionalLight { direction: [0.0, 1.0, 1.0], color: [1.0, 0.5, 0.2], intensity: 0.8 };
        let scene = scene.with_lights(Lights { directional: vec![light], shading, ..Lights::official() });
        let outputs = Outputs { color: true, ..Outputs::NOTHING };
        let alone = on_screen(&scene, &Settings { outputs, ..one_pixel() });
        assert_eq!(alone.color, on_screen(&scene, &one_pixel()).color, "{shading:?}");
        assert!(alone.color[0] > alone.color[1] && alone.color[1] > alone.color[2]);
    }
}

/// The margin is the nearness to any jump: of a depth to near, where that drops a fragment, and to far.
#[test]
fn margins_at_near_and_far() {
    let margin = |z: f32, parity| {
        let settings = Settings { near: 2.0, far: 10.0, parity, ..one_pixel() };
        on_screen(&Scene::new(screen_mesh(&triangle_above(3.0, z))), &settings).margin[0]
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} instead of {b}");
    near(margin(2.125, Parity::Official), 0.0625);
    near(margin(9.5, Parity::Official), 0.05);
    near(margin(9.5, Parity::Model), 0.05);
    // The near plane cuts triangles, at no jump.
    near(margin(2.125, Parity::Model), 1.0 - 0.2125);
}
