//! What recording costs the host's thread: a forward and a backward pass into a command buffer, nothing executed.
//!
//! `cargo bench --bench record`
// A host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used)]

#[path = "../examples/engine/mod.rs"]
mod engine;

use engine::Engine;
use gpu_allocator::MemoryLocation;
use softras::embed::{Arena, Differentiate, Rasterizer, Shape};
use softras::{Camera, Projection, Scene, Settings, Wanted, shapes};
use std::time::Instant;

const RUNS: usize = 2000;

fn main() {
    let engine = Engine::new(false).expect("a Vulkan device");
    let rasterizer = Rasterizer::new(&engine.host_device()).expect("a rasterizer");
    let scene = Scene::new(shapes::icosphere(4).expect("a mesh"));
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).expect("a camera")];
    let settings = Settings { sigma: 1e-4, save: true, ..Settings::default() };
    let plan = Instant::now();
    let shape = Shape::of(&scene, &cameras, &settings).expect("a shape");
    let shaped = plan.elapsed();
    let plan = rasterizer.plan(&shape, &settings).expect("a plan");
    println!("{:>24} {:>10} {:>10}", "", "median µs", "worst µs");
    for (name, wanted) in [("positions", Wanted::default()), ("all gradients", Wanted::ALL)] {
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
        let mut times: [Vec<f64>; 3] = Default::default();
        for _ in 0..RUNS {
            frame.begin().expect("a command buffer");
            let mut commands = frame.host();
            let start = Instant::now();
            rasterizer.record_forward(&mut commands, &plan, &forward).expect("recorded");
            let middle = Instant::now();
            rasterizer.record_backward(&mut commands, &gradient_plan, &backward).expect("recorded");
            let end = Instant::now();
            for (times, span) in times.iter_mut().zip([middle - start, end - middle, end - start]) {
                times.push(span.as_secs_f64() * 1e6);
            }
            engine.end(&frame).expect("ended");
        }
        for (part, mut times) in ["forward", "backward", "both"].into_iter().zip(times) {
            times.sort_by(f64::total_cmp);
            println!("{:>24} {:>10.2} {:>10.2}", format!("{name}: {part}"), times[RUNS / 2], times[RUNS - 1]);
        }
    }
    println!("shape of {} triangles: {:.1} µs", scene.meshes[0].triangles().len(), shaped.as_secs_f64() * 1e6);
    let start = Instant::now();
    for _ in 0..RUNS {
        std::hint::black_box(rasterizer.plan(&shape, &settings).expect("a plan"));
    }
    println!("plan: {:.2} µs", start.elapsed().as_secs_f64() * 1e6 / RUNS as f64);
}
