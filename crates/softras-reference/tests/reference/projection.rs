//! Cameras, and what the near plane cuts.

use super::*;

/// A camera at the origin looking along +z, 90° wide: x / z, y / z.
pub fn pinhole_at_origin() -> Camera {
    Camera::from_matrix(DMat4::IDENTITY, Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 }).unwrap()
}

#[test]
fn the_near_plane_cuts() {
    let settings = Settings { width: 16, height: 16, sigma: 1e-4, near: 1.0, ..Settings::default() };
    // A floor from behind the camera to z = 5, cut at z = 1: on the screen a trapezoid whose lower edge is beyond view.
    let floor = [[-3.0, -0.5, -3.0], [3.0, -0.5, -3.0], [0.0, -0.5, 5.0]];
    let colors = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let cut = render(&colored(&floor, &colors), &[pinhole_at_origin()], &settings, Truncation::Tau).unwrap();
    // The cut floor made by hand: at z = 1, halfway from corner 0 or 1 to corner 2.
    let by_hand = [[0.0, -0.1, 5.0], [-1.5, -0.5, 1.0], [1.5, -0.5, 1.0]];
    let screen_colors = [[0.0, 0.0, 1.0], [0.5, 0.0, 0.5], [0.5, 0.0, 0.5]];
    let expected = on_screen(&colored(&by_hand, &screen_colors), &settings);
    for (name, a, b) in [("colour", &cut.color, &expected.color), ("alpha", &cut.silhouette, &expected.silhouette)] {
        let worst = a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // The hand-made vertices are float32.
        assert!(worst < 1e-5, "{name}: {worst:e}");
    }
    assert!(cut.silhouette.iter().any(|&a| a > 0.99));
}

#[test]
fn one_corner_cut_off_leaves_two_pieces() {
    let settings = Settings { silhouette: SilhouetteAggregation::Sum, distance: Distance::Hard, ..one_pixel() };
    let scene = Scene::new(screen_mesh(&[[-2.0, -2.0, 3.0], [2.0, -2.0, 3.0], [0.0, 2.0, 0.5]]));
    let frame = render(&scene, &[pinhole_at_origin()], &settings, Truncation::Tau).unwrap();
    assert_eq!(frame.silhouette, [1.0], "one of the two pieces covers the pixel");
    let all_near = Scene::new(screen_mesh(&[[-2.0, -2.0, 0.3], [2.0, -2.0, 0.3], [0.0, 2.0, 0.5]]));
    let frame = render(&all_near, &[pinhole_at_origin()], &settings, Truncation::Tau).unwrap();
    assert_eq!(frame.silhouette, [0.0]);
}

#[test]
fn screen_triangles_are_cut_like_the_view_space_ones_they_stand_for() {
    let settings = Settings { width: 16, height: 16, sigma: 1e-3, outputs: Outputs::ALL, ..Settings::default() };
    let view = [[-1.0f32, -0.5, 2.0], [1.0, -0.5, 4.0], [0.25, 0.25, 0.5]];
    let screen = view.map(|[x, y, z]| [x / z, y / z, z]);
    let in_view = render(&Scene::new(screen_mesh(&view)), &[pinhole_at_origin()], &settings, Truncation::Tau).unwrap();
    let given = on_screen(&Scene::new(screen_mesh(&screen)), &settings);
    // Normals are those of the coordinates given.
    let images = |f: ReferenceFrame| [f.color, f.silhouette, f.depth];
    for (a, b) in images(in_view).iter().zip(images(given)) {
        let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst:e}");
    }
}

/// A camera anywhere shows what the screen shows of the points that it projects to.
#[test]
fn cameras_show_what_they_project() {
    let settings = Settings { width: 14, height: 10, sigma: 1e-3, ..Settings::default() };
    let points = [[-1.0, -0.75, 0.5], [1.5, -0.5, 0.25], [0.25, 1.0, -0.5]];
    let pinhole = Projection::Pinhole { fx: 9.0, fy: 8.0, cx: 6.0, cy: 5.5 };
    let [perspective, orthographic] =
        [Projection::Perspective { fov_y: 0.8 }, Projection::Orthographic { half_height: 1.3 }];
    for projection in [perspective, orthographic, pinhole] {
        let camera = Camera::look_at([1.0, 2.0, 3.0].into(), DVec3::ZERO, DVec3::Y, projection).unwrap();
        let seen = render(&Scene::new(screen_mesh(&points)), &[camera], &settings, Truncation::Tau).unwrap();
        let projected = points.map(|p| {
            let [column, row, z] = camera.project(p.map(f64::from).into(), (14, 10)).unwrap();
            [column / 5.0 - 1.4, 1.0 - row / 5.0, z].map(|x| x as f32)
        });
        let expected = on_screen(&Scene::new(screen_mesh(&projected)), &settings);
        let worst = seen.silhouette.iter().zip(&expected.silhouette).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // The projected vertices are float32.
        assert!(worst < 1e-4 && seen.silhouette.iter().any(|&a| a > 0.9), "{projection:?}: {worst:e}");
    }
}

#[test]
fn projections_agree_on_the_same_camera() {
    let settings = Settings { width: 12, height: 8, sigma: 1e-3, outputs: Outputs::ALL, ..Settings::default() };
    let scene = Scene::new(screen_mesh(&[[-1.0, -0.75, 3.0], [1.5, -0.5, 2.5], [0.25, 1.0, 2.0]]));
    let image = |projection, settings: &Settings| {
        let camera = Camera::from_matrix(DMat4::IDENTITY, projection).unwrap();
        render(&scene, &[camera], settings, Truncation::Tau).unwrap()
    };
    let perspective = image(Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 }, &settings);
    let pinhole = image(Projection::Pinhole { fx: 4.0, fy: 4.0, cx: 6.0, cy: 4.0 }, &settings);
    assert!(difference(&perspective, &pinhole) < 1e-9);
    let shifted = image(Projection::Pinhole { fx: 4.0, fy: 4.0, cx: 7.0, cy: 3.0 }, &settings);
    for (row, column) in [(3, 5), (4, 4), (2, 7)] {
        let at = |f: &ReferenceFrame, r: usize, c: usize| f.silhouette[r * 12 + c];
        let (a, b) = (at(&perspective, row, column), at(&shifted, row - 1, column + 1));
        assert!((a - b).abs() < 1e-9, "one pixel right and up: {a} {b}");
    }
    // P = K [I|0] for a square image of 8, y turned by P itself: x'' in pixels, mapped to [-1, 1].
    let square = Settings { width: 8, height: 8, ..settings };
    let p = [[4.0, 0.0, 4.0, 0.0], [0.0, 4.0, 4.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let official = render(&scene, &[Camera::official(p, [0.0; 5], 8.0).unwrap()], &square, Truncation::Tau).unwrap();
    let perspective = image(Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 }, &square);
    // z + 1e-5 moves points by 1e-5.
    let worst = official.silhouette.iter().zip(&perspective.silhouette).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-2 && worst > 0.0, "{worst:e}");
}

#[test]
fn distortion_moves_points_as_written() {
    // A point at x' = 0.5, y' = 0.25: r² = 0.3125.
    let [k1, k2, p1, p2, k3] = [0.1, 0.2, 0.03, 0.04, 0.5];
    let (x, y, r2) = (0.5, 0.25, 0.3125f64);
    let radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    let expected = [
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    ];
    let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let camera = Camera::official(identity, [k1, k2, p1, p2, k3], 1.0).unwrap();
    // A triangle shrunk to the point, seen from one pixel at the origin: D tells its distance from there.
    let z = 2.0f32;
    let z_official = f64::from(z) + 1e-5;
    let point = [(x * z_official) as f32, (y * z_official) as f32, z];
    let settings = Settings { sigma: 1.0, tau: 1e-6, ..one_pixel() };
    let frame = render(&Scene::new(screen_mesh(&[point; 3])), &[camera], &settings, Truncation::None).unwrap();
    let distance2: f64 = expected.iter().map(|c| (2.0 * (c - 0.5)).powi(2)).sum();
    assert!((frame.silhouette[0] - sigmoid(-distance2)).abs() < 1e-6);
}
