//! Every function that takes lengths, sides or counts, with absurd ones: an error, and never a panic.

use crate::common::renderer;
use proptest::prelude::*;
use softras::scene::{Appearance, Outputs, Texture, Wrap};
use softras::{Camera, Image, ImageGradient, Lights, Mesh, Projection, Settings, shapes};
use softras_fit::{
    ImageLoss, Method, Optimizer, PoseTarget, ShapeFit, ShapeOptions, Topology, Voxels, blur_factor, blurred,
    blurred_gradient, mask_iou, pooled, pooled_gradient, signed_distance, soft_target, voxel_iou,
};
use softras_io::Views;

/// A length: a small one, or one whose product with others wraps.
fn length() -> impl Strategy<Value = usize> {
    prop_oneof![
        4 => 0usize..6,
        1 => Just(usize::MAX),
        1 => Just(usize::MAX / 2 + 1),
        1 => Just(1usize << 32),
        1 => any::<usize>(),
    ]
}

/// An image whose values may be fewer or more than its shape says; now and then it is as it should be.
fn image() -> impl Strategy<Value = Image> {
    let channels = prop_oneof![3 => Just(1usize), 1 => length()];
    let shape = (length(), length(), length(), channels);
    (shape, 0usize..400, any::<bool>()).prop_map(|((batch, height, width, channels), count, whole)| {
        let product = [batch, height, width, channels].iter().try_fold(1usize, |n, &side| n.checked_mul(side));
        let count = product.filter(|&n| whole && n < 4000).unwrap_or(count);
        Image { batch, height, width, channels, data: (0..count).map(|i| (i % 7) as f32 / 6.0).collect() }
    })
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(1.0), Just(f64::NAN), Just(f64::INFINITY), Just(-1e300), Just(1e300), 0.0..20.0]
}

fn is_whole(image: &Image) -> bool {
    let shape = [image.batch, image.height, image.width, image.channels];
    let count = shape.iter().try_fold(1usize, |n, &side| n.checked_mul(side));
    count == Some(image.data.len()) && !image.data.is_empty()
}

fn camera() -> Camera {
    Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn functions_of_one_image(image in image(), factor in length(), x in number(), y in number()) {
        let whole = is_whole(&image);
        prop_assert_eq!(pooled(&image, factor).is_ok(), whole && factor > 0);
        prop_assert_eq!(blurred(&image, x).is_ok(), whole && blur_factor(x).is_ok());
        prop_assert_eq!(signed_distance(&image).is_ok(), whole && image.channels == 1);
        prop_assert!(soft_target(&image, x, y).is_err() || whole);
    }

    #[test]
    fn functions_of_two_images(a in image(), b in image(), factor in length(), x in number()) {
        let same = is_whole(&a) && is_whole(&b)
            && [a.batch, a.height, a.width, a.channels] == [b.batch, b.height, b.width, b.channels];
        prop_assert_eq!(mask_iou(&a, &b).is_ok(), same);
        for loss in [ImageLoss::NegativeIou, ImageLoss::L2] {
            prop_assert!(loss.evaluate(&a, &b, None).is_err() || same);
            prop_assert!(loss.evaluate(&a, &a, Some(&b)).is_err() || (is_whole(&a) && is_whole(&b)));
            prop_assert!(loss.evaluate(&a, &b, Some(&a)).is_err() || same);
        }
        prop_assert!(PoseTarget::new(a.clone(), b.clone()).is_err() || (is_whole(&a) && is_whole(&b)));
        prop_assert!(pooled_gradient(&a, &b, factor, x).is_err() || (is_whole(&a) && is_whole(&b)));
        prop_assert!(blurred_gradient(&a, &b, x).is_err() || (is_whole(&a) && is_whole(&b)));
        let gradient = ImageGradient { silhouette: Some(b.clone()), ..ImageGradient::color(a.clone()) };
        let rendered = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
        let checked = gradient.validate(rendered, a.batch, a.height, a.width, 0);
        prop_assert!(checked.is_err() || (is_whole(&a) && is_whole(&b)));
        let targets = Views { cameras: vec![camera(); a.batch.min(3)], silhouette: Some(a.clone()), color: Some(b), ..Views::default() };
        prop_assert!(targets.size().is_err() || is_whole(&a));
    }

    #[test]
    fn functions_of_counts(n in length(), m in length(), x in number(), side in any::<u32>()) {
        let cube = shapes::cube().unwrap();
        // Many voxels take long.
        if n > 40 {
            prop_assert_eq!(voxel_iou(&cube, &cube, n).is_ok(), n <= 512);
        }
        prop_assert!(Voxels::new(&cube, [x, 0.0, 0.0], x, n.max(513)).is_err());
        prop_assert!(Topology::new(n, &[[0, 1, side]]).is_err() || n > side as usize);
        prop_assert!(n <= 1 << 30 || Topology::new(n, &[]).is_err());
        prop_assert!(shapes::icosphere(side.max(10)).is_err());
        prop_assert!(shapes::torus(x, 0.1, side.max(5000), 3).is_err() && shapes::torus(x, 2.0 * x, 3, 3).is_err());
        prop_assert_eq!(Texture::new(side, n as u32, vec![[0.5; 3]], Wrap::Repeat).is_ok(), side == 1 && n as u32 == 1);
        let surface = Appearance::Surface { resolution: side, texels: vec![[0.5; 3]; m.min(12)] };
        prop_assert!(cube.clone().with_appearance(surface).is_err() || (side == 1 && m >= 12));
        prop_assert!(Mesh::new(vec![[0.0; 3]; n.min(9)], vec![[0, 1, side]]).is_err() || (side as usize) < n.min(9));
        let mut optimizer = Optimizer::new(Method::ADAM, 2);
        let state = (side as i32, vec![x; n.min(4)], vec![x; m.min(4)]);
        let is_state = n == 2 && m == 2 && x.is_finite() && x >= 0.0;
        prop_assert_eq!(optimizer.restore(&state), is_state && side as i32 >= 0);
    }
}

/// Fits of absurd targets, and of a template rendered with an absurd number of samples.
#[test]
fn fits_of_absurd_lengths_are_refused() {
    let mut renderer = renderer();
    let image = |batch, height, width, count| Image { batch, height, width, channels: 1, data: vec![0.5; count] };
    let targets = |image| Views { cameras: vec![camera()], silhouette: Some(image), ..Views::default() };
    let fit = |samples| {
        let options = ShapeOptions { samples, ..ShapeOptions::official() };
        ShapeFit::new(shapes::icosphere(0).unwrap(), Lights::unlit(), options)
    };
    let settings = Settings::default();
    for absurd in [image(1, 8, 8, 7), image(1, 1 << 63, 2, 0), image(1, usize::MAX, usize::MAX, 1), image(1, 0, 0, 0)] {
        let shown = format!("{:?}", [absurd.height, absurd.width]);
        let targets = targets(absurd);
        assert!(fit(1).unwrap().step(&mut renderer, &settings, &targets, 0.01, 0.01).is_err(), "{shown}");
    }
    let good = targets(image(1, 8, 8, 64));
    for samples in [usize::MAX, usize::MAX / 2, 1 << 40] {
        let step = fit(samples).and_then(|mut fit| fit.step(&mut renderer, &settings, &good, 0.01, 0.01));
        assert!(step.is_err(), "{samples} samples");
    }
}
