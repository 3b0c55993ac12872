//! softras in a host's hands, from its making to its end: memory that fails, devices that are lost, threads, and what may
//! be dropped when.

use crate::common::scenes::{Case, Kind, random_case};
use crate::common::tier;
use crate::host::engine::{Buffer, Engine};
use crate::host::memory::Memory;
use crate::host::{Backward, Host, assert_silent, engine, images, rasterizer, shim, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    Arena, BufferId, BufferRef, Counts, Differentiate, Draw, FrameImage, FramePlan, FrameShape, Geometry,
    GeometryBuffers, GeometryGradients, GradientPlan, HostAdapter, HostCommands, HostDevice, ImageFormat, ImageRef,
    Layout, Rasterizer,
};
use softras::{CacheFolder, Error, GradientRequest, ImageGradient, Renderer, RendererOptions};

/// A frame with gradients: its plans, and memory for them.
struct Planned {
    plan: FramePlan,
    gradient_plan: GradientPlan,
    _buffers: [Buffer; 2],
    refs: [Vec<(BufferId, BufferRef)>; 2],
}

fn saved_case() -> Case {
    let mut case = random_case(0, Kind::Plain);
    case.settings.save = true;
    case
}

impl Planned {
    fn new(engine: &Engine, case: &Case) -> Self {
        let shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        let plan = rasterizer(engine).plan(&shape, &case.settings).unwrap();
        let differentiate = Differentiate {
            upstream: case.settings.outputs,
            wanted: GradientRequest::default(),
            largest_upstream: 1.0,
        };
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
    let all = fail_in_turn(|n| shim::allow(tier(45, 9) * n), shim::live, || planned.make(&host));
    println!("{frame} and {all} calls failed in turn");
    assert!(frame > 30 && all > tier(1, 8), "the loader was hardly used: {frame} {all}");
    shim::allow_all();
    // Softras allocates no device memory on a host's device.
    shim::allow_memory(0);
    planned.make(&host).unwrap();
    drop(planned);
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
    // A device each time: of device memory each call, of the other calls each 115th (23rd in the full tier).
    let memory = fail_in_turn(shim::allow_memory, shim::live, make);
    shim::allow_all();
    let calls = fail_in_turn(|n| shim::allow(tier(115, 23) * n), shim::live, make);
    println!("{memory} allocations, {calls} calls failed in turn");
    assert!(memory >= 1 && calls > tier(1, 3), "{memory} {calls}");
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

/// What records with bindings of its own, by the name of what they are.
type Recording<'a> = (&'static str, Box<dyn Fn(&mut HostCommands) + 'a>);

/// A host's buffers that everything there is to bind is bound to.
struct Bound {
    host: Host,
    backward: Backward,
    geometry: Geometry,
    draws: Buffer,
    vertices: Buffer,
    gradients: Buffer,
    image: crate::host::engine::Image,
    image_size: (u32, u32),
}

impl Bound {
    fn new(engine: &Engine, rasterizer: &Rasterizer) -> Self {
        let mut case = saved_case();
        case.scene = softras::Scene::new(softras::shapes::cube().unwrap());
        case.cameras.truncate(1);
        case.settings.outputs.color = true;
        let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        shape.device_counts = true;
        let host = Host::of_shape(engine, rasterizer, &case, &shape);
        let size = (case.settings.width, case.settings.height);
        let image = softras::Image {
            batch: 1,
            height: size.1 as usize,
            width: size.0 as usize,
            channels: 3,
            data: vec![1e-3; (3 * size.0 * size.1) as usize],
        };
        let upstream = ImageGradient { color: Some(image), ..Default::default() };
        let backward = Backward::new(engine, rasterizer, &host, &upstream, GradientRequest::default());
        let vertices = case.scene.meshes[0].positions();
        let draw = Draw { vertices: vertices.len() as u32, triangles: 12, instances: 1, ..Draw::default() };
        let geometry = Geometry::new(vec![draw]).unwrap();
        let buffer = |bytes: &[u8], usage| {
            let mut buffer = engine.buffer(bytes.len() as u64, usage, MemoryLocation::CpuToGpu).unwrap();
            buffer.write(0, bytes);
            buffer
        };
        let (storage, texels) = (vk::BufferUsageFlags::STORAGE_BUFFER, vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER);
        Self {
            draws: buffer(bytemuck::cast_slice(&geometry.table()), texels),
            vertices: buffer(bytemuck::cast_slice(vertices), storage),
            gradients: buffer(&vec![0; 12 * vertices.len()], storage),
            image: engine.image(size.0, size.1).unwrap(),
            image_size: size,
            host,
            backward,
            geometry,
        }
    }

    /// Everything bound once more by one rasterizer, to be recorded by another. Not the image, whose layout is no matter
    /// here, but whose binding is.
    fn recordings<'a>(&'a self, binds: &Rasterizer, records: &'a Rasterizer) -> Vec<Recording<'a>> {
        let Self { host, backward, geometry, draws, vertices, gradients, image, image_size } = self;
        let frame = binds.bind(&host.plan, &host.arena.refs(&host.buffer.whole()).unwrap()).unwrap();
        let refs = backward.arena.refs(&backward.buffer.whole()).unwrap();
        let pass = binds.bind_backward(&backward.plan, &frame, &refs).unwrap();
        let counts = Counts { buffer: vertices.whole(), stride: 4, of_indices: false };
        let counts = binds.bind_counts(&host.plan, &frame, &counts).unwrap();
        let packed = Layout { stride: 12, offset: 0 };
        let positions = (vertices.whole(), packed);
        let buffers =
            GeometryBuffers { draws: draws.whole(), positions, colors: None, indices: None, transforms: None };
        let placed = binds.bind_geometry(geometry, &buffers, &frame).unwrap();
        let back = GeometryGradients { positions: Some((gradients.whole(), packed)), ..Default::default() };
        let back = binds.bind_geometry_gradients(&placed, &back, &pass).unwrap();
        let (width, height) = *image_size;
        let target = unsafe { ImageRef::new(image.view, ImageFormat::Rgba32Float, width, height) };
        let stored = binds.bind_image(&host.plan, &frame, FrameImage::Color { srgb: false }, 0, &target).unwrap();
        vec![
            ("counts", Box::new(move |c| records.record_counts(c, &counts).unwrap())),
            ("geometry", Box::new(move |c| records.record_vertices(c, &placed).unwrap())),
            ("frame", Box::new(move |c| records.record_forward(c, &host.plan, &frame).unwrap())),
            ("pass", Box::new(move |c| records.record_backward(c, &backward.plan, &pass).unwrap())),
            ("gradients", Box::new(move |c| records.record_geometry_gradients(c, &back).unwrap())),
            ("image", Box::new(move |c| records.record_image(c, &stored).unwrap())),
        ]
    }
}

/// Any of them may go first, and the rasterizer that bound them before them; what is left still records.
#[test]
fn bindings_may_be_dropped_in_any_order() {
    let _guard = shim::lock();
    let engine = engine();
    let shimmed = shimmed(&engine);
    let bound = Bound::new(&engine, &rasterizer(&engine));
    let records = Rasterizer::new(&shimmed).unwrap();
    assert_eq!(shim::live(), 0);
    to_general(&engine, &bound.image);
    for first in 0..tier(2, 6) {
        let binds = Rasterizer::new(&shimmed).unwrap();
        let mut left = bound.recordings(&binds, &records);
        // Half of the times the rasterizer goes last.
        let kept = (first % 2 == 0).then_some(binds);
        left.rotate_left(first);
        while !left.is_empty() {
            submit(&engine, |commands| left.iter().for_each(|(_, record)| record(commands)));
            let (name, _) = left.remove(0);
            println!("{name} is gone, {} objects live", shim::live());
        }
        assert_eq!(shim::live() > 0, kept.is_some(), "a rasterizer keeps its kernels");
        drop(kept);
        assert_eq!(shim::live(), 0, "{:?}", shim::objects());
    }
    assert!(shim::objects().values().all(|[made, destroyed]| made == destroyed), "{:?}", shim::objects());
    drop((records, bound));
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
