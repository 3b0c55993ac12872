//! Renders many frames in a row with many renderers at once, and checks that all of them give the same bits and that memory
//! does not grow.

use crate::commands::progress::Progress;
use glam::DVec3;
use serde_json::{Value, json};
use softras::{
    Camera, GradientRequest, Image, ImageGradient, Projection, Renderer, RendererOptions, Result, Scene, Settings,
    shapes,
};
use softras_lab::stress::fingerprint;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// The side of the images in pixels, small so that many frames take little time.
const SIZE: u32 = 24;
/// Frames of a renderer after which all lasting allocations have been made; a fifth of its frames where these are fewer.
const SETTLED: u64 = 1000;
/// The growth of memory that the allocator may cause by itself: of one renderer, and of each further one.
const SLACK: [u64; 2] = [16 << 20, 1 << 20];
/// The number of different frames. Later frames repeat their cameras, and must repeat their bits.
const DISTINCT: u64 = 1000;

/// What is rendered.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Frames of all renderers together.
    pub frames: u64,
    /// Threads that render at the same time.
    pub threads: u64,
    /// Renderers of each thread, which take turns.
    pub renderers: u64,
}

impl Work {
    /// The frames of one of the renderers.
    fn frames_of(self, renderer: u64) -> u64 {
        let all = self.threads * self.renderers;
        self.frames / all + u64::from(renderer < self.frames % all)
    }

    /// The frames of the first renderer after which memory counts as settled.
    fn settled(self) -> u64 {
        SETTLED.min(self.frames_of(0) / 5).max(1)
    }
}

/// The result of a run.
#[derive(Debug)]
pub struct Load {
    work: Work,
    seconds: f64,
    /// Frames whose bits were not those of the same frame of another renderer.
    different: u64,
    /// Resident bytes of this process once memory has settled and at the end, if the system reports them.
    resident: Option<(u64, u64)>,
    /// Bytes of device memory of one renderer at the same two times.
    device: (u64, u64),
}

impl Load {
    /// Whether all renderers gave the same bits and memory did not grow.
    pub fn is_good(&self) -> bool {
        self.different == 0 && self.is_flat()
    }

    fn is_flat(&self) -> bool {
        let slack = SLACK[0] + SLACK[1] * (self.work.threads * self.work.renderers - 1);
        self.resident.is_none_or(|(settled, end)| end <= settled + slack) && self.device.1 <= self.device.0
    }

    /// The result as a line of text.
    pub fn line(&self) -> String {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let Work { frames, threads, renderers } = self.work;
        let resident = self.resident.map_or("unknown here".into(), |(settled, end)| {
            format!("{:.1} MiB after {} frames of each, {:.1} at the end", mib(settled), self.work.settled(), mib(end))
        });
        let verdict = if self.is_flat() { "flat" } else { "GROWN" };
        let bits = match self.different {
            0 => "the same bits".into(),
            count => format!("OTHER BITS in {count} frames"),
        };
        format!(
            "{frames} frames of {threads} threads with {renderers} renderers each, rendered and differentiated, {:.0} s: {bits}; \
             process {resident}; device buffers {:.2} and {:.2} MiB: {verdict}",
            self.seconds,
            mib(self.device.0),
            mib(self.device.1)
        )
    }

    /// The result as JSON.
    pub fn json(&self) -> Value {
        json!({
            "frames": self.work.frames, "threads": self.work.threads, "renderers_of_each": self.work.renderers,
            "seconds": self.seconds, "different": self.different, "flat": self.is_flat(),
            "settled_after": self.work.settled(),
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

/// The bits of each frame, as the first renderer that came to it gave them.
#[derive(Debug)]
struct Bits(Mutex<Vec<Option<u64>>>);

impl Bits {
    fn new() -> Self {
        Self(Mutex::new(vec![None; DISTINCT as usize]))
    }

    /// Whether a frame has the bits that it had before, if it was rendered before.
    fn agree(&self, frame: u64, bits: u64) -> bool {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *all[(frame % DISTINCT) as usize].get_or_insert(bits) == bits
    }
}

/// Renders and differentiates frames with several threads at once. Each frame of a renderer has another camera, and some have
/// another size.
pub fn run(work: Work, options: &RendererOptions) -> Result<Load> {
    let progress = Progress::counted("frame", work.frames as usize);
    let start = Instant::now();
    let mut load = Load { work, seconds: 0.0, different: 0, resident: None, device: (0, 0) };
    // All devices are created before the first frame and destroyed after the last one, because the validation layers crash
    // otherwise.
    let count = work.threads * work.renderers;
    let mut renderers = (0..count).map(|_| Renderer::with_options(options)).collect::<Result<Vec<_>>>()?;
    let bits = Bits::new();
    let mut part = |frames: Range<u64>| -> Result<(Option<u64>, u64)> {
        load.different += at_once(work, frames, &mut renderers, &bits, &progress)?;
        Ok((resident(), renderers[0].device_bytes()))
    };
    let (settled, device_settled) = part(0..work.settled())?;
    let (end, device_end) = part(work.settled()..u64::MAX)?;
    (load.resident, load.device) = (settled.zip(end), (device_settled, device_end));
    load.seconds = start.elapsed().as_secs_f64();
    Ok(load)
}

/// Renders those of all frames whose numbers are in the range, with all threads at once; returns how many had other bits than
/// the same frame of another renderer.
fn at_once(
    work: Work,
    frames: Range<u64>,
    renderers: &mut [Renderer],
    bits: &Bits,
    progress: &Progress,
) -> Result<u64> {
    let turns = |first: u64, own: &mut [Renderer]| -> Result<u64> {
        let mut different = 0;
        for frame in frames.start..frames.end.min(work.frames_of(first)) {
            for (_, renderer) in (first..).zip(&mut *own).filter(|(number, _)| frame < work.frames_of(*number)) {
                different += u64::from(!bits.agree(frame, rendered(frame, renderer)?));
                progress.step();
            }
        }
        Ok(different)
    };
    std::thread::scope(|scope| {
        let turns = &turns;
        let own = (0..).step_by(work.renderers as usize).zip(renderers.chunks_mut(work.renderers as usize));
        let threads: Vec<_> = own.map(|(first, own)| scope.spawn(move || turns(first, own))).collect();
        let ended = threads.into_iter().map(|thread| thread.join().unwrap_or_else(|p| std::panic::resume_unwind(p)));
        ended.sum()
    })
}

/// Renders and differentiates a frame; returns a fingerprint of all values.
fn rendered(frame: u64, renderer: &mut Renderer) -> Result<u64> {
    let scene = Scene::new(shapes::icosphere(2)?);
    let angle = (frame % DISTINCT) as f64 * 0.1;
    let eye = DVec3::new(3.0 * angle.cos(), angle.sin(), 3.0 * angle.sin());
    let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 1.0 })?;
    // Both sizes occur before memory counts as settled.
    let size = if frame % 100 == 9 { 3 * SIZE } else { SIZE };
    let settings = Settings { width: size, height: size, sigma: 1e-4, save: true, ..Settings::default() };
    let image = renderer.render(&scene, &[camera], &settings)?;
    let ones = |image: &Image| Image { data: vec![1.0; image.data.len()], ..image.clone() };
    let upstream = ImageGradient {
        color: Some(ones(image.color()?)),
        silhouette: Some(ones(image.silhouette()?)),
        ..ImageGradient::default()
    };
    let gradients = renderer.backward(&image, &upstream, &GradientRequest::ALL)?;
    Ok(fingerprint(&image, &gradients))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_and_other_bits_are_told() {
        let work = Work { frames: 1, threads: 1, renderers: 1 };
        let flat = Load { work, seconds: 1.0, different: 0, resident: Some((1 << 20, 2 << 20)), device: (64, 64) };
        assert!(flat.is_good() && flat.line().contains("the same bits") && flat.line().contains(": flat"));
        let other = Load { different: 2, ..flat };
        assert!(!other.is_good() && other.line().contains("OTHER BITS in 2 frames"));
        let grown = Load { different: 0, resident: Some((0, SLACK[0] + 1)), ..other };
        assert!(!grown.is_good() && grown.line().contains("GROWN"));
        assert!(!Load { device: (64, 65), resident: None, ..grown }.is_good());
        let bits = Bits::new();
        assert!(bits.agree(3, 7) && bits.agree(4, 8) && bits.agree(3 + DISTINCT, 7) && !bits.agree(3, 8));
    }

    #[test]
    fn all_frames_are_shared_out() {
        let work = Work { frames: 100, threads: 3, renderers: 4 };
        assert_eq!((0..12).map(|r| work.frames_of(r)).sum::<u64>(), 100);
        assert_eq!((work.frames_of(0), work.frames_of(11), work.settled()), (9, 8, 1));
    }
}
