//! Tests of `eval --gradient`.

use super::common::tier;
use super::compare::{self, median_face, relative_l2 as relative};
use super::numpy::{self, Npz};
use super::official;
use super::program::{fails, succeeds};
use std::path::Path;

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|v| v * v).sum::<f64>().sqrt()
}

#[test]
fn comparisons_fail_on_wrong_answers() {
    compare::self_test();
}

#[test]
fn gradients_of_the_official_equations_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.npz");
    // What the library does with each of them is tested there.
    for case in official::scenes().into_iter().step_by(tier(5, 1)) {
        let mode = case.mode;
        case.scene.write(&folder.path().join("scene.npz"));
        let arguments = ["eval", "scene.npz", "-o", "out.npz", "--parity", "official", "--gradient", "paper"];
        succeeds(folder.path(), &[&arguments[..], &["--device", "reference"]].concat());
        let corners = case.gradient.corners.as_flattened().as_flattened();
        let of_device = |key: &str| numpy::read(&out, key).1;
        for (key, expected) in [("grad_face_vertices", corners), ("grad_textures", case.gradient.colors.as_flattened())]
        {
            let (shape, ours) = numpy::read(&out, key);
            assert_eq!((shape[..2].to_vec(), shape[3]), (vec![1, 8], 3), "{mode:?}: {key}");
            if expected.iter().all(|x| *x == 0.0) {
                assert!(ours.iter().all(|x| *x == 0.0), "{mode:?}: {key} {ours:?}");
                continue;
            }
            let error = relative(&ours, expected);
            assert!(error < 1e-8, "{mode:?}: {key} {error:e}");
        }
        succeeds(folder.path(), &arguments);
        let ours = of_device("grad_face_vertices");
        if corners.iter().any(|x| *x != 0.0) {
            let median = median_face(&ours, corners);
            assert!(median < 1e-3, "{mode:?}: median face {median:e}");
        } else {
            assert!(ours.iter().all(|x| *x == 0.0), "{mode:?}: {ours:?}");
        }
        let textures = relative(&of_device("grad_textures"), case.gradient.colors.as_flattened());
        assert!(textures < 1e-3, "{mode:?}: textures {textures:e}");
    }
}

const VIEWS: usize = 2;
const HEIGHT: usize = 12;
const WIDTH: usize = 20;

fn numbers(count: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * 37 + 11) % 64) as f64 / 32.0 - 1.0).collect()
}

/// A lit square of two triangles in two views, at a distance from which its edges are in the image.
fn world_of(outputs: &str, vertices: &[f64], sigma: f64, shift: f64) -> Npz {
    let view = |x: f64| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    Npz::stored()
        .f64("vertices", &[4, 3], vertices)
        .i64("triangles", &[2, 3], &[0, 1, 2, 0, 2, 3])
        .f64("colors", &[2, 3], &[1.0, 0.2, 0.1, 0.1, 0.3, 1.0])
        .f64("view", &[2, 4, 4], &[view(shift), view(0.5)].concat())
        .f64("fov_y", &[2], &[0.8, 0.7])
        .i64("width", &[], &[WIDTH as i64])
        .i64("height", &[], &[HEIGHT as i64])
        .f64("sigma", &[], &[sigma])
        .f64("gamma", &[], &[1e-2])
        .text("background", "composite")
        .f64("ambient_intensity", &[], &[0.4])
        .f64("light_directions", &[1, 3], &[0.0, 1.0, 1.0])
        .text("outputs", outputs)
}

fn world(vertices: &[f64], sigma: f64, shift: f64) -> Npz {
    world_of("color,silhouette,depth,normal", vertices, sigma, shift)
}

const SQUARE: [f64; 12] = [-0.8, -0.7, 0.0, 0.7, -0.8, 0.1, 0.75, 0.7, 0.3, -0.7, 0.8, 0.0];

fn with_upstream(npz: Npz) -> Npz {
    let images = [VIEWS, HEIGHT, WIDTH];
    let pixels = images.iter().product::<usize>();
    npz.f64("grad_color", &[VIEWS, HEIGHT, WIDTH, 3], &numbers(3 * pixels))
        .f64("grad_silhouette", &images, &numbers(pixels))
        .f64("grad_depth", &images, &numbers(pixels))
        .f64("grad_normal", &[VIEWS, HEIGHT, WIDTH, 3], &numbers(3 * pixels))
}

const DERIVATIVES: [(&str, &[usize]); 13] = [
    ("grad_vertices", &[4, 3]),
    ("grad_colors", &[2, 3]),
    ("grad_view", &[2, 6]),
    ("grad_projection", &[2, 1]),
    ("grad_ambient_color", &[3]),
    ("grad_ambient_intensity", &[]),
    ("grad_light_directions", &[1, 3]),
    ("grad_light_colors", &[1, 3]),
    ("grad_light_intensities", &[1]),
    ("grad_background_color", &[3]),
    ("grad_sigma", &[]),
    ("grad_gamma", &[]),
    ("grad_epsilon", &[]),
];

/// Σ upstream · image of a scene, rendered by the reference.
fn loss(folder: &Path, npz: Npz) -> f64 {
    npz.write(&folder.join("moved.npz"));
    succeeds(folder, &["eval", "moved.npz", "-o", "images.npz", "--device", "reference"]);
    let image = |key| numpy::read(&folder.join("images.npz"), key).1;
    let dot = |image: Vec<f64>| image.iter().zip(numbers(image.len())).map(|(a, b)| a * b).sum::<f64>();
    ["color", "silhouette", "depth", "normal"].into_iter().map(|key| dot(image(key))).sum()
}

#[test]
fn world_gradients_are_the_derivatives_of_the_world_images() {
    let folder = tempfile::tempdir().unwrap();
    let sigma = 1e-2;
    with_upstream(world(&SQUARE, sigma, 0.0)).write(&folder.path().join("world.npz"));
    succeeds(folder.path(), &["eval", "world.npz", "-o", "out.npz", "--gradient", "exact", "--device", "reference"]);
    let read = |key: &str| numpy::read(&folder.path().join("out.npz"), key);
    for (key, shape) in DERIVATIVES {
        let (ours, values) = read(key);
        assert_eq!(ours, shape, "{key}");
        let nothing = key == "grad_epsilon";
        assert_eq!(values.iter().all(|v| *v == 0.0), nothing, "{key}: {values:?}");
    }
    // Vertices are float32: steps that they hold exactly.
    let step = 1.0 / 1024.0;
    let moved = |i: usize, step: f64| {
        let mut vertices = SQUARE.map(|x| f64::from(x as f32));
        vertices[i] += step;
        loss(folder.path(), world(&vertices, sigma, 0.0))
    };
    let close = |what: &str, ours: f64, expected: f64| {
        assert!((ours - expected).abs() < 0.02 * expected.abs() + 0.05, "{what}: {ours} for {expected}");
    };
    for i in [0, 4, 8] {
        close("vertex", read("grad_vertices").1[i], (moved(i, step) - moved(i, -step)) / (2.0 * step));
    }
    let h = 1e-4;
    let by_sigma = |h: f64| loss(folder.path(), world(&SQUARE, sigma + h * sigma, 0.0));
    close("sigma", read("grad_sigma").1[0] * sigma, (by_sigma(h) - by_sigma(-h)) / (2.0 * h));
    let by_shift = |h: f64| loss(folder.path(), world(&SQUARE, sigma, h));
    close("view", read("grad_view").1[0], (by_shift(h) - by_shift(-h)) / (2.0 * h));
}

#[test]
fn the_device_gives_the_references_world_gradients() {
    let folder = tempfile::tempdir().unwrap();
    with_upstream(world(&SQUARE, 1e-2, 0.0)).write(&folder.path().join("world.npz"));
    for mode in ["exact", "paper"] {
        let truth = ["eval", "world.npz", "-o", "truth.npz", "--gradient", mode, "--device", "reference"];
        succeeds(folder.path(), &truth);
        succeeds(folder.path(), &["eval", "world.npz", "-o", "device.npz", "--gradient", mode]);
        for (key, _) in DERIVATIVES {
            let (shape, ours) = numpy::read(&folder.path().join("device.npz"), key);
            let (expected_shape, expected) = numpy::read(&folder.path().join("truth.npz"), key);
            assert_eq!(shape, expected_shape, "{mode} {key}");
            let error =
                if expected.iter().all(|e| *e == 0.0) { norm(ours.into_iter()) } else { relative(&ours, &expected) };
            assert!(error < 1e-3, "{mode} {key}: {error:e}");
        }
    }
}

#[test]
fn missing_and_misshapen_upstream_gradients_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |npz: Npz, parts: &[&str]| {
        npz.write(&folder.path().join("scene.npz"));
        let arguments = ["eval", "scene.npz", "-o", "out.npz", "--gradient", "exact", "--device", "reference"];
        fails(folder.path(), &arguments, 1, &[&["scene.npz"], parts].concat());
        assert!(!folder.path().join("out.npz").exists());
    };
    let screen = || Npz::stored().f64("face_vertices", &[1, 1, 3, 3], &[0.5; 9]).i64("opt_image_size", &[], &[4]);
    refused(screen(), &["`grad_soft_colors`", "missing", "[1, 4, 4, 4]"]);
    let shaped = screen().f64("grad_soft_colors", &[1, 3, 4, 4], &[0.0; 48]);
    refused(shaped, &["`grad_soft_colors`", "[1, 3, 4, 4]", "[1, 4, 4, 4]"]);
    let mut values = [0.0; 64];
    values[21] = f64::NAN;
    refused(screen().f64("grad_soft_colors", &[1, 4, 4, 4], &values), &["grad_soft_colors[0, 1, 1, 1] is NaN"]);
    let world = || world(&SQUARE, 1e-2, 0.0);
    refused(world(), &["`grad_color`", "missing", "grad_depth"]);
    let images = [VIEWS, HEIGHT, WIDTH];
    refused(world().f64("grad_color", &images, &numbers(480)), &["`grad_color`", "[2, 12, 20]", "[2, 12, 20, 3]"]);
    refused(world().text("grad_depth", "deep"), &["`grad_depth`"]);
    let few = world_of("color", &SQUARE, 1e-2, 0.0).f64("grad_silhouette", &images, &numbers(480));
    refused(few, &["`grad_silhouette`", "not among the outputs", "`outputs`"]);
}
