//! The gradient tests' own tools: each is fed a wrong answer and must see it.

use crate::common::{
    blame::{blame, only_pixel},
    gradient::{
        ALL_OUTPUTS, Group, Table, all_finite, backward, check, errors, groups, matching, norm, numbers,
        random_upstream, reference_gradient, relative_error, same_gradient_bits, small_case, upstream_norm,
        upstream_of, with_random_signs,
    },
    renderer,
    scenes::{Case, Kind},
    tolerance::GRADIENT,
};
use softras::{GradientMode, GradientRequest, Gradients, ImageGradient, Renderer, scene::Outputs};
use softras_reference::render_culled;

fn group(ours: &[f64], reference: &[f64]) -> Group {
    Group { name: "x", ours: ours.to_vec(), reference: reference.to_vec() }
}

#[test]
fn relative_error_sees_what_is_wrong() {
    assert_eq!(relative_error(&group(&[3.0, 4.0], &[3.0, 4.0]), 0.0), Ok(0.0));
    assert_eq!(relative_error(&group(&[3.0, 4.5], &[3.0, 4.0]), 0.0), Ok(0.1));
    assert_eq!(relative_error(&group(&[3.0, 4.5], &[3.0, 4.0]), 50.0), Ok(0.01));
    assert_eq!(relative_error(&group(&[-3.0, -4.0], &[3.0, 4.0]), 0.0), Ok(2.0));
    assert_eq!(relative_error(&group(&[0.0], &[0.0]), 0.0), Ok(0.0));
    assert_eq!(relative_error(&group(&[1e-9], &[0.0]), 0.0), Ok(f64::INFINITY));
    relative_error(&group(&[3.0], &[3.0, 4.0]), 0.0).unwrap_err();
    assert!(relative_error(&group(&[3.0, f64::NAN], &[3.0, 4.0]), 0.0).unwrap_err().contains("number 1 is NaN"));
    relative_error(&group(&[3.0, 4.0], &[f64::INFINITY, 4.0]), 0.0).unwrap_err();
    assert_eq!(norm(&[3.0, 4.0]), 5.0);
}

#[test]
fn the_table_counts_what_is_beyond() {
    let fill = |bad: &[f64]| {
        let mut table = Table::default();
        (0..98).for_each(|seed| table.add(GradientMode::Exact, seed, &vec![("x", 1e-6), ("x", 2e-6)]));
        bad.iter().for_each(|&e| table.add(GradientMode::Exact, 98, &vec![("x", e)]));
        table
    };
    fill(&[0.9e-4, 0.9e-4]).verdict(&GRADIENT).unwrap();
    fill(&[0.9e-3]).verdict(&GRADIENT).unwrap();
    let said = fill(&[0.9e-3, 0.8e-3]).verdict(&GRADIENT).unwrap_err();
    assert!(said.contains("Exact x: 2 of 100 scenes") && said.contains("98"), "{said}");
    fill(&[1.1e-3]).verdict(&GRADIENT).unwrap_err();
    let shown = fill(&[0.9e-3]).to_string();
    assert!(shown.contains("median 2.0e-6") && shown.contains("worst 9.0e-4 (seed 98)"), "{shown}");
}

fn base() -> Case {
    let seeds = (100..).map(|seed| small_case(seed, Kind::Plain));
    let textured =
        |case: &Case| matches!(case.scene.meshes[0].appearance(), softras::scene::Appearance::Textured { .. });
    let lit = |case: &Case| !case.scene.lights.directional.is_empty() && case.cameras.len() == 2;
    let mut case = seeds.into_iter().find(|case| lit(case) && textured(case) && case.scene.meshes.len() == 1).unwrap();
    case.settings.outputs = ALL_OUTPUTS;
    (case.settings.sigma, case.settings.gamma, case.settings.epsilon) = (1e-3, 1e-1, 0.9);
    case
}

fn result(renderer: &mut Renderer, case: &Case, upstream: &ImageGradient) -> Gradients {
    backward(renderer, case, upstream, &GradientRequest::ALL).unwrap()
}

/// Ways to be wrong, each in another gradient.
const WRONGS: [fn(&mut Gradients); 11] = [
    |g| g.meshes[0].positions[0][1] += 1.0,
    |g| g.meshes[0].uvs[0][1] += 1.0,
    |g| g.meshes[0].texture_texels[0][0][2] += 1.0,
    |g| g.cameras[1].twist[5] += 1.0,
    |g| g.cameras[0].projection[0] += 1.0,
    |g| g.lights.as_mut().unwrap().ambient_intensity += 1.0,
    |g| g.lights.as_mut().unwrap().directional[0].0[1] += 1.0,
    |g| g.lights.as_mut().unwrap().directional[0].2 += 1.0,
    |g| g.background_color[2] += 1.0,
    |g| g.sigma *= 1.01,
    |g| g.gamma *= 1.01,
];

#[test]
fn a_wrong_number_in_any_gradient_is_seen() {
    let (mut renderer, case) = (renderer(), base());
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let right = result(&mut renderer, &case, &upstream);
    let worst = |g: &Gradients| {
        let errors = errors(&case, &upstream, GradientMode::Exact, g, &GRADIENT).unwrap();
        errors.into_iter().fold(0.0, |worst: f64, (_, e)| worst.max(e))
    };
    assert!(worst(&right) <= GRADIENT.usual, "{}", worst(&right));
    assert_eq!(same_gradient_bits(&right, &right), Ok(()));
    assert_eq!(all_finite(&right), Ok(()));
    for (i, change) in WRONGS.iter().enumerate() {
        let mut wrong = right.clone();
        change(&mut wrong);
        assert!(worst(&wrong) > GRADIENT.usual, "wrong number {i} is not seen: {:e}", worst(&wrong));
        same_gradient_bits(&right, &wrong).unwrap_err();
    }
    let mut wrong = right.clone();
    wrong.epsilon = f64::NAN;
    assert_eq!(all_finite(&wrong), Err("epsilon: number 0 is NaN".into()));
    errors(&case, &upstream, GradientMode::Exact, &wrong, &GRADIENT).unwrap_err();
    let mut short = right.clone();
    short.meshes[0].positions.pop();
    groups(&case, &short, &reference_gradient(&case, &upstream, GradientMode::Exact)).unwrap_err();
    same_gradient_bits(&right, &short).unwrap_err();
    let mut zero = right.clone();
    zero.sigma = -zero.sigma;
    same_gradient_bits(&right, &zero).unwrap_err();
    assert_eq!(
        numbers(&right).len(),
        matching(&right, &right).len() + numbers(&right).iter().filter(|(_, v)| norm(v) == 0.0).count()
    );
}

/// What agrees in exact mode does not in paper mode, so neither is compared with the other's reference.
#[test]
fn modes_and_upstreams_are_told_apart() {
    let (mut renderer, case) = (renderer(), base());
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let exact = result(&mut renderer, &case, &upstream);
    let of = |mode, upstream: &ImageGradient| {
        let errors = errors(&case, upstream, mode, &exact, &GRADIENT).unwrap();
        errors.iter().find(|(group, _)| group.name == "positions").unwrap().1
    };
    assert!(of(GradientMode::Exact, &upstream) < 1e-4);
    assert!(of(GradientMode::Paper, &upstream) > 1e-3);
    assert!(of(GradientMode::Exact, &with_random_signs(&upstream, 3)) > 0.1);
    check(&mut renderer, &case, &upstream, GradientMode::Exact, &GRADIENT).unwrap();
    let impossible = softras_tolerance(1e-12);
    let said = check(&mut renderer, &case, &upstream, GradientMode::Exact, &impossible).unwrap_err();
    assert!(said.contains("Exact positions") && said.contains("row"), "{said}");
}

fn softras_tolerance(worst: f64) -> crate::common::tolerance::GradientTolerance {
    crate::common::tolerance::GradientTolerance { usual: worst, worst, floor: 0.0, nothing: 0.0, ..GRADIENT }
}

#[test]
fn upstreams_are_what_they_say() {
    let case = base();
    let images = Outputs { color: true, silhouette: false, depth: true, normal: false };
    let upstream = random_upstream(&case, images);
    assert_eq!(upstream.outputs(), images);
    let margin = render_culled(&case.scene, &case.cameras, &case.settings).unwrap().margin;
    let color = &upstream.color.as_ref().unwrap().data;
    for (pixel, margin) in margin.iter().enumerate() {
        let zero = color[3 * pixel..3 * pixel + 3] == [0.0; 3];
        assert_eq!(zero, *margin < GRADIENT.margin);
    }
    let negative = color.iter().filter(|x| **x < 0.0).count() as f64 / color.len() as f64;
    assert!((0.4..0.6).contains(&negative), "{negative}");
    let flipped = with_random_signs(&upstream, 1);
    assert_ne!(flipped, upstream);
    assert!((upstream_norm(&flipped) - upstream_norm(&upstream)).abs() < 1e-12);
    let pixel = 2 * case.settings.width as usize + 3;
    let by_place = upstream_of(
        &case,
        |name, row, column| if (name, row, column) == ("depth", 2, 3) { [2.0; 3] } else { [0.0; 3] },
    );
    assert_eq!(by_place.depth.as_ref().unwrap().data[pixel], 2.0);
    assert_eq!(upstream_norm(&by_place), 8f64.sqrt(), "two views, one value each");
    let alone = only_pixel(&upstream, pixel);
    assert_eq!(alone.color.as_ref().unwrap().data[3 * pixel..3 * pixel + 3], color[3 * pixel..3 * pixel + 3]);
    assert_eq!(alone.color.unwrap().data.iter().filter(|x| **x != 0.0).count(), 3);
}

/// The pixel whose weight the kernels were not told is named.
#[test]
fn the_blamed_pixel_is_the_wrong_one() {
    let (mut renderer, mut case) = (renderer(), base());
    case.cameras.truncate(1);
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let said = blame(&mut renderer, &case, &upstream, GradientMode::Exact, 0);
    assert!(said.starts_with("view 0, row ") && said.matches("off by").count() == 3, "{said}");
}
