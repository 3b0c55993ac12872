//! How long the first picture takes: `cargo bench --bench cold`.
//!
//! Each row is a process of its own: opening the device, the first frame, the first gradients, and the second of each, once
//! with nothing compiled yet and again with what the process before left on disk (the crate's own pipeline cache, and the
//! driver's where it has one: lavapipe keeps its code in Mesa's shader cache). Three of each, medians.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use softras::{CacheFolder, Renderer, RendererOptions, Settings, shapes};
use softras_check::measure::Mode;
use softras_check::measure::subject::{camera, scene, settings};
use softras_check::measure::time::{median, upstream};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const PARTS: [&str; 5] = ["open", "first frame", "first gradients", "second frame", "second gradients"];
const RUNS: usize = 3;

fn main() {
    if let Some(folder) = std::env::var_os("SOFTRAS_COLD") {
        return measure(Path::new(&folder));
    }
    println!("fish, 256², colour and silhouette; milliseconds, {RUNS} processes each");
    println!("{:>24} {:>16} {:>16}", "", "nothing cached", "caches warm");
    let runs: Vec<[Vec<f64>; 2]> = (0..RUNS).map(|_| cold_then_warm()).collect();
    for (i, part) in PARTS.iter().enumerate() {
        let [cold, warm] = [0, 1].map(|which| median(runs.iter().map(|run| run[which][i]).collect()));
        println!("{part:>24} {cold:>16.1} {warm:>16.1}");
    }
}

fn cold_then_warm() -> [Vec<f64>; 2] {
    let folder = std::env::temp_dir().join(format!("softras-cold-{}", std::process::id()));
    _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    let run = || {
        let mut command = Command::new(std::env::current_exe().expect("this program"));
        command.env("SOFTRAS_COLD", folder.join("softras")).env("MESA_SHADER_CACHE_DIR", folder.join("mesa"));
        let output = command.output().expect("a process");
        let text = String::from_utf8(output.stdout).expect("numbers");
        let times: Vec<f64> = text.split_whitespace().map(|number| number.parse().expect("a number")).collect();
        assert_eq!(times.len(), PARTS.len(), "{text} {}", String::from_utf8_lossy(&output.stderr));
        times
    };
    let both = [run(), run()];
    _ = std::fs::remove_dir_all(&folder);
    both
}

fn measure(folder: &Path) {
    let mode = Mode::ColorSilhouette;
    let scene = scene(&shapes::fish().expect("the crate's own mesh")).expect("a mesh");
    let cameras = [camera(0.0).expect("a camera")];
    let settings = Settings { save: true, ..mode.of(&settings(256)) };
    let upstream = upstream(mode, 1, &settings);
    let mut last = Instant::now();
    let mut lap = || println!("{}", std::mem::replace(&mut last, Instant::now()).elapsed().as_secs_f64() * 1e3);
    let options = RendererOptions { cache: CacheFolder::At(folder.to_owned()), ..RendererOptions::default() };
    let mut renderer = Renderer::with_options(&options).expect("a Vulkan device");
    lap();
    for _ in 0..2 {
        let frame = renderer.render(&scene, &cameras, &settings).expect("a frame");
        lap();
        renderer.backward(&frame, &upstream, &mode.wanted()).expect("gradients");
        lap();
    }
}
