//! Every kind of error is reached, and its text names the thing, the place and the fix.

use crate::common::renderer;
use glam::{DMat4, DVec3};
use softras::{
    Camera, Error, GradientRequest, Image, ImageGradient, Lights, Mesh, Projection, Renderer, RendererOptions, Result,
    Scene, Settings,
    scene::{Appearance, DirectionalLight, Outputs, Texture, Wrap},
};

/// The error's text has every part.
#[track_caller]
fn assert_says<T: std::fmt::Debug>(result: Result<T>, parts: &[&str]) -> Error {
    let error = result.expect_err("an error");
    let text = error.to_string();
    assert!(parts.iter().all(|part| text.contains(part)), "{parts:?} not all in: {text}");
    error
}

fn triangle() -> Mesh {
    Mesh::new(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]).unwrap()
}

const PERSPECTIVE: Projection = Projection::Perspective { fov_y: 0.8 };

fn camera() -> Camera {
    Camera::from_angles(3.0, 20.0, 30.0, PERSPECTIVE).unwrap()
}

#[test]
fn meshes() {
    let nan = vec![[0.0; 3], [0.0, f32::NAN, 0.0]];
    let error = assert_says(Mesh::new(nan, vec![]), &["mesh", "NaN", "vertex 1", "finite"]);
    assert!(matches!(error, Error::Mesh { .. }));
    assert_says(Mesh::new(vec![[0.0; 3]; 3], vec![[0, 1, 3]]), &["index 3", "there are 3", "triangle 0, corner 2"]);
    let with = |appearance| triangle().with_appearance(appearance);
    assert_says(with(Appearance::VertexColors(vec![[0.0; 3]; 2])), &["2 vertex colours", "3", "exactly"]);
    assert_says(with(Appearance::Uniform([f32::INFINITY; 3])), &["inf", "uniform colour"]);
    assert_says(with(Appearance::Surface { resolution: 0, texels: vec![] }), &["resolution 0", "1 to 1024"]);
    let texture = Texture::new(1, 1, vec![[0.5; 3]], Wrap::Repeat).unwrap();
    let textured = |uvs: Vec<[f32; 2]>, textures: Vec<Texture>, texture_of_triangle| Appearance::Textured {
        uvs,
        uv_triangles: vec![[0; 3]],
        textures,
        texture_of_triangle,
    };
    assert_says(with(textured(vec![[2e4, 0.0]], vec![texture.clone()], vec![])), &["20000", "UV 0", "repeats"]);
    assert_says(with(textured(vec![[0.0; 2]], vec![], vec![])), &["no texture", "at least one image"]);
    assert_says(with(textured(vec![[0.0; 2]], vec![texture], vec![1])), &["texture 1", "triangle 0"]);
    assert_says(Texture::new(2, 2, vec![[0.0; 3]; 3], Wrap::Clamp), &["3 texels for 2×2", "width × height"]);
    assert_says(triangle().set_positions(vec![]), &["0 positions", "3"]);
    assert_says(softras::shapes::by_name("cow"), &["cow", "torus"]);
}

#[test]
fn cameras() {
    let error = assert_says(
        Camera::look_at(DVec3::ONE, DVec3::ONE, DVec3::Y, PERSPECTIVE),
        &["camera", "direction", "eye and target must differ"],
    );
    assert!(matches!(error, Error::Camera { field: "direction", .. }));
    assert_says(
        Camera::look_direction(DVec3::ONE, DVec3::Y, DVec3::Y, PERSPECTIVE),
        &["up", "along the view direction"],
    );
    assert_says(Camera::from_angles(0.0, 0.0, 0.0, PERSPECTIVE), &["distance", "above 0"]);
    let wide = Projection::Perspective { fov_y: 4.0 };
    assert_says(Camera::from_angles(1.0, 0.0, 0.0, wide), &["fov_y = 4", "radians"]);
    assert_says(Camera::from_matrix(DMat4::ZERO, PERSPECTIVE), &["view", "rotation"]);
    assert_says(Camera::official([[f64::NAN; 4]; 3], [0.0; 5], 256.0), &["view", "NaN", "finite"]);
}

#[test]
fn scenes_lights_and_settings() {
    let mut renderer = renderer();
    let cameras = vec![camera(); 3];
    let mut render =
        |scene: &Scene, count: usize, settings: &Settings| renderer.render(scene, &cameras[..count], settings);
    let scene = Scene::new(triangle());
    let settings = Settings::default();

    assert!(matches!(
        assert_says(render(&scene, 0, &settings), &["scene", "0 cameras", "at least one"]),
        Error::Scene { .. }
    ));
    assert_says(render(&Scene::batch(vec![]), 1, &settings), &["0 meshes"]);
    assert_says(
        render(&Scene::batch(vec![triangle(); 2]), 3, &settings),
        &["2 meshes but 3 cameras", "one camera per mesh"],
    );

    let dark = DirectionalLight { direction: [0.0; 3], color: [1.0; 3], intensity: 1.0 };
    let lights = Lights { directional: vec![dark], ..Lights::unlit() };
    let error = assert_says(
        render(&scene.clone().with_lights(lights), 1, &settings),
        &["light", "directional[0].direction", "above 0"],
    );
    assert!(matches!(error, Error::Light { .. }));

    let none = Outputs::NOTHING;
    type Change = fn(&mut Settings);
    let wrong: [(&str, &str, Change); 9] = [
        ("width = 0", "1 to 16384", |s| s.width = 0),
        ("height = 16385", "1 to 16384", |s| s.height = 16385),
        ("sigma = -1", "1e-12", |s| s.sigma = -1.0),
        ("gamma = NaN", "1e-10", |s| s.gamma = f64::NAN),
        ("tau = 0.5", "0.4", |s| s.tau = 0.5),
        ("near = 0", "1e-6", |s| s.near = 0.0),
        ("far = 1", "beyond near", |s| s.far = 1.0),
        // f32 could not tell it from near.
        ("far = 1.0000005", "beyond near", |s| s.far = 1.0000005),
        ("background_color", "1e6", |s| s.background_color[2] = f64::INFINITY),
    ];
    for (what, fix, change) in wrong {
        let mut settings = settings.clone();
        change(&mut settings);
        let error = assert_says(render(&scene, 1, &settings), &["settings", what, fix]);
        assert!(matches!(error, Error::Settings { .. }));
    }
    assert_says(
        render(&scene, 1, &Settings { outputs: none, ..settings.clone() }),
        &["outputs = none", "at least one"],
    );

    // After all this the renderer still works.
    render(&scene, 1, &settings).unwrap();
}

/// Checks that the numbers at the `ends` are accepted, and the ones `beyond`, infinities and NaN refused.
#[track_caller]
fn assert_taken(name: &str, ends: [f64; 2], beyond: [f64; 2], taken: impl Fn(f64) -> bool) {
    ends.into_iter().for_each(|x| assert!(taken(x), "{name}: {x:?} is refused"));
    for x in beyond.into_iter().chain([f64::NEG_INFINITY, f64::INFINITY, f64::NAN]) {
        assert!(!taken(x), "{name}: {x:?} is taken");
    }
}

#[track_caller]
fn assert_range(name: &str, low: f64, high: f64, taken: impl Fn(f64) -> bool) {
    assert_taken(name, [low, high], [low.next_down(), high.next_up()], taken);
}

/// Checks a range from -`end` to `end` in single precision.
#[track_caller]
fn assert_narrow_range(name: &str, end: f32, taken: impl Fn(f32) -> bool) {
    assert_taken(name, [-end, end].map(f64::from), [-end.next_up(), end.next_up()].map(f64::from), |x| taken(x as f32));
}

type Set<T> = fn(&mut T, f64);

/// The numbers of settings, and their ranges.
const SETTINGS: [(&str, f64, f64, Set<Settings>); 7] = [
    ("sigma", 1e-12, 1e3, |s, x| s.sigma = x),
    ("gamma", 1e-10, 1e6, |s, x| s.gamma = x),
    ("epsilon", -1e3, 1e3, |s, x| s.epsilon = x),
    ("tau", 1e-12, 0.4, |s, x| s.tau = x),
    ("near", 1e-6, 1e9, |s, x| (s.near, s.far) = (x, 1e12)),
    ("far", 2.0 * (1.0 + 1e-6), 1e12, |s, x| (s.near, s.far) = (2.0, x)),
    ("background_color", -1e6, 1e6, |s, x| s.background_color[1] = x),
];

/// The numbers of lights, which are from -1e6 to 1e6.
const LIGHTS: [(&str, Set<Lights>); 4] = [
    ("ambient_color", |l, x| l.ambient_color[2] = x),
    ("ambient_intensity", |l, x| l.ambient_intensity = x),
    ("directional[0].color", |l, x| l.directional[0].color[1] = x),
    ("directional[0].intensity", |l, x| l.directional[0].intensity = x),
];

/// The result of validating settings, or lights, with this number.
fn validated_settings(set: Set<Settings>, x: f64) -> Result<()> {
    let mut settings = Settings::default();
    set(&mut settings, x);
    settings.validate()
}

fn validated_lights(set: Set<Lights>, x: f64) -> Result<()> {
    let mut lights = Lights::official();
    set(&mut lights, x);
    lights.validate()
}

#[test]
fn settings_end_where_they_say() {
    for (name, low, high, set) in SETTINGS {
        assert_range(name, low, high, |x| validated_settings(set, x).is_ok());
    }
}

#[test]
fn lights_end_where_they_say() {
    for (name, set) in LIGHTS {
        assert_range(name, -1e6, 1e6, |x| validated_lights(set, x).is_ok());
    }
    let many = |count: usize| Lights { directional: vec![Lights::official().directional[0]; count], ..Lights::unlit() };
    many(Lights::MAX_DIRECTIONAL).validate().unwrap();
    assert_says(many(Lights::MAX_DIRECTIONAL + 1).validate(), &["directional.len() = 65", "64"]);
}

/// However large a number is, an error shows it in few digits, under the name of the field that it is in.
#[test]
fn enormous_numbers_are_told_in_few_digits() {
    let direction: (&str, Set<Lights>) = ("directional[0].direction", |l, x| l.directional[0].direction = [x; 3]);
    let mut told = Vec::new();
    for x in [1e300, -1e300, 1e-300, f64::MAX, f64::MIN_POSITIVE] {
        told.extend(SETTINGS.iter().filter_map(|(name, .., set)| Some((*name, validated_settings(*set, x).err()?))));
        let lights = LIGHTS.into_iter().chain([direction]);
        told.extend(lights.filter_map(|(name, set)| Some((name, validated_lights(set, x).err()?))));
        told.extend(Camera::from_angles(x, 0.0, 0.0, PERSPECTIVE).err().map(|error| ("camera", error)));
        told.extend(
            Camera::from_angles(2.0, 0.0, 0.0, Projection::Perspective { fov_y: x }).err().map(|e| ("fov_y", e)),
        );
        told.extend(softras::shapes::torus(x, 1.0, 3, 3).err().map(|error| ("torus", error)));
    }
    assert!(told.len() > 40, "{} errors", told.len());
    for (name, error) in told {
        let text = error.to_string();
        assert!(text.contains(name) && text.len() < 160, "{name}: {text}");
    }
}

#[test]
fn cameras_end_where_they_say() {
    let taken = |projection| Camera::from_angles(2.0, 0.0, 0.0, projection).is_ok();
    let matrix = |x: f64| Camera::from_matrix(DMat4::from_translation(DVec3::new(0.0, x, 0.0)), PERSPECTIVE).is_ok();
    assert_range("view", -1e12, 1e12, matrix);
    let below_pi = (std::f64::consts::PI - 1e-6).next_down();
    assert_range("fov_y", 1e-6, below_pi, |fov_y| taken(Projection::Perspective { fov_y }));
    let orthographic = |half_height| taken(Projection::Orthographic { half_height });
    assert_range("half_height", 1e-9, 1e9, orthographic);
    let pinhole = |[fx, fy, cx, cy]: [f64; 4]| taken(Projection::Pinhole { fx, fy, cx, cy });
    assert_range("fx", 1e-6, 1e9, |x| pinhole([x, 1.0, 0.0, 0.0]));
    assert_range("fy", 1e-6, 1e9, |x| pinhole([1.0, x, 0.0, 0.0]));
    assert_range("cx", -1e9, 1e9, |x| pinhole([1.0, 1.0, x, 0.0]));
    assert_range("cy", -1e9, 1e9, |x| pinhole([1.0, 1.0, 0.0, x]));
    let official =
        |k, original_size| taken(Projection::Official { distortion: [0.0, 0.0, k, 0.0, 0.0], original_size });
    assert_range("distortion", -1e9, 1e9, |x| official(x, 256.0));
    assert_range("original_size", 1e-6, 1e9, |x| official(0.0, x));
}

#[test]
fn meshes_end_where_they_say() {
    let position = |x: f32| Mesh::new(vec![[0.0, x, 0.0]], vec![]).is_ok();
    assert_narrow_range("position", Mesh::FARTHEST, position);
    let color = |x: f32| triangle().with_appearance(Appearance::Uniform([0.0, 0.0, x])).is_ok();
    assert_narrow_range("colour", Mesh::BRIGHTEST, color);
    let texture = |x: f32| Texture::new(1, 2, vec![[0.0; 3], [0.0, x, 0.0]], Wrap::Clamp).is_ok();
    assert_narrow_range("texel", Mesh::BRIGHTEST, texture);
    let uv = |x: f32| {
        let textures = vec![Texture::new(1, 1, vec![[0.5; 3]], Wrap::Repeat).unwrap()];
        let uv_triangles = vec![[0; 3]];
        let uvs = vec![[0.5, x]];
        let appearance = Appearance::Textured { uvs, uv_triangles, textures, texture_of_triangle: vec![] };
        triangle().with_appearance(appearance).is_ok()
    };
    assert_narrow_range("UV", 1e4, uv);
}

/// dL/dimage must be of a rendered image, of its shape and finite.
#[test]
fn upstream_gradients() {
    let image =
        |channels: usize, count: usize| Image { batch: 2, height: 3, width: 4, channels, data: vec![0.5; count] };
    let rendered = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
    let check = |gradient: &ImageGradient| gradient.validate(rendered, 2, 3, 4, 0);
    let (color, silhouette) = (ImageGradient::color(image(3, 72)), ImageGradient::silhouette(image(1, 24)));
    let both = ImageGradient { silhouette: silhouette.silhouette.clone(), ..color.clone() };
    [&color, &silhouette, &both].into_iter().for_each(|good| check(good).unwrap());
    assert_says(check(&ImageGradient::default()), &["no image", "at least one"]);
    let depth = ImageGradient { depth: Some(image(1, 24)), ..color };
    assert_says(check(&depth), &["no depth image", "Settings::outputs"]);
    // The shape of another frame, and a shape that its values do not fill.
    assert_says(both.validate(rendered, 2, 4, 3, 0), &["color gradient has shape [2, 3, 4, 3]", "[2, 4, 3, 3]"]);
    assert_says(check(&ImageGradient::color(image(1, 24))), &["[2, 3, 4, 1]", "[2, 3, 4, 3]"]);
    assert_says(check(&ImageGradient::silhouette(image(1, 23))), &["the silhouette gradient"]);
    let mut infinite = both;
    infinite.silhouette.as_mut().unwrap().data[7] = f32::INFINITY;
    assert_says(check(&infinite), &["silhouette gradient is inf at value 7", "finite"]);
}

#[test]
fn devices() {
    let error = assert_says(Renderer::with_device("a device that nobody has"), &["a device that nobody has"]);
    assert!(matches!(error, Error::NoDevice { .. }), "{error:?}");
    let options = RendererOptions { lanes: Some(3), ..RendererOptions::default() };
    assert_says(Renderer::with_options(&options), &["lanes = 3", "power of two"]);
}

#[test]
fn numbers_beyond_arithmetic() {
    let mut renderer = renderer();
    let far_away = Mesh::new(vec![[3e38, 0.0, 0.0], [0.0, 3e38, 0.0], [0.0, 0.0, 3e38]], vec![[0, 1, 2]]);
    assert!(matches!(assert_says(far_away, &["vertex 0", "1e25", "scale"]), Error::Mesh { .. }));
    // An upstream gradient that is finite, of which the gradients are not.
    let settings = Settings { width: 8, height: 8, sigma: 1e-3, save: true, ..Settings::default() };
    let scene = Scene::new(triangle());
    let frame = renderer.render(&scene, &[camera()], &settings).unwrap();
    let silhouette = frame.silhouette().unwrap();
    let upstream = ImageGradient::silhouette(Image { data: vec![3e38; silhouette.data.len()], ..silhouette.clone() });
    let error = assert_says(
        renderer.backward(&frame, &upstream, &GradientRequest::ALL),
        &["not finite", "backward", "overflow"],
    );
    assert!(matches!(error, Error::NotFinite { .. }));
    renderer.render(&scene, &[camera()], &settings).unwrap();
}

/// More pixels than any device can address are refused before anything is set aside, and the renderer goes on.
#[test]
fn limits() {
    let mut renderer = renderer();
    let huge = Settings { width: 16384, height: 16384, ..Settings::default() };
    let scene = Scene::new(triangle());
    let error = assert_says(renderer.render(&scene, &[camera(); 16], &huge), &["needs", "limit", "fewer"]);
    assert!(matches!(error, Error::Limit { .. }), "{error:?}");
    renderer.render(&scene, &[camera()], &Settings::default()).unwrap();
}

/// 4 GiB of images: refused, or rendered where there is a device that holds them.
#[test]
fn memory() {
    let mut renderer = renderer();
    let huge = Settings { width: 16384, height: 8192, outputs: Outputs::ALL, ..Settings::default() };
    let scene = Scene::new(triangle());
    match renderer.render(&scene, &[camera()], &huge) {
        Err(error @ (Error::Limit { .. } | Error::OutOfMemory { .. })) => {
            assert!(error.to_string().contains("smaller image"), "{error}");
        }
        other => assert!(other.unwrap().color().is_ok()),
    }
    renderer.render(&scene, &[camera()], &Settings::default()).unwrap();
}
