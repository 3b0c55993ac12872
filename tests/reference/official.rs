//! The judge against outputs of the official SoftRas kernels (run in float64), which lie beside the repository.
//!
//! Without `../shared/reference` every test here passes without testing anything, and says so.

use softras::reference::{GradientMode, ReferenceFrame, Truncation, Upstream, gradient, render, render_culled};
use softras::scene::{
    Appearance, Camera, ColorAggregation, Distance, Faces, FrontFace, Mesh, Parity, Scene, Settings,
    SilhouetteAggregation,
};
use std::cmp::Ordering;
use std::path::PathBuf;

/// Forward: the official kernels agree with their own equations to 1.3e-10.
const IMAGE_TOLERANCE: f64 = 1e-9;
/// Gradient, relative L2: the official one agrees with its own equations to 3e-10 in x, y and colours, 6e-9 in z.
const GRADIENT_TOLERANCE: f64 = 1e-8;

/// An npz file of the reference.
struct Archive(PathBuf);

impl Archive {
    /// `None`, with a line that says so, where the reference is not there.
    fn open(name: &str) -> Option<Self> {
        let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/reference").join(name);
        if !path.exists() {
            println!("SKIPPED: {} is not there, nothing was tested", path.display());
            return None;
        }
        Some(Self(path))
    }

    fn array<T: npyz::Deserialize>(&self, key: &str) -> (Vec<usize>, Vec<T>) {
        let mut npz = npyz::npz::NpzArchive::open(&self.0).expect("an npz file");
        let array = npz.by_name(key).expect("readable").unwrap_or_else(|| panic!("no {key} in {}", self.0.display()));
        let shape = array.shape().iter().map(|&n| n as usize).collect();
        (shape, array.into_vec().unwrap_or_else(|e| panic!("{key}: {e}")))
    }

    fn f64s(&self, key: &str) -> Vec<f64> {
        self.array(key).1
    }

    fn f32s(&self, key: &str) -> Vec<f32> {
        self.array(key).1
    }

    fn json(&self, key: &str) -> serde_json::Value {
        serde_json::from_str(&self.array::<String>(key).1[0]).expect("JSON")
    }
}

fn rows<const N: usize>(values: &[f32]) -> Vec<[f32; N]> {
    values.chunks_exact(N).map(|row| row.try_into().unwrap()).collect()
}

/// The largest absolute difference; infinite for different lengths and where either is not a number.
fn max_difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// |a - b| / |b|; infinite for different lengths.
fn relative_l2(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let difference: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    let size: f64 = b.iter().map(|b| b * b).sum();
    if difference.is_finite() { (difference / size.max(1e-300)).sqrt() } else { f64::INFINITY }
}

#[test]
fn comparisons_fail_on_wrong_answers() {
    let right = [0.0, 1.0, -2.0];
    assert_eq!(max_difference(&right, &right), 0.0);
    assert_eq!(max_difference(&right, &[0.0, 1.0, -2.5]), 0.5);
    assert_eq!(max_difference(&right, &right[..2]), f64::INFINITY);
    assert_eq!(max_difference(&right, &[0.0, f64::NAN, -2.0]), f64::INFINITY);
    assert_eq!(relative_l2(&right, &right), 0.0);
    assert!((relative_l2(&[0.0, 2.0, -4.0], &right) - 1.0).abs() < 1e-15);
    assert_eq!(relative_l2(&[0.0, f64::NAN, 0.0], &right), f64::INFINITY);
    assert_eq!(relative_l2(&right, &[]), f64::INFINITY);
}

/// A recorded case: scene, cameras, settings as the official run had them.
struct Case {
    archive: Archive,
    scene: Scene,
    cameras: Vec<Camera>,
    settings: Settings,
}

impl Case {
    fn open(name: &str) -> Option<Self> {
        let archive = Archive::open(name)?;
        let options = archive.json("options");
        let settings = settings(&options, &archive.json("effective_f32_options"));
        let surface = options["texture_type"] == "surface";
        let (shape, vertices) = archive.array::<f32>("face_vertices");
        let colors = archive.f32s("textures");
        let (vertices, colors) = (vertices.chunks(vertices.len() / shape[0]), colors.chunks(colors.len() / shape[0]));
        let meshes = vertices.zip(colors).map(|(v, c)| soup(v, c, surface)).collect::<Vec<_>>();
        let cameras = vec![Camera::screen(); meshes.len()];
        Some(Self { archive, scene: Scene::batch(meshes), cameras, settings })
    }

    /// `[B, 4, H, W]` of the official renderer as colour `[B, H, W, 3]` and silhouette `[B, H, W]`.
    fn planes(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        split_planes(values, (self.settings.width * self.settings.height) as usize)
    }

    fn official_image(&self) -> (Vec<f64>, Vec<f64>) {
        self.planes(&self.archive.f64s("soft_colors"))
    }

    fn upstream(&self) -> Upstream {
        let values: Vec<f64> = self.archive.f32s("grad_soft_colors").into_iter().map(f64::from).collect();
        let (color, silhouette) = self.planes(&values);
        Upstream { d_color: Some(color), d_silhouette: Some(silhouette), ..Upstream::default() }
    }
}

fn split_planes(values: &[f64], pixels: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut color, mut silhouette) = (Vec::new(), Vec::new());
    for view in values.chunks(4 * pixels) {
        color.extend((0..pixels).flat_map(|i| [view[i], view[pixels + i], view[2 * pixels + i]]));
        silhouette.extend_from_slice(&view[3 * pixels..]);
    }
    (color, silhouette)
}

/// Triangles that share no vertex, given on the screen.
fn soup(vertices: &[f32], colors: &[f32], surface: bool) -> Mesh {
    let positions = rows::<3>(vertices);
    let faces = positions.len() as u32 / 3;
    let triangles = (0..faces).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let colors = rows::<3>(colors);
    let appearance = if surface {
        let resolution = ((colors.len() as u32 / faces) as f64).sqrt() as u32;
        Appearance::Surface { resolution, texels: colors }
    } else {
        Appearance::VertexColors(colors)
    };
    Mesh::new(positions, triangles).unwrap().with_appearance(appearance).unwrap()
}

fn settings(options: &serde_json::Value, effective: &serde_json::Value) -> Settings {
    let number = |key: &str| effective[key].as_f64().unwrap();
    let size = options["image_size"].as_u64().unwrap() as u32;
    let back_too = options["fill_back"].as_bool().unwrap();
    Settings {
        width: size,
        height: size,
        sigma: number("sigma_val"),
        gamma: number("gamma_val"),
        epsilon: effective_epsilon(number("eps"), number("gamma_val")),
        // The official threshold is ln(1/τ - 1) rounded to float32.
        tau: 1.0 / (1.0 + number("dist_cutoff").exp()),
        near: number("near"),
        far: number("far"),
        color: match options["aggr_func_rgb"].as_str() {
            Some("softmax") => ColorAggregation::Softmax,
            Some("hard") => ColorAggregation::Hard,
            other => panic!("aggr_func_rgb {other:?}"),
        },
        silhouette: match options["aggr_func_alpha"].as_str() {
            Some("prod") => SilhouetteAggregation::Product,
            Some("sum") => SilhouetteAggregation::Sum,
            Some("hard") => SilhouetteAggregation::Hard,
            other => panic!("aggr_func_alpha {other:?}"),
        },
        distance: match options["dist_func"].as_str() {
            Some("euclidean") => Distance::Euclidean,
            Some("barycentric") => Distance::Barycentric,
            Some("hard") => Distance::Hard,
            other => panic!("dist_func {other:?}"),
        },
        background_color: [0, 1, 2].map(|k| options["background_color"][k].as_f64().unwrap()),
        faces: if back_too { Faces::Both } else { Faces::Front },
        front_face: FrontFace::Clockwise,
        parity: Parity::Official,
        ..Settings::default()
    }
}

/// The official sum starts at exp(ε/γ) with the maximum at ε, and takes that one exponential in float32.
fn effective_epsilon(epsilon: f64, gamma: f64) -> f64 {
    let start = f64::from((epsilon as f32 / gamma as f32).exp());
    (epsilon + gamma * start.ln()) / 2.0
}

fn check_image(name: &str, frame: &ReferenceFrame, official: &(Vec<f64>, Vec<f64>), tolerance: f64) {
    let color = max_difference(&frame.color, &official.0);
    let silhouette = max_difference(&frame.silhouette, &official.1);
    println!("{name}: colour {color:.2e}, silhouette {silhouette:.2e}");
    assert!(color <= tolerance && silhouette <= tolerance, "{name}: colour {color:e}, silhouette {silhouette:e}");
}

fn check_forward(name: &str, brute_force: bool) {
    let Some(case) = Case::open(name) else { return };
    let frame = if brute_force {
        render(&case.scene, &case.cameras, &case.settings, Truncation::Tau).unwrap()
    } else {
        render_culled(&case.scene, &case.cameras, &case.settings).unwrap()
    };
    check_image(name, &frame, &case.official_image(), IMAGE_TOLERANCE);
}

fn check_gradient(name: &str) {
    let Some(case) = Case::open(name) else { return };
    let ours = gradient(&case.scene, &case.cameras, &case.settings, &case.upstream(), GradientMode::Paper).unwrap();
    let meshes = 0..case.scene.meshes.len();
    let positions: Vec<f64> = meshes.clone().flat_map(|m| ours.positions(m).to_vec()).collect();
    let textures: Vec<f64> = meshes.flat_map(|m| [ours.colors(m), ours.surface_texels(m)].concat()).collect();
    let official = case.archive.f64s("grad_face_vertices");
    let axes = |values: &[f64], wanted: &[usize]| -> Vec<f64> {
        values.chunks(3).flat_map(|p| wanted.iter().map(|&k| p[k])).collect()
    };
    let xy = relative_l2(&axes(&positions, &[0, 1]), &axes(&official, &[0, 1]));
    let z = relative_l2(&axes(&positions, &[2]), &axes(&official, &[2]));
    let texture = relative_l2(&textures, &case.archive.f64s("grad_textures"));
    println!("{name}: gradient x, y {xy:.2e}, z {z:.2e}, textures {texture:.2e}");
    let worst = xy.max(z).max(texture);
    assert!(worst <= GRADIENT_TOLERANCE, "{name}: x, y {xy:e}, z {z:e}, textures {texture:e}");
}

macro_rules! parity {
    ($($test:ident, $file:literal, brute force: $brute:literal;)*) => {
        mod image {
            $(#[test] fn $test() { super::check_forward($file, $brute); })*
        }
        mod gradients {
            $(#[test] fn $test() { super::check_gradient($file); })*
        }
    };
}

parity! {
    tiny_s1e5_g1e4, "tiny_s1e-05_g0.0001.npz", brute force: true;
    tiny_s1e4_g1e4, "tiny_s0.0001_g0.0001.npz", brute force: true;
    tiny_s1e4_g1e2, "tiny_s0.0001_g0.01.npz", brute force: true;
    tiny_s1e3_g1e2, "tiny_s0.001_g0.01.npz", brute force: true;
    alpha_sum, "tiny_mode_alpha_sum.npz", brute force: true;
    barycentric, "tiny_mode_barycentric.npz", brute force: true;
    batch_of_two, "tiny_mode_batch2.npz", brute force: true;
    near_and_far, "tiny_mode_nearfar.npz", brute force: true;
    no_fill_back, "tiny_mode_no_fill_back.npz", brute force: true;
    hard_color, "tiny_mode_silhouette_hard_rgb.npz", brute force: true;
    sphere_s1e4, "sphere_s0.0001_g0.0001.npz", brute force: true;
    sphere_s1e3, "sphere_s0.001_g0.01.npz", brute force: true;
    spot, "spot_s0.0001_g0.0001.npz", brute force: false;
}

/// Calls `visit(triangle, pixel, b)` with the barycentrics b of each pixel in reach of each triangle's box.
fn visit_pairs(vertices: &[f32], settings: &Settings, mut visit: impl FnMut(usize, usize, [f64; 3])) {
    let (width, height) = (settings.width as usize, settings.height as usize);
    let reach = (settings.sigma * settings.cutoff()).sqrt();
    let x = |column: usize| (2.0 * column as f64 + 1.0 - width as f64) / height as f64;
    let y = |row: usize| (height as f64 - 1.0 - 2.0 * row as f64) / height as f64;
    for (triangle, values) in vertices.chunks_exact(9).enumerate() {
        let p: [[f64; 2]; 3] = std::array::from_fn(|k| [values[3 * k], values[3 * k + 1]].map(f64::from));
        let near =
            |axis: usize, x: f64| p.iter().any(|p| p[axis] <= x + reach) && p.iter().any(|p| p[axis] >= x - reach);
        let doubled =
            |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let area = doubled(p[0], p[1], p[2]);
        for row in (0..height).filter(|&row| near(1, y(row))) {
            for column in (0..width).filter(|&column| near(0, x(column))) {
                let pixel = [x(column), y(row)];
                let b = [doubled(p[1], p[2], pixel), doubled(p[2], p[0], pixel), doubled(p[0], p[1], pixel)];
                visit(triangle, row * width + column, b.map(|b| b / area));
            }
        }
    }
}

/// Pixels where the official surface lookup is decided by rounding: a triangle within reach whose clipped b̂₂ is 0, so
/// that b̂₀ + b̂₁ = 1 lies exactly on a border of cells (and b̂₀ or b̂₁ = 1 indexes past its row).
fn undecided_cells(vertices: &[f32], settings: &Settings) -> Vec<bool> {
    let mut undecided = vec![false; (settings.width * settings.height) as usize];
    // Not above is also where a triangle without area gives NaN.
    visit_pairs(vertices, settings, |_, pixel, b| {
        undecided[pixel] |= b[2].partial_cmp(&1e-9) != Some(Ordering::Greater)
    });
    undecided
}

/// Triangles none of whose pixels has b̂₁ = 1, which the official lookup takes out of the triangle.
fn lookups_in_row(vertices: &[f32], settings: &Settings) -> Vec<bool> {
    let mut good = vec![true; vertices.len() / 9];
    visit_pairs(vertices, settings, |triangle, _, b| good[triangle] &= b[0] > 0.0 || b[2] > 0.0);
    good
}

/// The values of an RGB image at the pixels that are not masked.
fn unmasked(color: &[f64], masked: &[bool]) -> Vec<f64> {
    let pixels = color.chunks(3).zip(masked).filter(|(_, masked)| !**masked);
    pixels.flat_map(|(pixel, _)| pixel.to_vec()).collect()
}

#[test]
fn surface_r4() {
    let Some(case) = Case::open("tiny_mode_surface_R4.npz") else { return };
    let frame = render(&case.scene, &case.cameras, &case.settings, Truncation::Tau).unwrap();
    let official = case.official_image();
    let undecided = undecided_cells(&case.archive.f32s("face_vertices"), &case.settings);
    let compared = undecided.iter().filter(|u| !**u).count();
    let color = max_difference(&unmasked(&frame.color, &undecided), &unmasked(&official.0, &undecided));
    println!("surface R = 4: colour {color:.2e} on {compared} of {} pixels", undecided.len());
    assert!(color < IMAGE_TOLERANCE && compared > 512, "{color:e} on {compared}");
    assert!(max_difference(&frame.silhouette, &official.1) < IMAGE_TOLERANCE);
    // Which cell gets a texel's gradient is undecided alike, how much all of them get is not.
    let ours = gradient(&case.scene, &case.cameras, &case.settings, &case.upstream(), GradientMode::Paper).unwrap();
    let official = case.archive.f64s("grad_textures");
    let sum = |texels: &[f64]| [0, 1, 2].map(|c| texels.iter().skip(c).step_by(3).sum::<f64>());
    let decided = lookups_in_row(&case.archive.f32s("face_vertices"), &case.settings);
    let faces =
        ours.surface_texels(0).chunks(48).zip(official.chunks(48)).zip(&decided).filter(|(_, decided)| **decided);
    let differences: Vec<f64> = faces.map(|((a, b), _)| relative_l2(&sum(a), &sum(b))).collect();
    let worst = differences.iter().fold(0.0, |worst: f64, &d| worst.max(d));
    println!("surface R = 4: texel gradient summed by face {worst:.2e} on {} faces", differences.len());
    assert!(worst < GRADIENT_TOLERANCE && differences.len() >= 3, "{differences:?}");
}

#[test]
fn render_demo() {
    let Some(archive) = Archive::open("spot_demo_render.npz") else { return };
    let light = archive.f32s("light");
    let unlit: Vec<u16> = archive.array("textures_unlit_u16").1;
    let lit: Vec<f32> = unlit.iter().enumerate().map(|(i, &t)| f32::from(t) / 65535.0 * light[i / 75]).collect();
    let vertices = archive.f32s("face_vertices");
    let scene = Scene::new(soup(&vertices, &lit, true));
    let settings = Settings { parity: Parity::Official, ..Settings::default() };
    let frame = render_culled(&scene, &[Camera::screen()], &settings).unwrap();
    let image: Vec<f64> = archive.f32s("image").into_iter().map(f64::from).collect();
    let (color, silhouette) = split_planes(&image, 256 * 256);
    let undecided = undecided_cells(&vertices, &settings);
    let (ours, official) = (unmasked(&frame.color, &undecided), unmasked(&color, &undecided));
    let mean = ours.iter().zip(&official).map(|(a, b)| (a - b).abs()).sum::<f64>() / ours.len() as f64;
    let inside = undecided.iter().zip(&silhouette).filter(|(u, a)| !**u && **a > 0.5).count();
    println!("render demo: mean colour difference {mean:.2e}, {inside} pixels of the object compared");
    // Textures were stored to 16 bits.
    assert!(mean < 2e-5 && inside > 100, "{mean:e} on {inside}");
    let worst = max_difference(&frame.silhouette, &silhouette);
    assert!(worst < 1e-6, "silhouette {worst:e}");
}
