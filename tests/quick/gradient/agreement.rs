//! The second promise: every gradient of every scene in every mode is what the f64 reference says, within 1e-4 of its norm.
//!
//! `SOFTRAS_CASES=1000` runs that many random scenes of each kind instead of the usual few, which are more in the full tier.

use crate::common::{
    case_count,
    compare::same_bits,
    gradient::{ALL_OUTPUTS, Table, all_finite, backward, check, random_upstream, same_gradient_bits, small_case},
    modes::in_every_mode,
    random::Random,
    renderer,
    scenes::{Case, Kind, random_appearance},
    tier,
    tolerance::GRADIENT,
};
use softras::{
    Frame, GradientMode, GradientRequest, Gradients, Projection, Renderer,
    scene::{Background, Outputs, Shading},
};

const MODES: [GradientMode; 2] = [GradientMode::Exact, GradientMode::Paper];

fn first_case() -> u64 {
    std::env::var("SOFTRAS_FIRST").map_or(0, |seed| seed.parse().expect("SOFTRAS_FIRST is a number"))
}

/// Some of the images that the case renders, at least one.
fn random_images(case: &Case) -> Outputs {
    let random = &mut Random::new(case.seed ^ 0x1ace);
    let rendered = case.settings.outputs;
    let mut some = |rendered: bool| rendered && random.chance(0.7);
    let images = Outputs {
        color: some(rendered.color),
        silhouette: some(rendered.silhouette),
        depth: some(rendered.depth),
        normal: some(rendered.normal),
    };
    let none = Outputs::NOTHING;
    if images == none { rendered } else { images }
}

fn add(renderer: &mut Renderer, case: &Case, table: &mut Table, failures: &mut Vec<String>) {
    let images = random_images(case);
    let upstream = random_upstream(case, images);
    for mode in MODES {
        match check(renderer, case, &upstream, mode, &GRADIENT) {
            Ok(errors) => table.add(mode, case.seed, &errors),
            Err(error) => failures.push(format!("{error}\nupstream of {images:?}\n{case:?}")),
        }
    }
}

fn assert_random_cases_agree(kind: Kind, count: u64) {
    let (mut renderer, mut table, mut failures) = (renderer(), Table::default(), Vec::new());
    for seed in first_case()..first_case() + count {
        add(&mut renderer, &small_case(seed, kind), &mut table, &mut failures);
    }
    println!("{kind:?}\n{table}");
    assert!(failures.is_empty(), "{} failures\n{}", failures.len(), failures.join("\n"));
    table.verdict(&GRADIENT).unwrap();
}

#[test]
fn random_scenes() {
    assert_random_cases_agree(Kind::Plain, case_count(2, 10));
}

#[test]
fn random_scenes_in_all_modes() {
    assert_random_cases_agree(Kind::Modes, case_count(1, 12));
}

#[test]
fn random_scenes_through_near_and_far() {
    assert_random_cases_agree(Kind::Clipped, case_count(2, 10));
}

/// One camera before one blob or soup whose colours are textures, lit, every image asked for.
pub fn mode_base(seed: u64) -> Case {
    let seeds = (seed..).map(|seed| small_case(seed, Kind::Plain));
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

/// Each mode alone (a few in the quick tier, beside `modes`), so that a broken one is named, on one scene, for all images together; and by turns, because kernels
/// are compiled for each, the paper's gradient of all images or the gradient of one image alone, another one each time.
/// Whatever else they are, gradients are finite at the corners of the (σ, γ) plane and beyond, and images and gradients have
/// the same bits again after the next mode.
#[test]
fn every_mode_alone() {
    let mut renderer = renderer();
    let base = mode_base(11);
    let none = Outputs::NOTHING;
    let images = [
        ("colour", Outputs { color: true, ..none }),
        ("silhouette", Outputs { silhouette: true, ..none }),
        ("depth", Outputs { depth: true, ..none }),
        ("normal", Outputs { normal: true, ..none }),
        ("everything", ALL_OUTPUTS),
    ];
    let mut failures = Vec::new();
    let mut before: Option<(&str, Case, Made)> = None;
    for (i, (name, case)) in
        in_every_mode(&base).take(tier(1, usize::MAX)).chain(in_every_mode(&base).take(1)).enumerate()
    {
        let rendered = case.settings.outputs;
        let both = |a: Outputs| Outputs {
            color: a.color && rendered.color,
            silhouette: a.silhouette && rendered.silhouette,
            depth: a.depth && rendered.depth,
            normal: a.normal && rendered.normal,
        };
        let one = images[i / 2 % 4];
        let by_turns = if i % 2 == 0 { (images[4], GradientMode::Paper) } else { (one, MODES[i / 8 % 2]) };
        for ((image, outputs), mode) in [(images[4], GradientMode::Exact), by_turns] {
            let outputs = both(outputs);
            if outputs == none {
                continue;
            }
            let upstream = random_upstream(&case, outputs);
            if let Err(error) = check(&mut renderer, &case, &upstream, mode, &GRADIENT) {
                failures.push(format!("{name}, upstream of {image}: {error}"));
            }
        }
        let compiled = if i % 2 == 0 { &MODES[..] } else { &MODES[..1] };
        for &mode in compiled {
            let finite = finite_at(&mut renderer, &case, mode, &SOFTNESSES);
            failures.extend(finite.err().map(|error| format!("{name}, {error}")));
        }
        let made = made_of(&mut renderer, &case, GradientMode::Exact);
        if let Some((name, case, made)) = before {
            let again = made_of(&mut renderer, &case, GradientMode::Exact);
            if let Err(error) = same_bits(&made.0, &again.0).and(same_gradient_bits(&made.1, &again.1)) {
                failures.push(format!("{name}, again: {error}"));
            }
        }
        before = Some((name, case, made));
    }
    assert!(failures.is_empty(), "{}\n{base:?}", failures.join("\n"));
}

/// A frame and its gradients.
pub type Made = (Frame, Gradients);

pub fn made_of(renderer: &mut Renderer, case: &Case, mode: GradientMode) -> Made {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let upstream = random_upstream(case, case.settings.outputs);
    let gradients = renderer.backward(&frame, &upstream, &GradientRequest { mode, ..GradientRequest::ALL }).unwrap();
    (frame, gradients)
}

/// Corners of the plane of σ and γ, and beyond.
pub const SOFTNESSES: [(f64, f64); 6] =
    [(1e-8, 1e-8), (1.0, 1.0), (1e-8, 1.0), (1e-2, 1e-8), (1e-6, 1e-5), (1e-2, 1e-5)];

/// That no gradient is infinite or NaN at some σ and γ.
pub fn finite_at(
    renderer: &mut Renderer,
    base: &Case,
    mode: GradientMode,
    softnesses: &[(f64, f64)],
) -> Result<(), String> {
    for &(sigma, gamma) in softnesses {
        let mut case = base.clone();
        (case.settings.sigma, case.settings.gamma) = (sigma, gamma);
        let upstream = random_upstream(&case, case.settings.outputs);
        backward(renderer, &case, &upstream, &GradientRequest { mode, ..GradientRequest::ALL })
            .and_then(|gradients| all_finite(&gradients))
            .map_err(|error| format!("{mode:?}, sigma {sigma:e}, gamma {gamma:e}: {error}"))?;
    }
    Ok(())
}

/// Every kind of colour, under flat and smooth light.
#[test]
fn every_appearance_alone() {
    let mut renderer = renderer();
    let base = mode_base(40);
    let mut failures = Vec::new();
    for seed in 0..10 {
        for &shading in tier(&[Shading::Flat][..], &[Shading::Flat, Shading::Smooth]) {
            let mut case = base.clone();
            case.seed = seed;
            case.scene.lights.shading = shading;
            let mesh = case.scene.meshes.remove(0);
            let appearance = random_appearance(&mut Random::new(seed), &mesh);
            case.scene.meshes.push(mesh.with_appearance(appearance).unwrap());
            let upstream = random_upstream(&case, ALL_OUTPUTS);
            for &mode in tier(&MODES[..1], &MODES) {
                if let Err(error) = check(&mut renderer, &case, &upstream, mode, &GRADIENT) {
                    failures.push(format!("{shading:?}: {error}\n{case:?}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// What is not wanted is not there, and what is wanted does not depend on the rest.
#[test]
fn wanted_is_what_comes() {
    let mut renderer = renderer();
    let mut case = mode_base(11);
    let mesh = case.scene.meshes.remove(0);
    // 3 textures.
    let seeds = (0..).map(|seed| random_appearance(&mut Random::new(seed), &mesh));
    let textured = seeds.into_iter().find(|a| matches!(a, softras::scene::Appearance::Textured { .. })).unwrap();
    case.scene.meshes.push(mesh.with_appearance(textured).unwrap());
    let upstream = random_upstream(&case, ALL_OUTPUTS);
    let all = backward(&mut renderer, &case, &upstream, &GradientRequest::ALL).unwrap();
    let nothing = GradientRequest::NOTHING;
    let single: [(&str, GradientRequest); 7] = [
        ("positions", GradientRequest { positions: true, ..nothing }),
        ("texels", GradientRequest { texels: true, ..nothing }),
        ("uvs", GradientRequest { uvs: true, ..nothing }),
        ("camera", GradientRequest { camera: true, ..nothing }),
        ("lights", GradientRequest { lights: true, ..nothing }),
        ("background", GradientRequest { background: true, ..nothing }),
        ("scalars", GradientRequest { scalars: true, ..nothing }),
    ];
    for (name, wanted) in single.into_iter().step_by(tier(3, 1)) {
        let some = backward(&mut renderer, &case, &upstream, &wanted).unwrap();
        let mesh = &some.meshes[0];
        assert_eq!(mesh.positions.is_empty(), !wanted.positions, "{name}");
        assert_eq!(mesh.texture_texels.is_empty(), !wanted.texels, "{name}");
        assert_eq!(mesh.uvs.is_empty(), !wanted.uvs, "{name}");
        assert_eq!(some.cameras.is_empty(), !wanted.camera, "{name}");
        assert_eq!(some.lights.is_none(), !wanted.lights, "{name}");
        assert_eq!((some.background_color, some.epsilon) == ([0.0; 3], 0.0), !wanted.background, "{name}");
        assert_eq!((some.sigma, some.gamma) == (0.0, 0.0), !wanted.scalars, "{name}");
        for ((got, ours), (_, expected)) in crate::common::gradient::matching(&some, &all) {
            let group = crate::common::gradient::Group { name: got, ours, reference: expected };
            let error = crate::common::gradient::relative_error(&group, 0.0).unwrap();
            assert!(error < 1e-6, "{name} alone changes {got} by {error:e}\n{case:?}");
        }
    }
}
