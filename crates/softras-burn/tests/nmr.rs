//! The approximate gradient of hard images (Kato et al. 2018), by hand, by moves and by its bits.
#![allow(clippy::unwrap_used)]

use burn::tensor::{Device, Tensor, TensorData};
use softras::glam::DVec3;
use softras::scene::{Appearance, ColorAggregation, Distance, Outputs, SilhouetteAggregation};
use softras::{Camera, Mesh, Projection, Renderer, Scene, Settings, shapes};
use softras_burn::{Inputs, SoftRas, Views, packed_positions};

/// Pixels along the image's side.
const SIDE: usize = 8;
/// What the distance grows by: 1e-3 of half the image.
const LEAST: f32 = 4e-3;
const SILHOUETTE: Outputs = Outputs::SILHOUETTE;

/// A camera whose world units are pixels of an image of so many.
fn orthographic(side: usize) -> Camera {
    let projection = Projection::Orthographic { half_height: 0.5 * side as f64 };
    Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, projection).unwrap()
}

/// A mesh whose vertices lie at these columns and rows, in this height above the image.
fn mesh(places: &[[f32; 3]]) -> Mesh {
    let half = SIDE as f32 / 2.0 - 0.5;
    let positions = places.iter().map(|[column, row, height]| [column - half, half - row, *height]).collect();
    let triangles = (0..places.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh::new(positions, triangles).unwrap()
}

fn views(mesh: Mesh, outputs: Outputs) -> Views {
    let settings = Settings { width: SIDE as u32, height: SIDE as u32, outputs, ..Settings::default() };
    Views { scene: Scene::new(mesh), cameras: vec![orthographic(SIDE)], settings }
}

/// The silhouette as its pixels, and the gradient by columns and rows, of a loss with this gradient by the silhouette.
fn gradient(softras: &SoftRas, views: &Views, upstream: &[f32]) -> (Vec<f32>, Vec<[f32; 2]>) {
    let device = Device::flex().autodiff();
    let positions = packed_positions(&views.scene, &device).require_grad();
    let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
    let silhouette = softras.render_hard(views, &inputs).unwrap().silhouette.unwrap();
    let shape = silhouette.dims();
    let upstream = Tensor::<3>::from_data(TensorData::new(upstream.to_vec(), shape), &device);
    let gradients = (silhouette.clone() * upstream).sum().backward();
    softras.take_fault().unwrap();
    let gradient: Vec<f32> = positions.grad(&gradients).unwrap().try_into_vec_as().unwrap();
    assert!(gradient.iter().all(|x| x.is_finite()));
    let pixels = silhouette.try_into_vec_as().unwrap();
    (pixels, gradient.as_chunks().0.iter().map(|&[x, y, _]| [x, -y]).collect())
}

fn softras() -> SoftRas {
    SoftRas::new(Renderer::new().unwrap())
}

fn at(column: usize, row: usize, value: f32) -> Vec<f32> {
    let mut upstream = vec![0.0; SIDE * SIDE];
    upstream[row * SIDE + column] = value;
    upstream
}

/// Its right edge crosses row 2 at column 3.5, three eighths of the way down, and its upper left one at 1.25.
const TRIANGLE: [[f32; 3]; 3] = [[3.5, 0.5, 0.0], [3.5, 4.5, 0.0], [0.5, 2.5, 0.0]];

fn is_near(found: &[[f32; 2]], expected: &[[f32; 2]]) {
    let far = found.iter().flatten().zip(expected.iter().flatten()).any(|(a, b)| (a - b).abs() > 1e-5);
    assert!(!far && found.len() == expected.len(), "{found:?}, expected {expected:?}");
}

#[test]
fn a_pixel_that_should_be_covered_pulls_the_edge_that_faces_it() {
    let softras = softras();
    // Pixel (6, 2) lies 2.5 pixels beyond the edge, which the upper end moves by 5/8 and the lower one by 3/8 of their own way.
    let (silhouette, found) = gradient(&softras, &views(mesh(&TRIANGLE), SILHOUETTE), &at(6, 2, -1.0));
    assert_eq!((silhouette[2 * SIDE + 3], silhouette[2 * SIDE + 4]), (1.0, 0.0));
    is_near(&found, &[[-1.0 / (4.0 + LEAST), 0.0], [-1.0 / (20.0 / 3.0 + LEAST), 0.0], [0.0; 2]]);
    // If it should stay as it is, nothing moves.
    let (_, found) = gradient(&softras, &views(mesh(&TRIANGLE), SILHOUETTE), &at(6, 2, 1.0));
    is_near(&found, &[[0.0; 2]; 3]);
}

#[test]
fn a_covered_pixel_that_should_not_be_pushes_edges_from_both_sides() {
    let softras = softras();
    // Along row 2 the right edge has 1.5 pixels to go and the upper left one, a quarter of the way up, 0.75.
    let (_, found) = gradient(&softras, &views(mesh(&TRIANGLE), SILHOUETTE), &at(2, 2, 1.0));
    let columns: Vec<[f32; 2]> = found.iter().map(|&[column, _]| [column, 0.0]).collect();
    let upper = 1.0 / (2.4 + LEAST) - 1.0 / (3.0 + LEAST);
    is_near(&columns, &[[upper, 0.0], [1.0 / (4.0 + LEAST), 0.0], [-1.0 / (1.0 + LEAST), 0.0]]);
    // Along column 2 the upper left edge, half of the way up, crosses at row 1.5, and the lower left one at row 3.5.
    let rows: Vec<[f32; 2]> = found.iter().map(|&[_, row]| [0.0, row]).collect();
    let (above, below) = (1.0 / (0.5 / 0.5 + LEAST), 1.0 / (1.5 / 0.5 + LEAST));
    is_near(&rows, &[[0.0, -above], [0.0, below], [0.0, below - above]]);
    let (_, found) = gradient(&softras, &views(mesh(&TRIANGLE), SILHOUETTE), &at(2, 2, -1.0));
    is_near(&found, &[[0.0; 2]; 3]);
}

#[test]
fn what_is_hidden_has_no_gradient() {
    let softras = softras();
    // The same triangle, behind a larger one.
    let front = [[-9.0, -9.0, 1.0], [5.5, -9.0, 1.0], [5.5, 20.0, 1.0]];
    let both = mesh(&[TRIANGLE, front].concat());
    let (silhouette, found) = gradient(&softras, &views(both, SILHOUETTE), &at(6, 2, -1.0));
    assert_eq!((silhouette[2 * SIDE + 5], silhouette[2 * SIDE + 6]), (1.0, 0.0));
    is_near(&found[..3], &[[0.0; 2]; 3]);
    assert!(found[4][0] < 0.0 && found[5][0] < 0.0, "{found:?}");
}

#[test]
fn some_move_against_the_gradient_lessens_the_loss() {
    let softras = softras();
    // A sphere that should lie elsewhere.
    const SIDE: usize = 32;
    let sphere = |column: f32, row: f32, radius: f32| {
        let mesh = shapes::icosphere(1).unwrap();
        let positions = mesh.positions().iter().map(|&[x, y, z]| [radius * x + column, radius * y - row, z]).collect();
        Mesh::new(positions, mesh.triangles().to_vec()).unwrap()
    };
    let of = |mesh: Mesh| {
        let views = views(mesh, SILHOUETTE);
        let settings = Settings { width: SIDE as u32, height: SIDE as u32, ..views.settings };
        Views { settings, cameras: vec![orthographic(SIDE)], ..views }
    };
    let (target, _) = gradient(&softras, &of(sphere(3.2, 1.3, 7.5)), &[0.0; SIDE * SIDE]);
    let start = of(sphere(-2.1, -0.4, 8.2));
    let (silhouette, _) = gradient(&softras, &start, &[0.0; SIDE * SIDE]);
    let upstream: Vec<f32> = silhouette.iter().zip(&target).map(|(a, b)| 2.0 * (a - b)).collect();
    let (_, found) = gradient(&softras, &start, &upstream);
    let loss = |mesh: Mesh| {
        let (silhouette, _) = gradient(&softras, &of(mesh), &[0.0; SIDE * SIDE]);
        silhouette.iter().zip(&target).map(|(a, b)| (a - b).powi(2)).sum::<f32>()
    };
    let now = loss(start.scene.meshes[0].clone());
    let longest = found.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f32::max);
    let moved = |by: f32| {
        let mut mesh = start.scene.meshes[0].clone();
        let step = |(&[x, y, z], &[column, row]): (&[f32; 3], &[f32; 2])| {
            [x - by * column / longest, y + by * row / longest, z]
        };
        mesh.set_positions(mesh.positions().iter().zip(&found).map(step).collect()).unwrap();
        loss(mesh)
    };
    assert!(longest > 0.0 && now > 50.0, "{longest} {now}");
    assert!(moved(1.0) < now && moved(2.0) < moved(1.0), "{now} {} {}", moved(1.0), moved(2.0));
    assert!(moved(-1.0) > now, "{now} {}", moved(-1.0));
}

#[test]
fn colors_have_the_exact_gradient_and_positions_the_same_bits_every_time() {
    let device = Device::flex().autodiff();
    let mesh = shapes::icosphere(2).unwrap();
    let colors: Vec<[f32; 3]> = mesh.positions().iter().map(|p| p.map(|x| 0.5 + 0.4 * x)).collect();
    let flat: Vec<f32> = colors.as_flattened().to_vec();
    let mesh = mesh.with_appearance(Appearance::VertexColors(colors)).unwrap();
    let perspective = Projection::Perspective { fov_y: 1.0 };
    let cameras = [0.0, 100.0].map(|azimuth| Camera::from_angles(2.732, 30.0, azimuth, perspective).unwrap());
    let outputs = Outputs { color: true, ..SILHOUETTE };
    let settings = Settings { width: 48, height: 32, outputs, ..Settings::default() };
    let views = Views { scene: Scene::batch(vec![mesh.clone(), mesh]), cameras: cameras.to_vec(), settings };
    let hard = Settings {
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        distance: Distance::Hard,
        ..views.settings.clone()
    };
    let exact = Views { settings: hard, ..views.clone() };
    let softras = softras();
    let run = |hard: bool| {
        let positions = packed_positions(&views.scene, &device).require_grad();
        let rows = 2 * flat.len() / 3;
        let colors = Tensor::<2>::from_data(TensorData::new([&flat[..], &flat[..]].concat(), [rows, 3]), &device);
        let colors = colors.require_grad();
        let inputs = Inputs { positions: Some(positions.clone()), colors: Some(colors.clone()), ..Inputs::default() };
        let images = if hard { softras.render_hard(&views, &inputs) } else { softras.render(&exact, &inputs) }.unwrap();
        let loss = (images.color.unwrap() - 0.3).powf_scalar(2.0).sum() - images.silhouette.unwrap().sum();
        let value: f32 = loss.clone().into_scalar();
        let gradients = loss.backward();
        softras.take_fault().unwrap();
        let host = |of: &Tensor<2>| of.grad(&gradients).unwrap().try_into_vec_as::<f32>().unwrap();
        (value, host(&positions), host(&colors))
    };
    let (value, by_positions, by_colors) = run(true);
    let again = run(true);
    assert_eq!((value, &by_positions, &by_colors), (again.0, &again.1, &again.2));
    assert!(by_positions.iter().all(|x| x.is_finite()) && by_positions.iter().any(|x| *x != 0.0));
    let exact = run(false);
    assert_eq!((exact.0, exact.2), (value, by_colors));
    assert!(exact.1 != by_positions);

    // What has no such gradient is refused.
    let deep = Settings { outputs: Outputs { depth: true, ..SILHOUETTE }, ..views.settings.clone() };
    let inputs = Inputs { positions: Some(packed_positions(&views.scene, &device)), ..Inputs::default() };
    let error = softras.render_hard(&Views { settings: deep, ..views.clone() }, &inputs).unwrap_err().to_string();
    assert!(error.contains("approximate gradient"), "{error}");
    let screen = Views { cameras: vec![Camera::screen(); 2], ..views.clone() };
    assert!(softras.render_hard(&screen, &inputs).unwrap_err().to_string().contains("Screen"));
}
