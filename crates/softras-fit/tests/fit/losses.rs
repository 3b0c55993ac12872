//! Properties of every loss between images.

use proptest::prelude::*;
use softras::Image;
use softras_fit::ImageLoss;

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Every loss is finite and not negative, 0 where both images are one, and its gradient is downhill.
    #[test]
    fn losses_are_distances(
        pixels in prop::collection::vec((0f32..=1.0, 0f32..=1.0, 0f32..3.0), 1..40), kind in 0usize..3,
    ) {
        let image = |data: Vec<f32>| Image { batch: 1, height: 1, width: data.len(), channels: 1, data };
        let prediction = image(pixels.iter().map(|p| p.0).collect());
        let target = image(pixels.iter().map(|p| p.1).collect());
        let weights = image(pixels.iter().map(|p| p.2).collect());
        let loss = [ImageLoss::NegativeIou, ImageLoss::L1, ImageLoss::L2][kind];
        let Ok(valued) = loss.evaluate(&prediction, &target, Some(&weights)) else {
            prop_assert!(weights.data.iter().all(|w| *w == 0.0));
            return Ok(());
        };
        prop_assert!(valued.value.is_finite() && valued.value >= 0.0, "{}", valued.value);
        prop_assert!(valued.gradient.data.iter().all(|g| g.is_finite()));
        let same = loss.evaluate(&target, &target, Some(&weights)).unwrap().value;
        // The IoU of what is half covered with itself is below 1.
        prop_assert!(kind == 0 || same == 0.0, "{same}");
        // Convex ones lie above their tangent; the other falls along it.
        let differences = prediction.data.iter().zip(&target.data).map(|(p, t)| f64::from(p - t));
        let along: f64 = valued.gradient.data.iter().zip(differences).map(|(g, d)| f64::from(*g) * d).sum();
        prop_assert!(kind == 0 || along >= valued.value - 1e-6, "{along} of {}", valued.value);
        let moved = prediction.data.iter().zip(&valued.gradient.data).map(|(p, g)| p - 1e-3 * g);
        let lower = loss.evaluate(&image(moved.collect()), &target, Some(&weights)).unwrap().value;
        prop_assert!(kind != 0 || lower <= valued.value + 1e-6, "{lower} from {}", valued.value);
    }
}
