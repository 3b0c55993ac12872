//! softras in a host's hands: the example engine under validation, bits equal to the simple API's, misuse named, and what
//! was made freed whatever happens.
// The host's half of a contract of raw handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;
#[path = "../examples/embed_ash.rs"]
mod embed_ash;

use ash::vk;
use common::gradient::{random_upstream, same_gradient_bits};
use common::scenes::{Case, Kind, random_case};
use common::{renderer, tolerance};
use embed_ash::engine::{Buffer, Engine};
use gpu_allocator::MemoryLocation;
use softras::rasterizer::{
    Arena, BufferRef, Differentiate, FrameBindings, FramePlan, Gather, GradientPlan, Inputs, Rasterizer, Shape, Status,
    requirements,
};
use softras::scene::Outputs;
use softras::vulkan::{HostDevice, vk::Handle};
use softras::{Error, ImageGradient, Wanted};
use std::ffi::c_void;
use std::sync::atomic::{AtomicI64, Ordering};

type Messages = Vec<String>;

fn engine() -> Engine {
    Engine::new(true).expect("a Vulkan device with validation")
}

/// The engine goes; the layers must have had nothing to say, leaks included.
fn assert_silent(engine: Engine) {
    let log = engine.log();
    drop(engine);
    assert_eq!(*log.lock().unwrap(), Messages::new());
}

fn rasterizer(engine: &Engine) -> Rasterizer {
    unsafe { Rasterizer::new(&engine.host_device()) }.expect("a rasterizer")
}

fn error<T>(result: softras::Result<T>) -> String {
    result.map_or_else(|e| e.to_string(), |_| "no error".to_string())
}

/// A case's frame with every buffer in one, mapped.
struct Host {
    plan: FramePlan,
    arena: Arena,
    buffer: Buffer,
    bindings: FrameBindings,
}

impl Host {
    fn new(engine: &Engine, rasterizer: &Rasterizer, case: &Case) -> Self {
        let shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        Self::of_shape(engine, rasterizer, case, &shape)
    }

    fn of_shape(engine: &Engine, rasterizer: &Rasterizer, case: &Case, shape: &Shape) -> Self {
        let plan = rasterizer.plan(shape, &case.settings).unwrap();
        let arena = Arena::of(plan.buffers());
        let mut buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
        // What the device does not write itself must not matter.
        buffer.bytes_mut().fill(0xcd);
        let inputs = Inputs::new(&case.scene, &case.cameras, &case.settings, &plan);
        for (name, bytes) in inputs.all() {
            match arena.part(name) {
                Some((offset, size)) => {
                    assert_eq!(plan.buffer(name).unwrap().size, bytes.len() as u64, "{name}: {case:?}");
                    assert!(size >= bytes.len() as u64);
                    buffer.write(offset, bytes);
                }
                None => assert!(bytes.is_empty(), "{name} has bytes and no buffer"),
            }
        }
        let bindings = unsafe { rasterizer.bind(&plan, &arena.refs(buffer.raw)) }.unwrap();
        Self { plan, arena, buffer, bindings }
    }

    fn floats(&self, name: &str) -> Vec<f32> {
        let (offset, size) = self.arena.part(name).unwrap();
        self.buffer.floats(offset, size as usize / 4)
    }

    fn status(&self) -> Status {
        let (offset, _) = self.arena.part("status").unwrap();
        let bytes = &self.buffer.bytes()[offset as usize..];
        Status::from_bytes(bytes.first_chunk().unwrap())
    }
}

fn submit(engine: &Engine, record: impl FnOnce(vk::CommandBuffer)) {
    let frame = engine.commands().unwrap();
    let commands = frame.begin().unwrap();
    record(commands);
    let barrier = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ)];
    let from = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let (to, none) = (vk::PipelineStageFlags::HOST, vk::DependencyFlags::empty());
    unsafe { engine.device().cmd_pipeline_barrier(commands, from, to, none, &barrier, &[], &[]) };
    engine.submit(&frame).unwrap();
    frame.wait().unwrap();
}

fn forward(engine: &Engine, rasterizer: &Rasterizer, host: &Host) {
    submit(engine, |commands| unsafe { rasterizer.record_forward(commands, &host.plan, &host.bindings) }.unwrap());
}

#[test]
fn the_example_fits_its_vertex_and_draws_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("embed.png");
    let report = embed_ash::run(Some(&path), true).unwrap();
    assert_eq!(report.messages, Messages::new());
    for axis in 0..3 {
        assert!((report.vertex[axis] - report.target[axis]).abs() < 0.01, "{:?}", report.vertex);
    }
    let size = (report.pixels.len() / 4).isqrt();
    let pixel = |x: f64, y: f64| &report.pixels[4 * ((y * size as f64) as usize * size + (x * size as f64) as usize)..];
    // In the middle softras' image, in the lower left corner the engine's own triangles, elsewhere the background.
    assert!(pixel(0.5, 0.5)[..3].iter().all(|&c| c > 0.1), "{:?}", &pixel(0.5, 0.5)[..4]);
    assert_eq!(pixel(0.15, 0.87)[..3], [1.0, 0.8, 0.1]);
    assert_eq!(pixel(0.95, 0.95)[..3], [0.0; 3]);
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
    let info = decoder.read_info().unwrap();
    assert_eq!((info.info().width as usize, info.info().height as usize), (size, size));
}

/// Images as the simple API packs them.
fn images(case: &Case, host: &Host) -> Vec<(&'static str, Vec<f32>)> {
    let Outputs { color, silhouette, depth, normal } = case.settings.outputs;
    let rgb = |texels: &[f32]| texels.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>();
    let pixels = case.cameras.len() * (case.settings.width * case.settings.height) as usize;
    let mut images = Vec::new();
    if color {
        let texels = host.floats("color");
        images.push(("color", rgb(&texels[..4 * pixels])));
        if silhouette {
            images.push(("silhouette", texels.chunks_exact(4).map(|t| t[3]).take(pixels).collect()));
        }
    } else if silhouette {
        images.push(("silhouette", host.floats("silhouette")[..pixels].to_vec()));
    }
    if depth {
        images.push(("depth", host.floats("depths")[..pixels].to_vec()));
    }
    if normal {
        images.push(("normal", rgb(&host.floats("normals")[..4 * pixels])));
    }
    images
}

/// The first value whose bits differ.
fn difference(a: &[f32], b: &[f32]) -> Option<usize> {
    let equal = a.len() == b.len();
    let at = a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits());
    at.or_else(|| (!equal).then_some(a.len().min(b.len())))
}

#[test]
fn a_different_bit_is_noticed() {
    assert_eq!(difference(&[1.0, 2.0], &[1.0, 2.0]), None);
    assert_eq!(difference(&[1.0, 2.0], &[1.0, 2.000_000_2]), Some(1));
    assert_eq!(difference(&[0.0], &[-0.0]), Some(0));
    assert_eq!(difference(&[1.0], &[1.0, 2.0]), Some(1));
}

#[test]
fn images_are_the_simple_apis_bit_by_bit() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut simple = renderer();
    for seed in 0..12 {
        let case = random_case(seed, [Kind::Plain, Kind::Modes, Kind::Clipped][seed as usize % 3]);
        let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let mut host = Host::new(&engine, &rasterizer, &case);
        forward(&engine, &rasterizer, &host);
        if let Some(capacity) = host.status().judge(&host.plan).unwrap() {
            let mut shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
            shape.capacity = Some(capacity);
            host = Host::of_shape(&engine, &rasterizer, &case, &shape);
            forward(&engine, &rasterizer, &host);
            assert_eq!(host.status().judge(&host.plan).unwrap(), None);
        }
        let made = images(&case, &host);
        let expected = [
            ("color", frame.color()),
            ("silhouette", frame.silhouette()),
            ("depth", frame.depth()),
            ("normal", frame.normal()),
        ];
        assert_eq!(made.len(), expected.iter().filter(|(_, image)| image.is_some()).count());
        for (name, image) in made {
            let simple = expected.iter().find(|(n, _)| *n == name).and_then(|(_, image)| *image).unwrap();
            assert_eq!(difference(&image, &simple.data), None, "{name}: {case:?}");
        }
    }
    drop(rasterizer);
    assert_silent(engine);
}

/// Upstream gradients as the kernels read them.
fn upstream_bytes(upstream: &ImageGradient) -> Vec<(&'static str, Vec<f32>)> {
    let mut buffers = Vec::new();
    let alpha = upstream.silhouette.as_ref();
    if let Some(color) = &upstream.color {
        let texel = |(i, c): (usize, &[f32])| [c[0], c[1], c[2], alpha.map_or(0.0, |a| a.data[i])];
        buffers.push(("upstream_color", color.data.chunks_exact(3).enumerate().flat_map(texel).collect()));
    } else if let Some(alpha) = alpha {
        buffers.push(("upstream_silhouette", alpha.data.clone()));
    }
    if let Some(depth) = &upstream.depth {
        buffers.push(("upstream_depths", depth.data.clone()));
    }
    if let Some(normal) = &upstream.normal {
        let texels = normal.data.chunks_exact(3).flat_map(|n| [n[0], n[1], n[2], 0.0]);
        buffers.push(("upstream_normals", texels.collect()));
    }
    buffers
}

#[test]
fn gradients_are_the_simple_apis_bit_by_bit() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut simple = renderer();
    for seed in 20..26 {
        let mut case = random_case(seed, Kind::Plain);
        case.settings.save = true;
        let upstream = random_upstream(&case, case.settings.outputs, &tolerance::GRADIENT);
        let wanted = Wanted { colors: true, ..Wanted::default() };
        let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let expected = simple.backward(&frame, &upstream, &wanted).unwrap();
        assert_eq!(same_gradient_bits(&expected, &expected), Ok(()));

        let mut shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        let mut host = Host::of_shape(&engine, &rasterizer, &case, &shape);
        forward(&engine, &rasterizer, &host);
        if let Some(capacity) = host.status().judge(&host.plan).unwrap() {
            shape.capacity = Some(capacity);
            host = Host::of_shape(&engine, &rasterizer, &case, &shape);
            forward(&engine, &rasterizer, &host);
        }
        let differentiate = Differentiate { upstream: upstream.outputs(), wanted, largest_upstream: 1.0 };
        let plan = rasterizer.plan_backward(&host.plan, &differentiate).unwrap();
        let (arena, buffer) = gradient_buffer(&engine, &plan, &upstream);
        let bindings = unsafe { rasterizer.bind_backward(&plan, &host.bindings, &arena.refs(buffer.raw)) }.unwrap();
        submit(&engine, |commands| unsafe { rasterizer.record_backward(commands, &plan, &bindings) }.unwrap());
        let (offset, size) = arena.part("vertex_gradients").unwrap();
        let rows = buffer.floats(offset, size as usize / 4);
        let made: Vec<f32> = rows.chunks_exact(8).flat_map(|r| [r[0], r[1], r[2]]).collect();
        let positions: Vec<f32> = expected.meshes.iter().flat_map(|m| m.positions.iter().flatten().copied()).collect();
        assert_eq!(difference(&made[..positions.len()], &positions), None, "{case:?}");
        assert!(positions.iter().any(|&x| x != 0.0), "nothing to compare: {case:?}");
    }
    drop(rasterizer);
    assert_silent(engine);
}

fn gradient_buffer(engine: &Engine, plan: &GradientPlan, upstream: &ImageGradient) -> (Arena, Buffer) {
    let arena = Arena::of(plan.buffers());
    let mut buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
    buffer.bytes_mut().fill(0xcd);
    for (name, values) in upstream_bytes(upstream) {
        buffer.write(arena.part(name).unwrap().0, bytemuck::cast_slice(&values));
    }
    (arena, buffer)
}

/// Room that is too small is told, not hidden.
#[test]
fn the_status_tells_what_room_the_lists_needed() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = random_case(1, Kind::Plain);
    let mut shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    shape.capacity = Some(softras::plan::Capacity { coarse: 1, list: 1, cells: 1 });
    let small = Host::of_shape(&engine, &rasterizer, &case, &shape);
    forward(&engine, &rasterizer, &small);
    let mut needed = small.status().judge(&small.plan).unwrap().expect("more room");
    // A short bin list hides what its tiles need.
    for _ in 0..3 {
        shape.capacity = Some(needed);
        let larger = Host::of_shape(&engine, &rasterizer, &case, &shape);
        forward(&engine, &rasterizer, &larger);
        match larger.status().judge(&larger.plan).unwrap() {
            Some(more) => needed = more,
            None => {
                drop((larger, small, rasterizer));
                return assert_silent(engine);
            }
        }
    }
    panic!("the lists never fit: {needed:?}");
}

#[test]
fn requirements_are_known_before_there_is_a_device() {
    let engine = engine();
    let host = engine.host_device();
    let before = HostDevice { device: vk::Device::null(), ..host };
    let needed = requirements();
    let info = unsafe { needed.judge(&before) }.unwrap();
    assert!(info.suitable.is_ok() && !info.name.is_empty());
    assert_eq!((needed.features, needed.extensions), (&[][..], &[][..]));
    // What every Vulkan 1.1 device guarantees, but for storage buffers in a stage, of which some have four.
    let minima = [128, 8, 16, 16384, 128];
    for ((name, limit), minimum) in needed.limits.iter().zip(minima) {
        assert!(*limit <= minimum, "{name}: {limit}");
    }
    let mut impossible = requirements();
    impossible.limits[0].1 = 1 << 40;
    let message = error(unsafe { impossible.judge(&before) });
    assert!(message.contains("maxPushConstantsSize"), "{message}");
    // A plan needs no device either.
    let case = random_case(0, Kind::Plain);
    let shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    let plan = FramePlan::new(&info.limits, info.kind, &shape, &case.settings).unwrap();
    assert_eq!(plan, rasterizer(&engine).plan(&shape, &case.settings).unwrap());
    assert_silent(engine);
}

#[test]
fn handles_may_be_plain_numbers() {
    let engine = engine();
    let host = engine.host_device();
    let function = host.get_instance_proc_addr as *const c_void;
    let [instance, physical, device] = [host.instance.as_raw(), host.physical_device.as_raw(), host.device.as_raw()];
    let mut raw = unsafe { HostDevice::from_raw(function, instance, physical, device) }.unwrap();
    // And the host's own pipeline cache, which stays the host's.
    raw.pipeline_cache = unsafe { engine.device().create_pipeline_cache(&Default::default(), None) }.unwrap();
    let rasterizer = unsafe { Rasterizer::new(&raw) }.unwrap();
    let case = random_case(0, Kind::Plain);
    let host = Host::new(&engine, &rasterizer, &case);
    forward(&engine, &rasterizer, &host);
    assert!(!host.status().not_finite);
    let null = error(unsafe { HostDevice::from_raw(std::ptr::null(), instance, physical, device) });
    assert!(null.contains("null"), "{null}");
    let null = error(unsafe { HostDevice::from_raw(function, instance, physical, 0) });
    assert!(null.contains("null"), "{null}");
    drop((host, rasterizer));
    assert!(unsafe { engine.device().get_pipeline_cache_data(raw.pipeline_cache) }.is_ok());
    unsafe { engine.device().destroy_pipeline_cache(raw.pipeline_cache, None) };
    assert_silent(engine);
}

#[test]
fn what_does_not_fit_is_an_error_that_names_it() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = random_case(0, Kind::Plain);
    let host = Host::new(&engine, &rasterizer, &case);
    let refs = host.arena.refs(host.buffer.raw);
    let bind = |refs: &[(&str, BufferRef)]| error(unsafe { rasterizer.bind(&host.plan, refs) });
    let changed = |name: &str, change: &dyn Fn(&mut BufferRef)| {
        let mut refs = refs.clone();
        change(&mut refs.iter_mut().find(|(n, _)| *n == name).unwrap().1);
        bind(&refs)
    };
    assert_eq!(bind(&refs), "no error");
    let missing = bind(&refs[1..]);
    assert!(missing.contains(&format!("no buffer `{}`", refs[0].0)), "{missing}");
    let unknown = bind(&[&refs[..], &[("pixels", refs[0].1)]].concat());
    assert!(unknown.contains("`pixels`"), "{unknown}");
    let twice = bind(&[&refs[..], &refs[..1]].concat());
    assert!(twice.contains("twice"), "{twice}");
    let small = changed("positions", &|at| at.range -= 4);
    assert!(small.contains("positions") && small.contains("needs"), "{small}");
    let crooked = changed("geometry", &|at| at.offset += 4);
    assert!(crooked.contains("geometry") && crooked.contains("multiple"), "{crooked}");
    let null = changed("boxes", &|at| at.buffer = vk::Buffer::null());
    assert!(null.contains("boxes") && null.contains("null"), "{null}");

    // A plan of another size or other kernels is not recorded with these bindings.
    let shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    let replan = |change: &dyn Fn(&mut softras::Settings)| {
        let mut settings = case.settings.clone();
        change(&mut settings);
        rasterizer.plan(&shape, &settings).unwrap()
    };
    let larger = replan(&|s| (s.width, s.height) = (4 * s.width, 4 * s.height));
    assert!(error(host.bindings.fits(&larger)).contains("bytes"), "{}", error(host.bindings.fits(&larger)));
    let others = replan(&|s| s.outputs.depth = !s.outputs.depth);
    assert!(error(host.bindings.fits(&others)).contains("other kernels"));
    assert!(host.bindings.fits(&replan(&|s| s.background_color = [0.5; 3])).is_ok());
    let unsaved = replan(&|s| s.save = false);
    let differentiate =
        Differentiate { upstream: case.settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 };
    assert!(matches!(rasterizer.plan_backward(&unsaved, &differentiate), Err(Error::Backward { .. })));
    drop((host, rasterizer));
    assert_silent(engine);
}

/// A host's interleaved vertices and 16-bit indices give the image of the packed ones, bit by bit.
#[test]
fn interleaved_vertices_and_short_indices_are_gathered() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut case = random_case(2, Kind::Plain);
    case.scene = softras::Scene::new(softras::shapes::torus(0.6, 0.3, 12, 7).unwrap());
    case.cameras.truncate(1);
    let host = Host::new(&engine, &rasterizer, &case);
    forward(&engine, &rasterizer, &host);
    let expected = images(&case, &host);
    assert!(expected[0].1.iter().any(|&x| x != expected[0].1[0]), "an empty image");
    drop(host);

    let mesh = &case.scene.meshes[0];
    // Normal, position, UV.
    let vertices: Vec<[f32; 8]> =
        mesh.positions().iter().map(|p| [9.0, 9.0, 9.0, p[0], p[1], p[2], 7.0, 7.0]).collect();
    let indices: Vec<u16> = mesh.triangles().iter().flatten().map(|&i| i as u16).collect();
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
    let source = |bytes: &[u8]| {
        let size = bytes.len().next_multiple_of(4) as u64;
        let mut buffer = engine.buffer(size, usage, MemoryLocation::CpuToGpu).unwrap();
        buffer.write(0, bytes);
        buffer
    };
    let sources = [source(bytemuck::cast_slice(&vertices)), source(bytemuck::cast_slice(&indices))];
    let mut host = Host::new(&engine, &rasterizer, &case);
    let targets = ["positions", "indices"].map(|name| {
        let (offset, range) = host.arena.part(name).unwrap();
        host.buffer.bytes_mut()[offset as usize..][..range as usize].fill(0);
        BufferRef { buffer: host.buffer.raw, offset, range }
    });
    let bind = |i: usize| {
        let source: &Buffer = &sources[i];
        let source = BufferRef { buffer: source.raw, offset: 0, range: source.size };
        unsafe { rasterizer.bind_gather(source, targets[i]) }.unwrap()
    };
    let bindings = [bind(0), bind(1)];
    let positions = Gather::Positions { stride: 32, offset: 12 };
    let count = [vertices.len() as u32, indices.len() as u32];
    submit(&engine, |commands| unsafe {
        // Some of them, then all: gathering again overwrites.
        let half = count[1] / 3 / 2 * 6;
        rasterizer.record_gather(commands, &bindings[0], positions, count[0], 0).unwrap();
        rasterizer.record_gather(commands, &bindings[1], Gather::Indices16 { base: 0 }, half, 0).unwrap();
        rasterizer.record_gather(commands, &bindings[1], Gather::Indices16 { base: 0 }, count[1], 0).unwrap();
        rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap();
    });
    assert_eq!(images(&case, &host), expected);

    submit(&engine, |commands| unsafe {
        let record = |i: usize, gather, count, first| {
            error(rasterizer.record_gather(commands, &bindings[i], gather, count, first))
        };
        assert!(record(0, positions, count[0] + 1, 0).contains("source"));
        assert!(record(0, positions, count[0], 1).contains("target"));
        assert!(record(1, Gather::Indices32 { base: 0 }, count[1], 0).contains("source"));
        assert!(record(0, Gather::Positions { stride: 10, offset: 0 }, 1, 0).contains("multiples of four"));
        assert_eq!(record(0, positions, 0, 0), "no error");
    });
    drop((bindings, host, sources, rasterizer));
    assert_silent(engine);
}

/// Each may be moved to and shared with another thread.
#[test]
fn everything_is_send_and_sync() {
    fn assert<T: Send + Sync>() {}
    assert::<Rasterizer>();
    assert::<(FramePlan, FrameBindings)>();
    assert::<(GradientPlan, softras::rasterizer::GradientBindings)>();
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
                let commands = frame.begin().unwrap();
                for _ in 0..20 {
                    unsafe { rasterizer.record_forward(commands, &host.plan, &host.bindings) }.unwrap();
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

/// Host memory as a foreign allocator gives it: counted, and refused after a number of calls.
struct Memory {
    live: AtomicI64,
    left: AtomicI64,
}

/// The size and the alignment go before each block, so that it can be freed and moved.
const HEADER: usize = 64;

fn layout(size: usize, alignment: usize) -> std::alloc::Layout {
    std::alloc::Layout::from_size_align(size + HEADER, alignment.max(HEADER)).unwrap()
}

unsafe extern "system" fn allocate(
    user: *mut c_void,
    size: usize,
    alignment: usize,
    _: vk::SystemAllocationScope,
) -> *mut c_void {
    let memory = unsafe { &*user.cast::<Memory>() };
    if size == 0 || memory.left.fetch_sub(1, Ordering::Relaxed) <= 0 {
        return std::ptr::null_mut();
    }
    memory.live.fetch_add(1, Ordering::Relaxed);
    unsafe {
        let block = std::alloc::alloc(layout(size, alignment));
        block.cast::<[usize; 2]>().write([size, alignment]);
        block.add(HEADER).cast()
    }
}

unsafe extern "system" fn free(user: *mut c_void, at: *mut c_void) {
    if at.is_null() {
        return;
    }
    unsafe {
        (*user.cast::<Memory>()).live.fetch_sub(1, Ordering::Relaxed);
        let block = at.cast::<u8>().sub(HEADER);
        let [size, alignment] = block.cast::<[usize; 2]>().read();
        std::alloc::dealloc(block, layout(size, alignment));
    }
}

unsafe extern "system" fn reallocate(
    user: *mut c_void,
    at: *mut c_void,
    size: usize,
    alignment: usize,
    scope: vk::SystemAllocationScope,
) -> *mut c_void {
    unsafe {
        let new = if size == 0 { std::ptr::null_mut() } else { allocate(user, size, alignment, scope) };
        if !at.is_null() && (size == 0 || !new.is_null()) {
            let [old, _] = at.cast::<u8>().sub(HEADER).cast::<[usize; 2]>().read();
            if !new.is_null() {
                std::ptr::copy_nonoverlapping(at.cast::<u8>(), new.cast(), old.min(size));
            }
            free(user, at);
        }
        new
    }
}

/// Each allocation in turn fails: an error, and nothing is left behind. Then all succeed.
#[test]
fn running_out_of_memory_anywhere_leaves_nothing() {
    let engine = engine();
    let mut case = random_case(0, Kind::Plain);
    case.settings.save = true;
    let memory = Memory { live: AtomicI64::new(0), left: AtomicI64::new(i64::MAX) };
    let callbacks = vk::AllocationCallbacks {
        p_user_data: (&raw const memory).cast_mut().cast(),
        pfn_allocation: Some(allocate),
        pfn_reallocation: Some(reallocate),
        pfn_free: Some(free),
        ..Default::default()
    };
    let host = HostDevice { allocation_callbacks: Some(callbacks), ..engine.host_device() };
    let shape = Shape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    let plan = rasterizer(&engine).plan(&shape, &case.settings).unwrap();
    let differentiate =
        Differentiate { upstream: case.settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 };
    let gradient_plan = rasterizer(&engine).plan_backward(&plan, &differentiate).unwrap();
    let arenas = [Arena::of(plan.buffers()), Arena::of(gradient_plan.buffers())];
    let buffers = arenas.each_ref().map(|a| engine.buffer(a.size, a.usage, MemoryLocation::GpuToCpu).unwrap());
    let refs = [0, 1].map(|i| arenas[i].refs(buffers[i].raw));
    let bind = |allowed: i64| {
        memory.left.store(allowed, Ordering::Relaxed);
        let rasterizer = unsafe { Rasterizer::new(&host) }?;
        let forward = unsafe { rasterizer.bind(&plan, &refs[0]) }?;
        unsafe { rasterizer.bind_backward(&gradient_plan, &forward, &refs[1]) }.map(drop)
    };
    let mut failures = 0;
    loop {
        match bind(failures) {
            Err(Error::OutOfMemory { .. }) => failures += 1,
            Err(other) => panic!("allocation {failures}: {other}"),
            Ok(()) => break,
        }
        assert_eq!(memory.live.load(Ordering::Relaxed), 0, "allocation {failures}");
        assert!(failures < 10_000);
    }
    println!("{failures} allocations failed in turn");
    assert!(failures > 20, "the callbacks were hardly used: {failures}");
    assert_eq!(memory.live.load(Ordering::Relaxed), 0);
    drop(buffers);
    assert_silent(engine);
}
