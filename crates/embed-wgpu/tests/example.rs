//! The wgpu example under validation: the picture shows the engine's pixels and softras' where they belong, and no
//! message is logged.
// The example hands raw handles across.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../src/main.rs"]
mod embed_wgpu;

use std::sync::Mutex;

/// Collects the messages of the validation layer, which wgpu passes on to the log.
struct Log(Mutex<Vec<String>>);

impl log::Log for Log {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            self.0.lock().unwrap().push(format!("{} {}: {}", record.level(), record.target(), record.args()));
        }
    }

    fn flush(&self) {}
}

static LOG: Log = Log(Mutex::new(Vec::new()));

#[test]
fn the_wgpu_example_draws_softras_image_over_its_own() {
    log::set_logger(&LOG).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wgpu.png");
    let pixels = embed_wgpu::run(Some(&path), true).unwrap();
    let size = (pixels.len() / 4).isqrt();
    let pixel = |column: usize, row: usize| {
        let at = 4 * (row * size + column);
        [pixels[at], pixels[at + 1], pixels[at + 2]].map(i32::from)
    };
    // The corners are wgpu's: blue above, sand below; the ring between is softras': redder than blue.
    let [top, bottom] = [pixel(2, 2), pixel(2, size - 3)];
    assert!(top[2] > top[0] + 40 && bottom[0] > bottom[2] + 20, "{top:?} {bottom:?}");
    let ring = pixel(size * 3 / 4, size * 5 / 8);
    assert!(ring[0] > ring[2] + 80, "{ring:?}");
    assert!(std::fs::metadata(path).unwrap().len() > 1000);
    let messages = std::mem::take(&mut *LOG.0.lock().unwrap());
    assert_eq!(messages, Vec::<String>::new());
    // An empty log means silence only if the log receives warnings.
    log::warn!("a warning");
    assert_eq!(LOG.0.lock().unwrap().len(), 1);
}
