//! Numbers that can be computed by hand.

use super::{culling::culled, projection::pinhole_at_origin, *};

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

/// A vertex's normal is the mean of its triangles' weighted by their areas, that of a corner inside a pixel's triangle.
#[test]
fn smooth_normals_by_hand() {
    // The pixel is the centroid of the first triangle; the second has (-6, -2, 6) as twice its area's normal, the first (0, 0, 6).
    let positions = vec![[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [0.0, 2.0, 2.0], [2.0, 2.0, 4.0]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [1, 3, 2]]).unwrap();
    let lights = Lights { shading: Shading::Smooth, ..Lights::official() };
    let scene = Scene::new(mesh).with_lights(lights);
    let frame = on_screen(&scene, &Settings { color: ColorAggregation::Hard, ..one_pixel() });
    let shared = [-6.0, -2.0, 12.0].map(|x| x / 184f64.sqrt());
    let normal = [0, 1, 2].map(|k| (2.0 * shared[k] + [0.0, 0.0, 1.0][k]) / 3.0);
    assert_close("normal", &frame.normal, &normal);
    // Light from above falls on neither of them: their y are 0 and below.
    assert_close("colour", &frame.color, &[0.5; 3]);
}

#[test]
fn mirrored_scenes_have_mirrored_images() {
    let settings =
        Settings { width: 9, height: 6, sigma: 1e-2, gamma: 0.05, outputs: Outputs::ALL, ..Settings::default() };
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
    let settings = Settings { width: 10, height: 10, sigma: 1e-3, outputs: Outputs::ALL, ..Settings::default() };
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
    let outputs = Outputs::SILHOUETTE;
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

/// A triangle that lies farther around the pixel may outweigh a nearer one, or not if γ is small. One that is out of reach and one
/// that the near plane cuts are left out.
#[test]
fn the_strongest_triangles_by_hand() {
    let cut = [[-4.0, -0.3, 0.5], [4.0, -0.3, 3.0], [0.0, 4.0, 3.0]];
    let placed = [(-9.0, 3.0), (0.2, 4.0), (0.1, 3.0), (-0.05, 3.0)].map(|(below, z)| triangle_above(below, z));
    let scene = Scene::new(screen_mesh(&[&placed[..], &[cut]].concat().concat()));
    for (gamma, order) in [(0.1, [1, 2, 3]), (1e-3, [2, 3, 1])] {
        let of = |count| strongest(&scene, &[Camera::screen()], &Settings { gamma, ..one_pixel() }, count).unwrap();
        assert_eq!(of(4), [&order.map(Some)[..], &[None]].concat(), "{gamma}");
        assert_eq!(of(1), [Some(order[0])]);
    }
}
