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

/// A rectangle of an image.
#[derive(Clone, Copy, Debug)]
struct Window {
    column: u32,
    row: u32,
    width: u32,
    height: u32,
}

impl Window {
    fn of(&self, camera: &Camera, settings: &Settings) -> softras::Result<(Camera, Settings)> {
        let range = |first: u32, count: u32| first..first.saturating_add(count);
        settings.cropped(camera, range(self.column, self.width), range(self.row, self.height))
    }
}

/// The pixels of a window.
fn cut(image: &Image, w: &Window) -> Image {
    let row = |view: usize, row: u32| {
        let start = ((view * image.height + row as usize) * image.width + w.column as usize) * image.channels;
        &image.data[start..start + w.width as usize * image.channels]
    };
    let rows = (0..image.batch).flat_map(|view| (w.row..w.row + w.height).map(move |r| (view, r)));
    let data = rows.flat_map(|(view, r)| row(view, r)).copied().collect();
    Image { height: w.height as usize, width: w.width as usize, data, ..*image }
}

/// The case's cameras and settings for a window.
fn of(case: &Case, window: &Window) -> (Vec<Camera>, Settings) {
    let made: Vec<_> = case.cameras.iter().map(|camera| window.of(camera, &case.settings).unwrap()).collect();
    (made.iter().map(|(camera, _)| *camera).collect(), made[0].1.clone())
}

fn can_be_cut(case: &Case) -> bool {
    case.cameras.iter().all(|camera| window(0, 0, 1, 1).of(camera, &case.settings).is_ok())
}

fn window(column: u32, row: u32, width: u32, height: u32) -> Window {
    Window { column, row, width, height }
}

fn random_window(random: &mut Random, settings: &Settings) -> Window {
    let mut side = |whole: u32| {
        let first = random.below(whole as usize) as u32;
        (first, 1 + random.below((whole - first) as usize) as u32)
    };
    let ((column, width), (row, height)) = (side(settings.width), side(settings.height));
    window(column, row, width, height)
}

/// In the model a window is exactly a part of the whole; on the device it is as near as any two ways to render a scene.
#[test]
fn a_window_shows_the_pixels_of_the_whole() {
    let mut renderer = renderer();
    let (mut cut_cases, mut equal, mut all) = (0, 0, 0);
    for seed in 0..tier(12, 30) {
        let kind = [Kind::Plain, Kind::Modes, Kind::Clipped][seed as usize % 3];
        let case = random_case(seed, kind);
        if !can_be_cut(&case) {
            continue;
        }
        cut_cases += 1;
        let random = &mut Random::new(seed);
        let whole = renderer.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let reference = render_culled(&case.scene, &case.cameras, &case.settings).unwrap();
        let window = random_window(random, &case.settings);
        let (cameras, settings) = of(&case, &window);
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
    let refused = |window: Window, camera: &Camera, settings: &Settings| {
        window.of(camera, settings).map_or_else(|e| e, |_| panic!("{window:?} was taken"))
    };
    for window in
        [window(0, 0, 0, 1), window(0, 0, 21, 1), window(19, 9, 2, 1), window(u32::MAX, 0, 2, 1), window(0, 9, 1, 2)]
    {
        assert!(matches!(refused(window, &camera, &settings), Error::Settings { field: "cropped", .. }));
    }
    assert!(window(19, 9, 1, 1).of(&camera, &settings).is_ok());
    let official = Projection::Official { distortion: [0.0; 5], original_size: 10.0 };
    for camera in [Camera::screen(), Camera::from_angles(3.0, 20.0, 30.0, official).unwrap()] {
        assert!(matches!(refused(window(0, 0, 1, 1), &camera, &settings), Error::Camera { field: "projection", .. }));
    }
    let boxed = Settings { distance: Distance::Barycentric, parity: Parity::Official, ..settings };
    assert!(matches!(refused(window(0, 0, 1, 1), &camera, &boxed), Error::Settings { field: "distance", .. }));
}
