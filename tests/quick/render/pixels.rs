//! Pixels that can be computed by hand from MODEL: one or two triangles, a few pixels, round numbers.

use crate::common::{renderer, tolerance::BY_HAND};
use softras::{
    Camera, Frame, Lights, Mesh, Renderer, Scene, Settings,
    scene::{
        Appearance, Background, ColorAggregation, DirectionalLight, Faces, FrontFace, Interpolation, Outputs,
        SilhouetteAggregation, Texture, Wrap,
    },
};
use softras_reference::{Truncation, render};

/// 2×2 pixels centred at ±½; near 1 and far 3, so that z = 2 has ζ = ½; γ = ½ / ln 2, so that exp(ζ/γ) = 2^(2ζ);
/// σ = ¼ / ln 3, so that half a unit inside an edge D = ¾ and outside D = ¼; background black with exp(ε/γ) = 1.
fn settings() -> Settings {
    Settings {
        width: 2,
        height: 2,
        near: 1.0,
        far: 3.0,
        sigma: 0.25 / 3f64.ln(),
        gamma: 0.5 / 2f64.ln(),
        epsilon: 0.0,
        outputs: Outputs::ALL,
        ..Settings::default()
    }
}

/// The half plane x > 0 at depth z, counter-clockwise.
const fn half_plane(z: f32) -> [[f32; 3]; 3] {
    [[0.0, 50.0, z], [0.0, -50.0, z], [100.0, 0.0, z]]
}

fn mesh(triangles: &[[[f32; 3]; 3]], colors: &[[f32; 3]]) -> Mesh {
    let indices = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let appearance = Appearance::Surface { resolution: 1, texels: colors.to_vec() };
    Mesh::new(triangles.concat(), indices).unwrap().with_appearance(appearance).unwrap()
}

/// The kernels' and the reference's values at (row, column), which must be those computed by hand.
struct Check {
    frame: Frame,
    reference: softras_reference::ReferenceFrame,
}

fn check(renderer: &mut Renderer, scene: &Scene, settings: &Settings) -> Check {
    let cameras = [Camera::screen()];
    Check {
        frame: renderer.render(scene, &cameras, settings).unwrap(),
        reference: render(scene, &cameras, settings, Truncation::Tau).unwrap(),
    }
}

impl Check {
    #[track_caller]
    fn assert(&self, name: &str, row: usize, column: usize, expected: &[f64]) {
        let (image, reference) = match name {
            "color" => (self.frame.color(), &self.reference.color),
            "silhouette" => (self.frame.silhouette(), &self.reference.silhouette),
            "depth" => (self.frame.depth(), &self.reference.depth),
            _ => (self.frame.normal(), &self.reference.normal),
        };
        let pixel = row * self.reference.width + column;
        let n = expected.len();
        let close = |x: f64, y: &f64, tolerance: f64| (x - y).abs() <= tolerance;
        let reference = &reference[pixel * n..(pixel + 1) * n];
        assert!(
            reference.iter().zip(expected).all(|(x, y)| close(*x, y, 1e-9)),
            "reference's {name}: {reference:?}, not {expected:?}"
        );
        let image = image.unwrap().pixel(0, row, column);
        let all = image.len() == n && image.iter().zip(expected).all(|(x, y)| close(f64::from(*x), y, BY_HAND));
        assert!(all, "{name}: {image:?}, not {expected:?}");
    }
}

const ORANGE: [f32; 3] = [1.0, 0.5, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];

#[test]
fn one_edge_half_a_unit_away() {
    let renderer = &mut renderer();
    let check = check(renderer, &Scene::new(mesh(&[half_plane(2.0)], &[ORANGE])), &settings());
    for row in 0..2 {
        check.assert("silhouette", row, 0, &[0.25]);
        check.assert("silhouette", row, 1, &[0.75]);
        // w = D·2 / (D·2 + 1): 0.5 / 1.5 outside, 1.5 / 2.5 inside.
        check.assert("color", row, 0, &[1.0 / 3.0, 1.0 / 6.0, 0.0]);
        check.assert("color", row, 1, &[0.6, 0.3, 0.0]);
        check.assert("depth", row, 0, &[2.0 / 3.0]);
        check.assert("depth", row, 1, &[1.2]);
        // Counter-clockwise with x right and y up: (b - a) × (c - a) points along +z.
        check.assert("normal", row, 1, &[0.0, 0.0, 0.6]);
    }
}

#[test]
fn two_triangles_by_depth() {
    let renderer = &mut renderer();
    let scene = Scene::new(mesh(&[half_plane(2.0), half_plane(1.0)], &[ORANGE, BLUE]));
    let soft = check(renderer, &scene, &settings());
    // Inside: D = ¾ each, so 1.5, 3 and the background's 1 of 5.5.
    soft.assert("silhouette", 0, 1, &[15.0 / 16.0]);
    soft.assert("color", 0, 1, &[1.5 / 5.5, 0.75 / 5.5, 3.0 / 5.5]);
    soft.assert("depth", 0, 1, &[6.0 / 5.5]);
    // Outside: 0.5, 1 and 1 of 2.5; A = 1 - (¾)².
    soft.assert("silhouette", 1, 0, &[7.0 / 16.0]);
    soft.assert("color", 1, 0, &[0.2, 0.1, 0.4]);

    let composite = Settings { background: Background::Composite, background_color: [0.0, 1.0, 0.0], ..settings() };
    let composite = check(renderer, &scene, &composite);
    // w' = ⅓ and ⅔, times A = 15/16, and 1/16 of green.
    composite.assert("color", 0, 1, &[15.0 / 48.0, 15.0 / 96.0 + 1.0 / 16.0, 30.0 / 48.0]);
    composite.assert("depth", 0, 1, &[15.0 / 16.0 * (2.0 / 3.0 + 2.0 / 3.0)]);

    let modes = Settings { color: ColorAggregation::Hard, silhouette: SilhouetteAggregation::Sum, ..settings() };
    let hard = check(renderer, &scene, &modes);
    hard.assert("color", 0, 1, &[0.0, 0.0, 1.0]);
    hard.assert("color", 0, 0, &[0.0; 3]);
    hard.assert("depth", 0, 1, &[1.0]);
    hard.assert("silhouette", 0, 1, &[0.75]);
    hard.assert("silhouette", 0, 0, &[0.25]);

    let hard = check(renderer, &scene, &Settings { silhouette: SilhouetteAggregation::Hard, ..settings() });
    hard.assert("silhouette", 0, 1, &[1.0]);
    hard.assert("silhouette", 0, 0, &[0.0]);
}

#[test]
fn beyond_the_far_plane_nothing_is_left() {
    let renderer = &mut renderer();
    let check = check(renderer, &Scene::new(mesh(&[half_plane(3.5), half_plane(2.0)], &[BLUE, ORANGE])), &settings());
    check.assert("silhouette", 0, 1, &[0.75]);
    check.assert("color", 0, 1, &[0.6, 0.3, 0.0]);
}

#[test]
fn before_the_near_plane_nothing_is_left() {
    let renderer = &mut renderer();
    let check = check(
        renderer,
        &Scene::new(mesh(&[half_plane(0.5), half_plane(2.0), half_plane(-2.0)], &[BLUE, ORANGE, BLUE])),
        &settings(),
    );
    check.assert("silhouette", 0, 1, &[0.75]);
    check.assert("color", 0, 1, &[0.6, 0.3, 0.0]);
}

#[test]
fn a_corner_is_as_far_as_pythagoras_says() {
    let renderer = &mut renderer();
    // The pixel (-½, ½) is ⅜ left of and ½ above the corner (-⅛, 0), so ⅝ away; all else lies right and below.
    let triangle = [[-0.125, 0.0, 2.0], [2.5, -5.0, 2.0], [2.5, -4.0, 2.0]];
    let check = check(renderer, &Scene::new(mesh(&[triangle], &[ORANGE])), &settings());
    // σ = ¼ / ln 3 makes exp(-d²/σ) = 3^(-4 d²).
    check.assert("silhouette", 0, 0, &[1.0 / (1.0 + 3f64.powf(4.0 * 25.0 / 64.0))]);
}

#[test]
fn screen_units_are_half_heights_on_both_axes() {
    let renderer = &mut renderer();
    // 4×2 pixels: columns at -1.5, -0.5, 0.5, 1.5; D of the first is 1 / (1 + 3^9), below τ, and dropped.
    let check = check(renderer, &Scene::new(mesh(&[half_plane(2.0)], &[ORANGE])), &Settings { width: 4, ..settings() });
    for (column, d) in [0.0, 0.25, 0.75, 1.0 - 1.0 / 19684.0].into_iter().enumerate() {
        check.assert("silhouette", 1, column, &[d]);
    }
}

#[test]
fn rows_count_from_the_top() {
    let renderer = &mut renderer();
    let below = [[-50.0, 0.0, 2.0], [0.0, -100.0, 2.0], [50.0, 0.0, 2.0]];
    let check = check(renderer, &Scene::new(mesh(&[below], &[ORANGE])), &settings());
    check.assert("silhouette", 0, 0, &[0.25]);
    check.assert("silhouette", 1, 0, &[0.75]);
}

/// One pixel at the centroid of a triangle whose corners are at depths 1, 1 and 2.
#[test]
fn corner_values_are_interpolated_as_asked() {
    let renderer = &mut renderer();
    let positions = vec![[-30.0, -30.0, 1.0], [30.0, -30.0, 1.0], [0.0, 60.0, 2.0]];
    let colors = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2]]).unwrap();
    let scene = Scene::new(mesh.with_appearance(Appearance::VertexColors(colors)).unwrap());
    let single = Settings { width: 1, height: 1, background: Background::Composite, ..settings() };
    let affine = check(renderer, &scene, &single);
    affine.assert("color", 0, 0, &[1.0 / 3.0; 3]);
    // 1/z = (1 + 1 + ½) / 3.
    affine.assert("depth", 0, 0, &[1.2]);
    let perspective = check(renderer, &scene, &Settings { interpolation: Interpolation::Perspective, ..single });
    perspective.assert("color", 0, 0, &[0.4, 0.4, 0.2]);
}

#[test]
fn textures_are_sampled_between_their_texels() {
    let renderer = &mut renderer();
    let texels = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    let expected = [
        // u, v, repeat, clamp; texel centres are at ¼ and ¾, row 0 at the top (v = ¾).
        ([0.25, 0.75], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ([0.75, 0.25], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]),
        ([0.5, 0.75], [0.5, 0.5, 0.0], [0.5, 0.5, 0.0]),
        ([0.0, 0.25], [0.5, 0.5, 1.0], [0.0, 0.0, 1.0]),
        ([-0.75, 1.75], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        ([1.5, -0.25], [0.5, 0.5, 0.0], [1.0, 1.0, 1.0]),
    ];
    for (uv, repeat, clamp) in expected {
        for (wrap, color) in [(Wrap::Repeat, repeat), (Wrap::Clamp, clamp)] {
            let appearance = Appearance::Textured {
                uvs: vec![uv],
                uv_triangles: vec![[0; 3]],
                textures: vec![Texture::new(2, 2, texels.clone(), wrap).unwrap()],
                texture_of_triangle: vec![],
            };
            let mesh = mesh(&[half_plane(2.0)], &[BLUE]).with_appearance(appearance).unwrap();
            let hard = Settings { color: ColorAggregation::Hard, ..settings() };
            check(renderer, &Scene::new(mesh), &hard).assert("color", 0, 1, &color);
        }
    }
}

#[test]
fn light_falls_on_the_side_that_a_triangle_shows_to_it() {
    let renderer = &mut renderer();
    let light = |direction| DirectionalLight { direction, color: [1.0, 1.0, 0.5], intensity: 0.5 };
    // The normal is +z; 3-4-5 gives n · l = 0.6.
    for (direction, expected) in [
        ([0.0, 0.0, 7.0], [0.75, 0.75, 0.5]),
        ([8.0, 0.0, 6.0], [0.55, 0.55, 0.4]),
        ([0.0, 0.0, -1.0], [0.25, 0.25, 0.25]),
    ] {
        let lights = Lights { ambient_intensity: 0.25, directional: vec![light(direction)], ..Lights::unlit() };
        let scene = Scene::new(mesh(&[half_plane(2.0)], &[[1.0; 3]])).with_lights(lights);
        let hard = Settings { color: ColorAggregation::Hard, ..settings() };
        check(renderer, &scene, &hard).assert("color", 0, 1, &expected);
    }
}

#[test]
fn back_faces_are_left_out_on_request() {
    let renderer = &mut renderer();
    let mut back = half_plane(1.0);
    back.swap(0, 1);
    let scene = Scene::new(mesh(&[half_plane(2.0), back], &[ORANGE, BLUE]));
    let front = Settings { faces: Faces::Front, ..settings() };
    let check_front = check(renderer, &scene, &front);
    check_front.assert("silhouette", 0, 1, &[0.75]);
    check_front.assert("color", 0, 1, &[0.6, 0.3, 0.0]);
    let turned = check(renderer, &scene, &Settings { front_face: FrontFace::Clockwise, ..front });
    // The near blue one alone: 3 of 4.
    turned.assert("color", 0, 1, &[0.0, 0.0, 0.75]);
    turned.assert("depth", 0, 1, &[0.75]);
}

#[test]
fn nothing_is_the_background() {
    let renderer = &mut renderer();
    let empty = Scene::new(Mesh::new(vec![], vec![]).unwrap());
    let settings = Settings { background_color: [0.1, 0.2, 0.3], width: 5, ..settings() };
    for background in [Background::Weighted, Background::Composite] {
        let check = check(renderer, &empty, &Settings { background, ..settings.clone() });
        for column in 0..5 {
            check.assert("color", 1, column, &[0.1, 0.2, 0.3]);
            check.assert("silhouette", 1, column, &[0.0]);
            check.assert("depth", 1, column, &[0.0]);
            check.assert("normal", 1, column, &[0.0; 3]);
        }
    }
}
