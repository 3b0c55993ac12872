//! `eval` of the recorded scenes, on the device and by the reference.

use crate::official::compare::{median_face, relative_l2};
use crate::program::lab;
use crate::recorded::Archive;
use crate::{GRADIENT_TOLERANCE, SPOT};

/// What came of a recorded scene.
fn eval(name: &str, options: &[&str]) -> (Archive, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let scene = Archive::open(name).0;
    let arguments = ["eval", scene.to_str().unwrap(), "-o", "out.npz", "--parity", "official"];
    let output = lab(folder.path(), &[&arguments, options].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{name}: {errors}");
    (Archive(folder.path().join("out.npz")), folder)
}

fn wide(values: Vec<f32>) -> Vec<f64> {
    values.into_iter().map(f64::from).collect()
}

/// The device's image: within 2e-4 in all but few values.
pub fn image(name: &str) {
    let (out, _folder) = eval(name, &[]);
    let official = Archive::open(name);
    assert_eq!(out.array("soft_colors").shape, official.array("soft_colors").shape, "{name}");
    let (ours, theirs) = (out.f64s("soft_colors"), official.f64s("soft_colors"));
    let close = ours.iter().zip(&theirs).filter(|(a, b)| (**a - **b).abs() <= 2e-4).count();
    let part = close as f64 / ours.len() as f64;
    println!("eval, {name}: {part} of the values agree");
    assert!(part >= 0.995, "{name}: {part}");
}

/// The reference's gradient, and the device's: as near as the official float32 run.
pub fn gradients(name: &str) {
    let official = Archive::open(name);
    if name != SPOT {
        let (out, _folder) = eval(name, &["--gradient", "paper", "--device", "reference"]);
        for key in ["grad_face_vertices", "grad_textures"] {
            assert_eq!(out.array(key).shape, official.array(key).shape, "{name}: {key}");
            let error = relative_l2(&out.f64s(key), &official.f64s(key));
            assert!(error < GRADIENT_TOLERANCE, "{name}: {key} {error:e}");
        }
    }
    let (out, _folder) = eval(name, &["--gradient", "paper"]);
    let theirs = official.f64s("grad_face_vertices");
    let ours = wide(out.f32s("grad_face_vertices"));
    let (median, whole) = (median_face(&ours, &theirs), relative_l2(&ours, &theirs));
    let single = relative_l2(&wide(official.f32s("grad_face_vertices_f32")), &theirs);
    let textures = relative_l2(&wide(out.f32s("grad_textures")), &official.f64s("grad_textures"));
    println!(
        "eval, {name}: median face {median:.1e}, whole {whole:.1e}, official float32 {single:.1e}, textures {textures:.1e}"
    );
    assert!(median < 1e-3, "{name}: median face {median:e}");
    assert!(whole <= single, "{name}: {whole:e}, the official float32 run {single:e}");
    assert!(textures < 1e-3, "{name}: textures {textures:e}");
}
