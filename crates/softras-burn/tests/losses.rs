//! The losses are those of the library's fits: the same values and the same gradients.
#![allow(clippy::unwrap_used)]

use burn::tensor::{Device, Tensor, TensorData};
use softras::glam::DVec3;
use softras::{Image, shapes};
use softras_burn::{Smoothness, iou_loss};
use softras_fit::Topology;
use softras_fit::{ImageLoss, Regularizer};

fn close(found: &[f32], expected: impl ExactSizeIterator<Item = f64>) {
    assert_eq!(found.len(), expected.len());
    for (i, (&found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((f64::from(found) - expected).abs() < 1e-5 + 1e-4 * expected.abs(), "{i}: {found} and {expected}");
    }
}

#[test]
fn the_iou_loss_is_the_librarys() {
    let device = Device::flex().autodiff();
    let image = |seed: usize| {
        let data: Vec<f32> = (0..2 * 6 * 5).map(|i| ((i * 7 + seed) % 11) as f32 / 11.0).collect();
        Image { batch: 2, height: 6, width: 5, channels: 1, data }
    };
    let (predicted, target) = (image(0), image(4));
    let tensor = |image: &Image| Tensor::<3>::from_data(TensorData::new(image.data.clone(), [2, 6, 5]), &device);
    let input = tensor(&predicted).require_grad();
    let loss = iou_loss(input.clone(), tensor(&target));
    let gradient: Vec<f32> = input.grad(&loss.backward()).unwrap().into_data().try_to_vec().unwrap();
    let expected = ImageLoss::NegativeIou.evaluate(&predicted, &target, None).unwrap();
    close(&[loss.into_scalar::<f32>()], [expected.value].into_iter());
    close(&gradient, expected.gradient.data.iter().map(|&x| f64::from(x)));
}

#[test]
fn smoothness_is_the_librarys() {
    let device = Device::flex().autodiff();
    let mesh = shapes::icosphere(2).unwrap();
    // A sphere with dents, and a vertex that no triangle uses.
    let dented = |p: &[f32; 3]| p.map(|x| x * (1.0 + 0.3 * (5.0 * p[0]).sin() * p[1]));
    let mut positions: Vec<[f32; 3]> = mesh.positions().iter().map(dented).collect();
    positions.push([0.3, 0.4, 0.5]);
    let count = positions.len();
    let twice: Vec<f32> = [&positions[..], &positions[..]].concat().into_flattened();
    let smoothness = Smoothness::new(count, mesh.triangles(), &device).unwrap();
    let topology = Topology::new(count, mesh.triangles()).unwrap();
    let exact: Vec<DVec3> = positions.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
    for regularizer in [Regularizer::Laplacian, Regularizer::Flatten] {
        let input = Tensor::<3>::from_data(TensorData::new(twice.clone(), [2, count, 3]), &device).require_grad();
        let value = match regularizer {
            Regularizer::Laplacian => smoothness.laplacian(input.clone()),
            _ => smoothness.flatten(input.clone()),
        };
        let gradient: Vec<f32> = input.grad(&value.backward()).unwrap().into_data().try_to_vec().unwrap();
        let mut expected = vec![DVec3::ZERO; count];
        // The batch holds the mesh twice, and the loss is the mean over it.
        let expected_value = regularizer.add(&topology, &exact, 0.5, &mut expected).unwrap();
        close(&[value.into_scalar::<f32>()], [expected_value].into_iter());
        let expected: Vec<f64> = expected.iter().flat_map(|v| v.to_array()).collect();
        close(&gradient, [&expected[..], &expected[..]].concat().into_iter());
    }
    assert!(Smoothness::new(3, mesh.triangles(), &device).is_err());
}
