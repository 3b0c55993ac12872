//! The reference's gradient against central differences of its own images, one input at a time.
//!
//! Pixels within 1e-3 of a jump of the model have no weight in the loss: there a difference is not a derivative.

use crate::common::{gradient::made_case, modes::in_every_mode};
use glam::{DMat4, DVec3};
use softras::scene::{
    Appearance, Background, Camera, ColorAggregation, DirectionalLight, Distance, Faces, Interpolation, Lights, Mesh,
    Outputs, Parity, Projection, Scene, Settings, Shading, SilhouetteAggregation, Texture, Wrap,
};
use softras_reference::render_at;
use softras_reference::{GradientMode, Parameters, ReferenceFrame, Upstream, gradient};

const STEP: f64 = 1e-6;
/// Of the largest derivative in the vector; differences in f64 with this step are good to about 1e-8 of it.
const TOLERANCE: f64 = 2e-7;
/// The loss is a sum of some thousand terms around 1: its rounding, 1e-14, over two steps.
const FLOOR: f64 = 1e-8;

/// Numbers in [0, 1) that are the same every time.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f64 / (1u64 << 24) as f64
    }

    fn rows<const N: usize>(&mut self, count: usize) -> Vec<[f32; N]> {
        (0..count).map(|_| std::array::from_fn(|_| self.next() as f32)).collect()
    }
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
    let mut random = Random(3);
    let mut weights = |image: &[f64], channels: usize| -> Option<Vec<f64>> {
        let weight = |i: usize, r: f64| if frame.margin[i / channels] > 1e-3 { 2.0 * r - 1.0 } else { 0.0 };
        (!image.is_empty()).then(|| (0..image.len()).map(|i| weight(i, random.next())).collect())
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

/// A scene to differentiate.
struct Case {
    scene: Scene,
    cameras: Vec<Camera>,
    settings: Settings,
}

impl Case {
    fn new(appearance: Appearance, projection: Projection, settings: Settings) -> Self {
        let scene = Scene::new(mesh().with_appearance(appearance).unwrap()).with_lights(lights(Shading::Flat));
        Self { scene, cameras: vec![camera(projection)], settings }
    }

    fn loss_at(&self, parameters: &Parameters, upstream: &Upstream) -> f64 {
        loss(&render_at(&self.scene, &self.cameras, &self.settings, parameters).unwrap(), upstream)
    }

    /// Every derivative by central differences.
    fn differences(&self, parameters: &Parameters, upstream: &Upstream) -> Vec<f64> {
        let mut moved = parameters.clone();
        let slots = 0..parameters.values().len();
        slots.map(|slot| self.difference(&mut moved, slot, upstream)).collect()
    }

    fn difference(&self, moved: &mut Parameters, slot: usize, upstream: &Upstream) -> f64 {
        let value = moved.values()[slot];
        // σ and γ are small numbers, but the last one, ε, is not.
        let slots = moved.values().len();
        let step = if (slots - 3..slots - 1).contains(&slot) { 1e-5 * value } else { STEP };
        let [up, down] = [step, -step].map(|step| {
            moved.values_mut()[slot] = value + step;
            self.loss_at(moved, upstream)
        });
        moved.values_mut()[slot] = value;
        (up - down) / (2.0 * step)
    }

    fn check(&self, name: &str) {
        let parameters = Parameters::new(&self.scene, &self.cameras, &self.settings);
        let frame = render_at(&self.scene, &self.cameras, &self.settings, &parameters).unwrap();
        let kept = frame.margin.iter().filter(|&&m| m > 1e-3).count();
        assert!(
            2 * kept > frame.margin.len(),
            "{name}: only {kept} of {} pixels are away from jumps",
            frame.margin.len()
        );
        let upstream = upstream(&frame);
        let ours = gradient(&self.scene, &self.cameras, &self.settings, &upstream, GradientMode::Exact).unwrap();
        let expected = self.differences(&parameters, &upstream);
        for (group, range) in groups(&parameters, &self.scene) {
            let worst = mismatch(&ours.values()[range.clone()], &expected[range.clone()]);
            let size = expected[range.clone()].iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            // The steps of σ and γ are shorter.
            let floor = if group == "σ" || group == "γ" { 10.0 * FLOOR } else { FLOOR };
            println!("{name}: {group} {worst:.1e} of {size:.2e}");
            assert!(
                worst * size < TOLERANCE * size + floor,
                "{name}, {group}: {worst:e}\n{:?}\n{:?}",
                &ours.values()[range.clone()],
                &expected[range]
            );
        }
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
    Appearance::VertexColors(Random(11).rows(6))
}

/// Vertices on the screen, none of whose edges goes through pixel centres, where b̂ has a kink.
fn screen_mesh() -> Mesh {
    let mut mesh = mesh().with_appearance(vertex_colors()).unwrap();
    mesh.set_positions(mesh.positions().iter().map(|[x, y, z]| [x * 0.7, y * 0.7, *z]).collect()).unwrap();
    mesh
}

fn textured(wrap: Wrap) -> Appearance {
    let mut random = Random(5);
    let images = (0..2).map(|_| Texture::new(3, 4, random.rows(12), wrap).unwrap()).collect();
    let uvs = random.rows::<2>(7).into_iter().map(|uv| uv.map(|x| 2.0 * x - 0.5)).collect();
    let uv_triangles = vec![[0, 1, 2], [6, 2, 3], [1, 4, 2], [5, 1, 3], [3, 4, 0], [5, 2, 4]];
    Appearance::Textured { uvs, uv_triangles, textures: images, texture_of_triangle: vec![0, 1, 0, 1, 0, 1] }
}

fn surface(resolution: u32) -> Appearance {
    let texels = Random(9).rows(6 * (resolution * resolution) as usize);
    Appearance::Surface { resolution, texels }
}

#[test]
fn comparisons_fail_on_wrong_gradients() {
    let right = [1.0, -2.0, 0.5];
    assert_eq!(mismatch(&right, &right), 0.0);
    assert!((mismatch(&[1.0, -2.0, 0.7], &right) - 0.1).abs() < 1e-15);
    assert_eq!(mismatch(&right, &right[..2]), f64::INFINITY);
    assert_eq!(mismatch(&[1.0, f64::NAN, 0.5], &right), f64::INFINITY);
    // Paper gradients are not those of the image, and the comparison must see it.
    let case = Case::new(vertex_colors(), FOV, settings());
    let parameters = Parameters::new(&case.scene, &case.cameras, &case.settings);
    let frame = render_at(&case.scene, &case.cameras, &case.settings, &parameters).unwrap();
    let upstream = upstream(&frame);
    let paper = gradient(&case.scene, &case.cameras, &case.settings, &upstream, GradientMode::Paper).unwrap();
    assert!(mismatch(paper.values(), &case.differences(&parameters, &upstream)) > 1e-3);
}

#[test]
fn vertex_colours_weighted() {
    Case::new(vertex_colors(), FOV, settings()).check("vertex colours");
}

#[test]
fn vertex_colours_composite() {
    let settings = Settings { background: Background::Composite, ..settings() };
    Case::new(vertex_colors(), FOV, settings).check("composite");
}

#[test]
fn uniform_colour_smooth_light() {
    let mut case = Case::new(Appearance::Uniform([0.8, 0.3, 0.5]), FOV, settings());
    case.scene.lights = lights(Shading::Smooth);
    case.check("smooth");
}

#[test]
fn textures_perspective_correct() {
    let pinhole = Projection::Pinhole { fx: 15.0, fy: 13.0, cx: 6.5, cy: 6.2 };
    let settings = Settings { interpolation: Interpolation::Perspective, ..settings() };
    Case::new(textured(Wrap::Repeat), pinhole, settings.clone()).check("repeat");
    Case::new(textured(Wrap::Clamp), pinhole, settings).check("clamp");
}

#[test]
fn surface_textures() {
    let orthographic = Projection::Orthographic { half_height: 1.3 };
    for interpolation in [Interpolation::Affine, Interpolation::Perspective] {
        Case::new(surface(3), orthographic, Settings { interpolation, ..settings() }).check("surface");
    }
}

#[test]
fn every_mode() {
    let base = Case::new(vertex_colors(), FOV, settings());
    let base = made_case(base.scene, base.cameras, base.settings);
    for (name, case) in in_every_mode(&base) {
        Case { scene: case.scene, cameras: case.cameras, settings: case.settings }.check(name);
    }
}

#[test]
fn screen_vertices() {
    let mesh = screen_mesh();
    for silhouette in [SilhouetteAggregation::Product, SilhouetteAggregation::Sum] {
        for distance in [Distance::Euclidean, Distance::Barycentric] {
            for parity in [Parity::Model, Parity::Official] {
                let settings = Settings { silhouette, distance, parity, epsilon: 0.4, ..settings() };
                let case = Case { scene: Scene::new(mesh.clone()), cameras: vec![Camera::screen()], settings };
                case.check(&format!("screen {silhouette:?} {distance:?} {parity:?}"));
            }
        }
    }
}

#[test]
fn official_projection() {
    // The projected x', y' are of the size of 1, where distortion is mild; S = 1 maps [0, 1] to the screen.
    let p = [[1.0, 0.04, 0.5, 0.02], [0.01, 0.9, 0.45, -0.03], [0.01, 0.02, 1.0, 0.1]];
    let case = |distortion, settings| Case {
        scene: Scene::new(mesh().with_appearance(vertex_colors()).unwrap()),
        cameras: vec![Camera::official(p, distortion, 1.0).unwrap()],
        settings,
    };
    let square = Settings { width: 12, ..settings() };
    case([0.02, -0.01, 0.004, 0.003, 0.001], square.clone()).check("official projection");
    let outside =
        Settings { parity: Parity::Official, near: 2.5, far: 3.2, epsilon: 0.2, faces: Faces::Front, ..square };
    case([0.0; 5], outside).check("official near and far");
}

#[test]
fn hard_colour() {
    for background in [Background::Weighted, Background::Composite] {
        let settings = Settings { color: ColorAggregation::Hard, background, ..settings() };
        Case::new(vertex_colors(), FOV, settings).check("hard colour");
    }
    let settings = Settings { distance: Distance::Hard, silhouette: SilhouetteAggregation::Hard, ..settings() };
    Case::new(vertex_colors(), FOV, settings).check("hard distance");
}

#[test]
fn cut_at_the_near_plane() {
    // The camera stands so that one or two corners of most triangles are too near.
    let settings = Settings { near: 2.7, ..settings() };
    let mut case = Case::new(textured(Wrap::Repeat), FOV, settings);
    case.check("cut textures");
    case.settings.faces = Faces::Front;
    case.check("cut front faces");
    case.settings.faces = Faces::Both;
    let screen =
        Case { scene: Scene::new(screen_mesh()), cameras: vec![Camera::screen()], settings: case.settings.clone() };
    screen.check("cut on the screen");
}

#[test]
fn batches() {
    let other = Camera::from_matrix(DMat4::IDENTITY, Projection::Orthographic { half_height: 1.1 }).unwrap();
    let mut case = Case::new(vertex_colors(), FOV, settings());
    case.cameras.push(other);
    case.check("two cameras");
    let mut far = mesh();
    far.set_positions(mesh().positions().iter().map(|[x, y, z]| [*x, y * 0.8, z + 0.5]).collect()).unwrap();
    case.scene.meshes.push(far.with_appearance(surface(2)).unwrap());
    case.check("two meshes");
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
    let case = Case::new(vertex_colors(), FOV, settings());
    let run = |upstream: &Upstream| gradient(&case.scene, &case.cameras, &case.settings, upstream, GradientMode::Exact);
    assert!(run(&Upstream::default()).unwrap().values().iter().all(|&x| x == 0.0));
    let short = Upstream { d_color: Some(vec![1.0; 5]), ..Upstream::default() };
    assert!(run(&short).unwrap_err().to_string().contains("d_color has 5 values"));
    let other = Parameters::new(&Scene::new(mesh()), &case.cameras, &case.settings);
    assert!(render_at(&case.scene, &case.cameras, &case.settings, &other).is_err());
}

/// What a scene is made of stands where it is asked for.
#[test]
fn parameters_are_named_after_what_they_hold() {
    let (lights, settings) = (lights(Shading::Flat), settings());
    let scene = Scene::new(mesh()).with_lights(lights.clone());
    let p = Parameters::new(&scene, &[camera(FOV)], &settings);
    assert_eq!((p.ambient_color(), p.ambient_intensity()), (&lights.ambient_color[..], 0.4));
    for (i, light) in lights.directional.iter().enumerate() {
        assert_eq!((p.light_direction(i), p.light_color(i)), (&light.direction[..], &light.color[..]));
        assert_eq!(p.light_intensity(i), light.intensity);
    }
    assert_eq!((p.background(), p.projection(0)), (&settings.background_color[..], &[0.8][..]));
    assert_eq!((p.sigma(), p.gamma(), p.epsilon()), (settings.sigma, settings.gamma, settings.epsilon));
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
