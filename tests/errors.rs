//! Every kind of error is reached, and its text names the thing, the place and the mend.
#![cfg(all(feature = "reference", feature = "obj"))]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::renderer;
use glam::{DMat4, DVec3};
use softras::{
    Camera, Error, Image, ImageGradient, Lights, Mesh, Projection, Renderer, RendererOptions, Result, Scene, Settings,
    Wanted,
    obj::{LoadOptions, load, write_obj},
    reference::{GradientMode, Upstream, gradient},
    scene::{Appearance, DirectionalLight, Outputs, Texture, Wrap},
    shapes,
};
use std::path::Path;

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
    assert_says(shapes::by_name("cow"), &["cow", "torus"]);
}

#[test]
fn cameras() {
    let error = assert_says(
        Camera::look_at(DVec3::ONE, DVec3::ONE, DVec3::Y, PERSPECTIVE),
        &["camera", "direction", "eye and target must differ"],
    );
    assert!(matches!(error, Error::Camera { field: "direction", .. }));
    assert_says(Camera::look_direction(DVec3::ONE, DVec3::Y, DVec3::Y, PERSPECTIVE), &["up", "parallel"]);
    assert_says(Camera::from_angles(0.0, 0.0, 0.0, PERSPECTIVE), &["distance", "above 0"]);
    let wide = Projection::Perspective { fov_y: 4.0 };
    assert_says(Camera::from_angles(1.0, 0.0, 0.0, wide), &["fov_y = 4", "radians"]);
    assert_says(Camera::from_matrix(DMat4::ZERO, PERSPECTIVE), &["view", "last row"]);
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

    let none = Outputs { color: false, silhouette: false, depth: false, normal: false };
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
    for (what, mend, change) in wrong {
        let mut settings = settings.clone();
        change(&mut settings);
        let error = assert_says(render(&scene, 1, &settings), &["settings", what, mend]);
        assert!(matches!(error, Error::Settings { .. }));
    }
    assert_says(
        render(&scene, 1, &Settings { outputs: none, ..settings.clone() }),
        &["outputs = none", "at least one"],
    );

    // After all this the renderer still works.
    render(&scene, 1, &settings).unwrap();
}

#[test]
fn files() {
    let error =
        assert_says(load(Path::new("/no/such.obj"), &LoadOptions::default()), &["/no/such.obj", "No such file"]);
    assert!(matches!(error, Error::Io { .. }));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.obj");
    std::fs::write(&path, "v 0 0 0\nf 1 2 3\n").unwrap();
    let error = assert_says(load(&path, &LoadOptions::default()), &["mesh.obj:2: ", "index 2", "mend the index"]);
    assert!(matches!(error, Error::File { line: Some(2), .. }));
    assert_says(write_obj(&triangle(), &folder.path().join("no/mesh.obj")), &["no/mesh.obj"]);
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
    let silhouette = frame.silhouette().map(|image| Image { data: vec![3e38; image.data.len()], ..image.clone() });
    let upstream = ImageGradient { silhouette, ..ImageGradient::default() };
    let error =
        assert_says(renderer.backward(&frame, &upstream, &Wanted::ALL), &["not finite", "backward", "overflow"]);
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
    let outputs = Outputs { color: true, silhouette: true, depth: true, normal: true };
    let huge = Settings { width: 16384, height: 8192, outputs, ..Settings::default() };
    let scene = Scene::new(triangle());
    match renderer.render(&scene, &[camera()], &huge) {
        Err(error @ (Error::Limit { .. } | Error::OutOfMemory { .. })) => {
            assert!(error.to_string().contains("smaller image"), "{error}");
        }
        other => assert!(other.unwrap().color().is_some()),
    }
    renderer.render(&scene, &[camera()], &Settings::default()).unwrap();
}

#[test]
fn gradients_of_other_frames() {
    let upstream = Upstream { d_color: Some(vec![0.0; 5]), ..Upstream::default() };
    let result = gradient(&Scene::new(triangle()), &[camera()], &Settings::default(), &upstream, GradientMode::Exact);
    let error = assert_says(result, &["backward", "d_color has 5 values", "batch × height × width"]);
    assert!(matches!(error, Error::Backward { .. }));
}
