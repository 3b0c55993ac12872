//! The vk-graph example under validation: the fit converges, the picture shows the engine's pixels and softras' where they
//! belong, and no message is logged.
// The example hands raw handles across.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../src/main.rs"]
mod embed_vk_graph;

use std::io::Write;
use std::path::Path;
use std::sync::Mutex;

/// Collects what vk-graph logs, the messages of the validation layer among it. It prints them as well, since vk-graph aborts
/// the process after an error of the layer.
struct Log(Mutex<Vec<String>>);

impl log::Log for Log {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        let message = format!("{} {}: {}", record.level(), record.target(), record.args());
        // On a software device every frame is slow.
        if self.enabled(record.metadata()) && !message.contains("slow fence wait") {
            // Straight to the process's own stderr: the test harness would lose what is captured when the process aborts.
            std::io::stderr().write_all(format!("{message}\n").as_bytes()).unwrap();
            self.0.lock().unwrap().push(message);
        }
    }

    fn flush(&self) {}
}

static LOG: Log = Log(Mutex::new(Vec::new()));

/// The picture's size and its pixels, r, g, b.
fn read(path: &Path) -> (usize, Vec<[i32; 3]>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgba);
    (info.width as usize, bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2]].map(i32::from)).collect())
}

#[test]
fn the_vk_graph_example_fits_its_goal_and_composites_by_depth() {
    log::set_logger(&LOG).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("graph.png");
    let losses = embed_vk_graph::run(&path, None, 2, true).unwrap();
    assert!(losses[2] < 0.1 * losses[0], "{losses:?}");

    // Before the fit a grey sphere, cut by the engine's triangle: on the left it is nearer, on the right farther away.
    let (size, before) = read(&path.with_extension("start.png"));
    let at = |column: f64, row: f64| before[(row * size as f64) as usize * size + (column * size as f64) as usize];
    let is_grey = |p: [i32; 3]| p[0] > 80 && (p[0] - p[2]).abs() < 30;
    let is_triangle = |p: [i32; 3]| p[0] > 240 && p[2] < 100;
    assert!(is_grey(at(0.36, 0.62)) && is_triangle(at(0.65, 0.64)), "{:?} {:?}", at(0.36, 0.62), at(0.65, 0.64));
    // The background is dark blue in the corners.
    assert!(at(0.02, 0.02)[2] > at(0.02, 0.02)[0] + 20, "{:?}", at(0.02, 0.02));
    // After it the head, on the left, is orange.
    let (_, after) = read(&path);
    let head = after[size / 2 * size + size / 4];
    assert!(head[0] > head[2] + 60, "{head:?}");

    let messages = std::mem::take(&mut *LOG.0.lock().unwrap());
    assert_eq!(messages, Vec::<String>::new());
    // An empty log means silence only if the log receives warnings.
    log::warn!("a warning");
    assert_eq!(LOG.0.lock().unwrap().len(), 1);
}
