//! softras in a host's hands, from its making to its end: memory that fails, devices that are lost, threads, and what may
//! be dropped when.

use super::geometry::storage;
use crate::common::scenes::{Case, Kind, random_case};
use crate::common::tier;
use crate::host::engine::Engine;
use crate::host::memory::Memory as HostMemory;
use crate::host::{Host, Memory, assert_silent, engine, images, plan_of, rasterizer, record, shim, submit};
use ash::vk;
use softras::embed::{
    Counts, FrameImage, HostAdapter, HostDevice, ImageBindings, ImageFormat, ImageRef, PassPlan, Rasterizer,
};
use softras::{CacheFolder, Error, GradientRequest, ImageGradient, Renderer, RendererOptions};

fn saved_case() -> Case {
    let mut case = random_case(0, Kind::Plain);
    case.settings.save = true;
    case
}

/// A pass, with and without gradients: its plan, and memory for it.
struct Planned {
    plan: PassPlan,
    memory: Memory,
}

impl Planned {
    fn new(engine: &Engine, case: &Case, gradients: bool) -> Self {
        let plan = plan_of(&rasterizer(engine), case);
        let plan = if gradients { plan.gradients(GradientRequest::default()) } else { plan };
        let plan = plan.build().unwrap();
        Self { memory: Memory::new(engine, &plan), plan }
    }

    /// Makes a rasterizer, binds the pass, and drops both.
    fn make(&self, host: &HostDevice) -> softras::Result<()> {
        Rasterizer::new(host)?.bind_pass(self.plan.clone(), self.memory.refs(), &[]).map(drop)
    }
}

/// Lets one call more succeed until all do. Each failure is of memory and leaves nothing. Returns how many failed.
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

/// Each allocation of host memory fails in turn: that is an error, and nothing is left behind. Then all succeed.
#[test]
fn running_out_of_host_memory_anywhere_leaves_nothing() {
    let engine = engine();
    let [forward, both] = [false, true].map(|gradients| Planned::new(&engine, &saved_case(), gradients));
    let memory = HostMemory::new();
    let host = unsafe { engine.host_device().with_allocation_callbacks(memory.callbacks()) };
    // Each allocation of a frame fails, and with gradients only each ninth, because compiling takes time.
    let frame = fail_in_turn(|n| memory.allow(n), || memory.live(), || forward.make(&host));
    let all = fail_in_turn(|n| memory.allow(9 * n), || memory.live(), || both.make(&host));
    println!("{frame} and {all} allocations failed in turn");
    assert!(frame > 20 && all > 5, "the callbacks were hardly used: {frame} {all}");
    drop((forward, both));
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

/// Each call of the driver that makes something fails in turn, with the same result.
#[test]
fn each_object_that_cannot_be_made_leaves_nothing() {
    let _guard = shim::lock();
    let engine = engine();
    let [forward, both] = [false, true].map(|gradients| Planned::new(&engine, &saved_case(), gradients));
    let host = shimmed(&engine);
    let frame = fail_in_turn(shim::allow, shim::live, || forward.make(&host));
    let all = fail_in_turn(|n| shim::allow(tier(45, 9) * n), shim::live, || both.make(&host));
    println!("{frame} and {all} calls failed in turn");
    assert!(frame > 30 && all > tier(1, 8), "the loader was hardly used: {frame} {all}");
    shim::allow_all();
    // Softras allocates no device memory on a host's device.
    shim::allow_memory(0);
    both.make(&host).unwrap();
    drop((forward, both));
    assert_silent(engine);
}

fn simple(options: RendererOptions) -> softras::Result<Renderer> {
    let (loader, cache) = (Some(shim::loader()), CacheFolder::Nowhere);
    Renderer::with_options(&RendererOptions { loader, cache, ..options })
}

fn frame_and_gradients(renderer: &mut Renderer, case: &Case) -> softras::Result<(Vec<f32>, Vec<[f32; 3]>)> {
    let frame = renderer.render(&case.scene, &case.cameras, &case.settings)?;
    let image = frame.silhouette().expect("a silhouette").clone();
    let gradients =
        renderer.backward(&frame, &ImageGradient::silhouette(image.clone()), &GradientRequest::default())?;
    Ok((image.data, gradients.meshes[0].positions.clone()))
}

/// The simple API, whose memory is its own: calls fail in turn, from opening a device to the last gradient.
#[test]
fn the_simple_api_gives_everything_back_too() {
    let _guard = shim::lock();
    let mut case = saved_case();
    case.settings.outputs.silhouette = true;
    let make = || simple(RendererOptions::default()).and_then(|mut r| frame_and_gradients(&mut r, &case).map(drop));
    // Each call needs a new device. All calls for device memory fail, of the others each 115th (full tier: 23rd).
    let memory = fail_in_turn(shim::allow_memory, shim::live, make);
    shim::allow_all();
    let calls = fail_in_turn(|n| shim::allow(tier(115, 23) * n), shim::live, make);
    println!("{memory} allocations, {calls} calls failed in turn");
    assert!(memory >= 1 && calls > tier(1, 3), "{memory} {calls}");
}

/// A renderer that ran out of memory works again when there is some, with the same bits.
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
    let hosts = [0, 1, 2, 3].map(|i| {
        let rasterizer = &rasterizers[i % 2];
        Host::new(&engine, rasterizer, plan_of(rasterizer, &case))
    });
    let frames = [0, 1, 2, 3].map(|_| engine.commands().unwrap());
    std::thread::scope(|scope| {
        for (frame, host) in frames.iter().zip(&hosts) {
            scope.spawn(move || {
                frame.begin().unwrap();
                let mut commands = frame.host();
                host.pass.record_setup(&mut commands).unwrap();
                for _ in 0..20 {
                    host.pass.record_forward(&mut commands).unwrap();
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

/// Passes and what is bound to them may be dropped in any order, and before or after the rasterizer that bound them; what is
/// left still records.
#[test]
fn bindings_may_be_dropped_in_any_order() {
    let _guard = shim::lock();
    let engine = engine();
    let shimmed = shimmed(&engine);
    let mut case = saved_case();
    case.scene = softras::Scene::new(softras::shapes::cube().unwrap());
    case.cameras.truncate(1);
    case.settings.outputs.color = true;
    let size = (case.settings.width, case.settings.height);
    let image = engine.image(size.0, size.1).unwrap();
    let counts = storage(&engine, &[12, 0, 0, 0]);
    to_general(&engine, &image);
    assert_eq!(shim::live(), 0);
    for first in 0..3 {
        let binds = Rasterizer::new(&shimmed).unwrap();
        let plan = plan_of(&binds, &case).device_counts().gradients(GradientRequest::default());
        let mut hosts: Vec<Host> = (0..3).map(|_| Host::new(&engine, &binds, plan.clone())).collect();
        let target = unsafe { ImageRef::new(image.view, ImageFormat::Rgba32Float, size.0, size.1) };
        for host in &mut hosts {
            host.pass.bind_counts(&Counts { buffer: counts.whole(), stride: 4, of_indices: false }).unwrap();
        }
        let mut stores: Vec<Option<ImageBindings>> = hosts
            .iter()
            .map(|host| Some(host.pass.bind_image(FrameImage::Color { srgb: false }, 0, &target).unwrap()))
            .collect();
        // Half of the times the rasterizer goes last, and what is bound to a pass goes before it or after.
        let kept = (first % 2 == 0).then_some(binds);
        hosts.rotate_left(first);
        stores.rotate_left(first);
        while !hosts.is_empty() {
            submit(&engine, |commands| {
                for (host, store) in hosts.iter().zip(&stores) {
                    record(&host.pass, commands);
                    store.iter().for_each(|store| host.pass.record_store(commands, store).unwrap());
                }
            });
            let store = stores.remove(0);
            let host = hosts.remove(0);
            if first == 1 { drop((store, host)) } else { drop((host, store)) }
        }
        assert_eq!(shim::live() > 0, kept.is_some(), "a rasterizer keeps its kernels");
        drop(kept);
        assert_eq!(shim::live(), 0, "{:?}", shim::objects());
    }
    assert!(shim::objects().values().all(|[made, destroyed]| made == destroyed), "{:?}", shim::objects());
    drop((image, counts));
    assert_silent(engine);
}

fn to_general(engine: &Engine, image: &crate::host::engine::Image) {
    submit(engine, |commands| {
        let barrier = [vk::ImageMemoryBarrier::default()
            .image(image.raw)
            .subresource_range(crate::host::engine::color_range())
            .new_layout(vk::ImageLayout::GENERAL)
            .dst_access_mask(vk::AccessFlags::SHADER_WRITE)];
        let (from, to) = (vk::PipelineStageFlags::TOP_OF_PIPE, vk::PipelineStageFlags::COMPUTE_SHADER);
        let none = vk::DependencyFlags::empty();
        unsafe { engine.device().cmd_pipeline_barrier(commands.raw(), from, to, none, &[], &[], &barrier) };
    });
}
