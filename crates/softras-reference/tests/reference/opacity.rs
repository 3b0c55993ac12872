//! The reference's opacity against numbers computed by hand.

use super::{assert_close, close, on_screen, one_pixel, screen_mesh};
use softras::GradientMode;
use softras::scene::{
    Appearance, Background, Camera, ColorAggregation, Distance, Scene, Settings, SilhouetteAggregation, Texture, Wrap,
};
use softras_reference::{Upstream, gradient};

const RED: [f32; 3] = [1.0, 0.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

/// Triangles around the pixel at these depths, each of one colour and alpha.
fn layers(layers: &[(f32, [f32; 3], f32)]) -> Scene {
    let corners = |z: f32| [[-0.3, -0.2, z], [0.3, -0.2, z], [0.0, 0.3, z]];
    let positions: Vec<_> = layers.iter().flat_map(|layer| corners(layer.0)).collect();
    let image = |&(_, color, alpha): &(f32, [f32; 3], f32)| {
        Texture::new(1, 1, vec![color], Wrap::Clamp).unwrap().with_alpha(vec![alpha]).unwrap()
    };
    let appearance = Appearance::Textured {
        uvs: vec![[0.5, 0.5]],
        uv_triangles: vec![[0; 3]; layers.len()],
        textures: layers.iter().map(image).collect(),
        texture_of_triangle: (0..layers.len() as u32).collect(),
    };
    Scene::new(screen_mesh(&positions).with_appearance(appearance).unwrap())
}

/// D in each of the triangles at the pixel, from which the edges that meet at the top are the nearest.
fn probability(settings: &Settings) -> f64 {
    let (half, below, above) = (f64::from(0.3f32), f64::from(0.2f32), f64::from(0.3f32));
    let distance = half * above / half.hypot(below + above);
    1.0 / (1.0 + (-distance.powi(2) / settings.sigma).exp())
}

#[test]
fn probabilities_are_multiplied() {
    let scene = layers(&[(2.0, RED, 0.25), (3.0, BLUE, 1.0)]);
    let settings = Settings { background: Background::Composite, gamma: 0.5, ..one_pixel() };
    let frame = on_screen(&scene, &settings);
    let d = probability(&settings);
    let silhouette = 1.0 - (1.0 - 0.25 * d) * (1.0 - d);
    assert_close("silhouette", &frame.silhouette, &[silhouette]);
    let score = |z: f64| ((settings.far - z) / (settings.far - settings.near) / settings.gamma).exp();
    let [front, back] = [0.25 * d * score(2.0), d * score(3.0)];
    let red = silhouette * front / (front + back);
    assert_close("colour", &frame.color, &[red, 0.0, silhouette - red]);
    let sum = Settings { silhouette: SilhouetteAggregation::Sum, ..settings.clone() };
    assert_close("sum", &on_screen(&scene, &sum).silhouette, &[1.25 * d / 2.0]);
    let certain = Settings { distance: Distance::Hard, ..settings };
    let scene = layers(&[(2.0, RED, 0.25), (3.0, BLUE, 0.5)]);
    assert_close("hard distance", &on_screen(&scene, &certain).silhouette, &[1.0 - 0.75 * 0.5]);
}

/// A triangle of alpha 0 hides nothing, however near it is and however small γ.
#[test]
fn nothing_is_seen_of_an_alpha_of_0() {
    let scene = layers(&[(2.0, RED, 0.0), (50.0, BLUE, 1.0)]);
    for background in [Background::Weighted, Background::Composite] {
        let settings = Settings { background, gamma: 1e-8, sigma: 1e-6, ..one_pixel() };
        let frame = on_screen(&scene, &settings);
        assert_close("colour", &frame.color, &[0.0, 0.0, 1.0]);
        assert_close("silhouette and depth", &[frame.silhouette[0], frame.depth[0]], &[1.0, 50.0]);
    }
}

#[test]
fn hard_modes_count_from_a_half_on() {
    let hard = Settings {
        color: ColorAggregation::Hard,
        silhouette: SilhouetteAggregation::Hard,
        background_color: [0.0, 1.0, 0.0],
        ..one_pixel()
    };
    for (front, back, color, silhouette) in
        [(0.5, 1.0, [1.0, 0.0, 0.0], 1.0), (0.49, 0.5, [0.0, 0.0, 1.0], 1.0), (0.49, 0.49, [0.0, 1.0, 0.0], 0.0)]
    {
        let frame = on_screen(&layers(&[(2.0, RED, front), (3.0, BLUE, back)]), &hard);
        assert_close("colour", &frame.color, &color.map(f64::from));
        assert_close("silhouette", &frame.silhouette, &[silhouette]);
    }
}

/// ∂A/∂α_j = D Π (1 - α_k D) over the others, exact where 1 - D is 0; and an α of 0 before all others has a derivative that
/// is finite.
#[test]
fn gradients_by_alpha() {
    let settings = Settings { sigma: 1e-6, gamma: 1e-8, ..one_pixel() };
    let by_alpha = |alphas: [f32; 2], upstream: &Upstream| {
        let scene = layers(&[(2.0, RED, alphas[0]), (3.0, BLUE, alphas[1])]);
        let all = gradient(&scene, &[Camera::screen()], &settings, upstream, GradientMode::Exact).unwrap();
        assert!(all.values().iter().all(|x| x.is_finite()), "{alphas:?}");
        [0, 1].map(|texture| all.texture_alpha(0, texture)[0])
    };
    let silhouette = Upstream { d_silhouette: Some(vec![2.0]), ..Upstream::default() };
    // Textures whose alpha is 1 throughout are opaque; the other one's derivative is 2 (1 - 1).
    let just_below = 1.0 - f32::EPSILON / 2.0;
    let [front, back] = by_alpha([just_below, 0.25], &silhouette);
    assert!(close(front, 1.5) && back.abs() < 1e-6, "{front} {back}");
    let [front, back] = by_alpha([0.5, 0.25], &silhouette);
    assert!(close(front, 1.5) && close(back, 1.0), "{front} {back}");
    let color = Upstream { d_color: Some(vec![1.0, 0.0, 0.0]), ..Upstream::default() };
    // Red replaces blue: the limit 256 times (1 - 0).
    assert_close("limited", &by_alpha([0.0, 0.5], &color), &[256.0, 0.0]);
}
