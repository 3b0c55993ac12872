//! The f64 judge against numbers computed by hand, symmetries, and itself.
#![cfg(feature = "reference")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::DMat4;
use softras::reference::{ReferenceFrame, Truncation, pairs, render, render_culled, render_untruncated};
use softras::scene::{
    Appearance, Background, Camera, ColorAggregation, DirectionalLight, Distance, Faces, FrontFace, Interpolation,
    Lights, Mesh, Outputs, Parity, Projection, Scene, Settings, Shading, SilhouetteAggregation, Texture, Wrap,
};

const ALL: Outputs = Outputs { color: true, silhouette: true, depth: true, normal: true };

/// One pixel, at the screen's origin.
fn one_pixel() -> Settings {
    Settings { width: 1, height: 1, sigma: 0.01, gamma: 0.1, outputs: ALL, ..Settings::default() }
}

fn screen_mesh(positions: &[[f32; 3]]) -> Mesh {
    let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Mesh::new(positions.to_vec(), triangles).unwrap()
}

fn colored(positions: &[[f32; 3]], colors: &[[f32; 3]]) -> Scene {
    Scene::new(screen_mesh(positions).with_appearance(Appearance::VertexColors(colors.to_vec())).unwrap())
}

fn on_screen(scene: &Scene, settings: &Settings) -> ReferenceFrame {
    render(scene, &[Camera::screen()], settings, Truncation::Tau).unwrap()
}

/// Whether two numbers agree to 1e-12, absolutely or relatively.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * b.abs().max(1.0)
}

fn assert_close(what: &str, got: &[f64], expected: &[f64]) {
    let good = got.len() == expected.len() && got.iter().zip(expected).all(|(&a, &b)| close(a, b));
    assert!(good, "{what}: {got:?}, expected {expected:?}");
}

/// The largest difference between any images of two frames, margins included; infinite where shapes differ or a value is
/// not a number.
fn difference(a: &ReferenceFrame, b: &ReferenceFrame) -> f64 {
    let images = |f: &ReferenceFrame| [&f.color, &f.silhouette, &f.depth, &f.normal, &f.margin].map(Vec::clone);
    let pairs = images(a).into_iter().zip(images(b));
    pairs.fold(0.0, |worst: f64, (a, b)| {
        let differences = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
        let all = differences.fold(0.0, |w: f64, d| if d.is_nan() { f64::INFINITY } else { w.max(d) });
        if a.len() == b.len() { worst.max(all) } else { f64::INFINITY }
    })
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// A triangle around the origin, its lower edge `below` under it, at depth z.
fn triangle_above(below: f32, z: f32) -> [[f32; 3]; 3] {
    [[-4.0, -below, z], [4.0, -below, z], [0.0, 4.0, z]]
}

#[test]
fn comparisons_fail_on_wrong_answers() {
    assert!(close(1.0, 1.0 + 1e-13) && !close(1.0, 1.0 + 1e-9) && !close(f64::NAN, 1.0) && !close(1.0, f64::NAN));
    let frame = on_screen(&Scene::new(screen_mesh(&triangle_above(0.1, 2.0))), &one_pixel());
    assert_eq!(difference(&frame, &frame), 0.0);
    let changes: [fn(&mut ReferenceFrame); 7] = [
        |f| f.color[1] += 1e-3,
        |f| f.silhouette[0] += 1e-3,
        |f| f.depth[0] += 1e-3,
        |f| f.normal[2] += 1e-3,
        |f| f.margin[0] += 1e-3,
        |f| f.color.clear(),
        |f| f.depth[0] = f64::NAN,
    ];
    for change in changes {
        let mut wrong = frame.clone();
        change(&mut wrong);
        assert!(difference(&frame, &wrong) > 1e-4 && difference(&wrong, &frame) > 1e-4);
    }
}

#[test]
#[should_panic(expected = "expected [1.0, 2.0]")]
fn assert_close_fails_on_a_wrong_length() {
    assert_close("two", &[1.0], &[1.0, 2.0]);
}

#[test]
fn one_triangle_by_hand() {
    let (settings, colors) = (one_pixel(), [[1.0, 0.0, 0.0], [1.0, 0.5, 0.0], [1.0, 0.25, 0.5]]);
    let frame = on_screen(&colored(&triangle_above(0.0625, 2.0), &colors), &settings);
    let d = sigmoid(0.0625f64.powi(2) / 0.01);
    // Barycentrics at the origin: the height over the lower edge for corner 2, the rest in halves.
    let b2 = 0.0625 / 4.0625;
    let color = [1.0, 0.5 * (1.0 - b2) / 2.0 + 0.25 * b2, 0.5 * b2];
    let zeta = 98.0 / 99.0;
    let weight = d * f64::exp(zeta / 0.1);
    let share = weight / (weight + f64::exp(1e-3 / 0.1));
    assert_close("colour", &frame.color, &color.map(|c| c * share));
    assert_close("silhouette", &frame.silhouette, &[d]);
    assert_close("depth", &frame.depth, &[2.0 * share]);
    assert_close("normal", &frame.normal, &[0.0, 0.0, share]);
}

#[test]
fn official_parity_doubles_the_background_score() {
    let settings = Settings { parity: Parity::Official, epsilon: 0.3, ..one_pixel() };
    let frame = on_screen(&Scene::new(screen_mesh(&triangle_above(0.0625, 2.0))), &settings);
    let twice = Settings { parity: Parity::Model, epsilon: 0.6, ..one_pixel() };
    let model = on_screen(&Scene::new(screen_mesh(&triangle_above(0.0625, 2.0))), &twice);
    assert_close("colour", &frame.color, &model.color);
}

#[test]
fn outside_colour_fades_only_when_composited() {
    let scene = Scene::new(screen_mesh(&triangle_above(-0.125, 2.0)));
    let d = sigmoid(-0.125f64.powi(2) / 0.01);
    let weighted = on_screen(&scene, &Settings { gamma: 1e-4, ..one_pixel() });
    assert_close("weighted", &weighted.color, &[1.0; 3]);
    let settings =
        Settings { gamma: 1e-4, background: Background::Composite, background_color: [0.0, 0.5, 1.0], ..one_pixel() };
    let composite = on_screen(&scene, &settings);
    assert_close("composite", &composite.color, &[d, d + 0.5 * (1.0 - d), 1.0]);
    assert_close("composite depth", &composite.depth, &[2.0 * d]);
    // Past the cut there is nothing but background.
    let far_away = on_screen(&Scene::new(screen_mesh(&triangle_above(-0.5, 2.0))), &settings);
    assert_close("empty", &far_away.color, &[0.0, 0.5, 1.0]);
    assert_eq!((far_away.silhouette[0], far_away.depth[0]), (0.0, 0.0));
}

#[test]
fn two_triangles_by_hand() {
    let near = triangle_above(0.1, 3.0);
    let behind = triangle_above(0.2, 4.0);
    let colors = [[[1.0, 0.0, 0.0]; 3], [[0.0, 1.0, 0.0]; 3]].concat();
    let scene = colored(&[behind, near].concat(), &colors);
    let [d_behind, d_near] = [f64::from(0.2f32), f64::from(0.1f32)].map(|d| sigmoid(d * d / 0.01));
    let weight = |d: f64, z: f64| d * f64::exp((100.0 - z) / 99.0 / 0.1);
    let (first, second) = (weight(d_behind, 4.0), weight(d_near, 3.0));
    let all = first + second + f64::exp(0.01);
    let frame = on_screen(&scene, &one_pixel());
    assert_close("colour", &frame.color, &[first / all, second / all, 0.0]);
    assert_close("product", &frame.silhouette, &[1.0 - (1.0 - d_behind) * (1.0 - d_near)]);
    let silhouette = |silhouette| on_screen(&scene, &Settings { silhouette, ..one_pixel() }).silhouette;
    assert_close("sum", &silhouette(SilhouetteAggregation::Sum), &[(d_behind + d_near) / 2.0]);
    assert_close("hard", &silhouette(SilhouetteAggregation::Hard), &[1.0]);
    let hard = on_screen(&scene, &Settings { color: ColorAggregation::Hard, ..one_pixel() });
    assert_close("hard colour", &hard.color, &[0.0, 1.0, 0.0]);
    assert_close("hard depth", &hard.depth, &[3.0]);
    assert!(hard.margin[0] < 0.051, "the nearest border is 0.05 pixels away: {:?}", hard.margin);
}

#[test]
fn equal_depths_go_to_the_first_triangle() {
    let colors = [[[1.0, 0.0, 0.0]; 3], [[0.0, 1.0, 0.0]; 3]].concat();
    let scene = colored(&[triangle_above(0.1, 3.0); 2].concat(), &colors);
    let frame = on_screen(&scene, &Settings { color: ColorAggregation::Hard, ..one_pixel() });
    assert_close("first", &frame.color, &[1.0, 0.0, 0.0]);
    assert_eq!(frame.margin, [0.0]);
}

#[test]
fn other_distances_by_hand() {
    let scene = Scene::new(screen_mesh(&triangle_above(0.0625, 2.0)));
    let silhouette = |scene: &Scene, distance| on_screen(scene, &Settings { distance, ..one_pixel() }).silhouette[0];
    let m: f64 = 0.0625 / 4.0625;
    assert!(close(silhouette(&scene, Distance::Barycentric), sigmoid(m * m / 0.01)));
    assert!(close(silhouette(&scene, Distance::Hard), 1.0));
    let outside = Scene::new(screen_mesh(&triangle_above(-0.125, 2.0)));
    let m: f64 = 0.125 / 3.875;
    assert!(close(silhouette(&outside, Distance::Barycentric), sigmoid(-m * m / 0.01)));
    assert_eq!(silhouette(&outside, Distance::Hard), 0.0);
    // A point has no barycentrics.
    assert_eq!(silhouette(&Scene::new(screen_mesh(&[[0.0, 0.0, 2.0]; 3])), Distance::Barycentric), 0.0);
}

#[test]
fn the_cut_is_where_d_is_tau() {
    let settings = Settings { sigma: 0.01, ..one_pixel() };
    let radius = (settings.sigma * settings.cutoff()).sqrt() as f32;
    let at = |below: f32| Scene::new(screen_mesh(&triangle_above(-below, 2.0)));
    let inside = on_screen(&at(radius * 0.999), &settings);
    let outside = on_screen(&at(radius * 1.001), &settings);
    assert!((inside.silhouette[0] / settings.tau - 1.0).abs() < 0.05);
    assert_eq!(outside.silhouette[0], 0.0);
    assert!(inside.margin[0] < 0.003 && outside.margin[0] < 0.003 && inside.margin[0] > 0.001);
    let untruncated = render(&at(radius * 1.001), &[Camera::screen()], &settings, Truncation::None).unwrap();
    assert!(untruncated.silhouette[0] > 0.0 && untruncated.margin[0] > 0.5);
}

#[test]
fn triangles_without_area_have_a_boundary() {
    let settings = Settings { background: Background::Composite, ..one_pixel() };
    let line = [[-1.0, 0.0625, 1.0], [1.0, 0.0625, 3.0], [0.0, 0.0625, 2.0]];
    let colors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let frame = on_screen(&colored(&line, &colors), &settings);
    let d = sigmoid(-0.0625f64.powi(2) / 0.01);
    assert_close("line", &frame.silhouette, &[d]);
    // Halfway along the longest edge; the third corner has no part.
    assert_close("line colour", &frame.color, &[d / 2.0, d / 2.0, 0.0]);
    assert_close("line depth", &frame.depth, &[1.5 * d]);
    let point = on_screen(&colored(&[[0.125, 0.0, 2.0]; 3], &colors), &settings);
    let d = sigmoid(-0.125f64.powi(2) / 0.01);
    assert_close("point", &point.color, &[d, 0.0, 0.0]);
    // Its two faces are front faces.
    let front = Settings { faces: Faces::Front, ..settings };
    assert_close("front", &on_screen(&colored(&[[0.125, 0.0, 2.0]; 3], &colors), &front).silhouette, &[d]);
}

#[test]
fn back_faces_are_dropped_or_only_counted() {
    let [a, b, c] = triangle_above(0.1, 2.0);
    let back = Scene::new(screen_mesh(&[a, c, b]));
    let front_only = Settings { faces: Faces::Front, ..one_pixel() };
    let model = on_screen(&back, &front_only);
    assert_eq!((model.silhouette[0], model.color[0]), (0.0, 0.0));
    let official = on_screen(&back, &Settings { parity: Parity::Official, ..front_only.clone() });
    assert!(official.silhouette[0] > 0.5 && official.color[0] == 0.0);
    let clockwise = on_screen(&back, &Settings { front_face: FrontFace::Clockwise, ..front_only });
    assert!(clockwise.color[0] > 0.5);
}

#[test]
fn beyond_far_nothing_takes_part() {
    let scene = Scene::new(screen_mesh(&triangle_above(0.1, 200.0)));
    let model = on_screen(&scene, &one_pixel());
    assert_eq!((model.silhouette[0], model.color[0], model.depth[0]), (0.0, 0.0, 0.0));
    let official = on_screen(&scene, &Settings { parity: Parity::Official, ..one_pixel() });
    assert!(official.silhouette[0] > 0.5 && official.color[0] == 0.0);
    let at_far = on_screen(&Scene::new(screen_mesh(&triangle_above(0.1, 100.0))), &one_pixel());
    assert!(at_far.silhouette[0] > 0.5 && at_far.margin[0] == 0.0);
}

/// A camera at the origin looking along +z, 90° wide: x / z, y / z.
fn pinhole_at_origin() -> Camera {
    Camera::from_matrix(DMat4::IDENTITY, Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 }).unwrap()
}

#[test]
fn the_near_plane_cuts() {
    let settings = Settings { width: 16, height: 16, sigma: 1e-4, near: 1.0, ..Settings::default() };
    // A floor from behind the camera to z = 5, cut at z = 1: on the screen a trapezoid whose lower edge is beyond view.
    let floor = [[-3.0, -0.5, -3.0], [3.0, -0.5, -3.0], [0.0, -0.5, 5.0]];
    let colors = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let cut = render(&colored(&floor, &colors), &[pinhole_at_origin()], &settings, Truncation::Tau).unwrap();
    // The same made by hand: at z = 1, halfway from corner 0 or 1 to corner 2.
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
    let settings = Settings { width: 16, height: 16, sigma: 1e-3, outputs: ALL, ..Settings::default() };
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

#[test]
fn projections_agree_on_the_same_camera() {
    let settings = Settings { width: 12, height: 8, sigma: 1e-3, outputs: ALL, ..Settings::default() };
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
    let worst = official.color.iter().zip(&perspective.color).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
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

#[test]
fn perspective_correct_colours() {
    let colors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let triangle = [[-1.0, -1.0, 1.0], [1.0, -1.0, 2.0], [0.0, 2.0, 4.0]];
    let settings = Settings { interpolation: Interpolation::Perspective, color: ColorAggregation::Hard, ..one_pixel() };
    let frame = on_screen(&colored(&triangle, &colors), &settings);
    let b = [1.0 / 3.0; 3];
    let z = 1.0 / (b[0] / 1.0 + b[1] / 2.0 + b[2] / 4.0);
    assert_close("colour", &frame.color, &[b[0] * z, b[1] * z / 2.0, b[2] * z / 4.0]);
    assert_close("depth", &frame.depth, &[z]);
}

#[test]
fn surface_cells_by_hand() {
    // A pixel at barycentrics (b0, b1) of a triangle with R = 2: which of the four cells?
    let cell = |b0: f64, b1: f64| {
        let (x, y) = (-4.0 * b1, -4.0 * (1.0 - b0 - b1));
        let corners = [[x, y, 2.0], [x + 4.0, y, 2.0], [x, y + 4.0, 2.0]].map(|c| c.map(|v| v as f32));
        let texels = (0..4).map(|i| [i as f32, 0.0, 0.0]).collect();
        let mesh = screen_mesh(&corners).with_appearance(Appearance::Surface { resolution: 2, texels }).unwrap();
        on_screen(&Scene::new(mesh), &Settings { color: ColorAggregation::Hard, ..one_pixel() }).color[0]
    };
    assert_eq!(cell(0.2, 0.2), 0.0);
    assert_eq!(cell(0.7, 0.2), 1.0);
    assert_eq!(cell(0.2, 0.7), 2.0);
    // Upper half of cell (0, 0): (R-1-y) R + R-1-x.
    assert_eq!(cell(0.4, 0.4), 3.0);
}

#[test]
fn textures_are_bilinear_and_wrap() {
    let texel = |v: f32| [v, 0.0, 0.0];
    // Row 0 on top: 1 2 / 3 4.
    let sample = |u: f32, v: f32, wrap| {
        let image = Texture::new(2, 2, vec![texel(1.0), texel(2.0), texel(3.0), texel(4.0)], wrap).unwrap();
        let appearance = Appearance::Textured {
            uvs: vec![[u, v]],
            uv_triangles: vec![[0; 3]],
            textures: vec![image],
            texture_of_triangle: Vec::new(),
        };
        let mesh = screen_mesh(&triangle_above(0.5, 2.0)).with_appearance(appearance).unwrap();
        on_screen(&Scene::new(mesh), &Settings { color: ColorAggregation::Hard, ..one_pixel() }).color[0]
    };
    let checks = [
        (0.25, 0.75, 1.0, 1.0),
        (0.75, 0.75, 2.0, 2.0),
        (0.25, 0.25, 3.0, 3.0),
        (0.5, 0.5, 2.5, 2.5),
        (0.0, 0.75, 1.5, 1.0),
        (1.0, 0.75, 1.5, 2.0),
        (0.25, 1.0, 2.0, 1.0),
        (1.25, -0.25, 1.0, 4.0),
    ];
    for (u, v, repeat, clamp) in checks {
        assert!(close(sample(u, v, Wrap::Repeat), repeat), "repeat ({u}, {v}): {}", sample(u, v, Wrap::Repeat));
        assert!(close(sample(u, v, Wrap::Clamp), clamp), "clamp ({u}, {v}): {}", sample(u, v, Wrap::Clamp));
    }
}

#[test]
fn lights_by_hand() {
    let lights = Lights {
        ambient_color: [1.0, 0.5, 0.0],
        ambient_intensity: 0.5,
        directional: vec![
            DirectionalLight { direction: [0.0, 3.0, 4.0], color: [0.0, 1.0, 1.0], intensity: 2.0 },
            DirectionalLight { direction: [0.0, 0.0, -1.0], color: [9.0; 3], intensity: 9.0 },
        ],
        shading: Shading::Flat,
    };
    let scene = Scene::new(screen_mesh(&triangle_above(0.5, 2.0))).with_lights(lights);
    let frame = on_screen(&scene, &Settings { color: ColorAggregation::Hard, ..one_pixel() });
    // The normal is +z: cosine 0.8 to the first light, none to the second.
    assert_close("colour", &frame.color, &[0.5, 0.25 + 1.6, 1.6]);
    assert_close("normal", &frame.normal, &[0.0, 0.0, 1.0]);
}

#[test]
fn mirrored_scenes_have_mirrored_images() {
    let settings = Settings { width: 9, height: 6, sigma: 1e-2, gamma: 0.05, outputs: ALL, ..Settings::default() };
    let positions = [[-1.0f32, -0.5, 2.0], [0.5, -0.75, 3.0], [0.25, 0.75, 2.5], [1.0, 0.5, 4.0]];
    let triangles = [[0u32, 1, 2], [1, 3, 2]];
    let image = |sign: f32| {
        let positions = positions.map(|[x, y, z]| [sign * x, y, z]).to_vec();
        // Mirroring turns triangles over: turn them back.
        let turn = |[a, b, c]: [u32; 3]| if sign < 0.0 { [a, c, b] } else { [a, b, c] };
        let mesh = Mesh::new(positions, triangles.map(turn).to_vec()).unwrap();
        on_screen(&Scene::new(mesh), &settings)
    };
    let (plain, mirrored) = (image(1.0), image(-1.0));
    for row in 0..6 {
        for column in 0..9 {
            let (a, b) = (row * 9 + column, row * 9 + 8 - column);
            assert!(close(plain.silhouette[a], mirrored.silhouette[b]));
            assert!(close(plain.depth[a], mirrored.depth[b]));
            assert!(close(plain.normal[3 * a], -mirrored.normal[3 * b]));
        }
    }
}

#[test]
fn batches_are_their_views() {
    let settings = Settings { width: 10, height: 10, sigma: 1e-3, outputs: ALL, ..Settings::default() };
    let meshes = [0.1, 0.4].map(|below| screen_mesh(&triangle_above(below, 2.0)));
    let cameras = [Camera::screen(), pinhole_at_origin()];
    let single = |mesh: &Mesh, camera: Camera| {
        render(&Scene::new(mesh.clone()), &[camera], &settings, Truncation::Tau).unwrap().color
    };
    let one_mesh = render(&Scene::new(meshes[0].clone()), &cameras, &settings, Truncation::Tau).unwrap();
    assert_eq!(one_mesh.color, [single(&meshes[0], cameras[0]), single(&meshes[0], cameras[1])].concat());
    let two_meshes = render(&Scene::batch(meshes.to_vec()), &cameras, &settings, Truncation::Tau).unwrap();
    assert_eq!(two_meshes.color, [single(&meshes[0], cameras[0]), single(&meshes[1], cameras[1])].concat());
    assert_eq!((two_meshes.batch, two_meshes.margin.len()), (2, 200));
}

#[test]
fn only_asked_images_are_made_and_bad_settings_refused() {
    let outputs = Outputs { color: false, silhouette: true, depth: false, normal: false };
    let scene = Scene::new(screen_mesh(&triangle_above(0.1, 2.0)));
    let frame = on_screen(&scene, &Settings { outputs, ..one_pixel() });
    assert!(frame.color.is_empty() && frame.depth.is_empty() && frame.normal.is_empty());
    assert_eq!(frame.silhouette.len(), 1);
    let bad = Settings { sigma: -1.0, ..one_pixel() };
    assert!(render(&scene, &[Camera::screen()], &bad, Truncation::Tau).is_err());
    assert!(render_culled(&scene, &[], &one_pixel()).is_err());
}

#[test]
fn an_empty_mesh_is_background() {
    let settings = Settings { background_color: [0.1, 0.2, 0.3], width: 2, height: 2, ..one_pixel() };
    let scene = Scene::new(Mesh::new(Vec::new(), Vec::new()).unwrap());
    assert_close("background", &on_screen(&scene, &settings).color, &[0.1, 0.2, 0.3].repeat(4));
    assert!(difference(&on_screen(&scene, &settings), &culled(&scene, &settings)) < 1e-12);
}

fn culled(scene: &Scene, settings: &Settings) -> ReferenceFrame {
    render_culled(scene, &[Camera::screen()], settings).unwrap()
}

/// Numbers in [0, 1) that are the same every time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// Triangles of all sizes, beyond the image, the near and the far plane too; some without area.
fn random_scene(random: &mut Random, triangles: usize) -> Scene {
    let mut positions = Vec::new();
    for t in 0..triangles {
        let size = [0.05, 0.3, 2.0, 0.0][t % 4];
        let centre = [3.0 * random.next() - 1.5, 3.0 * random.next() - 1.5];
        let z = 0.5 + 5.0 * random.next();
        for _ in 0..3 {
            let [x, y] = centre.map(|c| c + size * (random.next() - 0.5));
            positions.push([x, y, z + size * random.next()]);
        }
    }
    let colors: Vec<[f32; 3]> = positions.iter().map(|_| [random.next(), random.next(), random.next()]).collect();
    colored(&positions, &colors)
}

#[test]
fn culling_changes_nothing() {
    let mut random = Random(7);
    let scene = random_scene(&mut random, 60);
    let base = Settings { width: 37, height: 26, near: 0.8, far: 5.0, outputs: ALL, ..Settings::default() };
    let mut checked = 0;
    for (sigma, gamma) in [(1e-5, 1e-4), (1e-3, 1e-2), (0.1, 1.0)] {
        for distance in [Distance::Euclidean, Distance::Barycentric, Distance::Hard] {
            for parity in [Parity::Model, Parity::Official] {
                for color in [ColorAggregation::Softmax, ColorAggregation::Hard] {
                    let settings = Settings { sigma, gamma, distance, parity, color, ..base.clone() };
                    let worst = difference(&on_screen(&scene, &settings), &culled(&scene, &settings));
                    assert!(worst < 1e-12, "{worst:e} for {settings:?}");
                    checked += 1;
                }
            }
        }
    }
    assert_eq!(checked, 36);
}

/// A smaller γ and σ leave fewer pairs that weigh anything, larger ones all of them.
#[test]
fn leaving_out_what_weighs_nothing_changes_nothing() {
    let mut random = Random(11);
    let scene = random_scene(&mut random, 60);
    let base = Settings { width: 37, height: 26, near: 0.8, far: 5.0, outputs: ALL, ..Settings::default() };
    for (sigma, gamma) in [(1e-5, 1e-4), (1e-4, 1e-2), (1e-3, 1e-2), (0.1, 1.0)] {
        for (background, epsilon) in
            [(Background::Weighted, 1e-3), (Background::Weighted, 0.7), (Background::Composite, 0.0)]
        {
            for parity in [Parity::Model, Parity::Official] {
                for faces in [Faces::Both, Faces::Front] {
                    for distance in [Distance::Euclidean, Distance::Barycentric] {
                        let settings =
                            Settings { sigma, gamma, background, epsilon, parity, faces, distance, ..base.clone() };
                        let camera = [Camera::screen()];
                        let mut all = render(&scene, &camera, &settings, Truncation::None).unwrap();
                        let few = render_untruncated(&scene, &camera, &settings).unwrap();
                        // A margin is a pixel's nearness to any pair's jump, those that weigh nothing included.
                        all.margin.clone_from(&few.margin);
                        // Depths reach 5, and 60 triangles lose 1e-16 each.
                        let worst = difference(&all, &few);
                        assert!(worst < 1e-12, "{worst:e} for {settings:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn untruncated_images_are_not_truncated_ones() {
    let scene = random_scene(&mut Random(11), 60);
    let settings = Settings { width: 37, height: 26, near: 0.8, sigma: 1e-3, outputs: ALL, ..Settings::default() };
    let untruncated = render_untruncated(&scene, &[Camera::screen()], &settings).unwrap();
    assert!(difference(&untruncated, &culled(&scene, &settings)) > 1e-3);
}

/// Two pixels a unit: a triangle that covers 10 centres, and one that its radius adds to beyond each side.
#[test]
fn pairs_are_counted() {
    let corners = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]];
    let scene = colored(&corners, &[[1.0; 3]; 3]);
    let count = |blur: f64| {
        let settings = Settings { width: 8, height: 4, ..Settings::default() }.with_blur_pixels(blur);
        let pairs = pairs(&scene, &[Camera::screen()], &settings).unwrap();
        (pairs.pieces, pairs.total(), pairs.needed, pairs.boxed)
    };
    // The slanted edge runs through the centres of its four pixels, which count as inside.
    let (pieces, total, needed, boxed) = count(1e-3);
    assert_eq!((pieces, total, boxed), (1, 10, 16));
    assert_eq!(needed[..8], [0, 0, 1, 0, 0, 0, 0, 0]);
    assert_eq!(needed[24..], [0, 0, 1, 1, 1, 1, 0, 0]);
    // 0.6 pixels beyond the left side lies the next column, at 0.5, for all four rows; and beyond the slanted side
    // none, at 0.71.
    assert_eq!(count(0.6).1, 14);
    // 0.8 reaches those too, one beside each of the four.
    assert_eq!(count(0.8).1, 14 + 4);
    assert_eq!(count(0.8).3, 24);
}

#[test]
fn extreme_scenes_stay_finite() {
    let scenes = [
        colored(&[[1e20, 0.0, 2.0], [0.0, 1e20, 2.0], [-1e20, -1e20, 2.0]], &[[1.0; 3]; 3]),
        colored(&[[3e38, 0.0, 3e38], [0.0, 3e38, 2.0], [-3e38, -3e38, 0.0]], &[[1.0; 3]; 3]),
        colored(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[1.0; 3]; 3]),
        colored(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1e-30, 0.0, 1.0]], &[[1.0; 3]; 3]),
    ];
    for scene in &scenes {
        for (sigma, gamma, epsilon) in [(1e-12, 1e-10, 1e3), (1e3, 1e6, -1e3), (1e-5, 1e-8, 1e-3)] {
            for parity in [Parity::Model, Parity::Official] {
                let settings = Settings { width: 5, height: 4, sigma, gamma, epsilon, parity, ..one_pixel() };
                let frame = on_screen(scene, &settings);
                let images = [frame.color, frame.silhouette, frame.depth, frame.normal];
                assert!(images.iter().flatten().all(|x| x.is_finite()), "{settings:?}: {images:?}");
            }
        }
    }
}
