//! The tests' own tools: each is fed a wrong answer and must see it.

use crate::common::{
    compare::{compare, compare_frames, mirrored, same_bits, same_image_bits, view_of},
    random::Random,
    renderer,
    scenes::{Kind, random_case},
    tolerance::{IMAGE, Tolerance},
};
use softras::{
    Image,
    scene::{Appearance, Projection},
};
use softras_reference::render_culled;
use std::collections::BTreeSet;

/// Two views of 2×3 pixels with two channels and all values different.
fn image() -> Image {
    Image { batch: 2, height: 2, width: 3, channels: 2, data: (0..24).map(|i| i as f32 / 8.0).collect() }
}

fn exact(image: &Image) -> Vec<f64> {
    image.data.iter().map(|&x| f64::from(x)).collect()
}

#[test]
fn compare_sees_every_kind_of_wrong_image() {
    let (image, margin) = (image(), vec![1.0; 12]);
    let reference = exact(&image);
    assert_eq!(compare("x", &image, &reference, &margin, &IMAGE).unwrap().worst, 0.0);

    type Change<'a> = &'a dyn Fn(&mut Image, &mut Vec<f64>, &mut Vec<f64>);
    let wrong = |change: Change| {
        let (mut image, mut reference, mut margin) = (image.clone(), reference.clone(), margin.clone());
        change(&mut image, &mut reference, &mut margin);
        compare("x", &image, &reference, &margin, &IMAGE).unwrap_err()
    };
    let said = wrong(&|_, reference, _| reference[15] += 4.1e-5);
    assert!(said.contains("view 1, row 0, column 1, channel 1"), "{said}");
    let said = wrong(&|image, _, _| image.data[0] = f32::NAN);
    assert!(said.contains("view 0, row 0, column 0, channel 0 is NaN"), "{said}");
    wrong(&|_, reference, _| reference[3] = f64::INFINITY);
    // Not a number is wrong at a jump of the model too.
    wrong(&|image, _, margin| (image.data[0], margin[0]) = (f32::NAN, 0.0));
    wrong(&|image, _, _| image.data.truncate(23));
    wrong(&|_, reference, _| reference.truncate(23));
    wrong(&|_, _, margin| margin.truncate(11));
    wrong(&|_, reference, _| reference.reverse());
    let said = wrong(&|_, _, margin| margin[..2].fill(0.0));
    assert!(said.contains("0.16"), "{said}");
}

#[test]
fn compare_allows_what_it_says() {
    let image = image();
    let (mut reference, mut margin) = (exact(&image), vec![1.0; 12]);
    reference[1] += 1.9e-5;
    reference[23] *= 1.0 + 1.9e-5;
    let report = compare("x", &image, &reference, &margin, &IMAGE).unwrap();
    assert!((0.9..1.0).contains(&report.worst) && report.left_out == 0.0, "{report:?}");
    reference[8] = 99.0;
    margin[4] = 0.9e-4;
    let report = compare("x", &image, &reference, &margin, &IMAGE).unwrap();
    assert_eq!(report.left_out, 1.0 / 12.0);
    let strict = Tolerance { left_out: 0.0, ..IMAGE };
    compare("x", &image, &reference, &margin, &strict).unwrap_err();
}

#[test]
fn bits_and_views_and_mirrors_are_told_apart() {
    let image = image();
    assert_eq!(same_image_bits("x", &image, &image), Ok(()));
    let mut other = image.clone();
    other.data[5] = f32::from_bits(other.data[5].to_bits() + 1);
    assert!(same_image_bits("x", &image, &other).unwrap_err().contains("1 values differ, the first is value 5"));
    let mut zero = image.clone();
    zero.data[0] = -0.0;
    same_image_bits("x", &image, &zero).unwrap_err();
    let shape = Image { width: 2, height: 3, ..image.clone() };
    same_image_bits("x", &image, &shape).unwrap_err();
    assert_eq!(mirrored(&mirrored(&image)), image);
    assert_eq!(mirrored(&image).pixel(1, 0, 0), image.pixel(1, 0, 2));
    assert_eq!(view_of(&image, 1).pixel(0, 1, 2), image.pixel(1, 1, 2));
}

#[test]
fn frames_are_compared_image_by_image() {
    let mut renderer = renderer();
    let mut case = random_case(4, Kind::Plain);
    let all = softras::scene::Outputs::ALL;
    case.settings.outputs = all;
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
    let middle = reference.margin.iter().position(|&m| m > 0.5).unwrap();
    for (name, change) in [("color", 3), ("silhouette", 1), ("depth", 1), ("normal", 3)] {
        let mut wrong = reference.clone();
        let image = match name {
            "color" => &mut wrong.color,
            "silhouette" => &mut wrong.silhouette,
            "depth" => &mut wrong.depth,
            _ => &mut wrong.normal,
        };
        image[middle * change] += 1e-3;
        assert!(compare_frames(&frame, &wrong, &IMAGE).unwrap_err().starts_with(name));
    }
    case.settings.outputs.depth = false;
    let less = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    assert!(compare_frames(&less, &reference, &IMAGE).unwrap_err().contains("asked for and not there"));
    assert!(same_bits(&frame, &less).unwrap_err().contains("only one"));
    case.settings.sigma *= 1.5;
    case.settings.outputs = all;
    let blurred = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
    same_bits(&frame, &blurred).unwrap_err();
    assert_eq!(same_bits(&frame, &frame), Ok(()));
}

#[test]
fn random_numbers_are_spread_and_repeat() {
    let mut random = Random::new(7);
    let numbers: Vec<f64> = (0..10_000).map(|_| random.range(-1.0, 3.0)).collect();
    assert!(numbers.iter().all(|x| (-1.0..3.0).contains(x)));
    let mean = numbers.iter().sum::<f64>() / 1e4;
    assert!((mean - 1.0).abs() < 0.05, "{mean}");
    let mut again = Random::new(7);
    assert!(numbers.iter().all(|x| *x == again.range(-1.0, 3.0)));
    assert_ne!(Random::new(1).bits(), Random::new(2).bits());
    let mut items: Vec<u32> = (0..50).collect();
    random.shuffle(&mut items);
    assert_ne!(items, (0..50).collect::<Vec<_>>());
    items.sort();
    assert_eq!(items, (0..50).collect::<Vec<_>>());
}

/// A generator that never makes a mode tests nothing of it.
#[test]
fn random_cases_repeat_and_reach_every_mode() {
    let describe = |case: &crate::common::scenes::Case| format!("{case:?}{:?}", case.scene);
    assert_eq!(describe(&random_case(3, Kind::Modes)), describe(&random_case(3, Kind::Modes)));
    assert_ne!(describe(&random_case(3, Kind::Modes)), describe(&random_case(4, Kind::Modes)));
    let mut seen = BTreeSet::new();
    for seed in 0..60 {
        let case = random_case(seed, Kind::Modes);
        let s = &case.settings;
        seen.extend([
            format!("{:?}", s.color),
            format!("{:?} silhouette", s.silhouette),
            format!("{:?} distance", s.distance),
        ]);
        seen.extend([
            format!("{:?}", s.background),
            format!("{:?} faces", s.faces),
            format!("{:?} front", s.front_face),
        ]);
        seen.extend([format!("{:?}", s.interpolation), format!("{:?} parity", s.parity)]);
        seen.extend([
            format!("{:?}", case.scene.lights.shading),
            format!("{} lights", case.scene.lights.directional.len()),
        ]);
        let batch = if case.scene.meshes.len() > 1 { "meshes" } else { "views" };
        seen.insert(format!("{} {batch}", case.cameras.len()));
        seen.insert(match case.cameras[0].projection() {
            Projection::Perspective { .. } => "perspective".into(),
            Projection::Orthographic { .. } => "orthographic".into(),
            Projection::Pinhole { .. } => "pinhole".into(),
            Projection::Official { .. } => "official".into(),
            Projection::Screen => "screen".into(),
        });
        seen.extend(case.scene.meshes.iter().map(|mesh| match mesh.appearance() {
            Appearance::Uniform(_) => "uniform".into(),
            Appearance::VertexColors(_) => "vertex colours".into(),
            Appearance::Surface { resolution, .. } => format!("surface {resolution}"),
            Appearance::Textured { textures, .. } => format!("{} textures", textures.len()),
        }));
    }
    // 2 + 3 + 3 modes, 2 + 2 + 2 of background, faces and front, 2 + 2 of interpolation and parity, 2 shadings, 0 to 3
    // lights, 1 to 3 views and 2 or 3 meshes, 5 projections, 2 + 3 + 2 appearances.
    assert_eq!(seen.len(), 8 + 6 + 4 + 2 + 4 + 5 + 5 + 7, "{seen:#?}");
}
