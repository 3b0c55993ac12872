//! The time that recording takes on the host's thread: a forward and a backward pass into a command buffer, nothing executed.
//!
//! `cargo bench --bench record`
// It plays the host and passes raw Vulkan handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used)]

#[path = "../examples/engine/mod.rs"]
mod engine;

use ash::vk;
use engine::{Commands, Engine};
use gpu_allocator::MemoryLocation;
use softras::embed::{HostCommands, Layout, MeshBuffers, PassMemory, PassMesh, Rasterizer};
use softras::{Camera, GradientRequest, Projection, Settings, shapes};
use std::time::Instant;

const RUNS: usize = 2000;

fn main() {
    let engine = Engine::new(false).expect("a Vulkan device");
    let rasterizer = Rasterizer::new(&engine.host_device()).expect("a rasterizer");
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).expect("a camera")];
    let settings = Settings { sigma: 1e-4, ..Settings::default() };
    println!("{:>24} {:>10} {:>10}", "", "median µs", "worst µs");
    let mesh = shapes::icosphere(4).expect("a mesh");
    let vertices = mesh.positions().len();
    for (name, wanted) in [("positions", GradientRequest::default()), ("all gradients", GradientRequest::ALL)] {
        let plan = rasterizer
            .pass(&[PassMesh::new(vertices as u32, mesh.triangles().as_flattened())])
            .settings(settings.clone())
            .cameras(&cameras)
            .gradients(wanted)
            .inside_planes()
            .build()
            .expect("a plan");
        let memory = plan.memory().map(|m| engine.buffer(m.size, m.usage, MemoryLocation::CpuToGpu).expect("memory"));
        let [upload, device, readback] = memory.each_ref().map(|buffer| buffer.whole());
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let bytes = 12 * vertices as u64;
        let [source, target] = [0; 2].map(|_| engine.buffer(bytes, storage, MemoryLocation::GpuOnly).expect("memory"));
        let packed = Layout { stride: 12, offset: 0 };
        let mut buffers = MeshBuffers::new(source.whole(), packed);
        buffers.gradients.positions = Some((target.whole(), packed));
        let memories = PassMemory { upload, device, readback, own: &[] };
        let pass = rasterizer.bind_pass(plan, memories, &[buffers]).expect("a pass");
        let frame = engine.commands().expect("a command buffer");
        frame.begin().expect("a command buffer");
        pass.record_setup(&mut frame.host()).expect("recorded");
        measure(&engine, &frame, name, |commands, part| match part {
            0 => pass.record_forward(commands).expect("recorded"),
            _ => pass.record_backward(commands).expect("recorded"),
        });
    }
}

/// Times both parts of a frame's recording.
fn measure(engine: &Engine, frame: &Commands, name: &str, mut record: impl FnMut(&mut HostCommands, usize)) {
    let mut times: [Vec<f64>; 3] = Default::default();
    for _ in 0..RUNS {
        frame.begin().expect("a command buffer");
        let mut commands = frame.host();
        let start = Instant::now();
        record(&mut commands, 0);
        let middle = Instant::now();
        record(&mut commands, 1);
        let end = Instant::now();
        for (times, span) in times.iter_mut().zip([middle - start, end - middle, end - start]) {
            times.push(span.as_secs_f64() * 1e6);
        }
        engine.end(frame).expect("ended");
    }
    for (part, mut times) in ["forward", "backward", "both"].into_iter().zip(times) {
        times.sort_by(f64::total_cmp);
        println!("{:>24} {:>10.2} {:>10.2}", format!("{name}: {part}"), times[RUNS / 2], times[RUNS - 1]);
    }
}
