//! Ten thousand frames leave memory as it was, and every object that was made for them destroyed. Alone in its process,
//! whose memory it measures.
// A host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![cfg(target_os = "linux")]

#[path = "../examples/engine/mod.rs"]
mod engine;
#[path = "host/shim/mod.rs"]
mod shim;

use engine::Engine;
use gpu_allocator::MemoryLocation;
use softras::embed::{Arena, Differentiate, HostAdapter, HostDevice, Inputs, Rasterizer, Shape};
use softras::{Camera, Projection, Scene, Settings, Wanted, shapes};

/// Bytes of this process that are in memory.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    4096 * text.split_whitespace().nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap()
}

const SLACK: u64 = 4 << 20;

/// Forward and backward, bound anew every hundredth frame.
#[test]
fn ten_thousand_frames_leak_nothing() {
    let before = resident();
    let block = std::hint::black_box(vec![1u8; 2 * SLACK as usize]);
    assert!(resident() > before + SLACK, "a leak would not be seen");
    drop(block);

    let engine = Engine::new(false).unwrap();
    let _guard = shim::lock();
    let core = engine.core();
    let host = unsafe {
        let adapter = HostAdapter::new(shim::function(), core.instance.handle(), core.physical);
        HostDevice::new(adapter, core.device.handle())
    };
    let rasterizer = Rasterizer::new(&host).unwrap();
    let scene = Scene::new(shapes::cube().unwrap());
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).unwrap()];
    let settings = Settings { width: 16, height: 16, sigma: 1e-3, save: true, ..Settings::default() };
    let frame = engine.commands().unwrap();
    let mut settled = 0;
    for hundred in 0..100 {
        let plan = rasterizer.plan(&Shape::of(&scene, &cameras, &settings).unwrap(), &settings).unwrap();
        let differentiate =
            Differentiate { upstream: settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 };
        let gradient_plan = rasterizer.plan_backward(&plan, &differentiate).unwrap();
        let (arena, gradient_arena) = (Arena::of(plan.buffers()), Arena::of(gradient_plan.buffers()));
        let buffer = |arena: &Arena| engine.buffer(arena.size, arena.usage, MemoryLocation::CpuToGpu).unwrap();
        let (mut one, mut two) = (buffer(&arena), buffer(&gradient_arena));
        two.bytes_mut().fill(0);
        for (name, bytes) in Inputs::new(&scene, &cameras, &settings, &plan).all() {
            if let Some((offset, _)) = arena.part(name) {
                one.write(offset, bytes);
            }
        }
        let forward = rasterizer.bind(&plan, &arena.refs(&one.whole()).unwrap()).unwrap();
        let backward =
            rasterizer.bind_backward(&gradient_plan, &forward, &gradient_arena.refs(&two.whole()).unwrap()).unwrap();
        let bound = shim::objects();
        for _ in 0..100 {
            frame.begin().unwrap();
            let mut commands = frame.host();
            rasterizer.record_forward(&mut commands, &plan, &forward).unwrap();
            rasterizer.record_backward(&mut commands, &gradient_plan, &backward).unwrap();
            engine.submit(&frame).unwrap();
        }
        frame.wait().unwrap();
        assert_eq!(shim::objects(), bound, "recording made something");
        if hundred == 9 {
            settled = resident();
        }
    }
    let end = resident();
    println!("resident after 1,000 frames {} KiB, after 10,000 {} KiB", settled >> 10, end >> 10);
    assert!(end < settled + SLACK, "{settled} bytes grew to {end}");
    drop((frame, rasterizer));
    let objects = shim::objects();
    println!("made and destroyed: {objects:?}");
    // Kernels are compiled once, all else is bound a hundred times.
    let made = |kind: &str| objects.get(kind).map_or(0, |[made, _]| *made);
    assert!(made("BufferView") > 1000 && made("DescriptorPool") == 200 && made("Pipeline") > 10, "{objects:?}");
    assert!(objects.values().all(|[made, destroyed]| made == destroyed), "{objects:?}");
}
