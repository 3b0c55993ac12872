//! Features of any number: they have the weights of colours, and gradients as exact.

use super::repeat::{EYES, ball};
use crate::common::{
    compare::compare,
    gradient::{
        Group, made, made_case, norm, numbers, random_upstream, reference_gradient, relative_error, same_made_bits,
        small_case,
    },
    random::Random,
    renderer, renderer_with,
    scenes::{Case, Kind, crowd, small, triangles},
    tier,
    tolerance::{self, GRADIENT, Tolerance},
};
use crate::host::Planner;
use softras::GradientMode::Exact;
use softras::embed::Capacity;
use softras::scene::{Appearance, Outputs};
use softras::{
    Camera, GradientRequest, Gradients, Image, ImageGradient, Lights, Mesh, Renderer, RendererOptions, Scene, Settings,
    shapes,
};
use softras_check::agreement::{Numbers, reference_numbers, unit, upstream_norm};
use softras_reference::render_culled;

/// A mesh whose vertices have random features.
fn with_features(mesh: Mesh, channels: u32, random: &mut Random) -> Mesh {
    let features = (0..mesh.positions().len() as u32 * channels).map(|_| random.range(-1.0, 1.0) as f32);
    let features = features.collect();
    mesh.with_features(channels, features).unwrap()
}

fn each_mesh(case: &Case, change: impl FnMut(Mesh) -> Mesh) -> Case {
    let meshes = case.scene.meshes.iter().cloned().map(change).collect();
    Case { scene: Scene::batch(meshes).with_lights(case.scene.lights.clone()), ..case.clone() }
}

/// The case without lights before a black background, with vertex colours that are the features of these channels as well.
fn as_colors(case: &Case, channels: [usize; 3]) -> Case {
    let mut case = each_mesh(case, |mesh| {
        let all = mesh.feature_channels() as usize;
        let rows = mesh.features().chunks_exact(all);
        let colors = rows.map(|row| channels.map(|c| row.get(c).copied().unwrap_or(0.0))).collect();
        mesh.with_appearance(Appearance::VertexColors(colors)).unwrap()
    });
    case.scene.lights = Lights::unlit();
    case.settings.background_color = [0.0; 3];
    case
}

/// The upstream gradient with that of these channels of the features in place of the colours', and none of the others.
fn of_colors(upstream: &ImageGradient, channels: [usize; 3]) -> ImageGradient {
    let features = upstream.features.as_ref().unwrap();
    let rows = features.data.chunks_exact(features.channels);
    let data = rows.flat_map(|row| channels.map(|c| row.get(c).copied().unwrap_or(0.0))).collect();
    ImageGradient { color: Some(Image { channels: 3, data, ..*features }), ..ImageGradient::default() }
}

/// A random upstream gradient of the features, 0 where the model jumps within rounding.
fn upstream_of_features(case: &Case, channels: usize) -> ImageGradient {
    let mask = random_upstream(case, Outputs::SILHOUETTE).silhouette.unwrap();
    let random = &mut Random::new(case.seed + 17);
    let weights = mask.data.iter().flat_map(|&kept| vec![kept; channels]);
    let data = weights.map(|kept| if kept == 0.0 { 0.0 } else { random.range(-1.0, 1.0) as f32 }).collect();
    ImageGradient { features: Some(Image { channels, data, ..mask }), ..ImageGradient::default() }
}

/// Small random scenes of every kind, whose vertices have features.
fn cases(count: u64, channels: u32) -> impl Iterator<Item = Case> {
    let kinds = [Kind::Plain, Kind::Modes, Kind::Clipped];
    let seeds = kinds.into_iter().flat_map(move |kind| (0..count).map(move |seed| (900 + seed, kind)));
    seeds.map(move |(seed, kind)| {
        let random = &mut Random::new(seed);
        let mut case = each_mesh(&small_case(seed, kind), |mesh| with_features(mesh, channels, random));
        case.settings.outputs = Outputs { color: true, silhouette: true, features: true, ..Outputs::NOTHING };
        case
    })
}

#[test]
fn three_features_are_a_colour_to_the_bit() {
    let (mut renderer, mut seen) = (renderer(), 0);
    let wanted = GradientRequest { background: false, lights: false, ..GradientRequest::ALL };
    let all: Vec<Case> = cases(tier(3, 40), 3).collect();
    for case in &all {
        let case = as_colors(case, [0, 1, 2]);
        let upstream = upstream_of_features(&case, 3);
        let (frame, ours) = made(&mut renderer, &case, &upstream, &wanted).unwrap();
        assert_eq!(frame.features().unwrap(), frame.color().unwrap(), "{case:?}");
        let (_, by_color) = made(&mut renderer, &case, &of_colors(&upstream, [0, 1, 2]), &wanted).unwrap();
        let found = numbers_of_colors(&ours).into_iter().zip(numbers_of_colors(&by_color));
        for ((name, ours), (_, reference)) in found {
            let error = relative_error(&Group { name, ours, reference: reference.clone() }, 0.0).unwrap();
            assert!(error < 1e-4, "{name} is off by {error:e}: {case:?}");
            seen += usize::from(norm(&reference) > 0.0);
        }
    }
    assert!(seen > 3 * all.len(), "{seen} gradients of {} scenes", all.len());
}

/// All gradients, those by features as those by colours.
fn numbers_of_colors(gradients: &Gradients) -> Numbers {
    let mut all = numbers(gradients);
    for i in 0..all.len() - 1 {
        if all[i].0 == "colors" && all[i].1.iter().all(|&x| x == 0.0) {
            all[i].1 = std::mem::take(&mut all[i + 1].1);
        }
    }
    all.into_iter().filter(|(name, _)| *name != "features").collect()
}

/// Features of any number beside colours, textures, lights and other images, all with an upstream gradient.
#[test]
fn any_number_is_the_references() {
    let (mut renderer, mut seen) = (renderer(), 0);
    for (channels, count) in [(1, tier(0, 5)), (5, tier(1, 20)), (16, tier(1, 20)), (32, tier(0, 5))] {
        for case in cases(count, channels).filter(|case| !case.scene.meshes.iter().any(has_alpha)) {
            let tolerance = tolerance::of(&case);
            seen += usize::from(assert_agrees(&mut renderer, &case, &tolerance, GRADIENT.worst));
        }
    }
    assert!(seen > 4, "{seen}");
}

/// Where triangles are no needles and depths no noise, sixteen features are within 2e-6 of the model and gradients within 1e-5.
#[test]
fn sixteen_are_exact() {
    let mut case = ball(2, &EYES[..1], 64);
    case.scene = Scene::new(with_features(shapes::icosphere(2).unwrap(), 16, &mut Random::new(11)));
    let outputs = Outputs { features: true, ..Outputs::NOTHING };
    case.settings = Settings { sigma: 1e-4, gamma: 1e-2, near: 1.0, far: 6.0, outputs, save: true, ..small(64, 64) };
    let tolerance = Tolerance { value: 2e-6, ..tolerance::IMAGE };
    assert!(assert_agrees(&mut renderer(), &case, &tolerance, 1e-5));
}

/// Compares the features, and all gradients with an upstream gradient of every image, with the reference, for which three features at
/// a time are colours. Returns whether some feature has a gradient.
fn assert_agrees(renderer: &mut Renderer, case: &Case, tolerance: &Tolerance, most: f64) -> bool {
    let channels = case.scene.meshes[0].feature_channels() as usize;
    let others = Outputs { features: false, ..case.settings.outputs };
    let of_features = upstream_of_features(case, channels);
    let of_others = if others == Outputs::NOTHING { ImageGradient::default() } else { random_upstream(case, others) };
    let upstream = ImageGradient { features: of_features.features, ..of_others.clone() };
    let (frame, ours) = made(renderer, case, &upstream, &GradientRequest::ALL).unwrap();
    let mut expected = reference_numbers(case.subject(), &reference_gradient(case, &of_others, Exact));
    let mut by_features = vec![Vec::new(); case.scene.meshes.len()];
    for first in (0..channels).step_by(3) {
        let channels = [first, first + 1, first + 2];
        let mut colors = as_colors(case, channels);
        colors.settings.outputs.color = true;
        let reference = render_culled(&colors.scene, &colors.cameras, &colors.settings).unwrap();
        let part = part_of(frame.features().unwrap(), channels);
        compare("features", &part, &reference.color, &reference.margin, tolerance).unwrap();
        let gradient = reference_gradient(&colors, &of_colors(&upstream, channels), Exact);
        for (m, by_mesh) in by_features.iter_mut().enumerate() {
            by_mesh.push(gradient.colors(m).to_vec());
        }
        add_geometry(&mut expected, &reference_numbers(colors.subject(), &gradient));
    }
    let mut by_features = by_features.into_iter().map(|parts| interleaved(&parts, channels));
    for (name, values) in expected.iter_mut().filter(|(name, _)| *name == "features") {
        *values = by_features.next().expect(name);
    }
    let mut seen = false;
    for ((name, ours), (_, reference)) in numbers(&ours).into_iter().zip(expected) {
        let floor = GRADIENT.nothing * upstream_norm(&upstream) * unit(case.subject(), name);
        let error = relative_error(&Group { name, ours, reference: reference.clone() }, floor).unwrap();
        assert!(error < most, "{name} of {channels} is off by {error:e}: {case:?}");
        seen |= name == "features" && norm(&reference) > 0.0;
    }
    seen
}

fn has_alpha(mesh: &Mesh) -> bool {
    let Appearance::Textured { textures, .. } = mesh.appearance() else { return false };
    textures.iter().any(|texture| texture.alpha().is_some())
}

/// These channels of an image, and zeros for those that it does not have.
fn part_of(image: &Image, channels: [usize; 3]) -> Image {
    let rows = image.data.chunks_exact(image.channels);
    let data = rows.flat_map(|row| channels.map(|c| row.get(c).copied().unwrap_or(0.0))).collect();
    Image { channels: 3, data, ..*image }
}

/// Adds the gradients by positions, cameras and scalars.
fn add_geometry(to: &mut Numbers, part: &Numbers) {
    for name in ["positions", "twist", "projection", "epsilon", "sigma", "gamma"] {
        let to = to.iter_mut().filter(|(n, _)| *n == name).flat_map(|(_, values)| values);
        let part = part.iter().filter(|(n, _)| *n == name).flat_map(|(_, values)| values);
        to.zip(part).for_each(|(to, part)| *to += part);
    }
}

/// Rows of `channels` numbers from rows of three of them each.
fn interleaved(parts: &[Vec<f64>], channels: usize) -> Vec<f64> {
    let rows = parts[0].len() / 3;
    (0..rows * channels).map(|i| (i / channels, i % channels)).map(|(row, c)| parts[c / 3][3 * row + c % 3]).collect()
}

/// Tiles without lists, in one turn and in several, and boxes of several cells without room.
#[test]
fn features_do_not_depend_on_the_room_for_lists() {
    let planner = Planner::new();
    let random = &mut Random::new(3);
    let mut blurred = ball(1, &EYES[..2], 130);
    (blurred.settings.height, blurred.settings.sigma) = (70, 1.2e-2);
    let settings = Settings { sigma: 1e-5, gamma: 1e-2, save: true, ..small(16, 16) };
    let turns = made_case(Scene::new(triangles(&crowd(48_000))), vec![Camera::screen()], settings);
    for (case, channels) in [(blurred, 5), (turns, 1)] {
        let mut case = each_mesh(&case, |mesh| with_features(mesh, channels, random));
        case.settings.outputs = Outputs { features: true, ..Outputs::SILHOUETTE };
        let mut upstream = upstream_of_features(&case, channels as usize);
        upstream.features.as_mut().unwrap().data.iter_mut().for_each(|x| *x = random.range(-1.0, 1.0) as f32);
        let of = |capacity| planner.render(&case, &upstream, GradientRequest::ALL, capacity);
        let whole = of(Capacity { coarse: 1 << 18, list: 1 << 20, cells: 1 << 12 });
        assert_eq!(whole.difference(&of(Capacity { coarse: 1, list: 1, cells: 1 })), None, "{channels}");
        assert!(whole.gradients.meshes[0].features.iter().any(|&x| x != 0.0));
    }
    planner.assert_silent();
}

/// Other features in the next frame are uploaded, and no others stay.
#[test]
fn a_frame_has_the_features_of_its_mesh() {
    let (mut renderer, random) = (renderer(), &mut Random::new(5));
    let mut case = ball(1, &EYES[..2], 24);
    case.settings.outputs = Outputs { features: true, ..Outputs::SILHOUETTE };
    let mut frames = Vec::new();
    for channels in [7, 7, 2, 32] {
        let case = each_mesh(&case, |mesh| with_features(mesh, channels, random));
        let upstream = upstream_of_features(&case, channels as usize);
        let made = made(&mut renderer, &case, &upstream, &GradientRequest::ALL).unwrap();
        let mut fresh = renderer_with(RendererOptions::default());
        same_made_bits(&made, &self::made(&mut fresh, &case, &upstream, &GradientRequest::ALL).unwrap()).unwrap();
        assert_eq!(made.0.features().unwrap().channels, channels as usize);
        frames.push(made.0);
    }
    assert_ne!(frames[0].features().unwrap(), frames[1].features().unwrap());
}

#[test]
fn wrong_features_are_refused() {
    let cube = || shapes::cube().unwrap();
    let of = |channels, values| cube().with_features(channels, values).unwrap_err().to_string();
    assert!(of(33, vec![0.0; 33 * 8]).contains("33 features"));
    assert!(of(2, vec![0.0; 15]).contains("15 features, expected 16"));
    for bad in [f32::NAN, f32::INFINITY, -2e12] {
        let mut values = vec![0.0; 16];
        values[5] = bad;
        assert!(of(2, values).contains("vertex 2, channel 1"), "{bad}");
    }
    let mut renderer = renderer();
    let (cameras, outputs) = (&ball(1, &EYES[..2], 8).cameras, Outputs { features: true, ..Outputs::NOTHING });
    let settings = Settings { outputs, ..small(8, 8) };
    let two = || cube().with_features(2, vec![0.5; 16]).unwrap();
    let mut refused = |meshes: Vec<Mesh>| renderer.render(&Scene::batch(meshes), cameras, &settings).unwrap_err();
    assert!(refused(vec![cube()]).to_string().contains("the meshes have 0 at"));
    assert!(refused(vec![two(), cube()]).to_string().contains("the meshes have 2, 0 at"));
    let frame = renderer.render_saved(&Scene::new(two()), cameras, &settings).unwrap();
    let Image { batch, height, width, .. } = *frame.features().unwrap();
    let wrong = Image { batch, height, width, channels: 3, data: vec![0.0; batch * height * width * 3] };
    let upstream = ImageGradient { features: Some(wrong), ..ImageGradient::default() };
    let error = renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap_err();
    assert!(error.to_string().contains("[2, 8, 8, 3], the image [2, 8, 8, 2]"), "{error}");
}
