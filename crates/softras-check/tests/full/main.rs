//! The full tier of softras-check: scenes of `softras stress` that broke a promise which said too much, each among those it
//! was drawn with.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use softras::RendererOptions;
use softras_check::stress::{Kind, Promise, Stress, batch};

fn stress() -> Stress {
    let validation = std::env::var("SOFTRAS_VALIDATION").is_ok_and(|value| value == "1");
    Stress::new(&RendererOptions { validation, ..RendererOptions::default() }).expect("a Vulkan device")
}

/// By seeds, alone or each among 64 it was drawn with:
/// - a depth composited from far away, a triangle that a pixel's centre made thin, a gradient of next to nothing at σ = 1.3e-6;
/// - composited colours of a triangle that no pixel has more than 1e-7 of: A = 1 - Π(1 - D) has no more digits there;
/// - triangles so thin that rounding puts a pixel outside all three edges, whose colour perspective made 1e-9 of what it is.
#[test]
fn nothing_is_promised_too_much() {
    let mut stress = stress();
    for (seed, count) in [(893, 1), (1799, 1), (104_124, 1), (1_357_376, 64), (1_021_120, 64), (1_820_032, 64)] {
        let outcomes = stress.batch(seed, Kind::default(), count).unwrap();
        assert!(outcomes.iter().all(|outcome| outcome.findings.is_empty()), "seed {seed}: {outcomes:?}");
    }
}

/// Distances are rounded as corners are, and those of a wide image lie further out than 1: 4e-5 at σ = 7e-6.
#[test]
fn a_wide_image_is_promised_what_its_corners_are_rounded_to() {
    let kind = Kind { realistic: true, ..Kind::default() };
    let case = batch(3_004_720, kind, 8).remove(4).unwrap();
    assert!(case.settings.width > 2 * case.settings.height && case.promise == Promise::Silhouette);
    let outcome = stress().run(&case).unwrap();
    assert_eq!(outcome.findings, []);
    assert!(outcome.image_error.is_some_and(|error| error > 0.3), "{outcome:?}");
}

/// Many cells, whose order is an atomic counter's: invocations beside each other left the walk over their tiles at different
/// times and went on to read others' bounds, so that what was left out hung on the order.
#[test]
fn what_backward_leaves_out_does_not_hang_on_the_order_of_cells() {
    let outcomes = stress().batch(1_987_776, Kind::default(), 64).unwrap();
    let bits: Vec<_> = outcomes.iter().flat_map(|outcome| &outcome.findings).filter(|f| f.kind == "bits").collect();
    assert!(bits.is_empty() && outcomes.iter().filter(|outcome| outcome.refused.is_none()).count() > 32, "{bits:?}");
}
