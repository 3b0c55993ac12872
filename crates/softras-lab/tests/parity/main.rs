//! Parity with recorded outputs of the official SoftRas kernels (run in float64), and the counts of well-known meshes; the
//! files lie beside the repository and not in it: `cargo test --test parity`.
//!
//! `cargo test` alone does not build this: where the files are absent nothing is to be said of them. The parity tests that
//! need no file are `equations.rs` of softras-reference, whose equations are compared with the reference in every mode.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cells;
mod of_eval;
mod of_meshes;
mod of_reference;
#[path = "../../../../tests/official/mod.rs"]
mod official;
#[allow(dead_code, reason = "shared with the tests of the quick tier")]
#[path = "../lab/program.rs"]
mod program;
mod recorded;

use std::panic::catch_unwind;
use std::process::ExitCode;

/// Forward: the official kernels agree with their own equations to 1.3e-10.
const IMAGE_TOLERANCE: f64 = 1e-9;
/// Gradient, relative L2: the official one agrees with its own equations to 3e-10 in x, y and colours, 6e-9 in z.
const GRADIENT_TOLERANCE: f64 = 1e-8;

/// The recorded scenes with an image and a gradient. In the surface case which cell a pixel looks up is decided by
/// rounding, so that it has checks of its own.
const SCENES: [&str; 13] = [
    "tiny_s1e-05_g0.0001.npz",
    "tiny_s0.0001_g0.0001.npz",
    "tiny_s0.0001_g0.01.npz",
    "tiny_s0.001_g0.01.npz",
    "tiny_mode_alpha_sum.npz",
    "tiny_mode_barycentric.npz",
    "tiny_mode_batch2.npz",
    "tiny_mode_nearfar.npz",
    "tiny_mode_no_fill_back.npz",
    "tiny_mode_silhouette_hard_rgb.npz",
    "sphere_s0.0001_g0.0001.npz",
    "sphere_s0.001_g0.01.npz",
    SPOT,
];
const SPOT: &str = "spot_s0.0001_g0.0001.npz";
const SURFACE: &str = "tiny_mode_surface_R4.npz";

fn main() -> ExitCode {
    let folder = recorded::folder();
    if !folder.is_dir() {
        println!("not run: {} is absent", folder.display());
        return ExitCode::from(2);
    }
    let mut checks: Vec<(String, Box<dyn Fn() + std::panic::RefUnwindSafe>)> = Vec::new();
    for scene in SCENES {
        checks.push((format!("image of the reference, {scene}"), Box::new(move || of_reference::image(scene))));
        checks.push((format!("gradient of the reference, {scene}"), Box::new(move || of_reference::gradients(scene))));
        checks.push((format!("eval, {scene}"), Box::new(move || of_eval::image_and_gradient(scene))));
    }
    checks.push(("surface texture of the reference".into(), Box::new(of_reference::surface)));
    checks.push(("surface texture of eval".into(), Box::new(|| of_eval::image_and_gradient(SURFACE))));
    checks.push(("render demo of the reference".into(), Box::new(of_reference::render_demo)));
    checks.push(("the camera".into(), Box::new(of_reference::camera)));
    checks.push(("counts of meshes".into(), Box::new(of_meshes::counts)));
    let wanted = std::env::args().nth(1).unwrap_or_default();
    checks.retain(|(name, _)| name.contains(&wanted));
    let failed: Vec<&String> =
        checks.iter().filter(|(_, check)| catch_unwind(check).is_err()).map(|(name, _)| name).collect();
    println!("{} checks, {} failed: {failed:?}", checks.len(), failed.len());
    ExitCode::from(u8::from(!failed.is_empty() || checks.is_empty()))
}
