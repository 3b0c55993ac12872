//! Time of a frame, forward and backward, by size and mode: `cargo bench --bench frame`.
//!
//! The scene is the one of the published comparisons: the mesh at distance 2.732, elevation 30°, filling 70 % of the
//! image's height, σ = γ = 1e-4. It is spot where `../shared/meshes` has it, else this crate's own fish. Medians of wall time
//! over `RUNS` frames, upload and download included, and the stages' device times. Machines are noisy: compare within
//! one run.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use softras::scene::Outputs;
use softras::{Camera, Image, ImageGradient, Mesh, Projection, Renderer, Scene, Settings, Wanted, shapes};
use std::time::Instant;

const RUNS: usize = 60;

fn main() {
    let mut renderer = Renderer::new().expect("a Vulkan device");
    let (name, mesh) = subject();
    println!("{name}, {} triangles, on {}", mesh.triangles().len(), renderer.device_name());
    println!("{:>5} {:>22} {:>9} {:>9} {:>9}   stages (ms)", "size", "images", "forward", "backward", "both");
    let scene = Scene::new(framed(&mesh));
    for size in [64, 128, 256, 512] {
        for (images, color) in [("colour + silhouette", true), ("silhouette", false)] {
            row(&mut renderer, &scene, size, images, color);
        }
    }
}

/// Spot where it is to be had, else the fish; in vertex colours.
fn subject() -> (&'static str, Mesh) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/meshes/spot.obj");
    match softras::obj::load(&path, &softras::obj::LoadOptions::default()) {
        Ok(loaded) => ("spot", loaded.mesh),
        Err(_) => ("fish", shapes::by_name("fish").expect("the crate's own mesh")),
    }
}

/// The mesh centred and scaled so that it fills 70 % of the image's height.
fn framed(mesh: &Mesh) -> Mesh {
    let (low, high) = mesh.bounds().expect("a mesh with triangles");
    let scale = 0.7 * 2.0 * 2.732 * 15f32.to_radians().tan() / (high[1] - low[1]);
    let place = |p: &[f32; 3]| [0, 1, 2].map(|k| (p[k] - (low[k] + high[k]) / 2.0) * scale);
    let positions: Vec<[f32; 3]> = mesh.positions().iter().map(place).collect();
    let colors = positions.iter().map(|p| p.map(|x| (x + 0.5).clamp(0.0, 1.0))).collect();
    Mesh::new(positions, mesh.triangles().to_vec())
        .and_then(|mesh| mesh.with_appearance(softras::scene::Appearance::VertexColors(colors)))
        .expect("finite positions")
}

fn row(renderer: &mut Renderer, scene: &Scene, size: u32, images: &str, color: bool) {
    let projection = Projection::Perspective { fov_y: 30f64.to_radians() };
    let cameras = [Camera::from_angles(2.732, 30.0, 0.0, projection).expect("a camera")];
    let look = Settings {
        width: size,
        height: size,
        sigma: 1e-4,
        gamma: 1e-4,
        outputs: Outputs { color, silhouette: true, depth: false, normal: false },
        ..Settings::default()
    };
    let save = Settings { save: true, ..look.clone() };
    let side = size as usize;
    let weights = |channels: usize| Image {
        batch: 1,
        height: side,
        width: side,
        channels,
        data: (0..side * side * channels).map(|i| (i * 7919 % 1000) as f32 / 1000.0 - 0.5).collect(),
    };
    let upstream =
        ImageGradient { color: color.then(|| weights(3)), silhouette: Some(weights(1)), ..ImageGradient::default() };
    let wanted = Wanted { colors: color, ..Wanted::default() };
    let (mut forward, mut backward, mut both) = (Vec::new(), Vec::new(), Vec::new());
    let mut stages = Vec::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        let frame = renderer.render(scene, &cameras, &look).expect("a frame");
        forward.push(start.elapsed().as_secs_f64() * 1e3);
        let start = Instant::now();
        let saved = renderer.render(scene, &cameras, &save).expect("a frame");
        let middle = Instant::now();
        renderer.backward(&saved, &upstream, &wanted).expect("gradients");
        backward.push(middle.elapsed().as_secs_f64() * 1e3);
        both.push(start.elapsed().as_secs_f64() * 1e3);
        let back = renderer.backward_timings().expect("timings");
        let times = frame.timings().iter().chain(&back);
        stages.push(times.map(|t| (t.stage, t.milliseconds)).collect::<Vec<_>>());
    }
    print!("{size:>5} {images:>22} {:>9.2} {:>9.2} {:>9.2}  ", median(forward), median(backward), median(both));
    for (i, (stage, _)) in stages[0].iter().enumerate() {
        let time = median(stages.iter().map(|row| row[i].1).collect());
        if time >= 0.005 {
            print!(" {stage} {time:.2}");
        }
    }
    println!();
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
