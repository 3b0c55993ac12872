//! Losses and regularisers against central differences of themselves, and against values known by hand.

use crate::meshes::{points, topology};
use glam::DVec3;
use softras::Image;
use softras::shapes;
use softras_check::random::Random;
use softras_fit::{
    ImageLoss, LossGradient, Regularizer, Topology, blurred, blurred_gradient, mask_iou, pooled, pooled_gradient,
};

const LOSSES: [ImageLoss; 3] = [ImageLoss::NegativeIou, ImageLoss::L1, ImageLoss::L2];

const REGULARIZERS: [Regularizer; 3] = [Regularizer::Laplacian, Regularizer::Flatten, Regularizer::NormalConsistency];

fn image(random: &mut Random, channels: usize) -> Image {
    let (batch, height, width) = (2, 5, 7);
    let data = (0..batch * height * width * channels).map(|_| random.range(0.0, 1.0) as f32).collect();
    Image { batch, height, width, channels, data }
}

/// Whether a gradient agrees with the differences of its function; `step` is that of an argument.
///
/// # Errors
/// The worst component.
fn agrees(gradient: &[f64], step: f64, tolerance: f64, value: impl Fn(usize, f64) -> f64) -> Result<(), String> {
    let scale = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs()));
    for (i, g) in gradient.iter().enumerate() {
        let difference = (value(i, step) - value(i, -step)) / (2.0 * step);
        if !difference.is_finite() || (g - difference).abs() > tolerance * scale.max(1e-12) {
            return Err(format!("component {i} of {}: {g} where differences give {difference}", gradient.len()));
        }
    }
    Ok(())
}

/// One loss at random images; the gradient that is checked is its own times `factor`.
fn check_loss(
    seed: u64,
    channels: usize,
    weighted: bool,
    evaluate: impl Fn(&Image, &Image, Option<&Image>) -> LossGradient,
    factor: f64,
) -> Result<(), String> {
    let mut random = Random::new(seed);
    let [prediction, target] = [image(&mut random, channels), image(&mut random, channels)];
    let mut weights = image(&mut random, 1);
    weights.data.iter_mut().step_by(3).for_each(|w| *w = 0.0);
    let weights = weighted.then_some(&weights);
    let valued = evaluate(&prediction, &target, weights);
    let gradient: Vec<f64> = valued.gradient.data.iter().map(|&g| factor * f64::from(g)).collect();
    // A power of two: the change of an f32 near 1 is exact.
    agrees(&gradient, 1.0 / 1024.0, 2e-3, |i, h| {
        let mut moved = prediction.clone();
        moved.data[i] = ((f64::from(moved.data[i]) * 1024.0).round() / 1024.0 + h) as f32;
        // Losses are smooth enough for the argument to be rounded to the step's grid.
        evaluate(&moved, &target, weights).value
    })
}

fn on_grid(image: &mut Image) {
    image.data.iter_mut().for_each(|x| *x = (*x * 1024.0).round() / 1024.0);
}

#[test]
fn image_losses_have_their_gradients() {
    for loss in LOSSES {
        for (channels, weighted) in [(1, false), (1, true), (3, true), (3, false)] {
            let evaluate = |p: &Image, t: &Image, w: Option<&Image>| {
                let mut p = p.clone();
                on_grid(&mut p);
                loss.evaluate(&p, t, w).unwrap()
            };
            let what = format!("{loss:?}, {channels} channels, weighted {weighted}");
            check_loss(7, channels, weighted, evaluate, 1.0).unwrap_or_else(|e| panic!("{what}: {e}"));
            let wrong = check_loss(7, channels, weighted, evaluate, 1.02);
            assert!(wrong.is_err(), "{what}: a gradient 2 % too long is not seen");
        }
    }
}

#[test]
fn image_losses_have_the_values_of_their_formulas() {
    let of = |data: &[f32]| Image { batch: 1, height: 1, width: data.len(), channels: 1, data: data.to_vec() };
    let (p, t) = (of(&[0.5, 1.0, 0.0, 0.25]), of(&[1.0, 1.0, 0.0, 0.0]));
    let value = |loss: ImageLoss, w: Option<&Image>| loss.evaluate(&p, &t, w).unwrap().value;
    // Intersection 1.5, union 1 + 1 + 0 + 0.25.
    assert!((value(ImageLoss::NegativeIou, None) - (1.0 - 1.5 / 2.250_001)).abs() < 1e-12);
    assert!((value(ImageLoss::L1, None) - 0.75 / 4.0).abs() < 1e-12);
    assert!((value(ImageLoss::L2, None) - (0.25 + 0.0625) / 4.0).abs() < 1e-12);
    let mask = of(&[0.0, 1.0, 1.0, 2.0]);
    assert!((value(ImageLoss::L1, Some(&mask)) - 2.0 * 0.25 / 4.0).abs() < 1e-12);
    assert_eq!(mask_iou(&p, &t).unwrap(), [0.5]);
    assert_eq!(mask_iou(&of(&[0.0]), &of(&[0.2])).unwrap(), [1.0]);
    // One half is not above one half.
    assert_eq!(mask_iou(&of(&[0.5, 1.0, 1.0]), &of(&[1.0, 0.5, 1.0])).unwrap(), [1.0 / 3.0]);
    assert_eq!(mask_iou(&of(&[0.5, 1.0, 0.0]), &of(&[0.0, 1.0, 0.5])).unwrap(), [1.0]);
    // Each view and each value has its own weight.
    let views = |data: &[f32]| Image { batch: 2, height: 1, width: 2, channels: 1, data: data.to_vec() };
    let (half, ones) = (views(&[0.5; 4]), views(&[1.0; 4]));
    let valued = ImageLoss::NegativeIou.evaluate(&half, &ones, Some(&views(&[1.0, 1.0, 0.0, 3.0]))).unwrap();
    assert!((valued.value - (0.5 * (1.0 - 1.0 / 2.000_001) + 0.5 * (1.0 - 1.5 / 3.000_001))).abs() < 1e-9);
    assert_eq!((valued.gradient.data[2], valued.gradient.data[0] < 0.0), (0.0, true));
    let rgb = |data: &[f32]| Image { batch: 1, height: 1, width: 2, channels: 3, data: data.to_vec() };
    let (zero, steps) = (rgb(&[0.0; 6]), rgb(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let weights = Image { channels: 1, data: vec![1.0, 3.0], ..steps };
    let weighted = ImageLoss::L1.evaluate(&steps, &zero, Some(&weights)).unwrap().value;
    assert!((weighted - (6.0 + 3.0 * 15.0) / 12.0).abs() < 1e-9, "{weighted}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let mut random = Random::new(3);
    let (one, three) = (image(&mut random, 1), image(&mut random, 3));
    let message = |loss: ImageLoss, w: Option<&Image>| loss.evaluate(&one, &one, w).unwrap_err().to_string();
    assert!(ImageLoss::L2.evaluate(&one, &three, None).is_err());
    assert!(message(ImageLoss::L2, Some(&three)).contains("one weight a pixel"));
    let masked = Image { data: vec![0.0; one.data.len()], ..one.clone() };
    assert!(message(ImageLoss::L2, Some(&masked)).contains("mask"));
    assert!(
        message(ImageLoss::L2, Some(&Image { data: masked.data[1..].to_vec(), ..one.clone() })).contains("one weight")
    );
    let negative = Image { data: vec![-1.0; one.data.len()], ..one.clone() };
    assert!(message(ImageLoss::NegativeIou, Some(&negative)).contains("not negative"));
    let short = Image { data: one.data[1..].to_vec(), ..one.clone() };
    assert!(ImageLoss::L2.evaluate(&short, &one, None).is_err() && ImageLoss::L2.evaluate(&one, &short, None).is_err());
    assert!([-1.0, f64::INFINITY].into_iter().all(|deviation| blurred(&one, deviation).is_err()));
    assert!(pooled(&one, 0).is_err());
}

#[test]
fn pooling_and_its_transpose_are_adjoint() {
    let mut random = Random::new(5);
    for factor in [1, 2, 3] {
        let fine = image(&mut random, 3);
        let coarse = pooled(&fine, factor).unwrap();
        let mut weights = coarse.clone();
        weights.data.iter_mut().for_each(|x| *x = random.range(-1.0, 1.0) as f32);
        let pulled = pooled_gradient(&fine, &weights, factor, 1.0).unwrap();
        let dot = |a: &Image, b: &Image| -> f64 {
            a.data.iter().zip(&b.data).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        assert!((dot(&coarse, &weights) - dot(&fine, &pulled)).abs() < 1e-5, "factor {factor}");
        let whole: f64 = coarse.data.iter().map(|&x| f64::from(x)).sum();
        assert!(whole > 0.0 && coarse.width == 7usize.div_ceil(factor));
        // Every coarse pixel is the mean of the fine ones under it, fewer at the lower and right edges.
        for (at, pixel) in coarse.data.chunks_exact(3).enumerate() {
            let (row, column) = (at / coarse.width % coarse.height, at % coarse.width);
            let view = at / (coarse.width * coarse.height);
            let rows = factor * row..(factor * (row + 1)).min(fine.height);
            let columns = factor * column..(factor * (column + 1)).min(fine.width);
            let under = rows.flat_map(|r| columns.clone().map(move |c| (r, c)));
            let red: Vec<f32> = under.map(|(r, c)| fine.pixel(view, r, c)[0]).collect();
            let mean = red.iter().sum::<f32>() / red.len() as f32;
            assert!((pixel[0] - mean).abs() < 1e-6, "factor {factor}, pixel {at}: {} for {mean}", pixel[0]);
        }
    }
}

/// A blur takes every view and channel for itself.
#[test]
fn channels_and_views_do_not_mix() {
    let mut random = Random::new(21);
    let whole = image(&mut random, 3);
    for deviation in [0.9, 1.7] {
        let soft = blurred(&whole, deviation).unwrap();
        for (view, channel) in [(0, 0), (0, 2), (1, 1)] {
            let data = whole.view(view).iter().skip(channel).step_by(3).copied().collect();
            let alone = blurred(&Image { batch: 1, channels: 1, data, ..whole }, deviation).unwrap();
            let part: Vec<f32> = soft.view(view).iter().skip(channel).step_by(3).copied().collect();
            assert_eq!(part, alone.data, "view {view}, channel {channel}");
        }
    }
}

/// A bumpy sphere, with a wall inside: three triangles meet at its edge.
fn surface(seed: u64) -> (Topology, Vec<DVec3>) {
    let mesh = shapes::icosphere(1).unwrap();
    let mut random = Random::new(seed);
    let mut bump = || DVec3::from([0; 3].map(|_| random.range(-0.2, 0.2)));
    let [a, b, _] = mesh.triangles()[0];
    let topology = Topology::new(42, &[mesh.triangles(), &[[a, b, 41]]].concat()).unwrap();
    (topology, points(&mesh).into_iter().map(|p| p + bump()).collect())
}

fn check_regularizer(regularizer: Regularizer, factor: f64) -> Result<(), String> {
    let (topology, positions) = surface(11);
    let mut gradient = vec![DVec3::ZERO; positions.len()];
    regularizer.add(&topology, &positions, 0.7 * factor, &mut gradient).unwrap();
    let flat: Vec<f64> = gradient.iter().flat_map(|g| g.to_array()).collect();
    agrees(&flat, 1e-5, 1e-6, |i, h| {
        let mut moved = positions.clone();
        moved[i / 3][i % 3] += h;
        let mut unused = vec![DVec3::ZERO; moved.len()];
        0.7 * regularizer.add(&topology, &moved, 0.0, &mut unused).unwrap()
    })
}

#[test]
fn regularizers_have_their_gradients() {
    for regularizer in REGULARIZERS {
        check_regularizer(regularizer, 1.0).unwrap_or_else(|e| panic!("{regularizer:?}: {e}"));
        assert!(check_regularizer(regularizer, 1.001).is_err(), "{regularizer:?}: a wrong gradient is not seen");
    }
}

#[test]
fn regularizers_have_the_values_of_their_formulas() {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(DVec3::from_array);
    // Two triangles at a right angle along the x axis.
    let topology = Topology::new(4, &[[0, 1, 2], [1, 0, 3]]).unwrap();
    let value = |regularizer: Regularizer, positions: &[DVec3]| {
        let mut gradient = vec![DVec3::ZERO; 4];
        let value = regularizer.add(&topology, positions, 1.0, &mut gradient).unwrap();
        assert!(gradient.iter().all(|g| g.is_finite()), "{regularizer:?}: {gradient:?}");
        let sum: DVec3 = gradient.iter().sum();
        assert!(sum.length() < 1e-9, "{regularizer:?}: moving everything changes nothing, but {sum}");
        value
    };
    assert!((value(Regularizer::Flatten, &corners) - 1.0).abs() < 1e-4);
    assert!((value(Regularizer::NormalConsistency, &corners) - 1.0).abs() < 1e-12);
    // Offsets of -(1, 1, 1) / 3, (3, -1, -1) / 3, (-1, 2, 0) / 2 and (-1, 0, 2) / 2.
    let laplacian = 3.0 / 9.0 + 11.0 / 9.0 + 2.0 * 5.0 / 4.0;
    assert!((value(Regularizer::Laplacian, &corners) - laplacian).abs() < 1e-12);
    // A triangle without area has no say beside one that has: here the second is a line.
    let line = [corners[0], corners[1], corners[2], DVec3::new(2.0, 0.0, 0.0)];
    assert_eq!(value(Regularizer::NormalConsistency, &line), 0.0);
    // A third triangle at the edge, which goes on from the first one: one pair is flat, two are at right angles. It is 2 at any scale.
    let three = Topology::new(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
    for scale in [1.0, 1e-30] {
        let scaled = [corners[0], corners[1], corners[2], corners[3], DVec3::NEG_Y].map(|corner| scale * corner);
        let found = Regularizer::NormalConsistency.add(&three, &scaled, 1.0, &mut [DVec3::ZERO; 5]).unwrap();
        assert!((found - 2.0).abs() < 1e-12, "{found}");
    }
    // Collapsed to a point nothing is infinite.
    REGULARIZERS.iter().for_each(|r| assert!(value(*r, &[DVec3::ONE; 4]).is_finite()));
    assert!(Regularizer::Laplacian.add(&topology, &corners[..3], 1.0, &mut [DVec3::ZERO; 4]).is_err());
}

#[test]
fn a_topology_knows_its_edges_and_subdivides() {
    let mesh = shapes::icosphere(1).unwrap();
    let topology = topology(&mesh);
    assert_eq!((topology.edges().len(), topology.flaps().len()), (120, 120));
    assert!((0..42).all(|i| [5, 6].contains(&topology.neighbors(i).len())) && topology.neighbors(42).is_empty());
    let finer = Topology::new(42 + 120, &topology.subdivided()).unwrap();
    assert_eq!((finer.triangles().len(), finer.edges().len(), finer.flaps().len()), (320, 480, 480));
    assert!(Topology::new(3, &[[0, 1, 3]]).is_err());
    // The official list has the first two edges of each face: of three flaps around a corner, not that which is twice last.
    let fan = Topology::new(4, &[[1, 2, 0], [2, 3, 0], [0, 3, 1]]).unwrap();
    let official: Vec<_> = fan.flaps().iter().map(|flap| (flap.edge, flap.official)).collect();
    assert_eq!(official, [([0, 1], false), ([0, 2], true), ([0, 3], true)]);
}

#[test]
fn the_transpose_of_a_blur_is_its_transpose() {
    let mut random = Random::new(9);
    let mut image = |height: usize, width: usize| Image {
        batch: 2,
        height,
        width,
        channels: 3,
        data: (0..2 * height * width * 3).map(|_| random.range(-1.0, 1.0) as f32).collect(),
    };
    let dot = |a: &Image, b: &Image| a.data.iter().zip(&b.data).map(|(a, b)| f64::from(a * b)).sum::<f64>();
    let mut error = |deviation: f64, back: f64| {
        let fine = image(13, 17);
        let soft = blurred(&fine, deviation).unwrap();
        let by_soft = image(soft.height, soft.width);
        let by_fine = blurred_gradient(&fine, &by_soft, back).unwrap();
        (dot(&soft, &by_soft) - dot(&fine, &by_fine)).abs()
    };
    for deviation in [0.0, 0.7, 2.0, 7.5] {
        assert!(error(deviation, deviation) < 1e-4, "at {deviation}");
    }
    assert!(error(2.0, 0.7) > 1e-2, "another blur is not seen");
    // A point spreads as far as it is told to, and nothing of it is lost.
    let mut point = Image { batch: 1, height: 41, width: 41, channels: 1, data: vec![0.0; 41 * 41] };
    point.data[20 * 41 + 20] = 1.0;
    let soft = blurred(&point, 2.5).unwrap();
    let moment = |power: i32| -> f64 {
        soft.data.iter().enumerate().map(|(i, x)| f64::from(*x) * ((i % 41) as f64 - 20.0).powi(power)).sum()
    };
    assert!((moment(0) - 1.0).abs() < 1e-5 && (moment(2).sqrt() - 2.5).abs() < 0.05, "{} {}", moment(0), moment(2));
    assert!(blurred(&point, f64::NAN).is_err_and(|e| e.to_string().contains("blur")));
}
