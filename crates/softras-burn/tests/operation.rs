//! The renderer as burn's operation: the renderer's own gradients to the bit, those of differences, and its errors.
#![allow(clippy::unwrap_used)]

use burn::tensor::{Device, Tensor, TensorData};
use softras::scene::{Appearance, Background, Outputs};
use softras::{
    Camera, Error, GradientRequest, Image, ImageGradient, Mesh, Projection, Renderer, Scene, Settings, shapes,
};
use softras_burn::{Inputs, SoftRas, Views, packed_positions};

const SIZE: usize = 24;

/// A number in [-1, 1) that looks random.
fn noise(i: usize) -> f32 {
    (i as u32).wrapping_mul(2_654_435_761).wrapping_add(977).wrapping_mul(2_246_822_519) as i32 as f32 / 2_147_483_648.0
}

/// Three meshes of different sizes and appearances, each seen by a camera of its own. Surface cells are looked up without
/// interpolation, so that the images jump where cells end; with one cell a triangle they do not.
fn views(resolution: u32) -> Views {
    let colored = shapes::icosphere(1).unwrap();
    let colors = (0..colored.positions().len()).map(|i| [0, 1, 2].map(|k| 0.5 + 0.4 * noise(3 * i + k))).collect();
    let celled = shapes::cube().unwrap();
    let texels = (0..celled.triangles().len() * resolution.pow(2) as usize)
        .map(|i| [0, 1, 2].map(|k| 0.5 + 0.4 * noise(5 * i + k)))
        .collect();
    let meshes = vec![
        colored.with_appearance(Appearance::VertexColors(colors)).unwrap(),
        celled.with_appearance(Appearance::Surface { resolution, texels }).unwrap(),
        shapes::icosphere(0).unwrap().with_appearance(Appearance::Uniform([0.9, 0.2, 0.4])).unwrap(),
    ];
    let projection = Projection::Perspective { fov_y: 1.2 };
    let cameras = (0..3).map(|i| Camera::from_angles(3.0, 25.0, 50.0 * f64::from(i), projection).unwrap()).collect();
    let settings = Settings {
        width: SIZE as u32,
        height: SIZE as u32,
        sigma: 3e-3,
        gamma: 1e-2,
        tau: 1e-7,
        background: Background::Composite,
        outputs: Outputs { color: true, silhouette: true, ..Outputs::NOTHING },
        ..Settings::default()
    };
    Views { scene: Scene::batch(meshes), cameras, settings }
}

/// The values of every input as the scene has them.
fn values(views: &Views) -> [Vec<f32>; 4] {
    let meshes = &views.scene.meshes;
    let of = |get: fn(&Mesh) -> Vec<[f32; 3]>| meshes.iter().flat_map(get).flatten().collect::<Vec<f32>>();
    let colors = of(|mesh| match mesh.appearance() {
        Appearance::VertexColors(colors) => colors.clone(),
        Appearance::Uniform(color) => vec![*color],
        _ => Vec::new(),
    });
    let texels = of(|mesh| match mesh.appearance() {
        Appearance::Surface { texels, .. } => texels.clone(),
        _ => Vec::new(),
    });
    let twists = (0..6 * views.cameras.len()).map(|i| 0.1 * noise(7 * i)).collect();
    [of(|mesh| mesh.positions().to_vec()), colors, texels, twists]
}

fn inputs(values: &[Vec<f32>; 4], device: &Device) -> [Tensor<2>; 4] {
    [0, 1, 2, 3].map(|i| {
        let columns = if i == 3 { 6 } else { 3 };
        let data = TensorData::new(values[i].clone(), [values[i].len() / columns, columns]);
        Tensor::from_data(data, device).require_grad()
    })
}

fn named([positions, colors, texels, cameras]: [Tensor<2>; 4]) -> Inputs {
    Inputs { positions: Some(positions), colors: Some(colors), texels: Some(texels), cameras: Some(cameras) }
}

fn weights(channels: usize) -> Vec<f32> {
    (0..3 * SIZE * SIZE * channels).map(|i| noise(i + 1000 * channels)).collect()
}

/// Σ weight × value over both images.
fn loss(softras: &SoftRas, views: &Views, inputs: &Inputs, device: &Device) -> Tensor<1> {
    let images = softras.render(views, inputs).unwrap();
    let color = Tensor::<4>::from_data(TensorData::new(weights(3), [3, SIZE, SIZE, 3]), device);
    let silhouette = Tensor::<3>::from_data(TensorData::new(weights(1), [3, SIZE, SIZE]), device);
    (images.color.unwrap() * color).sum() + (images.silhouette.unwrap() * silhouette).sum()
}

fn gradients(softras: &SoftRas, views: &Views, tensors: &[Tensor<2>; 4], device: &Device) -> [Vec<f32>; 4] {
    let gradients = loss(softras, views, &named(tensors.clone()), device).backward();
    softras.take_fault().unwrap();
    [0, 1, 2, 3].map(|i| tensors[i].grad(&gradients).unwrap().into_data().try_to_vec().unwrap())
}

#[test]
fn gradients_are_the_renderers_to_the_bit() {
    let (views, device) = (views(2), Device::flex().autodiff());
    let mut values = values(&views);
    values[3].fill(0.0);
    let tensors = inputs(&values, &device);
    let found = gradients(&SoftRas::new(Renderer::new().unwrap()), &views, &tensors, &device);

    let mut renderer = Renderer::new().unwrap();
    let frame = renderer.render_saved(&views.scene, &views.cameras, &views.settings).unwrap();
    let image = |channels| Image { batch: 3, height: SIZE, width: SIZE, channels, data: weights(channels) };
    let upstream = ImageGradient { color: Some(image(3)), silhouette: Some(image(1)), ..ImageGradient::default() };
    let wanted = GradientRequest { colors: true, texels: true, camera: true, ..GradientRequest::default() };
    let expected = renderer.backward(&frame, &upstream, &wanted).unwrap();
    let of = |get: fn(&softras::MeshGradients) -> &[[f32; 3]]| {
        expected.meshes.iter().flat_map(get).flatten().copied().collect::<Vec<f32>>()
    };
    assert_eq!(found[0], of(|mesh| &mesh.positions));
    assert_eq!(found[1], of(|mesh| &mesh.colors));
    assert_eq!(found[2], of(|mesh| &mesh.surface_texels));
    let twists: Vec<f32> = expected.cameras.iter().flat_map(|camera| camera.twist.map(|x| x as f32)).collect();
    assert_eq!(found[3], twists);
    assert!(found.iter().all(|gradient| gradient.iter().any(|x| x.abs() > 1e-3)));
}

#[test]
fn gradients_are_those_of_differences() {
    let (views, device) = (views(1), Device::flex().autodiff());
    let values = values(&views);
    let softras = SoftRas::new(Renderer::new().unwrap());
    let found = gradients(&softras, &views, &inputs(&values, &device), &device);
    for (i, step) in [1e-3, 1e-2, 1e-2, 5e-4].into_iter().enumerate() {
        let way: Vec<f32> = (0..values[i].len()).map(|k| noise(13 * k + i)).collect();
        let at = |step: f32| {
            let mut values = values.clone();
            values[i].iter_mut().zip(&way).for_each(|(value, way)| *value += step * way);
            let loss = loss(&softras, &views, &named(inputs(&values, &device)), &device);
            f64::from(loss.into_scalar::<f32>())
        };
        let difference = (at(step) - at(-step)) / f64::from(2.0 * step);
        let along: f64 = found[i].iter().zip(&way).map(|(g, w)| f64::from(g * w)).sum();
        let size: f64 = found[i].iter().zip(&way).map(|(g, w)| f64::from(g * w).powi(2)).sum::<f64>().sqrt();
        let error = (difference - along).abs() / size;
        assert!(error < 0.03, "input {i}: {difference} and {along}, error {error}");
    }
}

#[test]
fn what_the_scene_gives_needs_no_tensor() {
    let (views, device) = (views(2), Device::flex().autodiff());
    let softras = SoftRas::new(Renderer::new().unwrap());
    let positions = packed_positions(&views.scene, &device).require_grad();
    let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
    let images = softras.render(&views, &inputs).unwrap();
    let expected = Renderer::new().unwrap().render(&views.scene, &views.cameras, &views.settings).unwrap();
    let silhouette: Vec<f32> = images.silhouette.clone().unwrap().into_data().try_to_vec().unwrap();
    assert_eq!(silhouette, expected.silhouette().unwrap().data);
    let color: Vec<f32> = images.color.unwrap().into_data().try_to_vec().unwrap();
    assert_eq!(color, expected.color().unwrap().data);
    // A loss of one image alone has the gradient of that image.
    let gradients = images.silhouette.unwrap().sum().backward();
    softras.take_fault().unwrap();
    assert!(positions.grad(&gradients).unwrap().abs().sum().into_scalar::<f32>() > 1.0);
}

#[test]
fn a_batch_of_views_of_one_mesh_adds_their_gradients() {
    let device = Device::flex().autodiff();
    let mut views = views(2);
    views.scene = Scene::new(views.scene.meshes.swap_remove(0));
    let softras = SoftRas::new(Renderer::new().unwrap());
    let mut of = |cameras: Vec<Camera>| {
        let positions = packed_positions(&views.scene, &device).require_grad();
        views.cameras = cameras;
        let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
        let gradients = softras.render(&views, &inputs).unwrap().silhouette.unwrap().sum().backward();
        softras.take_fault().unwrap();
        positions.grad(&gradients).unwrap()
    };
    let [a, b] = [0.0, 60.0]
        .map(|azimuth| Camera::from_angles(3.0, 25.0, azimuth, Projection::Perspective { fov_y: 1.2 }).unwrap());
    let difference = of(vec![a, b]) - of(vec![a]) - of(vec![b]);
    assert!(difference.abs().max().into_scalar::<f32>() < 1e-3);
}

#[test]
fn several_nodes_live_in_one_graph() {
    let (views, device) = (views(2), Device::flex().autodiff());
    let softras = SoftRas::new(Renderer::new().unwrap());
    let positions = packed_positions(&views.scene, &device).require_grad();
    let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
    let mean = |views: &Views| softras.render(views, &inputs).unwrap().silhouette.unwrap().mean();
    let other = Views { settings: Settings { width: 40, sigma: 1e-2, ..views.settings.clone() }, ..views.clone() };
    let gradient = |loss: Tensor<1>| {
        let gradients = loss.backward();
        softras.take_fault().unwrap();
        positions.grad(&gradients).unwrap()
    };
    let together = gradient(mean(&views) + mean(&other));
    let apart = gradient(mean(&views)) + gradient(mean(&other));
    assert!((together - apart).abs().max().into_scalar::<f32>() < 1e-6);
}

#[test]
fn unfit_tensors_and_gradients_are_errors() {
    let (views, device) = (views(2), Device::flex().autodiff());
    let softras = SoftRas::new(Renderer::new().unwrap());
    let refused = |inputs: &Inputs| softras.render(&views, inputs).unwrap_err().to_string();
    assert!(refused(&Inputs::default()).contains("no input tensor"));
    let short = Inputs { positions: Some(Tensor::zeros([5, 3], &device)), ..Inputs::default() };
    assert!(refused(&short).contains("positions of shape [5, 3]"));
    let nan = packed_positions(&views.scene, &device) * f32::NAN;
    let error = softras.render(&views, &Inputs { positions: Some(nan), ..Inputs::default() }).unwrap_err();
    assert!(matches!(error, Error::Mesh { .. }), "{error}");

    let positions = packed_positions(&views.scene, &device).require_grad();
    let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
    let gradients = (softras.render(&views, &inputs).unwrap().silhouette.unwrap() * f32::INFINITY).sum().backward();
    let error = softras.take_fault().unwrap_err();
    assert!(matches!(error, Error::Backward { .. }), "{error}");
    let gradient: Vec<f32> = positions.grad(&gradients).unwrap().into_data().try_to_vec().unwrap();
    assert!(gradient.iter().all(|x| x.is_nan()));
    softras.take_fault().unwrap();
}

/// The features of meshes are constants, through which positions have a gradient.
#[test]
fn features_are_the_renderers_to_the_bit() {
    let (mut views, device) = (views(2), Device::flex().autodiff());
    let with_features = |mesh: Mesh| {
        let features = (0..5 * mesh.positions().len()).map(noise).collect();
        mesh.with_features(5, features).unwrap()
    };
    views.scene.meshes = views.scene.meshes.into_iter().map(with_features).collect();
    views.settings.outputs = Outputs { features: true, ..Outputs::SILHOUETTE };
    let positions = packed_positions(&views.scene, &device).require_grad();
    let inputs = Inputs { positions: Some(positions.clone()), ..Inputs::default() };
    let softras = SoftRas::new(Renderer::new().unwrap());
    let features = softras.render(&views, &inputs).unwrap().features.unwrap();
    let mut renderer = Renderer::new().unwrap();
    let frame = renderer.render_saved(&views.scene, &views.cameras, &views.settings).unwrap();
    assert_eq!(features.clone().into_data().try_to_vec::<f32>().unwrap(), frame.features().unwrap().data);
    let weighted = features * Tensor::<4>::from_data(TensorData::new(weights(5), [3, SIZE, SIZE, 5]), &device);
    let found: Vec<f32> = positions.grad(&weighted.sum().backward()).unwrap().into_data().try_to_vec().unwrap();
    let upstream = Image { data: weights(5), ..*frame.features().unwrap() };
    let upstream = ImageGradient { features: Some(upstream), ..ImageGradient::default() };
    let expected = renderer.backward(&frame, &upstream, &GradientRequest::default()).unwrap();
    assert_eq!(
        found,
        expected.meshes.iter().flat_map(|mesh| mesh.positions.as_flattened()).copied().collect::<Vec<_>>()
    );
}
