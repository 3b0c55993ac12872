//! The faults that `softras stress` has found: for each the smallest scene that showed it, named after the fault.

use crate::common::{gradient::all_finite, renderer, scenes::separate};
use glam::{DMat4, DVec3};
use softras::{
    Camera, GradientRequest, Image, ImageGradient, Lights, Mesh, Projection, Scene, Settings,
    scene::{Appearance, Background, Distance, Interpolation, Outputs, Parity, Shading, Texture, Wrap},
};

const USUAL: Outputs = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };

fn settings(near: f64, far: f64) -> Settings {
    Settings {
        width: 9,
        height: 7,
        near,
        far,
        sigma: 0.5,
        gamma: 1e-3,
        outputs: Outputs::ALL,
        save: true,
        ..Settings::default()
    }
}

/// Renders and differentiates one triangle; everything must be finite.
#[track_caller]
fn stays_finite(corners: [[f32; 3]; 3], camera: Camera, settings: &Settings, lights: Lights) {
    let mut renderer = renderer();
    let scene = Scene::new(Mesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap()).with_lights(lights);
    let frame = renderer.render(&scene, &[camera], settings).unwrap();
    let weights = |image: softras::Result<&Image>| {
        let image = image.ok()?;
        assert!(image.data.iter().all(|x| x.is_finite()), "{:?}", image.data);
        Some(Image { data: (0..image.data.len()).map(|i| 1.0 - (i % 5) as f32 / 2.0).collect(), ..image.clone() })
    };
    assert!(frame.color().is_ok() && frame.silhouette().is_ok());
    let upstream = ImageGradient {
        color: weights(frame.color()),
        silhouette: weights(frame.silhouette()),
        depth: weights(frame.depth()),
        normal: weights(frame.normal()),
        features: None,
    };
    all_finite(&renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap()).unwrap();
}

fn forward(fov_y: f64) -> Camera {
    Camera::from_matrix(DMat4::IDENTITY, Projection::Perspective { fov_y }).unwrap()
}

fn from(eye: [f64; 3], fov_y: f64) -> Camera {
    Camera::look_at(eye.into(), DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y }).unwrap()
}

#[test]
fn a_corner_on_the_cameras_plane_has_no_projection_but_a_gradient() {
    let corners = [[0.3, -0.46, 0.0], [0.4, -0.45, 4.66], [0.2, 0.46, 4.65]];
    stays_finite(corners, Camera::screen(), &settings(0.3, 12.0), Lights::unlit());
    stays_finite(corners, forward(1.0), &settings(0.3, 12.0), Lights::unlit());
}

#[test]
fn a_corner_that_is_too_far_for_a_float_has_a_depth() {
    let far = [-1.6502427e10, 5.3734453e10, 6.085457e10];
    let corners = [[-1.2815745, 3.9675534, 4.448739], [-1.1978017, 3.9624503, 4.4357204], far];
    let settings = Settings { gamma: 2.47e-7, background: Background::Composite, sigma: 5.77, ..settings(0.25, 6.68) };
    stays_finite(corners, forward(0.5), &settings, Lights::official());
}

#[test]
fn a_corner_that_is_too_far_for_a_float_has_a_perspective_share() {
    let far = [-4.2301643e14, 3.7866327e15, 2.21979e16];
    let corners = [[0.38258088, -0.04122674, 2.8811927], [0.24629705, 0.5093896, 2.909239], far];
    let settings = Settings { interpolation: Interpolation::Perspective, ..settings(0.23, 3.5) };
    let lights = Lights { shading: Shading::Smooth, ..Lights::official() };
    stays_finite(corners, Camera::screen(), &settings, lights);
}

#[test]
fn a_triangle_of_1e25_units_has_a_normal() {
    let corners = [[-1e25, -1e25, -1e25], [1e25, -1e25, 1e25], [-1e25, -1e25, 1e25]];
    stays_finite(corners, Camera::screen(), &settings(0.1, 3.0), Lights::official());
}

#[test]
fn a_triangle_of_1e_minus_19_units_is_a_point() {
    let first = [-2.5655717e-24, 1.9074816e-24, -4.6438147e-24];
    let second = [-5.869678e-23, -6.893295e-23, 6.860664e-23];
    let corners = [first, second, [-7.436202e-19, 9.199819e-19, -3.1333266e-19]];
    let settings = Settings { sigma: 3e-11, width: 1, height: 15, ..settings(2.0, 32.0) };
    stays_finite(corners, from([1.3, -3.6, -1.1], 0.5), &settings, Lights::unlit());
}

#[test]
fn a_thin_triangle_of_1e_minus_25_units_has_a_normal_or_none() {
    let camera = from([0.4, -0.9, -3.8], 1e-5);
    let settings = Settings { width: 23, height: 1, background: Background::Composite, ..settings(1.2, 28.0) };
    for corners in [
        [[0.0; 3], [-4.15e-43, 8.72e-43, 1.93e-43], [-4.0439854e-26, 1.3425836e-25, 4.3080218e-26]],
        [[-4.86e-41, 4.67e-41, -1.81e-40], [-1.780645e-30, 1.7893159e-30, -7.8972186e-30], [0.0; 3]],
    ] {
        stays_finite(corners, camera, &settings, Lights::official());
    }
}

/// Squares of such depths leave a float.
#[test]
fn an_edge_of_1e22_units_is_cut_at_near() {
    let mut corners = [[0.3, -0.4, 2.0], [-0.4, 0.3, 1.5], [0.1, 0.6, -1e22]];
    stays_finite(corners, forward(1.2), &settings(0.5, 10.0), Lights::unlit());
    corners.rotate_right(1);
    stays_finite(corners, forward(1.2), &settings(0.5, 10.0), Lights::unlit());
}

/// Beyond 1e12 of an image's half height a corner is held where it is: whatever it does sideways changes nothing.
#[test]
fn a_corner_that_is_held_at_the_farthest_pixel_pulls_on_nothing() {
    let mut renderer = renderer();
    let mesh = Mesh::new(vec![[1e10, 2e-6, 1e-5], [-0.2, -0.3, 1.0], [-0.3, 0.4, 1.2]], vec![[0, 1, 2]]).unwrap();
    let colors = Appearance::VertexColors(vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let mesh = mesh.with_appearance(colors).unwrap();
    let settings = Settings { gamma: 0.1, outputs: USUAL, ..settings(1e-6, 10.0) };
    let camera = forward(1.0);
    let frame = renderer.render(&Scene::new(mesh), &[camera], &settings).unwrap();
    let image = frame.color().unwrap();
    let weights = (0..image.data.len()).map(|i| 1.0 - (i % 5) as f32 / 2.0).collect();
    let upstream = ImageGradient::color(Image { data: weights, ..image.clone() });
    let gradients = renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap();
    all_finite(&gradients).unwrap();
    let by = &gradients.meshes[0].positions;
    assert!(by[0][0] == 0.0 && by[0][1] != 0.0, "{by:?}");
}

/// At γ = 1e-10 a unit in the last place of a depth is a thousand powers of two of weight: the nearer one is all that shows.
#[test]
fn a_tiny_gamma_tells_neighbouring_floats_apart() {
    let mut renderer = renderer();
    let behind = 1.0 + f32::EPSILON;
    let (near, far) = (0.5, 2.5);
    for (first, second) in [(1.0, behind), (behind, 1.0)] {
        let at = |z: f32| [[-3.0, -3.0, z], [3.0, -3.0, z], [0.0, 3.0, z]];
        let colors = |color: [f32; 3]| [color; 3];
        let mesh = Mesh::new([at(first), at(second)].concat(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let mesh = mesh
            .with_appearance(Appearance::VertexColors([colors([first, 0.0, 0.0]), colors([0.0, second, 0.0])].concat()))
            .unwrap();
        let settings = Settings { gamma: 1e-10, sigma: 1e-4, outputs: USUAL, ..settings(near, far) };
        let frame = renderer.render(&Scene::new(mesh), &[Camera::screen()], &settings).unwrap();
        let nearer = if first == 1.0 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let color = frame.color().unwrap();
        let middle = 3 * (color.height / 2 * color.width + color.width / 2);
        assert_eq!(color.data[middle..middle + 3], nearer, "{first} before {second}");
        let ones = |image: &Image| Image { data: vec![1.0; image.data.len()], ..image.clone() };
        let upstream = ImageGradient { color: Some(ones(color)), ..ImageGradient::default() };
        all_finite(&renderer.backward(&frame, &upstream, &GradientRequest::ALL).unwrap()).unwrap();
    }
}

/// Frames of one kind leave the background where it is from the one before, but not what a triangle has left there.
#[test]
fn a_tile_that_a_triangle_has_left_shows_the_background() {
    let mut renderer = renderer();
    let settings = Settings { width: 64, height: 64, sigma: 1e-6, outputs: USUAL, ..settings(0.5, 3.0) };
    let at = |x: f32| vec![[x - 0.1, -0.1, 1.0], [x + 0.1, -0.1, 1.0], [x, 0.1, 1.0]];
    for frame in 0..6 {
        let place = [-0.7, 0.7, 0.0][frame % 3];
        let scene = Scene::new(Mesh::new(at(place), vec![[0, 1, 2]]).unwrap());
        let image = renderer.render(&scene, &[Camera::screen()], &settings).unwrap();
        let silhouette = image.silhouette().unwrap();
        for (i, &shown) in silhouette.data.iter().enumerate() {
            let x = ((2 * (i % 64) + 1) as f32 - 64.0) / 64.0;
            assert!(shown == 0.0 || (x - place).abs() < 0.2, "frame {frame}: {shown} at x = {x}, none is near");
        }
        assert!(silhouette.data.iter().any(|&shown| shown > 0.99));
    }
}

/// Nothing is cut at near there, so that such a corner shows.
#[test]
fn official_parity_differentiates_a_corner_on_the_cameras_plane() {
    let settings =
        Settings { distance: Distance::Barycentric, parity: Parity::Official, outputs: USUAL, ..settings(0.51, 3.2) };
    for depth in [0.0, -1e-40] {
        let corners =
            [[0.29966474, 0.5024282, 0.51049775], [-0.4182276, 0.67499167, depth], [-0.8085267, 0.253066, 2.3]];
        stays_finite(corners, Camera::screen(), &settings, Lights::unlit());
        let lens = forward(1.0);
        stays_finite(corners, lens, &settings, Lights::unlit());
        stays_finite([corners[0], [0.0, 0.0, depth], corners[2]], lens, &settings, Lights::unlit());
    }
}

/// Sums of colours in units of 2^60 were infinite from 1e20 on.
#[test]
fn the_brightest_colours_stay_finite_under_the_brightest_light() {
    let settings = Settings {
        width: 1,
        height: 9,
        near: 1e-6,
        far: 1e12,
        sigma: 4.77e-11,
        gamma: 1.236e-5,
        tau: 4.06e-11,
        background: Background::Weighted,
        interpolation: Interpolation::Perspective,
        outputs: Outputs::ALL,
        ..Settings::default()
    };
    let corners =
        [[-2.2318373e-7, -1.6085621e-6, 8.9e-6], [6.9749694e-7, -1.0221595e-6, 9.6e-6], [9.9e-7, -1.2e-6, 9.0e-6]];
    // A thousand of them in one pixel.
    let mesh = separate(&[corners; 1000]);
    let textured = Appearance::Textured {
        uvs: vec![[0.1, 0.2], [0.7, 0.4], [0.3, 0.9]],
        uv_triangles: vec![[0, 1, 2]; 1000],
        textures: vec![Texture::new(2, 1, vec![[Mesh::BRIGHTEST; 3]; 2], Wrap::Clamp).unwrap()],
        texture_of_triangle: Vec::new(),
    };
    let lights = Lights { ambient_color: [1e6; 3], ambient_intensity: 1e6, ..Lights::unlit() };
    for appearance in [textured, Appearance::Uniform([-Mesh::BRIGHTEST; 3])] {
        let scene = Scene::new(mesh.clone().with_appearance(appearance).unwrap()).with_lights(lights.clone());
        let frame = renderer().render(&scene, &[Camera::screen()], &settings).unwrap();
        let color = frame.color().unwrap();
        assert!(color.data.iter().all(|x| x.is_finite()), "{:?}", color.data);
        assert!(color.data.iter().any(|x| x.abs() > 1e11 * Mesh::BRIGHTEST), "{:?}", color.data);
    }
}
