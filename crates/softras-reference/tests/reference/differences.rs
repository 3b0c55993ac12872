//! The reference's gradient against central differences of its own images, one input at a time.
//!
//! Pixels within 1e-3 of a jump of the model have no weight in the loss: there a difference is not a derivative.

use crate::common::{
    gradient::made_case,
    modes::{alone, pairwise},
    random::Random,
    scenes::Case,
};
use glam::{DMat4, DVec3};
use softras::scene::{
    Appearance, Background, Camera, DirectionalLight, Distance, Faces, Interpolation, Lights, Mesh, Outputs, Parity,
    Projection, Scene, Settings, Shading, SilhouetteAggregation, Texture, Wrap,
};
use softras_reference::render_at;
use softras_reference::{GradientMode, Parameters, ReferenceFrame, Upstream, gradient};

const STEP: f64 = 1e-6;
/// A fraction of the largest derivative in the vector; differences in f64 with this step are good to about 1e-8 of it, and to 1e-6 by the
/// barycentrics of the slivers that the near plane leaves.
const TOLERANCE: f64 = 3e-6;
/// The loss is a sum of some thousand terms around 1: its rounding, 1e-14, over two steps.
const FLOOR: f64 = 1e-8;

fn rows<const N: usize>(random: &mut Random, count: usize) -> Vec<[f32; N]> {
    (0..count).map(|_| [(); N].map(|()| random.range(0.0, 1.0) as f32)).collect()
}

/// Six vertices and six triangles about the z axis from z = 2 to 4, some in front of others, one seen from behind.
fn mesh() -> Mesh {
    let positions = vec![
        [-0.9, -0.7, 2.2],
        [0.8, -0.8, 2.6],
        [0.1, 0.9, 3.1],
        [-0.6, 0.5, 2.9],
        [1.1, 0.6, 3.7],
        [0.37, -0.13, 2.0],
    ];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [1, 4, 2], [5, 1, 3], [3, 4, 0], [5, 2, 4]];
    Mesh::new(positions, triangles).unwrap()
}

fn lights(shading: Shading) -> Lights {
    let light = |direction, color, intensity| DirectionalLight { direction, color, intensity };
    let directional =
        vec![light([0.3, 0.2, -0.9], [0.9, 0.5, 0.3], 0.7), light([-0.5, 1.5, 0.4], [0.2, 0.8, 0.6], 0.4)];
    Lights { ambient_color: [0.9, 0.8, 0.7], ambient_intensity: 0.4, directional, shading }
}

fn settings() -> Settings {
    Settings {
        width: 14,
        height: 12,
        sigma: 3e-3,
        gamma: 2e-2,
        epsilon: 0.9,
        tau: 1e-5,
        far: 10.0,
        background_color: [0.1, 0.4, 0.2],
        outputs: Outputs::ALL,
        ..Settings::default()
    }
}

fn camera(projection: Projection) -> Camera {
    let eye = DVec3::new(0.2, 0.1, -0.3);
    Camera::look_at(eye, DVec3::new(0.1, 0.0, 3.0), DVec3::new(0.1, 1.0, 0.0), projection).unwrap()
}

const FOV: Projection = Projection::Perspective { fov_y: 0.8 };

/// A random weight for every value of every image that there is, 0 near jumps.
fn upstream(frame: &ReferenceFrame) -> Upstream {
    let mut random = Random::new(3);
    let mut weights = |image: &[f64], channels: usize| -> Option<Vec<f64>> {
        let weight = |i: usize, r: f64| if frame.margin[i / channels] > 1e-3 { r } else { 0.0 };
        (!image.is_empty()).then(|| (0..image.len()).map(|i| weight(i, random.range(-1.0, 1.0))).collect())
    };
    Upstream {
        d_color: weights(&frame.color, 3),
        d_silhouette: weights(&frame.silhouette, 1),
        d_depth: weights(&frame.depth, 1),
        d_normal: weights(&frame.normal, 3),
    }
}

fn loss(frame: &ReferenceFrame, upstream: &Upstream) -> f64 {
    let dot = |image: &[f64], weights: &Option<Vec<f64>>| -> f64 {
        weights.as_ref().map_or(0.0, |weights| image.iter().zip(weights).map(|(a, b)| a * b).sum())
    };
    dot(&frame.color, &upstream.d_color)
        + dot(&frame.silhouette, &upstream.d_silhouette)
        + dot(&frame.depth, &upstream.d_depth)
        + dot(&frame.normal, &upstream.d_normal)
}

/// The largest difference between two gradients, as a fraction of the largest derivative; infinite where shapes differ or
/// a value is not a number.
fn mismatch(ours: &[f64], expected: &[f64]) -> f64 {
    if ours.len() != expected.len() {
        return f64::INFINITY;
    }
    let scale = expected.iter().fold(1e-30, |scale: f64, x| scale.max(x.abs()));
    let differences = ours.iter().zip(expected).map(|(a, b)| (a - b).abs() / scale);
    differences.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// One lit mesh before one camera.
fn case(appearance: Appearance, projection: Projection, settings: Settings) -> Case {
    let scene = Scene::new(mesh().with_appearance(appearance).unwrap()).with_lights(lights(Shading::Flat));
    made_case(scene, vec![camera(projection)], settings)
}

fn render(case: &Case, parameters: &Parameters) -> ReferenceFrame {
    render_at(&case.scene, &case.cameras, &case.settings, parameters).unwrap()
}

/// The derivative by an input, by central differences.
fn difference(case: &Case, moved: &mut Parameters, slot: usize, upstream: &Upstream) -> f64 {
    let value = moved.values()[slot];
    // σ and γ are small numbers, but the last one, ε, is not.
    let slots = moved.values().len();
    let step = if (slots - 3..slots - 1).contains(&slot) { 1e-5 * value } else { STEP };
    let [up, down] = [step, -step].map(|step| {
        moved.values_mut()[slot] = value + step;
        loss(&render(case, moved), upstream)
    });
    moved.values_mut()[slot] = value;
    (up - down) / (2.0 * step)
}

fn check(name: &str, case: &Case) {
    let mut parameters = Parameters::new(&case.scene, &case.cameras, &case.settings);
    let frame = render(case, &parameters);
    let (kept, all) = (frame.margin.iter().filter(|&&m| m > 1e-3).count(), frame.margin.len());
    assert!(2 * kept > all, "{name}: only {kept} of {all} pixels are away from jumps");
    let upstream = upstream(&frame);
    let ours = gradient(&case.scene, &case.cameras, &case.settings, &upstream, GradientMode::Exact).unwrap();
    let slots = 0..parameters.values().len();
    let expected: Vec<f64> = slots.map(|slot| difference(case, &mut parameters, slot, &upstream)).collect();
    for (group, range) in groups(&parameters, &case.scene) {
        let (ours, expected) = (&ours.values()[range.clone()], &expected[range]);
        let worst = mismatch(ours, expected);
        let size = expected.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        // The steps of σ and γ are shorter.
        let floor = if group == "σ" || group == "γ" { 10.0 * FLOOR } else { FLOOR };
        println!("{name}: {group} {worst:.1e} of {size:.2e}");
        assert!(worst * size < TOLERANCE * size + floor, "{name}, {group}: {worst:e}\n{ours:?}\n{expected:?}");
    }
}

/// Each input's place in the flat vector, found by the addresses of the named slices.
fn groups(parameters: &Parameters, scene: &Scene) -> Vec<(&'static str, std::ops::Range<usize>)> {
    let all = parameters.values();
    let place = |part: &[f64]| {
        let start = (part.as_ptr() as usize - all.as_ptr() as usize) / size_of::<f64>();
        start..start + part.len()
    };
    let settings = place(parameters.background()).end;
    let mut groups = vec![
        ("positions", place(parameters.positions(0))),
        ("colours", place(parameters.colors(0))),
        ("surface texels", place(parameters.surface_texels(0))),
        ("UVs", place(parameters.uvs(0))),
        ("twist", place(parameters.twist(0))),
        ("projection", place(parameters.projection(0))),
        ("ambient colour", place(parameters.ambient_color())),
        ("background", place(parameters.background())),
        ("σ", settings..settings + 1),
        ("γ", settings + 1..settings + 2),
        ("ε", settings + 2..settings + 3),
        ("everything", 0..all.len()),
    ];
    if let Appearance::Textured { textures, .. } = scene.meshes[0].appearance() {
        for texture in 0..textures.len() {
            groups.push(("texture texels", place(parameters.texture_texels(0, texture))));
            groups.push(("texture alpha", place(parameters.texture_alpha(0, texture))));
        }
    }
    for light in 0..scene.lights.directional.len() {
        groups.push(("light direction", place(parameters.light_direction(light))));
        groups.push(("light colour", place(parameters.light_color(light))));
    }
    groups.retain(|(_, range)| !range.is_empty());
    groups
}

fn vertex_colors() -> Appearance {
    Appearance::VertexColors(rows(&mut Random::new(11), 6))
}

/// Vertices on the screen, none of whose edges goes through pixel centres, where b̂ has a kink.
fn screen_mesh() -> Mesh {
    let mut mesh = mesh().with_appearance(vertex_colors()).unwrap();
    mesh.set_positions(mesh.positions().iter().map(|[x, y, z]| [x * 0.7, y * 0.7, *z]).collect()).unwrap();
    mesh
}

fn textured(wrap: Wrap) -> Appearance {
    let random = &mut Random::new(5);
    let images = (0..2).map(|_| Texture::new(3, 4, rows(random, 12), wrap).unwrap()).collect();
    let uvs = rows::<2>(random, 7).into_iter().map(|uv| uv.map(|x| 2.0 * x - 0.5)).collect();
    let uv_triangles = vec![[0, 1, 2], [6, 2, 3], [1, 4, 2], [5, 1, 3], [3, 4, 0], [5, 2, 4]];
    Appearance::Textured { uvs, uv_triangles, textures: images, texture_of_triangle: vec![0, 1, 0, 1, 0, 1] }
}

fn surface(resolution: u32) -> Appearance {
    let texels = rows(&mut Random::new(9), 6 * (resolution * resolution) as usize);
    Appearance::Surface { resolution, texels }
}

/// Each choice alone, and every pair of choices.
#[test]
fn every_mode() {
    let base = case(vertex_colors(), FOV, settings());
    let pairs = pairwise(&base).map(|(name, case, _)| (name, case));
    for (name, case) in alone(&base).chain(pairs) {
        check(&name, &case);
    }
}

#[test]
fn every_projection_and_appearance() {
    let pinhole = Projection::Pinhole { fx: 15.0, fy: 13.0, cx: 6.5, cy: 6.2 };
    let orthographic = Projection::Orthographic { half_height: 1.3 };
    let perspective = Settings { interpolation: Interpolation::Perspective, ..settings() };
    let composite = Settings { background: Background::Composite, ..settings() };
    for (name, appearance, projection, settings) in [
        ("uniform", Appearance::Uniform([0.8, 0.3, 0.5]), FOV, settings()),
        ("repeated", textured(Wrap::Repeat), pinhole, perspective.clone()),
        ("clamped", textured(Wrap::Clamp), pinhole, composite),
        ("surface", surface(3), orthographic, settings()),
        ("surface in perspective", surface(3), orthographic, perspective),
    ] {
        let mut case = case(appearance, projection, settings);
        check(name, &case);
        case.scene.lights = lights(Shading::Smooth);
        check(&format!("{name}, smooth light"), &case);
    }
}

#[test]
fn screen_vertices() {
    let on_screen = |settings| made_case(Scene::new(screen_mesh()), vec![Camera::screen()], settings);
    for parity in [Parity::Model, Parity::Official] {
        check(&format!("screen {parity:?}"), &on_screen(Settings { parity, epsilon: 0.4, ..settings() }));
    }
    let (silhouette, distance) = (SilhouetteAggregation::Sum, Distance::Barycentric);
    check("screen, sum, barycentric", &on_screen(Settings { silhouette, distance, ..settings() }));
    // One or two corners of most triangles are too near.
    check("cut on the screen", &on_screen(Settings { near: 2.7, ..settings() }));
}

#[test]
fn official_projection() {
    // The projected x', y' are of the size of 1, where distortion is mild; S = 1 maps [0, 1] to the screen.
    let p = [[1.0, 0.04, 0.5, 0.02], [0.01, 0.9, 0.45, -0.03], [0.01, 0.02, 1.0, 0.1]];
    let scene = Scene::new(mesh().with_appearance(vertex_colors()).unwrap());
    let case =
        |distortion, settings| made_case(scene.clone(), vec![Camera::official(p, distortion, 1.0).unwrap()], settings);
    let square = Settings { width: 12, ..settings() };
    check("official projection", &case([0.02, -0.01, 0.004, 0.003, 0.001], square.clone()));
    let outside =
        Settings { parity: Parity::Official, near: 2.5, far: 3.2, epsilon: 0.2, faces: Faces::Front, ..square };
    check("official near and far", &case([0.0; 5], outside));
}

#[test]
fn cut_at_the_near_plane() {
    let mut case = case(textured(Wrap::Repeat), FOV, Settings { near: 2.7, ..settings() });
    check("cut textures", &case);
    case.settings.faces = Faces::Front;
    check("cut front faces", &case);
}

#[test]
fn batches() {
    let other = Camera::from_matrix(DMat4::IDENTITY, Projection::Orthographic { half_height: 1.1 }).unwrap();
    let mut case = case(vertex_colors(), FOV, settings());
    case.cameras.push(other);
    check("two cameras", &case);
    let mut far = mesh();
    far.set_positions(mesh().positions().iter().map(|[x, y, z]| [*x, y * 0.8, z + 0.5]).collect()).unwrap();
    case.scene.meshes.push(far.with_appearance(surface(2)).unwrap());
    check("two meshes", &case);
}

#[test]
fn paper_is_exact_where_nothing_depends_on_barycentrics() {
    let flat: Vec<[f32; 3]> = mesh().positions().iter().map(|[x, y, _]| [*x, *y, 3.0]).collect();
    let mut mesh = mesh();
    mesh.set_positions(flat).unwrap();
    let scene = Scene::new(mesh);
    let settings = settings();
    let cameras = [Camera::screen()];
    let parameters = Parameters::new(&scene, &cameras, &settings);
    let upstream = upstream(&render_at(&scene, &cameras, &settings, &parameters).unwrap());
    // Depth and normal too: z is the same everywhere, normals are the face's.
    let [exact, paper] = [GradientMode::Exact, GradientMode::Paper]
        .map(|m| gradient(&scene, &cameras, &settings, &upstream, m).unwrap());
    assert!(mismatch(paper.positions(0), exact.positions(0)) < 1e-12);
}

#[test]
fn a_loss_without_images_has_no_gradient_and_wrong_sizes_are_refused() {
    let case = case(vertex_colors(), FOV, settings());
    let run = |upstream: &Upstream| gradient(&case.scene, &case.cameras, &case.settings, upstream, GradientMode::Exact);
    assert!(run(&Upstream::default()).unwrap().values().iter().all(|&x| x == 0.0));
    let short = Upstream { d_color: Some(vec![1.0; 5]), ..Upstream::default() };
    assert!(run(&short).unwrap_err().to_string().contains("d_color has 5 values"));
    let other = Parameters::new(&Scene::new(mesh()), &case.cameras, &case.settings);
    assert!(render_at(&case.scene, &case.cameras, &case.settings, &other).is_err());
}

/// The official silhouette's gradient is smaller by (1 - D) / 1e-6 where 1 - D is below 1e-6, and elsewhere the model's.
#[test]
fn official_gradients_are_damped_deep_inside() {
    let settings = Settings { width: 1, height: 1, sigma: 0.01, ..Settings::default() };
    let slope = |inside: f64, parity| {
        // An edge so far below the pixel that x = d² / σ is what is asked for.
        let below = -(inside * 0.01).sqrt() as f32;
        let mesh = Mesh::new(vec![[-9.0, below, 2.0], [9.0, below, 2.0], [0.0, 9.0, 2.0]], vec![[0, 1, 2]]).unwrap();
        let upstream = Upstream { d_silhouette: Some(vec![1.0]), ..Upstream::default() };
        let settings = Settings { parity, ..settings.clone() };
        let scene = Scene::new(mesh);
        gradient(&scene, &[Camera::screen()], &settings, &upstream, GradientMode::Paper).unwrap().positions(0)[1]
    };
    for inside in [2.0, 12.0, 15.0, 20.0] {
        let ratio = slope(inside, Parity::Official) / slope(inside, Parity::Model);
        // (1 - D) / D in the place of 1 - D: their D / D is the official code's own.
        let expected = ((-inside).exp() / 1e-6).min(1.0);
        assert!((ratio / expected - 1.0).abs() < 1e-4, "{ratio} for {expected} at {inside}");
    }
}
