//! Tests of `eval`.

use super::common::tier;
use super::numpy::{self, Npz};
use super::official;
use super::program::{fails, lab, succeeds};

#[test]
fn images_of_the_official_equations_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = official::scenes();
    assert!(scenes.len() >= 10, "{} scenes", scenes.len());
    for case in scenes.into_iter().step_by(tier(5, 1)) {
        case.scene.write(&folder.path().join("scene.npz"));
        let expected = official::planes(&case.image.color, &case.image.silhouette);
        let command = ["eval", "scene.npz", "-o", "out.npz", "--parity", "official"];
        let output = lab(folder.path(), &command);
        assert!(output.status.success(), "{:?}: {}", case.mode, String::from_utf8_lossy(&output.stderr));
        assert!(output.stderr.is_empty(), "no key is unknown: {}", String::from_utf8_lossy(&output.stderr));
        let (shape, ours) = numpy::read(&folder.path().join("out.npz"), "soft_colors");
        assert_eq!(shape, [1, 4, official::SIZE, official::SIZE]);
        // A pixel at a jump of the model may fall on its other side.
        let wrong = ours.iter().zip(&expected).filter(|(a, b)| (**a - **b).abs() > 2e-4).count();
        assert!(wrong <= 4, "{:?}: {wrong} of {} values differ", case.mode, ours.len());
        succeeds(folder.path(), &[&command[..], &["--device", "reference"]].concat());
        let (_, truth) = numpy::read(&folder.path().join("out.npz"), "soft_colors");
        let worst = truth.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{:?}: the reference differs by {worst:e}", case.mode);
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

fn official_options(npz: Npz) -> Npz {
    npz.i64("opt_image_size", &[], &[24])
        .f64("opt_background_color", &[3], &[0.1, 0.2, 0.3])
        .i64("opt_near", &[], &[1])
        .bool("opt_fill_back", true)
        .f64("opt_sigma_val", &[], &[1e-3])
        .f64("opt_gamma_val", &[], &[1e-2])
        .text("opt_texture_type", "vertex")
        .text("opt_dist_func", "euclidean")
}

#[test]
fn types_orders_and_compression_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let shape = [1, 2, 3, 3];
    let plain = official_options(Npz::stored()).f32("face_vertices", &shape, &CORNERS);
    plain.f32("textures", &shape, &colors()).write(&folder.path().join("a.npz"));
    let mut fortran = Vec::new();
    for (k, c, f) in (0..3).flat_map(|k| (0..3).flat_map(move |c| (0..2).map(move |f| (k, c, f)))) {
        fortran.extend(f64::from(CORNERS[9 * f + 3 * c + k]).to_be_bytes());
    }
    let odd = official_options(Npz::deflated()).raw("face_vertices", ">f8", true, &shape, &fortran);
    let exact: Vec<f64> = colors().iter().map(|c| f64::from(*c)).collect();
    odd.f64("textures", &shape, &exact).write(&folder.path().join("b.npz"));
    let said = succeeds(folder.path(), &["eval", "a.npz", "-o", "a_out.npz"]);
    assert_eq!(said.trim(), "a_out.npz: soft_colors [1, 4, 24, 24]");
    succeeds(folder.path(), &["eval", "b.npz", "-o", "b_out.npz"]);
    let (_, a) = numpy::read(&folder.path().join("a_out.npz"), "soft_colors");
    assert_eq!(a, numpy::read(&folder.path().join("b_out.npz"), "soft_colors").1);
    succeeds(folder.path(), &["eval", "a.npz", "-o", "truth.npz", "--device", "reference"]);
    let (_, truth) = numpy::read(&folder.path().join("truth.npz"), "soft_colors");
    let worst = a.iter().zip(&truth).map(|(a, t)| (a - t).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-4, "{worst}");
    // Row 0 is the top: the second triangle's lower corner is cut by the lower border, the upper border is empty.
    assert!(
        truth[3 * 24 * 24..][..24].iter().all(|a| *a == 0.0) && truth[3 * 24 * 24 + 23 * 24..].iter().any(|a| *a > 0.9)
    );
}

/// A world-space scene of two views of a square of two triangles.
fn world() -> Npz {
    let view = |x: f64| [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 4.0, 0.0, 0.0, 0.0, 1.0];
    Npz::deflated()
        .f64("vertices", &[4, 3], &[-1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.3, -1.0, 1.0, 0.0])
        .i64("triangles", &[2, 3], &[0, 1, 2, 0, 2, 3])
        .f32("colors", &[2, 3], &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        .f64("view", &[2, 4, 4], &[view(0.0), view(0.5)].concat())
        .f64("fov_y", &[2], &[0.8, 0.7])
        .i64("width", &[], &[20])
        .i64("height", &[], &[12])
        .f64("sigma", &[], &[1e-3])
        .text("background", "composite")
        .f64("ambient_intensity", &[], &[0.4])
        .f64("light_directions", &[1, 3], &[0.0, 1.0, 1.0])
        .text("outputs", "color,silhouette,depth,normal")
}

#[test]
fn world_scenes_give_every_output_and_agree_with_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let (device, truth) = (folder.path().join("device.npz"), folder.path().join("truth.npz"));
    world().write(&folder.path().join("world.npz"));
    succeeds(folder.path(), &["eval", "world.npz", "-o", "device.npz"]);
    succeeds(folder.path(), &["eval", "world.npz", "-o", "truth.npz", "--device", "reference"]);
    for (key, channels) in [("color", 3), ("silhouette", 0), ("depth", 0), ("normal", 3)] {
        let (shape, ours) = numpy::read(&device, key);
        let (expected_shape, expected) = numpy::read(&truth, key);
        assert_eq!(shape, expected_shape);
        assert_eq!(shape, [&[2, 12, 20][..], &[channels][..usize::from(channels > 0)]].concat());
        let worst = ours.iter().zip(&expected).map(|(a, t)| (a - t).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-3 && expected.iter().any(|v| v.abs() > 0.2), "{key}: {worst}");
    }
}

#[test]
fn unknown_keys_are_named() {
    let folder = tempfile::tempdir().unwrap();
    world().f64("sigmma", &[], &[1e-5]).write(&folder.path().join("world.npz"));
    let output = lab(folder.path(), &["eval", "world.npz", "-o", "out.npz"]);
    assert!(output.status.success() && String::from_utf8_lossy(&output.stderr).contains("sigmma"));
}

#[test]
fn malformed_scenes_are_refused_with_key_shape_and_expectation() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |npz: Npz, parts: &[&str]| {
        npz.write(&folder.path().join("scene.npz"));
        let parts = [&["scene.npz"], parts].concat();
        fails(folder.path(), &["eval", "scene.npz", "-o", "out.npz", "--device", "reference"], 1, &parts);
    };
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
