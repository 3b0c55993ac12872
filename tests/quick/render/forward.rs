//! The main promise: every image of every scene in every mode is what the f64 reference says, within 2e-5.
//!
//! `SOFTRAS_CASES=1000` runs that many random scenes of each kind instead of the usual few, which are more in the full tier.

use crate::common::{
    case_count,
    compare::compare_frames,
    gradient::made_case,
    random::Random,
    renderer,
    scenes::{Case, Kind, random_case, separate, small, triangles},
    tier, tolerance,
};
use softras::{
    Camera, Renderer, Scene, Settings,
    scene::{Appearance, Background, Distance, Outputs, Parity},
};
use softras_reference::{ReferenceFrame, Truncation, render, render_culled};

/// The largest error in units of the tolerance, or what is wrong, with the case.
fn agreement(renderer: &mut Renderer, case: &Case) -> Result<f64, String> {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).map_err(|e| format!("{e}\n{case:?}"))?;
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    compare_frames(&frame, &reference, &tolerance::of(case)).map_err(|error| format!("{error}\n{case:?}"))
}

fn assert_random_cases_agree(kind: Kind, count: u64) {
    let mut renderer = renderer();
    let (mut worst, mut failures): (f64, Vec<String>) = (0.0, Vec::new());
    for seed in 0..count {
        match agreement(&mut renderer, &random_case(seed, kind)) {
            Ok(error) => worst = worst.max(error),
            Err(error) => failures.push(error),
        }
    }
    println!("{kind:?}: the largest error is {worst:.3} of the tolerance");
    assert!(failures.is_empty(), "{} disagree\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn random_scenes() {
    assert_random_cases_agree(Kind::Plain, case_count(4, 15));
}

#[test]
fn random_scenes_in_all_modes() {
    assert_random_cases_agree(Kind::Modes, case_count(2, 15));
}

#[test]
fn random_scenes_through_near_and_far() {
    assert_random_cases_agree(Kind::Clipped, case_count(3, 15));
}

/// The official code drops what lies outside the box grown by the Euclidean radius. In this scene, of barycentric distances
/// with a tau of 0.08, some triangles would reach beyond it.
#[test]
fn official_box_ends_barycentric_support() {
    let case = random_case(74, Kind::Modes);
    assert_eq!((case.settings.distance, case.settings.parity), (Distance::Barycentric, Parity::Official));
    agreement(&mut renderer(), &case).unwrap();
}

/// Triangles with corners nearly in a line, from a tenth of a pixel high to no height at all, and as long as the image:
/// where rounding may confuse their edges, the kernel that measures one edge leaves the tile to the one that measures all.
#[test]
fn slivers_of_every_height() {
    // A triangle without height has no defined normal.
    let outputs = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
    let mut renderer = renderer();
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let corners: Vec<[[f32; 3]; 3]> = (0..24)
            .map(|i| {
                let (sin, cos) = (random.range(0.0, std::f64::consts::TAU)).sin_cos();
                let length = [0.1, 1.5][i % 2];
                let height = if i % 8 == 7 { 0.0 } else { random.log_range(1e-9, 1e-2) };
                let middle = [random.range(-0.5, 0.5), random.range(-0.5, 0.5)];
                let z = random.range(2.0, 3.0);
                [(-1.0, 0.0), (1.0, 0.0), (random.range(-1.2, 1.2), height)].map(|(along, across)| {
                    let (along, across) = (along * length * 0.5, across * length);
                    [middle[0] + along * cos - across * sin, middle[1] + along * sin + across * cos, z]
                        .map(|x| x as f32)
                })
            })
            .collect();
        // The mesh has one colour, because rounding decides where in a sliver a pixel lies.
        let mesh = triangles(&corners).with_appearance(Appearance::Uniform([1.0, 0.5, 0.25])).unwrap();
        let settings = Settings { sigma: 1e-4, gamma: 1e-2, near: 1.0, far: 10.0, outputs, ..small(48, 48) };
        let case = made_case(Scene::new(mesh), vec![Camera::screen()], settings);
        agreement(&mut renderer, &case).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Only the images that are asked for are made, and they do not depend on which others are.
#[test]
fn outputs_are_those_asked_for() {
    let mut renderer = renderer();
    let case = random_case(3, Kind::Plain);
    for bits in (1..16u32).step_by(tier(5, 1)) {
        let [color, silhouette, depth, normal] = [0, 1, 2, 3].map(|bit| bits >> bit & 1 == 1);
        let mut case = case.clone();
        case.settings.outputs = Outputs { color, silhouette, depth, normal, features: false };
        agreement(&mut renderer, &case).unwrap_or_else(|e| panic!("{e}"));
        let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let made = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()].map(|image| image.is_ok());
        assert_eq!(made, [color, silhouette, depth, normal]);
        assert_eq!(frame.images().count() as u32, bits.count_ones());
        let (batch, size) = (case.cameras.len(), (case.settings.height as usize, case.settings.width as usize));
        for (image, channels) in [(frame.color(), 3), (frame.silhouette(), 1), (frame.depth(), 1), (frame.normal(), 3)]
        {
            let image = match image {
                Ok(image) => image,
                Err(error) => {
                    assert!(error.to_string().starts_with("settings: outputs."), "{error}");
                    continue;
                }
            };
            assert_eq!((image.batch, (image.height, image.width), image.channels), (batch, size, channels));
        }
    }
}

/// The comparison sees one wrong value of any image.
#[test]
fn a_wrong_value_is_seen() {
    let mut case = random_case(4, Kind::Plain);
    case.settings.outputs = Outputs::ALL;
    let frame = renderer().render(&case.scene, &case.cameras, &case.settings).unwrap();
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    let pixel = reference.margin.iter().position(|&m| m > 0.5).unwrap();
    type Change = fn(&mut ReferenceFrame, usize);
    let changes: [(&str, Change); 5] = [
        ("color", |f, pixel| f.color[3 * pixel] += 1e-3),
        ("silhouette", |f, pixel| f.silhouette[pixel] += 1e-3),
        ("depth", |f, pixel| f.depth[pixel] += 1e-3),
        ("normal", |f, pixel| f.normal[3 * pixel + 2] += 1e-3),
        ("color", |f, pixel| f.color[3 * pixel] = f64::NAN),
    ];
    for (name, change) in changes {
        let mut wrong = reference.clone();
        change(&mut wrong, pixel);
        assert!(compare_frames(&frame, &wrong, &tolerance::IMAGE).unwrap_err().starts_with(name));
    }
}

/// With a small γ and a far plane that is far, log weights reach 1e8, where floats are 8 apart, and yet depths blend.
/// forward_soft, whose sums are relative to an integer log weight, divided 0 by 0 there.
#[test]
fn log_weights_beyond_the_integers_of_a_float() {
    let corner = |z| [[-0.8, -0.7, z], [0.9, -0.6, z], [0.1, 0.8, z]];
    let depths = [900.0, 400.0, 250.0, 60.0];
    let texels = vec![[1.0, 0.0, 0.2], [0.0, 1.0, 0.4], [0.3, 0.2, 1.0], [0.9, 0.8, 0.0]];
    let mesh = separate(&depths.map(corner));
    let scene = Scene::new(mesh.with_appearance(Appearance::Surface { resolution: 1, texels }).unwrap());
    for (gamma, epsilon) in [(1e-8, 1.0), (1.3e-8, 0.999_999_99), (1.7e-8, -1.0), (1e-7, 1e3)] {
        let settings = Settings {
            width: 9,
            height: 7,
            near: 1e-2,
            far: 1e10,
            sigma: 1e-2,
            gamma,
            epsilon,
            background: Background::Weighted,
            ..Settings::default()
        };
        let reference = render(&scene, &[Camera::screen()], &settings, Truncation::Tau).unwrap();
        let frame = renderer().render(&scene, &[Camera::screen()], &settings).unwrap();
        compare_frames(&frame, &reference, &tolerance::IMAGE).unwrap();
    }
}
