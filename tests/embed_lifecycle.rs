//! softras in a host's hands, from its making to its end: memory that fails, devices that are lost, threads, and what may
//! be dropped when.
// The host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
mod host;

use common::scenes::{Case, Kind, random_case};
use gpu_allocator::MemoryLocation;
use host::engine::{Buffer, Engine};
use host::memory::Memory;
use host::{Host, assert_silent, engine, images, rasterizer, shim};
use softras::rasterizer::{
    Arena, BufferRef, Differentiate, FramePlan, GradientPlan, HostAdapter, HostDevice, Rasterizer, Shape,
};
use softras::vulkan::CacheFolder;
use softras::{Error, ImageGradient, Renderer, RendererOptions, Wanted};

/// A frame with gradients: its plans, and memory for them.
struct Planned {
    plan: FramePlan,
    gradient_plan: GradientPlan,
    _buffers: [Buffer; 2],
    refs: [Vec<(&'static str, BufferRef)>; 2],
}

fn saved_case() -> Case {
    let mut case = random_case(0, Kind::Plain);
    case.settings.save = true;
    case
}

impl Planned {
    fn new(engine: &Engine, case: &Case) -> Self {
        let shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        let plan = rasterizer(engine).plan(&shape, &case.settings).unwrap();
        let differentiate =
            Differentiate { upstream: case.settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 };
        let gradient_plan = rasterizer(engine).plan_backward(&plan, &differentiate).unwrap();
        let arenas = [Arena::of(plan.buffers()), Arena::of(gradient_plan.buffers())];
        let buffers = arenas.each_ref().map(|a| engine.buffer(a.size, a.usage, MemoryLocation::GpuToCpu).unwrap());
        let refs = [0, 1].map(|i| arenas[i].refs(&buffers[i].whole()).unwrap());
        Self { plan, gradient_plan, _buffers: buffers, refs }
    }

    /// What softras makes for a frame, and its end.
    fn make_forward(&self, host: &HostDevice) -> softras::Result<()> {
        Rasterizer::new(host)?.bind(&self.plan, &self.refs[0]).map(drop)
    }

    /// The same with its gradients.
    fn make(&self, host: &HostDevice) -> softras::Result<()> {
        let rasterizer = Rasterizer::new(host)?;
        let forward = rasterizer.bind(&self.plan, &self.refs[0])?;
        rasterizer.bind_backward(&self.gradient_plan, &forward, &self.refs[1]).map(drop)
    }
}

/// Lets one thing more succeed until all do; each failure is of memory and leaves nothing. Returns how many failed.
fn fail_in_turn(allow: impl Fn(i64), live: impl Fn() -> i64, mut make: impl FnMut() -> softras::Result<()>) -> i64 {
    for failures in 0..1_000 {
        allow(failures);
        match make() {
            Err(Error::OutOfMemory { .. }) => {}
            Err(other) => panic!("call {failures}: {other}"),
            Ok(()) => {
                assert_eq!(live(), 0);
                return failures;
            }
        }
        assert_eq!(live(), 0, "call {failures}");
    }
    panic!("it never succeeds");
}

/// Each allocation of the host's memory in turn fails: an error, and nothing is left behind. Then all succeed.
#[test]
fn running_out_of_host_memory_anywhere_leaves_nothing() {
    let engine = engine();
    let planned = Planned::new(&engine, &saved_case());
    let memory = Memory::new();
    let host = unsafe { engine.host_device().with_allocation_callbacks(memory.callbacks()) };
    // Of a frame each, of its gradients as well each ninth: compiling takes its time.
    let frame = fail_in_turn(|n| memory.allow(n), || memory.live(), || planned.make_forward(&host));
    let all = fail_in_turn(|n| memory.allow(9 * n), || memory.live(), || planned.make(&host));
    println!("{frame} and {all} allocations failed in turn");
    assert!(frame > 20 && all > 5, "the callbacks were hardly used: {frame} {all}");
    drop(planned);
    assert_silent(engine);
}

/// The engine's device behind a loader that makes calls fail.
fn shimmed(engine: &Engine) -> HostDevice {
    let core = engine.core();
    unsafe {
        let adapter = HostAdapter::new(shim::function(), core.instance.handle(), core.physical);
        HostDevice::new(adapter, core.device.handle())
    }
}

/// So does each call of the driver that makes something.
#[test]
fn each_object_that_cannot_be_made_leaves_nothing() {
    let _guard = shim::lock();
    let engine = engine();
    let planned = Planned::new(&engine, &saved_case());
    let host = shimmed(&engine);
    let frame = fail_in_turn(shim::allow, shim::live, || planned.make_forward(&host));
    let all = fail_in_turn(|n| shim::allow(9 * n), shim::live, || planned.make(&host));
    println!("{frame} and {all} calls failed in turn");
    assert!(frame > 30 && all > 8, "the loader was hardly used: {frame} {all}");
    shim::allow_all();
    // Softras allocates no device memory on a host's device.
    shim::allow_memory(0);
    planned.make(&host).unwrap();
    drop(planned);
    assert_silent(engine);
}

fn simple(options: RendererOptions) -> softras::Result<Renderer> {
    let (loader, cache) = (Some(shim::loader()), CacheFolder::Nowhere);
    Renderer::with_options(&RendererOptions { loader, cache, validation: true, ..options })
}

fn frame_and_gradients(renderer: &mut Renderer, case: &Case) -> softras::Result<(Vec<f32>, Vec<[f32; 3]>)> {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings)?;
    let image = frame.silhouette().expect("a silhouette").clone();
    let gradients = renderer.backward(&frame, &ImageGradient::silhouette(image.clone()), &Wanted::default())?;
    Ok((image.data, gradients.meshes[0].positions.clone()))
}

/// The simple API, whose memory is its own: calls fail in turn, from opening a device to the last gradient.
#[test]
fn the_simple_api_gives_everything_back_too() {
    let _guard = shim::lock();
    let mut case = saved_case();
    case.settings.outputs.silhouette = true;
    let make = || simple(RendererOptions::default()).and_then(|mut r| frame_and_gradients(&mut r, &case).map(drop));
    // A device each time: of device memory each call, of the other calls each 23rd.
    let memory = fail_in_turn(shim::allow_memory, shim::live, make);
    shim::allow_all();
    let calls = fail_in_turn(|n| shim::allow(23 * n), shim::live, make);
    println!("{memory} allocations, {calls} calls failed in turn");
    assert!(memory >= 1 && calls > 3, "{memory} {calls}");
}

/// A renderer whose memory ran out in the middle goes on when there is some again, with the same bits.
#[test]
fn a_renderer_goes_on_after_memory_ran_out() {
    let _guard = shim::lock();
    let mut case = saved_case();
    case.settings.outputs.silhouette = true;
    let mut renderer = simple(RendererOptions::default()).unwrap();
    let expected = frame_and_gradients(&mut renderer, &case).unwrap();
    drop(renderer);
    for calls in [1, 20, 50, 90] {
        let mut renderer = simple(RendererOptions::default()).unwrap();
        shim::allow(calls);
        let failed = frame_and_gradients(&mut renderer, &case);
        assert!(matches!(failed, Err(Error::OutOfMemory { .. })), "{calls}: {failed:?}");
        shim::allow_all();
        assert_eq!(frame_and_gradients(&mut renderer, &case).unwrap(), expected, "{calls}");
        assert_eq!(renderer.validation_messages(), Vec::<String>::new());
    }
    assert_eq!(shim::live(), 0);
}

#[test]
fn a_lost_device_is_an_error_of_its_own() {
    let _guard = shim::lock();
    let mut case = saved_case();
    case.settings.outputs.silhouette = true;
    let mut renderer = simple(RendererOptions::default()).unwrap();
    shim::allow_submits(1);
    let lost = frame_and_gradients(&mut renderer, &case);
    match lost {
        Err(error @ Error::DeviceLost { call: "vkQueueSubmit", .. }) => {
            assert!(error.to_string().contains("make it anew"), "{error}");
        }
        other => panic!("{other:?}"),
    }
    // All that is left to do is to drop it.
    drop(renderer);
    assert_eq!(shim::live(), 0);
}

/// Two rasterizers on one device, each recorded by a thread of its own, dropped before and after their bindings.
#[test]
fn threads_record_side_by_side() {
    let engine = engine();
    let rasterizers = [rasterizer(&engine), rasterizer(&engine)];
    let case = random_case(4, Kind::Plain);
    let hosts = [0, 1, 2, 3].map(|i| Host::new(&engine, &rasterizers[i % 2], &case));
    let frames = [0, 1, 2, 3].map(|_| engine.commands().unwrap());
    std::thread::scope(|scope| {
        for (i, (frame, host)) in frames.iter().zip(&hosts).enumerate() {
            let rasterizer = &rasterizers[i % 2];
            scope.spawn(move || {
                frame.begin().unwrap();
                let mut commands = frame.host();
                for _ in 0..20 {
                    rasterizer.record_forward(&mut commands, &host.plan, &host.bindings).unwrap();
                }
            });
        }
    });
    // The kernels live as long as what was bound to them.
    drop(rasterizers);
    for frame in &frames {
        engine.submit(frame).unwrap();
    }
    engine.wait_idle().unwrap();
    let expected = images(&case, &hosts[0]);
    for host in &hosts[1..] {
        assert_eq!(images(&case, host), expected);
    }
    drop(frames);
    drop(hosts);
    assert_silent(engine);
}
