//! Renders many frames in a row and checks that memory does not grow.

use crate::commands::progress::Progress;
use glam::DVec3;
use serde_json::{Value, json};
use softras::{
    Camera, Image, ImageGradient, Projection, Renderer, RendererOptions, Result, Scene, Settings, Wanted, shapes,
};
use std::time::Instant;

/// The side of the images in pixels, small so that many frames take little time.
const SIZE: u32 = 24;
/// Frames after which all lasting allocations have been made.
const SETTLED: u64 = 1000;
/// The growth that the allocator may cause by itself.
const SLACK: u64 = 16 << 20;

/// The result of a run.
#[derive(Debug)]
pub struct Load {
    frames: u64,
    renderers: u64,
    seconds: f64,
    /// Resident bytes of this process after [`SETTLED`] frames and at the end, if the system reports them.
    resident: Option<(u64, u64)>,
    /// Bytes of device memory of one renderer at the same two times.
    device: (u64, u64),
}

impl Load {
    /// Whether memory did not grow.
    pub fn is_flat(&self) -> bool {
        self.resident.is_none_or(|(settled, end)| end <= settled + SLACK) && self.device.1 <= self.device.0
    }

    /// The result as a line of text.
    pub fn line(&self) -> String {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let resident = self.resident.map_or("unknown here".into(), |(settled, end)| {
            format!("{:.1} MiB after {SETTLED} frames, {:.1} at the end", mib(settled), mib(end))
        });
        let verdict = if self.is_flat() { "flat" } else { "GROWN" };
        format!(
            "{} frames of {} renderers, rendered and differentiated, {:.0} s: process {resident}; device buffers {:.2} and \
             {:.2} MiB: {verdict}",
            self.frames,
            self.renderers,
            self.seconds,
            mib(self.device.0),
            mib(self.device.1)
        )
    }

    /// The result as JSON.
    pub fn json(&self) -> Value {
        json!({
            "frames": self.frames, "renderers": self.renderers, "seconds": self.seconds, "flat": self.is_flat(),
            "resident_settled": self.resident.map(|r| r.0), "resident_end": self.resident.map(|r| r.1),
            "device_settled": self.device.0, "device_end": self.device.1,
        })
    }
}

/// Resident bytes of this process.
fn resident() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(4096 * text.split_whitespace().nth(1)?.parse::<u64>().ok()?)
}

/// Renders and differentiates frames, shared by several renderers at once. Each frame has another camera, and some have
/// another size.
///
/// # Errors
/// Errors of the device.
pub fn run(frames: u64, renderers: u64, options: &RendererOptions) -> Result<Load> {
    let progress = Progress::counted("frame", frames as usize);
    let start = Instant::now();
    let each = |renderer: u64| frames / renderers + u64::from(renderer < frames % renderers);
    let mut load = Load { frames, renderers, seconds: 0.0, resident: None, device: (0, 0) };
    let mut settled = None;
    // All devices are created before the first frame and destroyed after the last one, because the validation layers crash
    // otherwise.
    let mut first = Renderer::with_options(options)?;
    let mut others = (1..renderers).map(|_| Renderer::with_options(options)).collect::<Result<Vec<_>>>()?;
    std::thread::scope(|scope| {
        let progress = &progress;
        let others: Vec<_> = (1..renderers)
            .zip(&mut others)
            .map(|(r, other)| scope.spawn(move || work(each(r), other, || progress.step(), |_, _| ())))
            .collect();
        let first = work(
            each(0),
            &mut first,
            || progress.step(),
            |frame, renderer| {
                if frame < SETTLED {
                    settled = resident();
                    load.device.0 = renderer.device_bytes();
                }
                load.device.1 = renderer.device_bytes();
            },
        );
        let ended =
            others.into_iter().map(|other| other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        ended.fold(first, Result::and)
    })?;
    load.seconds = start.elapsed().as_secs_f64();
    load.resident = settled.zip(resident());
    Ok(load)
}

fn work(frames: u64, renderer: &mut Renderer, step: impl Fn(), mut seen: impl FnMut(u64, &Renderer)) -> Result<()> {
    let scene = Scene::new(shapes::icosphere(2)?);
    for frame in 0..frames {
        let angle = frame as f64 * 0.1;
        let eye = DVec3::new(3.0 * angle.cos(), angle.sin(), 3.0 * angle.sin());
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 1.0 })?;
        // Both sizes occur before memory counts as settled.
        let size = if frame % 100 == 99 { 3 * SIZE } else { SIZE };
        let settings = Settings { width: size, height: size, sigma: 1e-4, save: true, ..Settings::default() };
        let image = renderer.render(&scene, &[camera], &settings)?;
        let ones = |image: &Image| Image { data: vec![1.0; image.data.len()], ..image.clone() };
        let upstream = ImageGradient {
            color: image.color().map(ones),
            silhouette: image.silhouette().map(ones),
            ..ImageGradient::default()
        };
        renderer.backward(&image, &upstream, &Wanted::ALL)?;
        seen(frame, renderer);
        step();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_told() {
        let flat = Load { frames: 1, renderers: 1, seconds: 1.0, resident: Some((1 << 20, 2 << 20)), device: (64, 64) };
        assert!(flat.is_flat() && flat.line().contains(": flat"));
        assert!(!Load { resident: Some((0, SLACK + 1)), ..flat }.is_flat());
        assert!(!Load { device: (64, 65), resident: None, ..flat }.is_flat());
    }
}
