//! Run time against error: `cargo bench --bench error`, or `-- full` for more sizes.
//!
//! The subject of the published comparisons, with a composite background and near and far close around the mesh. τ is
//! swept for both kinds of support; the naive kernel, every pixel over every face, stands beside them. Errors are the
//! largest of colour and silhouette against the untruncated f64 reference; the naive kernel's τ is the smallest of the sweep.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod subject;

use softras::{Renderer, Settings};
use softras_cli::measure::subject::{camera, scene, settings};
use softras_cli::measure::sweep::{front, front_settings};
use softras_naive as naive;

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let (name, mesh) = subject::mesh("spot");
    println!("{name}, {} triangles, on {}", mesh.triangles().len(), renderer.device_name());
    let (scene, camera) = (scene(&mesh).expect("a mesh"), camera(0.0).expect("a camera"));
    let sizes: &[u32] = if subject::asked("full") { &[64, 128, 256, 512] } else { &[256] };
    for &size in sizes {
        let settings = front_settings(&settings(size));
        println!("{size} pixels, sigma {:e}, gamma {:e}", settings.sigma, settings.gamma);
        println!("{:>12} {:>8} {:>10} {:>10} {:>10}", "", "tau", "forward", "frame", "error");
        let exact = softras::internals::reference::render_untruncated(&scene, &[camera], &settings).expect("images");
        let curves = front(&mut renderer, &scene, &[camera], &settings, 15).expect("frames");
        for curve in &curves {
            for p in &curve.points {
                let (forward, frame) = (p.forward, p.milliseconds);
                println!("{:>12} {:>8.0e} {forward:>10.2} {frame:>10.2} {:>10.1e}", curve.name, p.tau, p.error);
            }
        }
        let fine = Settings { tau: 1e-6, ..settings.clone() };
        let (time, image) = naive::render(&scene, &camera, &fine, 2).expect("a frame");
        let error = naive::error(&image, &exact, fine.outputs);
        println!("{:>12} {:>8.0e} {time:>10.2} {:>10} {error:>10.1e}", "naive", fine.tau, "-");
        let better = |c: &softras_cli::measure::sweep::Curve| {
            c.points.iter().filter(|p| p.error <= error).map(|p| p.forward).fold(f64::INFINITY, f64::min)
        };
        let best = curves.iter().map(better).fold(f64::INFINITY, f64::min);
        println!("naive over the fastest of ours with an error no larger: {:.0}", time / best);
    }
}
