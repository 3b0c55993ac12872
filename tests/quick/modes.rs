//! Every pair of choices that kernels are compiled for, on one small scene each: images and gradients against the f64
//! reference, finite numbers at the corners of the (σ, γ) plane, and the same bits after the next mode.

use crate::common::{
    compare::{compare_frames, same_bits},
    gradient::{ALL_OUTPUTS, all_finite, check, random_upstream, same_gradient_bits, small_case},
    modes::{FACTORS, PAIRWISE, pairwise},
    renderer,
    scenes::{Case, Kind},
    tier,
    tolerance::{self, GRADIENT},
};
use softras::{Frame, GradientMode, GradientRequest, Gradients, Projection, Renderer, scene::Background};
use softras_reference::render_culled;

/// One camera before one lit blob or soup.
fn base() -> Case {
    let seeds = (11..).map(|seed| small_case(seed, Kind::Plain));
    let usable = |case: &Case| {
        case.cameras.len() == 1
            && case.scene.meshes[0].triangles().len() > 20
            && matches!(case.cameras[0].projection(), Projection::Perspective { .. })
            && !case.scene.lights.directional.is_empty()
    };
    let mut case = seeds.into_iter().find(usable).unwrap();
    case.settings.outputs = ALL_OUTPUTS;
    case.settings.background = Background::Weighted;
    (case.settings.sigma, case.settings.gamma, case.settings.epsilon) = (1e-3, 1e-2, 0.9);
    case
}

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

/// A frame and its gradients.
type Made = (Frame, Gradients);

fn made(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> softras::Result<Made> {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings)?;
    let upstream = random_upstream(case, case.settings.outputs);
    let gradients = renderer.backward(&frame, &upstream, &GradientRequest { mode, ..GradientRequest::ALL })?;
    Ok((frame, gradients))
}

/// Images and gradients are the reference's, and finite at any softness.
fn agrees(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> Result<Made, String> {
    let first = made(renderer, case, mode).map_err(|error| error.to_string())?;
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    compare_frames(&first.0, &reference, &tolerance::of(case))?;
    check(renderer, case, &random_upstream(case, case.settings.outputs), mode, &GRADIENT)?;
    let corners = [(1e-8, 1e-8), (1.0, 1.0), (1e-8, 1.0), (1e-2, 1e-8), (1e-6, 1e-5), (1e-2, 1e-5)];
    for &(sigma, gamma) in tier(&corners[..2], &corners) {
        let mut case = case.clone();
        (case.settings.sigma, case.settings.gamma) = (sigma, gamma);
        let (_, gradients) = made(renderer, &case, mode).map_err(|error| error.to_string())?;
        all_finite(&gradients).map_err(|error| format!("sigma {sigma:e}, gamma {gamma:e}: {error}"))?;
    }
    Ok(first)
}

#[test]
fn every_pair_of_choices_agrees() {
    let mut renderer = renderer();
    let mut failures = Vec::new();
    let mut before: Option<(Case, GradientMode, Made)> = None;
    for (row, case, mode) in pairwise(&base()) {
        match agrees(&mut renderer, &case, mode) {
            Err(error) => failures.push(format!("{row}, {mode:?}: {error}")),
            Ok(now) => {
                if let Some((case, mode, first)) = before {
                    let again = made(&mut renderer, &case, mode).unwrap();
                    let same = same_bits(&first.0, &again.0).and(same_gradient_bits(&first.1, &again.1));
                    failures.extend(same.err().map(|error| format!("before {row}: {error}")));
                }
                before = Some((case, mode, now));
            }
        }
    }
    assert!(failures.is_empty(), "{}\n{:?}", failures.join("\n"), base());
}
