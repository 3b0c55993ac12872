//! Ten thousand frames, and renderers that come and go, leave memory as it was and every object that was made for them
//! destroyed. Alone in their process, whose memory they measure, one after the other.

use crate::host::{engine::Engine, shim};
use gpu_allocator::MemoryLocation;
use peak_alloc::PeakAlloc;
use softras::embed::{HostAdapter, HostDevice, PassMemory, Rasterizer};
use softras::{
    CacheFolder, Camera, GradientRequest, Image, ImageGradient, Projection, Renderer, RendererOptions, Scene, Settings,
    shapes,
};

/// Counts what Rust allocates; the driver's memory is not among it.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes of this process that are in memory.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap();
    4096 * text.split_whitespace().nth(1).and_then(|pages| pages.parse::<u64>().ok()).unwrap()
}

const SLACK: u64 = 4 << 20;

/// Forward and backward, bound anew every hundredth frame.
#[test]
fn ten_thousand_frames_leak_nothing() {
    let _guard = shim::lock();
    let before = resident();
    // The block is so large that the allocator takes it from the system, not from what an earlier test freed.
    let block = std::hint::black_box(vec![1u8; 16 * SLACK as usize]);
    assert!(resident() > before + SLACK, "a leak would not be seen");
    drop(block);

    let engine = Engine::new(false).unwrap();
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
        let plan = rasterizer.scene_pass(&scene).cameras(&cameras).settings(settings.clone());
        let plan = plan.gradients(GradientRequest::default()).build().unwrap();
        let memory = plan.memory().map(|m| engine.buffer(m.size, m.usage, MemoryLocation::CpuToGpu).unwrap());
        let [mut upload, mut device, readback] = memory;
        device.bytes_mut().fill(0);
        let refs = PassMemory { upload: upload.whole(), device: device.whole(), readback: readback.whole(), own: &[] };
        let pass = rasterizer.bind_pass(plan, refs, &[]).unwrap();
        pass.write_inputs(upload.bytes_mut()).unwrap();
        let bound = shim::objects();
        for _ in 0..100 {
            frame.begin().unwrap();
            let mut commands = frame.host();
            pass.record_setup(&mut commands).unwrap();
            pass.record_forward(&mut commands).unwrap();
            pass.record_backward(&mut commands).unwrap();
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
    // Kernels are compiled once; everything else is bound a hundred times.
    let made = |kind: &str| objects.get(kind).map_or(0, |[made, _]| *made);
    assert!(made("BufferView") > 1000 && made("DescriptorPool") == 200 && made("Pipeline") > 10, "{objects:?}");
    assert!(objects.values().all(|[made, destroyed]| made == destroyed), "{objects:?}");
}

/// Repeats work until memory has settled, then again; returns the bytes by which the second half grew.
fn growth(times: u32, work: impl Fn()) -> u64 {
    (0..times).for_each(|_| work());
    let settled = resident();
    (0..times).for_each(|_| work());
    resident().saturating_sub(settled)
}

/// Every new size has buffers, sets and commands of its own.
#[test]
fn frames_of_changing_size_leave_nothing_behind() {
    let _guard = shim::lock();
    let renderer = std::cell::RefCell::new(Renderer::new().unwrap());
    let scene = Scene::new(shapes::cube().unwrap());
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).unwrap()];
    let sizes = [16, 40].map(|side| Settings { width: side, height: side, ..Settings::default() });
    let two = || {
        for settings in &sizes {
            renderer.borrow_mut().render(&scene, &cameras, settings).unwrap();
        }
    };
    let grown = growth(5_000, two);
    println!("growth of 10,000 frames of changing size {} KiB", grown >> 10);
    assert!(grown < SLACK / 4, "{grown} bytes");
}

/// A renderer that renders and differentiates destroys all that it made, and frees all that Rust allocated for it. The
/// process still grows by the memory in which the driver compiles kernels: a renderer that compiles none leaves as
/// little behind as a bare device of a foreign engine.
#[test]
fn renderers_that_come_and_go_leave_nothing_behind() {
    let _guard = shim::lock();
    let options =
        || RendererOptions { cache: CacheFolder::Nowhere, loader: Some(shim::loader()), ..Default::default() };
    let scene = Scene::new(shapes::cube().unwrap());
    let cameras = [Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 1.0 }).unwrap()];
    let settings = Settings { width: 16, height: 16, sigma: 1e-3, save: true, ..Settings::default() };
    let whole = || {
        let mut renderer = Renderer::with_options(&options()).unwrap();
        let frame = renderer.render(&scene, &cameras, &settings).unwrap();
        let silhouette = frame.silhouette().unwrap();
        let upstream = Image { data: vec![1.0; silhouette.data.len()], ..silhouette.clone() };
        renderer.backward(&frame, &ImageGradient::silhouette(upstream), &GradientRequest::default()).unwrap();
    };
    whole();
    let allocated = MEMORY.current_usage();
    let driver = growth(4, whole);
    let left = MEMORY.current_usage().saturating_sub(allocated);
    assert!(left < 16 << 10, "Rust's allocations grew by {left} bytes");
    let objects = shim::objects();
    assert!(objects.get("Pipeline").is_some_and(|[made, _]| *made >= 9 * 10), "{objects:?}");
    assert!(objects.values().all(|[made, destroyed]| made == destroyed), "{objects:?}");
    let bare = growth(50, || drop(Engine::new(false).unwrap()));
    let without_kernels = growth(50, || drop(Renderer::with_options(&options()).unwrap()));
    println!(
        "growth of 50 bare devices {} KiB, of 50 renderers without kernels {} KiB",
        bare >> 10,
        without_kernels >> 10
    );
    println!("growth of 4 renderers with all kernels {} KiB, none of it in Rust's heap", driver >> 10);
    assert!(without_kernels < bare + SLACK, "{without_kernels} bytes, a bare device {bare}");
}
