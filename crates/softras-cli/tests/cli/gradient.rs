//! Tests of the commands `check` and `grad`.

use super::command::tier;
use super::{fails, succeeds};
use std::path::Path;

#[test]
fn check_passes_here() {
    let folder = tempfile::tempdir().unwrap();
    if tier(false, true) {
        let text = succeeds(folder.path(), &["check"]);
        let verdict = text.lines().last().unwrap();
        assert!(verdict.starts_with("PASS: ") && text.lines().count() > 11 && !text.contains("FAIL"), "{text}");
    }
    let json: serde_json::Value = serde_json::from_str(&succeeds(folder.path(), &["check", "--json"])).unwrap();
    assert_eq!(json["pass"], true);
    let scenes = json["scenes"].as_array().unwrap();
    assert!(scenes.len() > 8 && scenes.iter().all(|scene| scene["repeats"] == true), "{json}");
    // Every kind of image and of gradient is compared somewhere.
    for (kind, names) in [
        ("images", &["color", "silh", "depth", "normal"][..]),
        ("gradients", &["vertex", "color", "texel", "uv", "camera", "light", "backgr", "scalar"]),
    ] {
        for name in names {
            assert!(scenes.iter().any(|scene| scene[kind][name].is_f64()), "{kind} {name}: {json}");
        }
    }
    fails(folder.path(), &["check", "--device", "a device that nobody has"], 1, &["a device that nobody has"]);
}

/// An octahedron, and the same further right as a target.
fn octahedra(folder: &Path) {
    let octahedron = |x: f64| {
        let vertices = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        let lines = vertices.map(|[i, j, k]| format!("v {} {} {}\n", x + f64::from(i), j, k));
        let faces = [[1, 3, 5], [3, 2, 5], [2, 4, 5], [4, 1, 5], [3, 1, 6], [2, 3, 6], [4, 2, 6], [1, 4, 6]];
        lines.concat() + &faces.map(|[a, b, c]| format!("f {a} {b} {c}\n")).concat()
    };
    std::fs::write(folder.join("mesh.obj"), octahedron(0.0)).unwrap();
    std::fs::write(folder.join("moved.obj"), octahedron(0.3)).unwrap();
    let arguments = ["render", "moved.obj", "-o", "target.png", "--size", "72x48", "--unlit", "--frame", "sphere"];
    succeeds(folder, &[&arguments[..], &["--blur", "1.5"], &CAMERA].concat());
}

/// From +z, so that +x is on the right.
const CAMERA: [&str; 4] = ["--eye", "0,0,9", "--look-at", "0,0,0"];

#[test]
fn grad_draws_four_panels_and_says_the_loss() {
    let folder = tempfile::tempdir().unwrap();
    octahedra(folder.path());
    let grad = |extra: &[&str]| {
        let arguments = ["grad", "mesh.obj", "--target", "target.png", "-o", "grad.png", "--unlit"];
        succeeds(folder.path(), &[&arguments[..], &CAMERA, extra].concat())
    };
    let said = grad(&[]);
    assert!(said.starts_with("grad.png: loss ") && said.contains("gradient norm "), "{said}");
    let picture = image::open(folder.path().join("grad.png")).unwrap().into_rgb8();
    assert!(picture.width() > 4 * 72 * 5 && picture.height() > 48 * 5, "{:?}", picture.dimensions());
    let orange =
        picture.enumerate_pixels().filter(|(x, y, p)| p.0 == [255, 176, 46] && 4 * x > 3 * picture.width() && *y < 400);
    assert!(orange.count() > 50, "arrows");
    let number = |json: &str, key: &str| -> f64 {
        serde_json::from_str::<serde_json::Value>(json).unwrap()[key]
            .as_f64()
            .unwrap_or_else(|| panic!("{key}: {json}"))
    };
    let (device, truth) = (grad(&["--json"]), grad(&["--json", "--device", "reference"]));
    for key in ["loss", "color_loss", "silhouette_loss", "gradient_norm"] {
        let (ours, expected) = (number(&device, key), number(&truth, key));
        assert!((ours / expected - 1.0).abs() < 1e-3, "{key}: {ours} for {expected}");
    }
    assert!(number(&device, "arrows") >= 4.0 && number(&device, "loss") > 0.01);
    // Nearer to the target there is less loss.
    let arguments =
        ["grad", "moved.obj", "--target", "target.png", "-o", "b.png", "--unlit", "--blur", "1.5", "--json"];
    let near = succeeds(folder.path(), &[&arguments[..], &CAMERA].concat());
    assert!(number(&near, "loss") < 0.1 * number(&device, "loss"), "{near}");
}

#[test]
fn a_target_without_alpha_is_a_silhouette_by_its_brightness() {
    let folder = tempfile::tempdir().unwrap();
    octahedra(folder.path());
    let opaque = image::open(folder.path().join("target.png")).unwrap().into_rgba8();
    let covered = |p: &image::Rgba<u8>| if p.0[3] > 127 { image::Rgb([255; 3]) } else { image::Rgb([0; 3]) };
    image::RgbImage::from_fn(72, 48, |x, y| covered(opaque.get_pixel(x, y)))
        .save(folder.path().join("rgb.png"))
        .unwrap();
    let loss = |target: &str| {
        let arguments = ["grad", "moved.obj", "--target", target, "-o", "b.png", "--unlit", "--blur", "1.5", "--json"];
        let said = succeeds(folder.path(), &[&arguments[..], &CAMERA].concat());
        serde_json::from_str::<serde_json::Value>(&said).unwrap()["silhouette_loss"].as_f64().unwrap()
    };
    assert!(loss("rgb.png") < 0.02 && loss("target.png") < 0.02, "{} {}", loss("rgb.png"), loss("target.png"));
}

#[test]
fn grad_names_what_it_cannot_use() {
    let folder = tempfile::tempdir().unwrap();
    octahedra(folder.path());
    fails(folder.path(), &["grad", "mesh.obj", "-o", "a.png"], 2, &["--target"]);
    fails(folder.path(), &["grad", "mesh.obj", "--target", "target.png", "-o", "a.gif"], 2, &["a.gif", ".png"]);
    fails(folder.path(), &["grad", "mesh.obj", "--target", "mesh.obj", "-o", "a.png"], 1, &["mesh.obj", "picture"]);
    fails(folder.path(), &["grad", "mesh.obj", "--target", "none.png", "-o", "a.png"], 1, &["none.png"]);
    fails(folder.path(), &["grad", "none.obj", "--target", "target.png", "-o", "a.png"], 1, &["none.obj"]);
    assert!(!folder.path().join("a.png").exists());
}
