//! Parts of an image, rendered by themselves: the whole image's pixels.

use crate::common::{
    compare::{compare, images},
    random::Random,
    renderer,
    scenes::{Case, Kind, random_case},
    tier, tolerance,
};
use softras::{
    Camera, Error, Image, Projection, Settings,
    scene::{Distance, Parity},
};
use softras_reference::render_culled;
use std::ops::Range;

/// Columns and rows of an image.
type Window = (Range<u32>, Range<u32>);

/// The pixels of a window.
fn cut(image: &Image, (columns, rows): &Window) -> Image {
    let (height, width) = (rows.len(), columns.len());
    let row = |view: usize, row: u32| {
        let start = ((view * image.height + row as usize) * image.width + columns.start as usize) * image.channels;
        &image.data[start..start + width * image.channels]
    };
    let all = (0..image.batch).flat_map(|view| rows.clone().map(move |r| (view, r)));
    let data = all.flat_map(|(view, r)| row(view, r)).copied().collect();
    Image { height, width, data, ..*image }
}

/// The case's cameras and settings for a window; `None` if the image cannot be cropped.
fn of(case: &Case, (columns, rows): &Window) -> Option<(Vec<Camera>, Settings)> {
    let of_camera = |camera| case.settings.cropped(camera, columns.clone(), rows.clone()).ok();
    let made: Vec<_> = case.cameras.iter().map(of_camera).collect::<Option<_>>()?;
    Some((made.iter().map(|(camera, _)| *camera).collect(), made[0].1.clone()))
}

fn random_window(random: &mut Random, settings: &Settings) -> Window {
    let mut side = |whole: u32| {
        let first = random.below(whole as usize) as u32;
        first..first + 1 + random.below((whole - first) as usize) as u32
    };
    (side(settings.width), side(settings.height))
}

/// In the model a window is exactly a part of the whole; on the device it is as near as any two ways to render a scene.
#[test]
fn a_window_shows_the_pixels_of_the_whole() {
    let mut renderer = renderer();
    let (mut cut_cases, mut equal, mut all) = (0, 0, 0);
    for seed in 0..tier(12, 30) {
        let kind = [Kind::Plain, Kind::Modes, Kind::Clipped][seed as usize % 3];
        let case = random_case(seed, kind);
        let window = random_window(&mut Random::new(seed), &case.settings);
        let Some((cameras, settings)) = of(&case, &window) else { continue };
        cut_cases += 1;
        let whole = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
        let part = renderer.render(&case.scene, &cameras, &settings).unwrap();
        let exact = render_culled(&case.scene, &cameras, &settings).unwrap();
        let (batch, height, width) = (reference.batch, reference.height, reference.width);
        let data = reference.margin.iter().map(|&m| m as f32).collect();
        let margin = wide(&cut(&Image { batch, height, width, channels: 1, data }, &window));
        let few_left_out = tolerance::Tolerance { left_out: 1.0, ..tolerance::of(&case) };
        let expected = [&exact.color, &exact.silhouette, &exact.depth, &exact.normal];
        for ((name, whole, part), exact) in images(&whole, &part).into_iter().zip(expected) {
            let (Some(whole), Some(part)) = (whole, part) else { continue };
            let whole = cut(whole, &window);
            let twice = tolerance::Tolerance { value: 2.0 * few_left_out.value, ..few_left_out };
            compare(name, part, &wide(&whole), &margin, &twice).unwrap_or_else(|e| panic!("{e}\n{window:?} {case:?}"));
            compare(name, part, exact, &margin, &few_left_out).unwrap_or_else(|e| panic!("{e}\n{window:?} {case:?}"));
            all += part.data.len();
            equal += part.data.iter().zip(&whole.data).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
        }
    }
    println!("{cut_cases} cases, {equal} of {all} values have the same bits");
    assert!(cut_cases > tier(3, 12) && equal > all / 2, "{cut_cases} {equal} {all}");
}

fn wide(image: &Image) -> Vec<f64> {
    image.data.iter().map(|&x| f64::from(x)).collect()
}

#[test]
fn windows_that_cannot_be_rendered_are_refused() {
    let settings = Settings { width: 20, height: 10, ..Settings::default() };
    let camera = Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.7 }).unwrap();
    let cropped = |(columns, rows): Window, camera: &Camera, settings: &Settings| {
        settings.cropped(camera, columns, rows).map(|_| ()).err()
    };
    for window in [(0..0, 0..1), (0..21, 0..1), (19..21, 9..10), (u32::MAX - 1..u32::MAX, 0..1), (0..1, 9..11)] {
        assert!(matches!(cropped(window, &camera, &settings), Some(Error::Settings { field: "cropped", .. })));
    }
    assert!(cropped((19..20, 9..10), &camera, &settings).is_none());
    let official = Projection::Official { distortion: [0.0; 5], original_size: 10.0 };
    for camera in [Camera::screen(), Camera::from_angles(3.0, 20.0, 30.0, official).unwrap()] {
        let refused = cropped((0..1, 0..1), &camera, &settings);
        assert!(matches!(refused, Some(Error::Camera { field: "projection", .. })));
    }
    let boxed = Settings { distance: Distance::Barycentric, parity: Parity::Official, ..settings };
    assert!(matches!(cropped((0..1, 0..1), &camera, &boxed), Some(Error::Settings { field: "distance", .. })));
}
