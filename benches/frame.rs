//! Time of a frame, forward and backward, by mesh, size and mode, next to its floor: `cargo bench --bench frame`.
//!
//! Quick by default: spot (else the fish) at 64² to 512², colour and silhouette. `-- full` takes every mode, 64² to 2048²,
//! meshes of 1k to 124k faces where `../shared/meshes` has them, and a sphere of 1.3 million at a σ of a pixel and a half.
//! `-- modes` takes every mode at 256² and says what each saves. Medians of wall time, upload and download included, and the
//! stages' device times. Machines are noisy: compare within one run.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod subject;

use softras::{Error, Mesh, Renderer, Settings, shapes};
use softras_lab::measure::subject::{cameras, scene, settings};
use softras_lab::measure::time::times;
use softras_lab::measure::{Mode, floor, peak_flops};

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let full = subject::asked("full");
    let modes =
        if full || subject::asked("modes") { &Mode::ALL[..] } else { &[Mode::ColorSilhouette, Mode::Silhouette] };
    let sizes: &[u32] = match (full, subject::asked("modes")) {
        (true, _) => &[64, 128, 256, 512, 1024, 2048],
        (_, true) => &[256],
        _ => &[64, 128, 256, 512],
    };
    let peak = (0..3).map(|_| peak_flops(renderer.device_info()).expect("a peak")).fold(0.0, f64::max);
    println!("{}, {:.1} GFLOP/s measured", renderer.device_name(), peak / 1e9);
    println!(
        "{:>10} {:>8} {:>5} {:>17} {:>9} {:>9} {:>9} {:>8} {:>8}   stages (ms)",
        "mesh", "faces", "size", "images", "forward", "backward", "both", "of full", "x floor"
    );
    for (name, mesh) in meshes(full) {
        for &size in sizes {
            let mut full = None;
            for &mode in modes {
                let both = row(&mut renderer, &name, &mesh, &settings(size), mode, peak, full);
                full = full.or(Some(both));
            }
        }
    }
    if full {
        let million = shapes::icosphere(8).expect("a sphere");
        // At the usual 1e-4, 15 pixels, its lists would be longer than a buffer may be.
        let settings = settings(1024).with_blur_pixels(1.5);
        row(&mut renderer, "million", &million, &settings, Mode::ColorSilhouette, peak, None);
        println!("device memory held: {} MiB", renderer.device_bytes() >> 20);
    }
}

fn meshes(full: bool) -> Vec<(String, Mesh)> {
    let mut all = vec![subject::mesh("spot")];
    if full {
        all.extend(
            ["suzanne", "fandisk", "bunny", "nefertiti"].map(subject::mesh).into_iter().filter(|m| m.0 != "fish"),
        );
    }
    all
}

/// Prints a row; the milliseconds of a whole frame. `full` are those of the mode that it is compared with.
fn row(
    renderer: &mut Renderer,
    name: &str,
    mesh: &Mesh,
    settings: &Settings,
    mode: Mode,
    peak: f64,
    full: Option<f64>,
) -> f64 {
    let scene = scene(mesh).expect("a mesh");
    let cameras = cameras(1).expect("a camera");
    let (settings, size) = (mode.of(settings), settings.height);
    // Large frames take long enough to need few repeats.
    let heavy = mesh.triangles().len() > 50_000 || size > 512;
    let found = match times(renderer, &scene, &cameras, &settings, mode, if heavy { 5 } else { 40 }) {
        Ok(found) => found,
        Err(error @ Error::Limit { .. }) => {
            println!("{name:>10} {:>8} {size:>5} {:>17} {error}", mesh.triangles().len(), mode.name());
            return f64::NAN;
        }
        Err(error) => panic!("{error}"),
    };
    let pairs = softras_reference::pairs(&scene, &cameras, &settings).expect("pairs").total() as f64;
    let operations = floor::forward_operations(mode) + floor::backward_operations(mode);
    let least = pairs * operations / peak * 1e3;
    print!(
        "{name:>10} {:>8} {size:>5} {:>17} {:>9.2} {:>9.2} {:>9.2} {:>8} {:>8.1}  ",
        mesh.triangles().len(),
        mode.name(),
        found.forward,
        found.backward,
        found.frame,
        full.map_or("-".to_string(), |full| format!("{:.2}", found.frame / full)),
        found.frame / least
    );
    for time in found.frame_stages.iter().filter(|t| t.milliseconds >= 0.02) {
        print!(" {} {:.2}", time.stage, time.milliseconds);
    }
    let stage = |name: &str| found.frame_stages.iter().find(|t| t.stage == name).map_or(f64::NAN, |t| t.milliseconds);
    let of = |name: &str, operations: f64| stage(name) / (pairs * operations / peak * 1e3);
    println!(
        "; forward {:.1}, backward {:.1} times their floors",
        of("forward", floor::forward_operations(mode)),
        of("backward", floor::backward_operations(mode))
    );
    found.frame
}
