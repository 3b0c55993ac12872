//! Run time against error: `cargo bench --bench error`, or `-- full` for more sizes.
//!
//! The subject of the published comparisons, with a composite background and near and far close around the mesh. τ is
//! swept for both kinds of support. Errors are the largest of colour and silhouette against the untruncated f64 reference.
//! Other renderers' points follow ([`published`]).
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod published;
mod subject;

use softras::{Mesh, Renderer, shapes};
use softras_check::measure::subject::{camera, cameras, scene, settings};
use softras_check::measure::sweep::{front, front_settings};
use softras_check::measure::time::times;
use softras_check::measure::{Mode, error};

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let (name, mesh) = subject::mesh("spot");
    println!("{name}, {} triangles, on {}", mesh.triangles().len(), renderer.device_name());
    curves(&mut renderer, &mesh);
    peers(&mut renderer, &name, &mesh);
}

/// Run time against error over τ.
fn curves(renderer: &mut Renderer, mesh: &Mesh) {
    let (scene, camera) = (scene(mesh).expect("a mesh"), camera(0.0).expect("a camera"));
    let sizes: &[u32] = if subject::asked("full") { &[64, 128, 256, 512] } else { &[256] };
    for &size in sizes {
        let settings = front_settings(&settings(size));
        println!("{size} pixels, sigma {:e}, gamma {:e}", settings.sigma, settings.gamma);
        println!("{:>12} {:>8} {:>10} {:>10} {:>10}", "", "tau", "forward", "frame", "error");
        let curves = front(renderer, &scene, &[camera], &settings, 15).expect("frames");
        for curve in curves {
            for p in curve.points {
                let (forward, frame) = (p.forward, p.milliseconds);
                println!("{:>12} {:>8.0e} {forward:>10.2} {frame:>10.2} {:>10.1e}", curve.name, p.tau, p.error);
            }
        }
    }
}

/// Other renderers' times beside ours for the same work, and their errors where their outputs are recorded.
fn peers(renderer: &mut Renderer, name: &str, mesh: &Mesh) {
    let mode = Mode::ColorSilhouette;
    let (scene_of_peers, camera) = (scene(mesh).expect("a mesh"), camera(0.0).expect("a camera"));
    let s = mode.of(&settings(256));
    let ours = times(renderer, &scene_of_peers, &[camera], &s, mode, 15).expect("frames");
    let frame = renderer.render(&scene_of_peers, &[camera], &s).expect("a frame");
    let exact = softras_reference::render_untruncated(&scene_of_peers, &[camera], &s).expect("images");
    let culled = softras_reference::render_culled(&scene_of_peers, &[camera], &s).expect("images");
    let own = error::images(&frame, &exact, None);
    let rounding = error::images(&frame, &culled, Some(&culled.margin)).most;
    println!("peers: spot, 5856 triangles, 256 pixels, sigma 1e-4, gamma 1e-4, weighted background; ours: {name}");
    println!(
        "{:>20} {:>10} {:>10} {:>8} {:>10} {:>10} {:>10}",
        "", "forward", "frame", "x ours", "error", "silh.", "rounding"
    );
    let row = |name: &str, forward: f64, frame: f64, errors: Option<[f64; 3]>| {
        let errors = errors.map_or(["-".to_string(), "-".into(), "-".into()], |e| e.map(|e| format!("{e:.1e}")));
        let [error, silhouette, rounding] = errors;
        let ratio = frame / ours.frame;
        println!("{name:>20} {forward:>10.2} {frame:>10.2} {ratio:>8.1} {error:>10} {silhouette:>10} {rounding:>10}");
    };
    row("softras", ours.forward, ours.frame, Some([own.most, own.silhouette, rounding]));
    for peer in &published::PEERS {
        let errors = peer.error().map(|e| [e.untruncated, e.silhouette, e.rounding]);
        row(peer.name, peer.forward, peer.forward + peer.backward, errors);
    }
    if published::PEERS.iter().all(|peer| peer.error().is_none()) {
        println!("../shared/reference is absent: no error of the peers is measured");
    }
    published::NO_POINT.iter().for_each(|line| println!("{line}"));
    let task = scene(&shapes::icosphere(3).expect("a sphere")).expect("a scene");
    let mode = Mode::Silhouette;
    let views = cameras(8).expect("cameras");
    let step = times(renderer, &task, &views, &mode.of(&settings(128)), mode, 15).expect("frames").frame;
    let [low, high] = published::DRESSI_STEP.map(|time| time / step);
    println!(
        "8 silhouettes of 128², sphere of 1280 triangles, forward and backward: ours {step:.2}, dressi's step {low:.0} to {high:.0} times that"
    );
}
