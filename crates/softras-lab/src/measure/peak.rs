//! The peak rate of the device in single-precision operations a second.

use softras::internals::vulkan::{
    BufferDesc, CommandBuffer, Context, ContextOptions, DescriptorPool, Pipeline, SharedBuffer, TimestampPool, kernels,
};
use softras::{Error, Result};
use std::time::Instant;

/// Operations of one pass of glsl/peak.comp's loop: four steps of twelve multiply-adds.
const PASS: f64 = 4.0 * 12.0 * 2.0;
/// A run shorter than this many milliseconds is repeated with more passes.
const LONG_ENOUGH: f64 = 10.0;
/// Mesa 22.3 ends a loop after 65535 passes.
const MOST_LOOPS: u32 = 1 << 15;
const RUNS: usize = 12;
const GROUPS: u32 = 2048;

/// The push constants of glsl/peak.comp.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    loops: u32,
    factor: f32,
    term: f32,
}

/// Measures single-precision operations a second: the best of several runs of independent multiply-adds, each counted as
/// two operations whether or not the driver fuses them. `device` is an index or part of a name, as for
/// [`softras::Renderer::with_device`].
///
/// # Errors
/// As [`softras::Renderer::new`].
pub fn peak_flops(device: Option<&str>) -> Result<f64> {
    let context = Context::new(&ContextOptions { device: device.map(str::to_owned), ..ContextOptions::default() })?;
    let kernel = &kernels::PEAK;
    let invocations = u64::from(GROUPS) * u64::from(kernel.local_size[0]);
    let results = BufferDesc { name: "peak results", size: 4 * invocations, ..BufferDesc::default() };
    let results = SharedBuffer::for_download(&context, &results)?;
    let pipeline = Pipeline::new(context.device(), kernel, &[], Some(context.pipeline_cache()))?;
    let set = DescriptorPool::new(context.device(), &[kernel])?.bind(&pipeline, &[("Results", results.whole())])?;
    let times = TimestampPool::new(context.device(), context.queue_family(), 2)?;
    let mut commands = CommandBuffer::new(&context, "peak")?;
    let (mut loops, mut best, mut runs) = (1u32, 0.0f64, 0);
    while runs < RUNS {
        // Values stay near 1, so that no operation meets infinities or denormals.
        let push = Push { loops, factor: 0.999, term: 1e-3 };
        commands.record(|recorder| {
            if let Some(times) = &times {
                recorder.reset_timestamps(times)?;
                recorder.timestamp(times, 0)?;
            }
            recorder.dispatch(&pipeline, &set, bytemuck::bytes_of(&push), [GROUPS, 1, 1])?;
            recorder.barrier();
            if let Some(times) = &times {
                recorder.timestamp(times, 1)?;
            }
            results.record_download(recorder)?;
            recorder.barrier_to_host();
            Ok(())
        })?;
        let start = Instant::now();
        commands.submit_and_wait()?;
        let wall = start.elapsed().as_secs_f64() * 1e3;
        let stamps = times.as_ref().map(|times| times.read(2)).transpose()?;
        let milliseconds = stamps.and_then(|s| s.last().copied()).unwrap_or(wall);
        if milliseconds < LONG_ENOUGH && loops < MOST_LOOPS {
            loops *= 2;
            continue;
        }
        best = best.max(PASS * f64::from(loops) * invocations as f64 / milliseconds * 1e3);
        runs += 1;
    }
    let mut first = [0.0f32];
    results.read(0, bytemuck::cast_slice_mut(&mut first))?;
    if !(best.is_finite() && best > 0.0 && first[0].is_finite()) {
        let fix = "update the device's driver".into();
        return Err(Error::NotFinite { stage: "peak", fix });
    }
    Ok(best)
}
