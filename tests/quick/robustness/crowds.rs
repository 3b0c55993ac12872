//! More triangles at one place than a loop of lavapipe's takes: loops on Mesa 22.3.6 silently end after 65535 passes.

use crate::common::{
    compare::compare_frames,
    random::Random,
    renderer,
    scenes::{crowd, small, triangles},
    tier, tolerance,
};
use softras::{
    Camera, GradientRequest, ImageGradient, Mesh, Renderer, Scene, Settings,
    scene::{Appearance, Outputs, SilhouetteAggregation},
};
use softras_reference::render_culled;

fn is_software(renderer: &Renderer) -> bool {
    renderer.device_info().kind == softras::DeviceKind::Software
}

/// One list that a loop walks, and one that takes several turns.
#[test]
fn a_tile_holds_any_number_of_triangles() {
    for &count in tier(&[130_000][..], &[50_000, 130_000]) {
        let settings = Settings { silhouette: SilhouetteAggregation::Sum, sigma: 1e-5, ..small(16, 16) };
        let scene = Scene::new(triangles(&crowd(count as usize)));
        let frame = renderer().render(&scene, &[Camera::screen()], &settings).unwrap();
        let reference = render_culled(&scene, &[Camera::screen()], &settings).unwrap();
        compare_frames(&frame, &reference, &tolerance::CROWD).unwrap_or_else(|error| panic!("{count}: {error}"));
        let count = f64::from(count);
        let total: f64 = reference.silhouette.iter().sum::<f64>() * count;
        assert!(total > 0.3 * count, "the triangles are seen {total} times");
        let sum: f64 = frame.silhouette().unwrap().data.iter().map(|&x| f64::from(x)).sum::<f64>() * count;
        assert!((sum / total - 1.0).abs() < 1e-4, "{sum} of {total}");
    }
}

/// Triangles of about a pixel each all over one bin of 64×32 pixels.
fn dust(count: usize) -> Vec<[[f32; 3]; 3]> {
    let random = &mut Random::new(7);
    let corners = (0..count).map(|_| {
        let (x, y) = (random.range(-2.0, 2.0) as f32, random.range(-1.0, 1.0) as f32);
        [[x, y, 2.0], [x + 0.06, y, 2.0], [x, y + 0.06, 2.0]]
    });
    corners.collect()
}

fn silhouette_sums(renderer: &mut Renderer, corners: &[[[f32; 3]; 3]]) -> Vec<f64> {
    let settings =
        Settings { silhouette: SilhouetteAggregation::Sum, outputs: Outputs::SILHOUETTE, sigma: 1e-5, ..small(64, 32) };
    let frame = renderer.render(&Scene::new(triangles(corners)), &[Camera::screen()], &settings).unwrap();
    frame.silhouette().unwrap().data.iter().map(|&x| f64::from(x) * corners.len() as f64).collect()
}

/// The scene's silhouette sums are those of the parts together. The parts have all triangles that show. Each pixel has
/// a sum of at least `at_least`.
#[track_caller]
fn assert_sums_of_parts(scene: &[[[f32; 3]; 3]], parts: std::slice::Chunks<[[f32; 3]; 3]>, at_least: f64) {
    let renderer = &mut renderer();
    let whole = silhouette_sums(renderer, scene);
    let mut sums = vec![0.0; whole.len()];
    for part in parts {
        sums.iter_mut().zip(silhouette_sums(renderer, part)).for_each(|(sum, x)| *sum += x);
    }
    let worst = whole.iter().zip(&sums).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    let least = sums.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(least > at_least && worst < 1e-4, "at least {least} a pixel, off by {worst}");
}

/// A bin holds any number of triangles too; other kernels make its list. Most triangles are outside the image, so that few
/// lanes have all the others.
#[test]
fn a_bin_holds_a_hundred_thousand_of_a_million_triangles() {
    let corners = dust(100_000);
    let mut scene = corners.clone();
    scene.resize(1_000_000, [[50.0, 50.0, 2.0], [50.1, 50.0, 2.0], [50.0, 50.1, 2.0]]);
    assert_sums_of_parts(&scene, corners.chunks(20_000), 5.0);
}

/// A software device cannot write the lists of this bin's tiles in one go. The bin has nearly as many records for each
/// lane of bin_coarse as the plan allows; fewer in the quick tier.
#[test]
fn a_bin_holds_half_a_million_triangles_in_the_order_of_tiles() {
    let mut corners = dust(tier(66_000, 524_000));
    let row = |c: &[[f32; 3]; 3]| ((c[0][1] + 1.0) * 4.0) as i32;
    corners.sort_by(|a, b| row(a).cmp(&row(b)).then(a[0][0].total_cmp(&b[0][0])));
    assert_sums_of_parts(&corners, corners.chunks(50_000), tier(2.0, 20.0));
}

#[test]
fn a_vertex_of_too_many_triangles_is_an_error() {
    let mut renderer = renderer();
    let fan = |count: u32| {
        let rim = (0..=count).map(|i| (f64::from(i) * std::f64::consts::TAU / f64::from(count)).sin_cos());
        let positions = std::iter::once([0.0, 0.0, 2.0]).chain(rim.map(|(y, x)| [x as f32, y as f32, 2.0]));
        Mesh::new(positions.collect(), (1..=count).map(|i| [0, i, i + 1]).collect()).unwrap()
    };
    let mut gradients = |count: u32, views: usize| {
        let settings = Settings { save: true, sigma: 1e-5, ..small(8, 8) };
        let frame = renderer.render(&Scene::new(fan(count)), &vec![Camera::screen(); views], &settings)?;
        let upstream = ImageGradient::silhouette(frame.silhouette().unwrap().clone());
        renderer.backward(&frame, &upstream, &GradientRequest { positions: true, ..GradientRequest::NOTHING })
    };
    let at_centre = |g: softras::Gradients| g.meshes[0].positions[0][0];
    assert!(at_centre(gradients(300, 3).unwrap()).is_finite());
    let many = gradients(700, 90).map(at_centre);
    if is_software(&renderer) {
        let error = many.unwrap_err().to_string();
        assert!(error.contains("700 triangle corners, in 90 views"), "{error}");
    }
}

/// The loop that sums over pixels: the gradient by the background is the sum of what four million pixels show of it.
#[test]
fn a_background_of_four_million_pixels_is_summed_to_the_end() {
    let mesh = triangles(&[[[-0.7, -0.6, 2.0], [0.8, -0.5, 2.0], [0.1, 0.7, 2.0]]]);
    let black = mesh.with_appearance(Appearance::Uniform([0.0; 3])).unwrap();
    let settings = Settings {
        background_color: [1.0; 3],
        outputs: Outputs { color: true, ..Outputs::NOTHING },
        save: true,
        sigma: 1e-5,
        ..small(2048, 2048)
    };
    let mut renderer = renderer();
    let frame = renderer.render(&Scene::new(black), &[Camera::screen()], &settings).unwrap();
    let color = frame.color().unwrap();
    let shown: f64 = color.data.iter().step_by(3).map(|&x| f64::from(x)).sum();
    let mut ones = color.clone();
    ones.data.fill(1.0);
    let wanted = GradientRequest { background: true, ..GradientRequest::NOTHING };
    let gradients = renderer.backward(&frame, &ImageGradient::color(ones), &wanted).unwrap();
    let off = (gradients.background_color[0] / shown - 1.0).abs();
    assert!(shown > 3e6 && off < 1e-6, "{:?} should be {shown}", gradients.background_color);
}
