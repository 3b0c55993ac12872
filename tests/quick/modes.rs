//! Every pair of choices that kernels are compiled for, on one small scene each: images and gradients against the f64
//! reference, finite numbers at the corners of the (σ, γ) plane, and the same bits after the next mode.

use crate::common::{
    compare::{compare_frames, same_bits},
    gradient::{check, random_upstream, same_gradient_bits},
    modes::{FACTORS, PAIRWISE, pairwise},
    renderer,
    scenes::Case,
    tier,
    tolerance::{self, GRADIENT},
};
use crate::gradient::agreement::{Made, SOFTNESSES, finite_at, made_of, mode_base};
use softras::{GradientMode, Renderer};
use softras_reference::render_culled;

#[test]
fn every_pair_of_choices_is_in_a_row() {
    let sizes: Vec<usize> = FACTORS.iter().map(|(_, choices)| choices.len()).chain([2]).collect();
    let rows = PAIRWISE.map(|row| row.bytes().map(|digit| usize::from(digit - b'0')).collect::<Vec<_>>());
    assert!(rows.iter().all(|row| row.len() == sizes.len()));
    for (i, j) in (0..sizes.len()).flat_map(|j| (0..j).map(move |i| (i, j))) {
        for (a, b) in (0..sizes[i]).flat_map(|a| (0..sizes[j]).map(move |b| (a, b))) {
            assert!(rows.iter().any(|row| (row[i], row[j]) == (a, b)), "choice {a} of {i} with {b} of {j}");
        }
    }
}

/// Images and gradients are the reference's, and finite at any softness.
fn agrees(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> Result<Made, String> {
    let first = made_of(renderer, case, mode);
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    compare_frames(&first.0, &reference, &tolerance::of(case))?;
    check(renderer, case, &random_upstream(case, case.settings.outputs), mode, &GRADIENT)?;
    finite_at(renderer, case, mode, tier(&SOFTNESSES[..2], &SOFTNESSES))?;
    Ok(first)
}

#[test]
fn every_pair_of_choices_agrees() {
    let mut renderer = renderer();
    let (base, mut failures) = (mode_base(11), Vec::new());
    let mut before: Option<(Case, GradientMode, Made)> = None;
    for (row, case, mode) in pairwise(&base) {
        match agrees(&mut renderer, &case, mode) {
            Err(error) => failures.push(format!("{row}, {mode:?}: {error}")),
            Ok(now) => {
                if let Some((case, mode, first)) = before {
                    let again = made_of(&mut renderer, &case, mode);
                    let same = same_bits(&first.0, &again.0).and(same_gradient_bits(&first.1, &again.1));
                    failures.extend(same.err().map(|error| format!("before {row}: {error}")));
                }
                before = Some((case, mode, now));
            }
        }
    }
    assert!(failures.is_empty(), "{}\n{:?}", failures.join("\n"), base);
}
