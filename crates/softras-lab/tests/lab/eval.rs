//! Tests of `eval`.

use super::common::tier;
use super::numpy::{self, Npz};
use super::official;
use super::official_equations::compare::{max_difference, median_face, relative_l2 as relative};
use super::program::{fails, lab, succeeds};
use std::path::Path;

#[test]
fn images_and_gradients_of_the_official_equations_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let read = |key: &str| numpy::read(&folder.path().join("out.npz"), key);
    let command = ["eval", "scene.npz", "-o", "out.npz", "--parity", "official", "--gradient", "paper"];
    let scenes = official::scenes();
    assert!(scenes.len() >= 10, "{} scenes", scenes.len());
    for case in scenes.into_iter().step_by(tier(5, 1)) {
        let mode = case.mode;
        case.scene.write(&folder.path().join("scene.npz"));
        let image = official::planes(&case.image.color, &case.image.silhouette);
        let (corners, colors) =
            (case.gradient.corners.as_flattened().as_flattened(), case.gradient.colors.as_flattened());
        let is_flat = corners.iter().all(|x| *x == 0.0);
        let output = lab(folder.path(), &command);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.is_empty(), "{mode:?}, no key is unknown: {said}");
        let (shape, ours) = read("soft_colors");
        assert_eq!(shape, [1, 4, official::SIZE, official::SIZE]);
        // A pixel at a jump of the model may fall on its other side.
        let wrong = ours.iter().zip(&image).filter(|(a, b)| (**a - **b).abs() > 2e-4).count();
        assert!(wrong <= 4, "{mode:?}: {wrong} of {} values differ", ours.len());
        let ours = read("grad_face_vertices").1;
        let error = if is_flat { max_difference(&ours, corners) } else { median_face(&ours, corners) };
        assert!(error < 1e-3, "{mode:?}: median face {error:e}");
        let error = relative(&read("grad_textures").1, colors);
        assert!(error < 1e-3, "{mode:?}: textures {error:e}");

        succeeds(folder.path(), &[&command[..], &["--device", "reference"]].concat());
        let error = max_difference(&read("soft_colors").1, &image);
        assert!(error < 1e-9, "{mode:?}: the reference differs by {error:e}");
        for (key, expected) in [("grad_face_vertices", corners), ("grad_textures", colors)] {
            let (shape, ours) = read(key);
            assert_eq!((shape[..2].to_vec(), shape[3]), (vec![1, 8], 3), "{mode:?}: {key}");
            let error = relative(&ours, expected);
            assert!(error < 1e-8, "{mode:?}: {key} {error:e}");
        }
    }
}

/// Two overlapping triangles, one of them partly off the screen.
const CORNERS: [f32; 18] = [
    -0.5, -0.5, 2.0, 0.6, -0.4, 3.0, 0.1, 0.7, 2.5, //
    -0.9, 0.1, 4.0, 0.2, -1.4, 2.2, 0.9, 0.8, 5.0,
];

fn colors() -> Vec<f32> {
    (0..18).map(|i| i as f32 / 17.0).collect()
}

#[test]
fn types_orders_and_compression_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shape = [1, 2, 3, 3];
    let plain = Npz::stored().i64("opt_image_size", &[], &[24]).f32("face_vertices", &shape, &CORNERS);
    plain.f32("textures", &shape, &colors()).write(&folder.path().join("a.npz"));
    let mut fortran = Vec::new();
    for (k, c, f) in (0..3).flat_map(|k| (0..3).flat_map(move |c| (0..2).map(move |f| (k, c, f)))) {
        fortran.extend(f64::from(CORNERS[9 * f + 3 * c + k]).to_be_bytes());
    }
    let odd = Npz::deflated().f64("opt_image_size", &[1], &[24.0]).raw("face_vertices", ">f8", true, &shape, &fortran);
    let exact: Vec<f64> = colors().iter().map(|c| f64::from(*c)).collect();
    odd.f64("textures", &shape, &exact).write(&folder.path().join("b.npz"));
    let [a, b] = ["a", "b"].map(|name| {
        let out = format!("{name}_out.npz");
        let said = succeeds(folder.path(), &["eval", &format!("{name}.npz"), "-o", &out]);
        assert_eq!(said.trim(), format!("{out}: soft_colors [1, 4, 24, 24]"));
        numpy::read(&folder.path().join(out), "soft_colors").1
    });
    assert_eq!(a, b);
    // Row 0 is the top: the second triangle's lower corner is cut by the lower border, the upper border is empty.
    let alpha = &a[3 * 24 * 24..];
    assert!(alpha[..24].iter().all(|a| *a == 0.0) && alpha[23 * 24..].iter().any(|a| *a > 0.9));
}

const VIEWS: usize = 2;
const HEIGHT: usize = 12;
const WIDTH: usize = 20;

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

const SQUARE: [f64; 12] = [-0.8, -0.7, 0.0, 0.7, -0.8, 0.1, 0.75, 0.7, 0.3, -0.7, 0.8, 0.0];
const SIGMA: f64 = 1e-2;

fn world() -> Npz {
    world_of("color,silhouette,depth,normal", &SQUARE, SIGMA, 0.0)
}

fn numbers(count: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * 37 + 11) % 64) as f64 / 32.0 - 1.0).collect()
}

const RGB: [usize; 4] = [VIEWS, HEIGHT, WIDTH, 3];
const IMAGES: [(&str, &[usize]); 4] =
    [("color", &RGB), ("silhouette", &[VIEWS, HEIGHT, WIDTH]), ("depth", &[VIEWS, HEIGHT, WIDTH]), ("normal", &RGB)];

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

fn with_upstream(mut npz: Npz) -> Npz {
    for (key, shape) in IMAGES {
        npz = npz.f64(&format!("grad_{key}"), shape, &numbers(shape.iter().product()));
    }
    npz
}

/// Σ upstream · image of a scene, rendered by the reference.
fn loss(folder: &Path, npz: Npz) -> f64 {
    npz.write(&folder.join("moved.npz"));
    succeeds(folder, &["eval", "moved.npz", "-o", "images.npz", "--device", "reference"]);
    let image = |key| numpy::read(&folder.join("images.npz"), key).1;
    let dot = |image: Vec<f64>| image.iter().zip(numbers(image.len())).map(|(a, b)| a * b).sum::<f64>();
    IMAGES.into_iter().map(|(key, _)| dot(image(key))).sum()
}

#[test]
fn world_gradients_are_the_derivatives_of_the_world_images() {
    let folder = tempfile::tempdir().unwrap();
    with_upstream(world()).write(&folder.path().join("world.npz"));
    succeeds(folder.path(), &["eval", "world.npz", "-o", "out.npz", "--gradient", "exact", "--device", "reference"]);
    let close = |key: &str, index: usize, scene: &dyn Fn(f64) -> Npz, step: f64| {
        let ours = numpy::read(&folder.path().join("out.npz"), key).1[index];
        let expected = (loss(folder.path(), scene(step)) - loss(folder.path(), scene(-step))) / (2.0 * step);
        assert!((ours - expected).abs() < 0.02 * expected.abs() + 0.05, "{key}: {ours} for {expected}");
    };
    let outputs = "color,silhouette,depth,normal";
    for i in [0, 4, 8] {
        let moved = |step: f64| {
            let mut vertices = SQUARE.map(|x| f64::from(x as f32));
            vertices[i] += step;
            world_of(outputs, &vertices, SIGMA, 0.0)
        };
        // Vertices are float32: steps that they hold exactly.
        close("grad_vertices", i, &moved, 1.0 / 1024.0);
    }
    close("grad_sigma", 0, &|step| world_of(outputs, &SQUARE, SIGMA + step, 0.0), 1e-6);
    close("grad_view", 0, &|step| world_of(outputs, &SQUARE, SIGMA, step), 1e-4);
}

#[test]
fn the_device_gives_the_references_world_images_and_gradients() {
    let folder = tempfile::tempdir().unwrap();
    with_upstream(world()).write(&folder.path().join("world.npz"));
    for mode in ["exact", "paper"] {
        let truth = ["eval", "world.npz", "-o", "truth.npz", "--gradient", mode, "--device", "reference"];
        succeeds(folder.path(), &truth);
        succeeds(folder.path(), &["eval", "world.npz", "-o", "device.npz", "--gradient", mode]);
        for (key, shape) in IMAGES.into_iter().chain(DERIVATIVES) {
            let [(ours_shape, ours), (truth_shape, truth)] =
                ["device.npz", "truth.npz"].map(|file| numpy::read(&folder.path().join(file), key));
            assert_eq!((&ours_shape[..], &truth_shape[..]), (shape, shape), "{mode} {key}");
            // Nothing depends on ε over a composite background.
            assert_eq!(truth.iter().all(|x| *x == 0.0), key == "grad_epsilon", "{mode} {key}");
            let is_image = IMAGES.iter().any(|(image, _)| *image == key);
            let error = if is_image || key == "grad_epsilon" { max_difference } else { relative }(&ours, &truth);
            assert!(error < 1e-3, "{mode} {key}: {error:e}");
        }
    }
}

#[test]
fn unknown_keys_are_named() {
    let folder = tempfile::tempdir().unwrap();
    world().f64("sigmma", &[], &[1e-5]).write(&folder.path().join("world.npz"));
    let output = lab(folder.path(), &["eval", "world.npz", "-o", "out.npz"]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stderr).contains("sigmma"));
}

/// `eval` with more options refuses the scene and names all parts.
#[track_caller]
fn assert_refused(npz: Npz, more: &[&str], parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    npz.write(&folder.path().join("scene.npz"));
    let arguments = ["eval", "scene.npz", "-o", "out.npz", "--device", "reference"];
    fails(folder.path(), &[&arguments, more].concat(), 1, &[&["scene.npz"], parts].concat());
    assert!(!folder.path().join("out.npz").exists());
}

#[test]
fn malformed_scenes_are_refused_with_key_shape_and_expectation() {
    let refused = |npz: Npz, parts: &[&str]| assert_refused(npz, &[], parts);
    let shape = [1, 2, 3, 3];
    let with = || Npz::stored().f32("face_vertices", &shape, &CORNERS);
    refused(Npz::stored().f32("face_vertices", &[2, 9], &CORNERS), &["`face_vertices`", "[2, 9]", "[B, F, 3, 3]"]);
    refused(Npz::stored().f32("face_vertices", &[0, 2, 3, 3], &[]), &["`face_vertices`", "[0, 2, 3, 3]"]);
    refused(Npz::stored().text("face_vertices", "abc"), &["`face_vertices`"]);
    let mut nan = CORNERS;
    nan[13] = f32::NAN;
    refused(Npz::stored().f32("face_vertices", &shape, &nan), &["face_vertices[0, 1, 1, 1] is NaN"]);
    refused(with().f32("textures", &[1, 2, 5, 3], &[0.0; 30]), &["`textures`", "[1, 2, 5, 3]", "R²"]);
    refused(with().f32("textures", &[1, 1, 3, 3], &[0.0; 9]), &["`textures`", "[1, 1, 3, 3]", "[1, 2, 3, 3]"]);
    let typed = |kind: &str| with().f32("textures", &shape, &colors()).text("opt_texture_type", kind);
    refused(typed("surface"), &["`textures`", "'surface'"]);
    refused(typed("cubes"), &["`opt_texture_type`", "cubes", "vertex, surface"]);
    refused(with().text("opt_sigma_val", "tiny"), &["`opt_sigma_val`", "text"]);
    refused(with().f64("opt_sigma_val", &[2], &[1.0, 2.0]), &["`opt_sigma_val`", "[2]", "single number"]);
    refused(with().f64("opt_image_size", &[], &[2.5]), &["`opt_image_size`", "2.5"]);
    refused(with().raw("opt_near", "|O", false, &[], &[0; 8]), &["`opt_near`", "|O"]);
    refused(Npz::stored().f64("x", &[], &[1.0]), &["`vertices`", "missing", "the file has: x"]);
    refused(world().f64("half_height", &[], &[1.0]), &["fov_y", "half_height"]);
    let triangles = Npz::stored().f64("vertices", &[3, 3], &[0.0; 9]).i64("triangles", &[1, 3], &[0, 1, 3]);
    refused(triangles, &["`triangles`", "triangles[0, 2] is 3", "below 3"]);
}

#[test]
fn missing_and_misshapen_upstream_gradients_are_named() {
    let refused = |npz: Npz, parts: &[&str]| assert_refused(npz, &["--gradient", "exact"], parts);
    let screen = || Npz::stored().f64("face_vertices", &[1, 1, 3, 3], &[0.5; 9]).i64("opt_image_size", &[], &[4]);
    refused(screen(), &["`grad_soft_colors`", "missing", "[1, 4, 4, 4]"]);
    let shaped = screen().f64("grad_soft_colors", &[1, 3, 4, 4], &[0.0; 48]);
    refused(shaped, &["`grad_soft_colors`", "[1, 3, 4, 4]", "[1, 4, 4, 4]"]);
    let mut values = [0.0; 64];
    values[21] = f64::NAN;
    refused(screen().f64("grad_soft_colors", &[1, 4, 4, 4], &values), &["grad_soft_colors[0, 1, 1, 1] is NaN"]);
    refused(world(), &["`grad_color`", "missing", "grad_depth"]);
    let images = [VIEWS, HEIGHT, WIDTH];
    refused(world().f64("grad_color", &images, &numbers(480)), &["`grad_color`", "[2, 12, 20]", "[2, 12, 20, 3]"]);
    refused(world().text("grad_depth", "deep"), &["`grad_depth`"]);
    let few = world_of("color", &SQUARE, SIGMA, 0.0).f64("grad_silhouette", &images, &numbers(480));
    refused(few, &["`grad_silhouette`", "not among the outputs", "`outputs`"]);
}

#[test]
fn senseless_arguments_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |line: &str, part: &str| {
        fails(folder.path(), &line.split_whitespace().collect::<Vec<_>>(), 2, &[part, "Usage: softras-lab eval"]);
    };
    refused("evaluate a.npz -o b.npz", "`eval`");
    refused("eval -o b.npz", "SCENE.npz");
    refused("eval a.npz", "-o OUT.npz");
    refused("eval a.npz -o a.npz", "overwritten");
    refused("eval a.npz -o b.npz c.npz", "c.npz");
    refused("eval a.npz -o b.npz --json", "--json");
    refused("eval a.npz -o b.npz --parity exact", "model or official");
    refused("eval a.npz -o b.npz --gradient", "--gradient needs a value");
    refused("eval a.npz -o b.npz --gradient model", "exact or paper");
    fails(folder.path(), &["eval", "none.npz", "-o", "b.npz"], 1, &["none.npz"]);
    std::fs::write(folder.path().join("a.obj"), "v 0 0 0\n").unwrap();
    fails(folder.path(), &["eval", "a.obj", "-o", "b.npz"], 1, &["a.obj", "numpy.savez"]);
    assert!(succeeds(folder.path(), &["--help"]).contains("grad_face_vertices"));
}

/// Vertices far from 0 keep the digits of their 64 bits.
#[test]
fn a_scene_far_from_0_is_that_at_0() {
    let folder = tempfile::tempdir().unwrap();
    let images = [0.0, 1048576.0].map(|far| {
        let vertices: Vec<f64> =
            SQUARE.iter().enumerate().map(|(i, x)| if i % 3 == 0 { x + far } else { *x }).collect();
        let view = [1.0, 0.0, 0.0, -far, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 4.0, 0.0, 0.0, 0.0, 1.0];
        Npz::stored()
            .f64("vertices", &[4, 3], &vertices)
            .i64("triangles", &[2, 3], &[0, 1, 2, 0, 2, 3])
            .f64("view", &[4, 4], &view)
            .f64("fov_y", &[], &[0.8])
            .i64("width", &[], &[WIDTH as i64])
            .i64("height", &[], &[HEIGHT as i64])
            .text("outputs", "silhouette,depth")
            .write(&folder.path().join("scene.npz"));
        succeeds(folder.path(), &["eval", "scene.npz", "-o", "out.npz", "--device", "reference"]);
        ["silhouette", "depth"].map(|key| numpy::read(&folder.path().join("out.npz"), key).1).concat()
    });
    let error = max_difference(&images[0], &images[1]);
    assert!(error < 1e-6, "{error:e}");
}
