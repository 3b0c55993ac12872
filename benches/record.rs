//! What recording costs the host's thread: a forward and a backward pass into a command buffer, nothing executed.
//!
//! `cargo bench --bench record`
// A host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used)]

#[path = "../examples/engine/mod.rs"]
mod engine;

use ash::vk;
use engine::{Commands, Engine};
use gpu_allocator::MemoryLocation;
use softras::embed::{
    Arena, Differentiate, FrameShape, HostCommands, Layout, MeshBuffers, PassMemory, PassMesh, Rasterizer,
};
use softras::{Camera, GradientRequest, Projection, Scene, Settings, shapes};
use std::time::Instant;

const RUNS: usize = 2000;

fn main() {
    let engine = Engine::new(false).expect("a Vulkan device");
    let rasterizer = Rasterizer::new(&engine.host_device()).expect("a rasterizer");
    let scene = Scene::new(shapes::icosphere(4).expect("a mesh"));
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).expect("a camera")];
    let settings = Settings { sigma: 1e-4, save: true, ..Settings::default() };
    let plan = Instant::now();
    let shape = FrameShape::of(&scene, &cameras, &settings).expect("a shape");
    let shaped = plan.elapsed();
    let plan = rasterizer.plan(&shape, &settings).expect("a plan");
    println!("{:>24} {:>10} {:>10}", "", "median µs", "worst µs");
    for (name, wanted) in [("positions", GradientRequest::default()), ("all gradients", GradientRequest::ALL)] {
        let differentiate = Differentiate { upstream: settings.outputs, wanted, largest_upstream: 1.0 };
        let gradient_plan = rasterizer.plan_backward(&plan, &differentiate).expect("a plan");
        let (arena, gradient_arena) = (Arena::of(plan.buffers()), Arena::of(gradient_plan.buffers()));
        let buffer = |arena: &Arena| engine.buffer(arena.size, arena.usage, MemoryLocation::GpuOnly).expect("memory");
        let (one, two) = (buffer(&arena), buffer(&gradient_arena));
        let forward = rasterizer.bind(&plan, &arena.refs(&one.whole()).expect("parts")).expect("bindings");
        let backward = rasterizer
            .bind_backward(&gradient_plan, &forward, &gradient_arena.refs(&two.whole()).expect("parts"))
            .expect("more");
        let frame = engine.commands().expect("a command buffer");
        measure(&engine, &frame, name, |commands, part| match part {
            0 => rasterizer.record_forward(commands, &plan, &forward).expect("recorded"),
            _ => rasterizer.record_backward(commands, &gradient_plan, &backward).expect("recorded"),
        });
    }
    facade(&engine, &rasterizer, &cameras, &settings);
    println!("shape of {} triangles: {:.1} µs", scene.meshes[0].triangles().len(), shaped.as_secs_f64() * 1e6);
    let start = Instant::now();
    for _ in 0..RUNS {
        std::hint::black_box(rasterizer.plan(&shape, &settings).expect("a plan"));
    }
    println!("plan: {:.2} µs", start.elapsed().as_secs_f64() * 1e6 / RUNS as f64);
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

/// The same frame by the facade: with it come the copies of the cameras and the status, and the host's own vertex layout.
fn facade(engine: &Engine, rasterizer: &Rasterizer, cameras: &[Camera], settings: &Settings) {
    let mesh = shapes::icosphere(4).expect("a mesh");
    let vertices = mesh.positions().len();
    for (name, wanted) in
        [("pass, positions", GradientRequest::default()), ("pass, all gradients", GradientRequest::ALL)]
    {
        let plan = rasterizer
            .pass(&[PassMesh::new(vertices as u32, mesh.triangles().as_flattened())])
            .settings(settings.clone())
            .cameras(cameras)
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
        measure(engine, &frame, name, |commands, part| match part {
            0 => pass.record_forward(commands).expect("recorded"),
            _ => pass.record_backward(commands).expect("recorded"),
        });
    }
}
