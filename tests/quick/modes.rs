//! Every pair of choices that kernels are compiled for, and in the full tier every choice alone, on one small scene each: images
//! and gradients against the f64 reference, finite numbers at the corners of the (σ, γ) plane, and the same bits after the next
//! mode.

use crate::common::{
    compare::compare_frames,
    gradient::{Made, all_finite, backward, check, made, random_upstream, same_made_bits, small_case},
    modes::{FACTORS, PAIRWISE, alone, pairwise},
    renderer,
    scenes::{Case, Kind},
    tier,
    tolerance::{self, GRADIENT},
};
use softras::{
    GradientMode, GradientRequest, Projection, Renderer,
    scene::{Background, Outputs},
};
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

/// One camera before one lit blob or soup, every image asked for.
pub fn mode_base(seed: u64) -> Case {
    let usable = |case: &Case| {
        case.cameras.len() == 1
            && case.scene.meshes[0].triangles().len() > 20
            && matches!(case.cameras[0].projection(), Projection::Perspective { .. })
            && !case.scene.lights.directional.is_empty()
    };
    let mut case = (seed..).map(|seed| small_case(seed, Kind::Plain)).find(usable).unwrap();
    case.settings.outputs = Outputs::ALL;
    case.settings.background = Background::Weighted;
    (case.settings.sigma, case.settings.gamma, case.settings.epsilon) = (1e-3, 1e-2, 0.9);
    case
}

fn made_of(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> Made {
    let upstream = random_upstream(case, case.settings.outputs);
    made(renderer, case, &upstream, &GradientRequest { mode, ..GradientRequest::ALL }).unwrap()
}

/// Corners of the plane of σ and γ, and beyond.
const SOFTNESSES: [(f64, f64); 6] = [(1e-8, 1e-8), (1.0, 1.0), (1e-8, 1.0), (1e-2, 1e-8), (1e-6, 1e-5), (1e-2, 1e-5)];

/// Checks that no gradient is infinite or NaN at some σ and γ.
fn finite_at(renderer: &mut Renderer, base: &Case, mode: GradientMode) -> Result<(), String> {
    for &(sigma, gamma) in tier(&SOFTNESSES[..2], &SOFTNESSES) {
        let mut case = base.clone();
        (case.settings.sigma, case.settings.gamma) = (sigma, gamma);
        let upstream = random_upstream(&case, case.settings.outputs);
        backward(renderer, &case, &upstream, &GradientRequest { mode, ..GradientRequest::ALL })
            .and_then(|gradients| all_finite(&gradients))
            .map_err(|error| format!("{mode:?}, sigma {sigma:e}, gamma {gamma:e}: {error}"))?;
    }
    Ok(())
}

/// Images and gradients are the reference's, and finite at any softness.
fn agrees(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> Result<Made, String> {
    let first = made_of(renderer, case, mode);
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    compare_frames(&first.0, &reference, &tolerance::of(case))?;
    check(renderer, case, &random_upstream(case, case.settings.outputs), mode, &GRADIENT)?;
    finite_at(renderer, case, mode)?;
    Ok(first)
}

fn assert_all_agree(cases: impl Iterator<Item = (String, Case, GradientMode)>) {
    let (mut renderer, mut failures) = (renderer(), Vec::new());
    let mut before: Option<(Case, GradientMode, Made)> = None;
    for (name, case, mode) in cases {
        match agrees(&mut renderer, &case, mode) {
            Err(error) => failures.push(format!("{name}, {mode:?}: {error}\n{case:?}")),
            Ok(now) => {
                if let Some((case, mode, first)) = before {
                    let same = same_made_bits(&first, &made_of(&mut renderer, &case, mode));
                    failures.extend(same.err().map(|error| format!("before {name}: {error}")));
                }
                before = Some((case, mode, now));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_pair_of_choices_agrees() {
    assert_all_agree(pairwise(&mode_base(11)));
}

/// If a choice is broken, this test names it.
#[test]
fn every_choice_alone_agrees() {
    let base = mode_base(16);
    let all = alone(&base).take(tier(1, usize::MAX));
    assert_all_agree(all.flat_map(|(name, case)| {
        [GradientMode::Exact, GradientMode::Paper].map(|mode| (name.clone(), case.clone(), mode))
    }));
}
