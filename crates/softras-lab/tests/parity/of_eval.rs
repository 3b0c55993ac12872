//! `eval` of the recorded scenes on the device.

use crate::SURFACE;
use crate::official::compare::{median_face, relative_l2};
use crate::program::lab;
use crate::recorded::Archive;

fn wide(values: Vec<f32>) -> Vec<f64> {
    values.into_iter().map(f64::from).collect()
}

/// The image: within 2e-4 in all but few values. The gradient: as near as the official float32 run.
pub fn image_and_gradient(name: &str) {
    let folder = tempfile::tempdir().unwrap();
    let official = Archive::open(name);
    let scene = official.0.to_str().unwrap();
    let output = lab(folder.path(), &["eval", scene, "-o", "out.npz", "--parity", "official", "--gradient", "paper"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{name}: {errors}");
    let out = Archive(folder.path().join("out.npz"));
    assert_eq!(out.array("soft_colors").shape, official.array("soft_colors").shape, "{name}");
    let (ours, theirs) = (out.f64s("soft_colors"), official.f64s("soft_colors"));
    let close = ours.iter().zip(&theirs).filter(|(a, b)| (**a - **b).abs() <= 2e-4).count();
    let part = close as f64 / ours.len() as f64;
    println!("eval, {name}: {part} of the values agree");
    assert!(part >= 0.995, "{name}: {part}");
    if name == SURFACE {
        return;
    }
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
