//! The reference and the kernels against recorded outputs of the official SoftRas kernels (run in float64), the official camera,
//! and the counts of well-known meshes. The files lie beside the repository and not in it: `cargo test --test parity`, with
//! `SOFTRAS_RECORDED=FOLDER` for other recordings.
//!
//! `cargo test` alone does not build this: where the files are absent nothing is to be said of them. The parity tests that
//! need no file are `equations.rs` of softras-reference, whose equations are compared with the reference in every mode.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cells;
mod of_kernels;
mod of_meshes;
mod of_reference;
#[path = "../official/mod.rs"]
mod official;
mod recorded;

use recorded::Case;
use std::panic::catch_unwind;
use std::process::ExitCode;

/// Forward: the official kernels agree with their own equations to 1.3e-10.
const IMAGE_TOLERANCE: f64 = 1e-9;
/// Gradient, relative L2: the official one agrees with its own equations to 3e-10 in x, y and colours, 6e-9 in z.
const GRADIENT_TOLERANCE: f64 = 1e-8;

fn main() -> ExitCode {
    let folder = recorded::folder();
    let Ok(files) = std::fs::read_dir(&folder) else {
        println!("not run: {} is absent", folder.display());
        return ExitCode::from(2);
    };
    let mut names: Vec<String> = files.flatten().map(|file| file.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| name.ends_with(".npz"));
    names.sort();
    let mut checks: Vec<(String, Box<dyn Fn() + std::panic::RefUnwindSafe>)> = Vec::new();
    for name in names {
        match name.as_str() {
            "pipeline.npz" => checks.push(("camera".into(), Box::new(of_reference::camera))),
            "spot_demo_render.npz" => checks.push(("render demo".into(), Box::new(of_reference::render_demo))),
            _ => {
                let scene = name.clone();
                checks.push((format!("reference, {name}"), Box::new(move || of_reference::scene(&Case::open(&scene)))));
                checks.push((format!("kernels, {name}"), Box::new(move || of_kernels::scene(&Case::open(&name)))));
            }
        }
    }
    if folder.join("../meshes").is_dir() {
        checks.push(("counts of meshes".into(), Box::new(of_meshes::counts)));
    }
    let wanted = std::env::args().nth(1).unwrap_or_default();
    checks.retain(|(name, _)| name.contains(&wanted));
    let failed: Vec<&String> =
        checks.iter().filter(|(_, check)| catch_unwind(check).is_err()).map(|(name, _)| name).collect();
    println!("{} checks, {} failed: {failed:?}", checks.len(), failed.len());
    ExitCode::from(u8::from(!failed.is_empty() || checks.is_empty()))
}
