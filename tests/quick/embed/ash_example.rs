//! softras in a host's hands: the example engine under validation, bits equal to the simple API's, misuse named, and what
//! was made freed whatever happens.

#[path = "../../../examples/embed_ash.rs"]
mod embed_ash;

use crate::common::gradient::{random_upstream, same_gradient_bits};
use crate::common::modes::give_normals;
use crate::common::scenes::{Case, Kind, random_case};
use crate::common::{renderer, tier, validates};
use crate::host::{
    Backward, Host, Messages, assert_silent, difference, engine, error, forward, images, rasterizer, submit,
};
use ash::vk::{self, Handle};
use softras::embed::{
    AppearanceShape, Arena, BufferId, BufferRef, Capacity, DepthSpan, Differentiate, FrameBindings, FramePlan,
    FrameShape, GradientPlan, HostAdapter, HostCommands, HostDevice, MeshShape, Rasterizer, Requirements,
};
use softras::{DeviceKind, Error, GradientRequest, Lights, Limits, Scene};
use std::ffi::c_void;

#[test]
fn the_example_fits_its_vertex_and_draws_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("embed.png");
    let report = embed_ash::run(Some(&path), validates()).unwrap();
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
    for seed in 0..tier(2, 12) {
        let mut case = random_case(seed, [Kind::Plain, Kind::Modes, Kind::Clipped][seed as usize % 3]);
        if seed % 4 < 2 {
            // Flat shading has no use for them.
            give_normals(&mut case);
        }
        let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let host = Host::whole_frame(&engine, &rasterizer, &case);
        let made = images(&case, &host);
        assert_eq!(made.len(), frame.images().count());
        for (name, image) in made {
            let (_, simple) = frame.images().find(|(n, _)| *n == name).unwrap();
            assert_eq!(difference(&image, &simple.data), None, "{name}: {case:?}");
        }
    }
    drop(rasterizer);
    assert_silent(engine);
}

/// Raw, and decoded; what is not there to decode is named.
#[test]
fn gradients_are_the_simple_apis_bit_by_bit() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut simple = renderer();
    for seed in 20..tier(21, 26) {
        let mut case = random_case(seed, Kind::Plain);
        case.settings.save = true;
        let upstream = random_upstream(&case, case.settings.outputs);
        let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let expected = simple.backward(&frame, &upstream, &GradientRequest::ALL).unwrap();
        assert_eq!(same_gradient_bits(&expected, &expected), Ok(()));

        let host = Host::whole_frame(&engine, &rasterizer, &case);
        let backward = Backward::new(&engine, &rasterizer, &host, &upstream, GradientRequest::ALL);
        submit(&engine, |commands| backward.record(&rasterizer, commands));
        let made = backward.decode(&host, &case, &case.scene);
        assert_eq!(same_gradient_bits(&expected, &made), Ok(()), "{case:?}");
        let rows: &[f32] = bytemuck::cast_slice(backward.part(BufferId::VertexGradients).unwrap());
        let raw: Vec<f32> = rows.chunks_exact(8).flat_map(|r| [r[0], r[1], r[2]]).collect();
        let positions: Vec<f32> = expected.meshes.iter().flat_map(|m| m.positions.iter().flatten().copied()).collect();
        assert_eq!(difference(&raw[..positions.len()], &positions), None, "{case:?}");
        assert!(positions.iter().any(|&x| x != 0.0), "nothing to compare: {case:?}");

        let none = backward.decode_cut(&host, &case, &case.scene, |_| None);
        assert!(error(none).contains("no bytes of"));
        let short = backward.decode_cut(&host, &case, &case.scene, |bytes| Some(&bytes[..8]));
        assert!(error(short).contains("has 8 bytes"));
        let crooked = backward.decode_cut(&host, &case, &case.scene, |bytes| Some(&bytes[1..]));
        assert!(error(crooked).contains("bytes"));
        let other = Case { cameras: case.cameras.repeat(2), ..case.clone() };
        let cameras = backward.decode_cut(&host, &other, &case.scene, Some);
        assert!(error(cameras).contains("the cameras"));
        let other = Scene::batch(case.scene.meshes.iter().map(|_| softras::shapes::cube().unwrap()).collect());
        let meshes = backward.decode_cut(&host, &case, &other, Some);
        assert!(error(meshes).contains("the meshes"));
    }
    drop(rasterizer);
    assert_silent(engine);
}

/// Room that is too small is told, not hidden.
#[test]
fn the_status_tells_what_room_the_lists_needed() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = random_case(1, Kind::Plain);
    let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    shape.capacity = Some(Capacity { coarse: 1, list: 1, cells: 1 });
    let small = Host::of_shape(&engine, &rasterizer, &case, &shape);
    forward(&engine, &rasterizer, &small);
    let mut needed = small.status().validate(&small.plan).unwrap().expect("more room");
    // A short bin list hides what its tiles need.
    for _ in 0..3 {
        shape.capacity = Some(needed);
        let larger = Host::of_shape(&engine, &rasterizer, &case, &shape);
        forward(&engine, &rasterizer, &larger);
        match larger.status().validate(&larger.plan).unwrap() {
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
    let needed = Requirements::new();
    let info = needed.validate(&engine.host_adapter()).unwrap();
    assert!(info.suitable.is_ok() && !info.name.is_empty());
    assert_eq!((needed.features, needed.extensions), (&[][..], &[][..]));
    // What every Vulkan 1.1 device guarantees, but for storage buffers in a stage, of which some have four.
    let minima = [128, 8, 16, 16384, 128];
    for ((name, limit), minimum) in needed.limits.iter().zip(minima) {
        assert!(*limit <= minimum, "{name}: {limit}");
    }
    // Each limit is held against its own: one more than the device has is too much, and what it has is not.
    let has = |name: &str| match name {
        "maxPushConstantsSize" => info.limits.max_push_constants,
        "maxPerStageDescriptorStorageBuffers" => info.limits.max_storage_buffers,
        "maxPerStageDescriptorSampledImages" => info.limits.max_texel_buffers,
        "maxComputeSharedMemorySize" => info.limits.max_shared_memory,
        "maxComputeWorkGroupInvocations" => info.limits.max_workgroup_invocations,
        other => panic!("{other}"),
    };
    for (i, (name, _)) in needed.limits.iter().enumerate() {
        let mut most = Requirements::new();
        most.limits[i].1 = has(name).into();
        most.validate(&engine.host_adapter()).unwrap();
        most.limits[i].1 += 1;
        let message = error(most.validate(&engine.host_adapter()));
        assert!(message.contains(&format!("{name} is {}", has(name))), "{message}");
    }
    // A plan needs no device either.
    let case = random_case(0, Kind::Plain);
    let shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    let plan = FramePlan::new(&info.limits, info.kind, &shape, &case.settings).unwrap();
    assert_eq!(plan, rasterizer(&engine).plan(&shape, &case.settings).unwrap());
    assert_silent(engine);
}

#[test]
fn handles_may_be_plain_numbers() {
    let engine = engine();
    let core = engine.core();
    let function = core.get_instance_proc_addr() as *const c_void;
    let [instance, physical] = [core.instance.handle().as_raw(), core.physical.as_raw()];
    let adapter = unsafe { HostAdapter::from_raw(function, instance, physical) }.unwrap();
    let device = unsafe { HostDevice::from_raw(adapter, engine.device().handle().as_raw()) }.unwrap();
    // And the host's own pipeline cache, which stays the host's.
    let cache = unsafe { engine.device().create_pipeline_cache(&Default::default(), None) }.unwrap();
    let rasterizer = Rasterizer::new(&unsafe { device.with_pipeline_cache(cache) }).unwrap();
    let case = random_case(0, Kind::Plain);
    let mut host = Host::new(&engine, &rasterizer, &case);
    let whole = host.buffer.whole();
    let raw = unsafe { BufferRef::from_raw(whole.raw().as_raw(), whole.range(), whole.usage().as_raw()) };
    assert_eq!(raw, whole);
    host.bindings = rasterizer.bind(&host.plan, &host.arena.refs(&raw).unwrap()).unwrap();
    submit(&engine, |commands| {
        let mut commands = unsafe { HostCommands::from_raw(commands.raw().as_raw()) };
        rasterizer.record_forward(&mut commands, &host.plan, &host.bindings).unwrap();
    });
    assert!(!host.status().not_finite);
    let nulls = [(std::ptr::null(), instance, physical), (function, 0, physical), (function, instance, 0)];
    for (function, instance, physical) in nulls {
        let null = error(unsafe { HostAdapter::from_raw(function, instance, physical) });
        assert!(null.contains("null"), "{null}");
    }
    let null = error(unsafe { HostDevice::from_raw(adapter, 0) });
    assert!(null.contains("the device is null"), "{null}");
    let null = error(Rasterizer::new(&unsafe { HostDevice::new(adapter, vk::Device::null()) }));
    assert!(null.contains("the device is null"), "{null}");
    drop((host, rasterizer));
    assert!(unsafe { engine.device().get_pipeline_cache_data(cache) }.is_ok());
    unsafe { engine.device().destroy_pipeline_cache(cache, None) };
    assert_silent(engine);
}

#[test]
fn what_does_not_fit_is_an_error_that_names_it() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = random_case(0, Kind::Plain);
    let host = Host::new(&engine, &rasterizer, &case);
    let refs = host.arena.refs(&host.buffer.whole()).unwrap();
    let bind = |refs: &[(BufferId, BufferRef)]| error(rasterizer.bind(&host.plan, refs));
    let changed = |id: BufferId, change: &dyn Fn(BufferRef) -> BufferRef| {
        let mut refs = refs.clone();
        let at = &mut refs.iter_mut().find(|(i, _)| *i == id).unwrap().1;
        *at = change(*at);
        bind(&refs)
    };
    assert_eq!(bind(&refs), "no error");
    let missing = bind(&refs[1..]);
    assert!(missing.contains(&format!("no buffer `{}`", refs[0].0)), "{missing}");
    let unknown = bind(&[&refs[..], &[(BufferId::PixelSums, refs[0].1)]].concat());
    assert!(unknown.contains("`pixel_sums`"), "{unknown}");
    let twice = bind(&[&refs[..], &refs[..1]].concat());
    assert!(twice.contains("twice"), "{twice}");
    let small = changed(BufferId::Positions, &|at| at.part(0, at.range() - 4).unwrap());
    assert!(small.contains("positions") && small.contains("needs"), "{small}");
    let whole = host.buffer.whole();
    let crooked =
        changed(BufferId::Geometry, &|at| whole.part(at.offset() + 4, whole.range() - at.offset() - 4).unwrap());
    assert!(crooked.contains("geometry") && crooked.contains("multiple"), "{crooked}");
    let null = changed(BufferId::Boxes, &|at| unsafe { BufferRef::new(vk::Buffer::null(), at.range(), at.usage()) });
    assert!(null.contains("boxes") && null.contains("null"), "{null}");
    let useless = changed(BufferId::Boxes, &|_| unsafe {
        BufferRef::new(whole.raw(), whole.range(), vk::BufferUsageFlags::TRANSFER_DST)
    });
    assert!(useless.contains("boxes") && useless.contains("STORAGE_BUFFER"), "{useless}");
    assert!(error(whole.part(16, whole.range())).contains("outside"));

    // A plan of another size or other kernels is not recorded with these bindings.
    let shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
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
        Differentiate { upstream: case.settings.outputs, wanted: GradientRequest::default(), largest_upstream: 1.0 };
    assert!(matches!(rasterizer.plan_backward(&unsaved, &differentiate), Err(Error::Backward { .. })));

    // Nor is a backward pass of a frame with more room than was bound, though its own buffers are no larger.
    let mut saved = case.clone();
    saved.settings.save = true;
    let frame = Host::new(&engine, &rasterizer, &saved);
    let upstream = random_upstream(&saved, saved.settings.outputs);
    let backward = Backward::new(&engine, &rasterizer, &frame, &upstream, GradientRequest::default());
    let capacity = frame.plan.capacity();
    let capacity = Some(Capacity { list: 2 * capacity.list, ..capacity });
    let roomier = rasterizer.plan(&FrameShape { capacity, ..shape.clone() }, &saved.settings).unwrap();
    let roomier = rasterizer.plan_backward(&roomier, &differentiate).unwrap();
    assert!(backward.bindings.fits(&backward.plan).is_ok());
    assert!(error(backward.bindings.fits(&roomier)).contains("is bound where"));
    drop((backward, frame));
    drop((host, rasterizer));
    assert_silent(engine);
}

/// Whatever counts a host asks for, a plan is made or refused; none is too large to be counted.
#[test]
fn counts_of_any_size_are_planned_or_refused() {
    let random = &mut crate::common::random::Random::new(7);
    let limits = Requirements::new().validate(&engine().host_adapter()).unwrap().limits;
    let unlimited = Limits {
        max_storage_buffer_range: u64::MAX,
        max_texel_buffer_elements: u64::MAX,
        max_memory_allocation_size: u64::MAX,
        ..limits
    };
    let (mut made, mut refused) = (0, 0);
    for _ in 0..20_000 {
        let mut count = || random.choose(&[0, 1, 2, 3, 100, 70_000, 1 << 20, (1 << 31) - 1, 1 << 31, u32::MAX]);
        let appearances = [
            AppearanceShape::Uniform,
            AppearanceShape::VertexColors,
            AppearanceShape::Surface { resolution: count() },
            AppearanceShape::Textured {
                uvs: count(),
                textures: vec![(count(), count()), (count(), count())],
                of_triangle: count() > 2,
            },
        ];
        let meshes = (0..count().min(3)).map(|_| MeshShape {
            vertices: count(),
            triangles: count(),
            most_corners: count(),
            appearance: appearances[count() as usize % 4].clone(),
            normals: count() > 2,
        });
        let meshes: Vec<_> = meshes.collect();
        let views = if meshes.len() == 1 { count() } else { meshes.len() as u32 };
        let capacity = (count() > 2).then(|| Capacity { coarse: count(), list: count(), cells: count() });
        let depth_span = DepthSpan { crosses_near: count() > 2, crosses_far: count() > 2 };
        let (lights, device_counts) = (Lights::official(), count() > 2);
        let opacity = count() > 2;
        let (distorted, cutoff) = (false, 9.0);
        let shape =
            FrameShape { meshes, views, lights, depth_span, opacity, distorted, cutoff, capacity, device_counts };
        let sizes = [1, 8, 640, 16384];
        let (width, height) = (sizes[count() as usize % 4], sizes[count() as usize % 4]);
        let settings = softras::Settings { width, height, save: count() > 2, ..Default::default() };
        for limits in [&limits, &unlimited] {
            let Ok(plan) = FramePlan::new(limits, DeviceKind::Discrete, &shape, &settings) else {
                refused += 1;
                continue;
            };
            made += 1;
            assert_eq!(plan.view_shapes().len(), views as usize);
            let differentiate =
                Differentiate { upstream: settings.outputs, wanted: GradientRequest::ALL, largest_upstream: 1.0 };
            if settings.save
                && let Ok(gradients) = GradientPlan::new(&plan, &differentiate)
            {
                assert!(Arena::of(plan.buffers().iter().chain(gradients.buffers())).size > 0);
            }
        }
    }
    assert!(made > 100 && refused > 1000, "{made} made, {refused} refused");
}

/// Kernels index texels with 32 bits, the sign one of them.
#[test]
fn records_beyond_32_bits_are_refused() {
    let limits = Requirements::new().validate(&engine().host_adapter()).unwrap().limits;
    let (ranges, elements) = (u64::MAX, u64::MAX);
    let limits = Limits { max_storage_buffer_range: ranges, max_texel_buffer_elements: elements, ..limits };
    let limits = Limits { max_memory_allocation_size: u64::MAX, ..limits };
    let plan = |views: u32| {
        let (appearance, normals) = (AppearanceShape::Uniform, false);
        let mesh = MeshShape { vertices: 3, triangles: 4_000_000, most_corners: 3, appearance, normals };
        let depth_span = DepthSpan { crosses_near: false, crosses_far: false };
        let (meshes, lights) = (vec![mesh], Lights::unlit());
        let shape = FrameShape {
            meshes,
            views,
            lights,
            depth_span,
            opacity: false,
            distorted: false,
            cutoff: 9.0,
            capacity: None,
            device_counts: false,
        };
        FramePlan::new(&limits, DeviceKind::Discrete, &shape, &softras::Settings::default())
    };
    // Nine texels a triangle: 36 million a view.
    assert!(plan(59).is_ok());
    let error = plan(60).unwrap_err().to_string();
    assert!(error.contains("32-bit index") && error.contains("2160000000"), "{error}");
}

/// Each may be moved to and shared with another thread.
#[test]
fn everything_is_send_and_sync() {
    fn assert<T: Send + Sync>() {}
    assert::<Rasterizer>();
    assert::<(FramePlan, FrameBindings)>();
    assert::<(GradientPlan, softras::embed::GradientBindings)>();
}
