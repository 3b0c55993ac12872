//! softras in a host's hands: the example engine under validation, bits equal to the simple API's, misuse named, and what
//! was made freed whatever happens.

#[path = "../../../examples/embed_ash.rs"]
mod embed_ash;

use super::facade::assert_images;
use super::geometry::storage;
use crate::common::gradient::{random_upstream, same_gradient_bits};
use crate::common::modes::give_normals;
use crate::common::scenes::{Kind, random_case};
use crate::common::{renderer, tier, validates};
use crate::host::{
    Host, Memory, Messages, assert_silent, bind, difference, engine, error, images, plan_backward, plan_of, rasterizer,
    record, submit,
};
use ash::vk::{self, Handle};
use gpu_allocator::MemoryLocation;
use softras::embed::{
    BufferRef, HostAdapter, HostCommands, HostDevice, ImageBindings, Layout, MeshBuffers, Pass, PassBuffer, PassMemory,
    PassMesh, PassPlan, Rasterizer, Requirements,
};
use softras::scene::{Outputs, Shading};
use softras::{Camera, GradientRequest, ImageGradient, Lights, Mesh, Projection, Scene, Settings};
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
    // softras' image is in the middle, the engine's own triangles in the lower left corner, the background elsewhere.
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
            // Flat shading does not use them.
            give_normals(&mut case);
        }
        let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
        let host = Host::whole(&engine, &rasterizer, plan_of(&rasterizer, &case), &ImageGradient::default());
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

/// Gradients are read raw and decoded; an error names gradients that the pass does not have.
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

        let plan = plan_backward(plan_of(&rasterizer, &case), &upstream, GradientRequest::ALL);
        let host = Host::whole(&engine, &rasterizer, plan, &upstream);
        assert_eq!(same_gradient_bits(&expected, &host.gradients()), Ok(()), "{case:?}");
        let rows = host.floats(PassBuffer::VertexGradients);
        let raw: Vec<f32> = rows.chunks_exact(8).flat_map(|r| [r[0], r[1], r[2]]).collect();
        let positions: Vec<f32> = expected.meshes.iter().flat_map(|m| m.positions.iter().flatten().copied()).collect();
        assert_eq!(difference(&raw[..positions.len()], &positions), None, "{case:?}");
        assert!(positions.iter().any(|&x| x != 0.0), "nothing to compare: {case:?}");

        let bytes = host.memory.readback.bytes();
        let decode = |bytes| error(host.pass.decode_gradients(bytes));
        assert!(decode(&bytes[..64]).contains("64 bytes, of which"));
        assert!(decode(&bytes[1..]).contains("the bytes of"));
    }
    drop(rasterizer);
    assert_silent(engine);
}

#[test]
fn requirements_are_known_before_there_is_a_device() {
    let engine = engine();
    let needed = Requirements::new();
    let info = needed.validate(&engine.host_adapter()).unwrap();
    assert!(info.suitable.is_ok() && !info.name.is_empty());
    assert_eq!((needed.features, needed.extensions), (&[][..], &[][..]));
    // The limits that every Vulkan 1.1 device guarantees, but for storage buffers in a stage, of which some have four.
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
    let plan = plan_of(&rasterizer, &case).build().unwrap();
    let mut memory = Memory::new(&engine, &plan);
    let whole = memory.device.whole();
    let raw = unsafe { BufferRef::from_raw(whole.raw().as_raw(), whole.range(), whole.usage().as_raw()) };
    assert_eq!(raw, whole);
    let pass = rasterizer.bind_pass(plan, PassMemory { device: raw, ..memory.refs() }, &[]).unwrap();
    pass.write_inputs(memory.upload.bytes_mut()).unwrap();
    submit(&engine, |commands| record(&pass, &mut unsafe { HostCommands::from_raw(commands.raw().as_raw()) }));
    pass.status(memory.readback.bytes()).unwrap();
    let nulls = [(std::ptr::null(), instance, physical), (function, 0, physical), (function, instance, 0)];
    for (function, instance, physical) in nulls {
        let null = error(unsafe { HostAdapter::from_raw(function, instance, physical) });
        assert!(null.contains("null"), "{null}");
    }
    let null = error(unsafe { HostDevice::from_raw(adapter, 0) });
    assert!(null.contains("the device is null"), "{null}");
    let null = error(Rasterizer::new(&unsafe { HostDevice::new(adapter, vk::Device::null()) }));
    assert!(null.contains("the device is null"), "{null}");
    drop((pass, memory, rasterizer));
    assert!(unsafe { engine.device().get_pipeline_cache_data(cache) }.is_ok());
    unsafe { engine.device().destroy_pipeline_cache(cache, None) };
    assert_silent(engine);
}

#[test]
fn what_does_not_fit_is_an_error_that_names_it() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut case = random_case(0, Kind::Plain);
    case.settings.outputs = Outputs::ALL;
    let ids = [PassBuffer::Color, PassBuffer::Depths, PassBuffer::Status];
    let plan = plan_of(&rasterizer, &case).own_buffers(&ids).build().unwrap();
    let memory = Memory::new(&engine, &plan);
    let own: Vec<_> = plan
        .own_buffers()
        .iter()
        .map(|(id, r)| (*id, engine.buffer(r.size, r.usage, MemoryLocation::GpuToCpu).unwrap()))
        .collect();
    let refs: Vec<_> = own.iter().map(|(id, buffer)| (*id, buffer.whole())).collect();
    let bind = |own: &[(PassBuffer, BufferRef)]| {
        error(rasterizer.bind_pass(plan.clone(), PassMemory { own, ..memory.refs() }, &[]))
    };
    assert_eq!(bind(&refs), "no error");
    let changed = |id: PassBuffer, change: &dyn Fn(BufferRef) -> BufferRef| {
        let mut refs = refs.clone();
        let at = &mut refs.iter_mut().find(|(i, _)| *i == id).unwrap().1;
        *at = change(*at);
        bind(&refs)
    };
    let missing = bind(&refs[1..]);
    assert!(missing.contains("there is no buffer"), "{missing}");
    let unknown = bind(&[&refs[..], &[(PassBuffer::TexelSums, refs[0].1)]].concat());
    assert!(unknown.contains("`texel_sums`"), "{unknown}");
    let twice = bind(&[&refs[..], &refs[..1]].concat());
    assert!(twice.contains("twice"), "{twice}");
    let small = changed(PassBuffer::Color, &|at| at.part(0, at.range() - 4).unwrap());
    assert!(small.contains("color") && small.contains("needs"), "{small}");
    let null = changed(PassBuffer::Depths, &|at| unsafe { BufferRef::new(vk::Buffer::null(), at.range(), at.usage()) });
    assert!(null.contains("depths") && null.contains("null"), "{null}");
    let useless = changed(PassBuffer::Depths, &|at| unsafe {
        BufferRef::new(at.raw(), at.range(), vk::BufferUsageFlags::TRANSFER_DST)
    });
    assert!(useless.contains("depths") && useless.contains("STORAGE_BUFFER"), "{useless}");
    let whole = memory.device.whole();
    assert!(error(whole.part(16, whole.range())).contains("outside"));

    // Plans with other kernels, and a scene that crosses a plane that the plan left out, are refused.
    let mut pass = rasterizer.bind_pass(plan.clone(), PassMemory { own: &refs, ..memory.refs() }, &[]).unwrap();
    let mut others = case.settings.clone();
    others.outputs.depth = !others.outputs.depth;
    assert!(error(pass.set_settings(others)).contains("outputs"));
    let cube = Scene::new(softras::shapes::cube().unwrap());
    let camera = |distance| Camera::from_angles(distance, 0.0, 0.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let settings = Settings { width: 16, height: 16, near: 1.0, far: 100.0, ..Settings::default() };
    let plan = rasterizer.scene_pass(&cube).settings(settings).cameras(&[camera(5.0)]).build().unwrap();
    let memory = Memory::new(&engine, &plan);
    pass = rasterizer.bind_pass(plan, memory.refs(), &[]).unwrap();
    assert_eq!(error(pass.set_cameras(&[camera(6.0)])), "no error");
    assert!(error(pass.set_cameras(&[camera(1.2)])).contains("crosses the near or the far plane"));
    drop((pass, memory, own, rasterizer));
    assert_silent(engine);
}

/// Smooth shading by normals that a host's kernel wrote.
#[test]
fn a_hosts_own_normals_shade_its_meshes() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let [ball, plain] = [2, 1].map(|level| softras::shapes::icosphere(level).unwrap());
    let tilted = |p: &[f32; 3]| glam::Vec3::new(p[0], p[1] + 0.5, p[2]).normalize().to_array();
    let lights = Lights { shading: Shading::Smooth, ..Lights::official() };
    let with_normals = ball.clone().with_normals(ball.positions().iter().map(tilted).collect()).unwrap();
    let normals = with_normals.normals().to_vec();
    let cameras = [15.0, 60.0]
        .map(|angle| Camera::from_angles(4.0, 20.0, angle, Projection::Perspective { fov_y: 0.8 }).unwrap());
    let settings = Settings { width: 32, height: 32, ..Settings::default() };
    let scene = Scene::batch(vec![plain.clone(), with_normals]).with_lights(lights.clone());
    let frame = renderer().render(&scene, &cameras, &settings).unwrap();
    let mesh = |mesh: &Mesh| PassMesh::new(mesh.positions().len() as u32, mesh.triangles().as_flattened());
    let plan = rasterizer.pass(&[mesh(&plain), mesh(&ball).with_normals()]).one_mesh_a_view();
    let plan = plan.settings(settings).cameras(&cameras).lights(lights).inside_planes().build().unwrap();
    let sources = [&plain, &ball].map(|mesh| storage(&engine, bytemuck::cast_slice(mesh.positions())));
    let buffers = sources.each_ref().map(|at| MeshBuffers::new(at.whole(), Layout { stride: 12, offset: 0 }));
    let mut memory = Memory::new(&engine, &plan);
    let pass = bind(&rasterizer, &plan, &mut memory, &buffers);
    submit(&engine, |commands| pass.record_setup(commands).unwrap());
    memory.device.write(pass.normals(1).unwrap().offset(), bytemuck::cast_slice(&normals));
    submit(&engine, |commands| pass.record_forward(commands).unwrap());
    assert_images(&memory, &pass, &frame, "normals of the host's");
    drop((pass, memory, sources, rasterizer));
    assert_silent(engine);
}

/// Each type may be moved to and shared with another thread.
#[test]
fn everything_is_send_and_sync() {
    fn assert<T: Send + Sync>() {}
    assert::<Rasterizer>();
    assert::<(PassPlan, Pass, ImageBindings)>();
}
