//! Misuse by a host, and uses that were once errors: shared gradient buffers, orders of calls, changes of a bound pass.

use super::facade::*;
use super::geometry::storage;
use super::images::after_store;
use crate::common::gradient::random_upstream;
use crate::common::renderer;
use crate::common::scenes::Case;
use crate::heap::allocations;
use crate::host::engine::{Buffer, Engine};
use crate::host::{Host, assert_silent, difference, engine, error, plan_backward, plan_of, rasterizer, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    BufferRef, CameraMatrices, ClipSpace, Draw, FrameImage, GeometryGradients, HostCommands, ImageFormat, IndexFormat,
    Layout, MemoryKind, MeshBuffers, MeshLook, Pass, PassBuffer, PassBuilder, PassMemory, PassMesh, PassStatus,
    Rasterizer,
};
use softras::glam::{DMat4, DVec3};
use softras::scene::{Background, DirectionalLight, Support};
use softras::{Camera, GradientRequest, Lights, Mesh, Projection, Scene, Settings, shapes};

const PACKED: Layout = Layout { stride: 12, offset: 0 };
/// The bits of a float that no gradient has: the byte 0xcd four times.
const UNTOUCHED: u32 = 0xcdcd_cdcd;

fn case(mesh: &Mesh) -> Case {
    let camera = Camera::from_angles(3.0, 20.0, 30.0, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let settings = Settings { width: 40, height: 32, sigma: 1e-3, save: true, ..Settings::default() };
    Case { scene: Scene::new(mesh.clone()), cameras: vec![camera], settings, ..super::geometry::Engines::new().case() }
}

fn builder(rasterizer: &Rasterizer, meshes: &[PassMesh], case: &Case) -> PassBuilder {
    rasterizer.pass(meshes).settings(case.settings.clone()).cameras(&case.cameras)
}

fn indices(mesh: &Mesh) -> &[u32] {
    mesh.triangles().as_flattened()
}

/// A model's two materials: two meshes of one vertex buffer, one gradient buffer and one array of transforms.
#[test]
fn meshes_that_share_a_gradient_buffer_add_to_it() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::torus(0.7, 0.3, 12, 7).unwrap();
    let case = case(&model);
    let upstream = random_upstream(&case, case.settings.outputs);
    let count = model.positions().len() as u32;
    let vertices = storage(&engine, bytemuck::cast_slice(model.positions()));
    let transform = [[1.0f32, 0.0, 0.0, 0.1], [0.0, 0.0, 1.0, 0.2], [0.0, -1.0, 0.0, 0.3]];
    let transforms = storage(&engine, bytemuck::cast_slice(&[transform; 2]));
    let gradients_of = |meshes: &[PassMesh]| {
        let plan = builder(&rasterizer, meshes, &case).gradients(GradientRequest::default()).build().unwrap();
        let targets = [12 * count as usize, 96].map(|size| storage(&engine, &vec![0xcd; size]));
        let array = |target: &Buffer, stride| Some((target.whole(), Layout { stride, offset: 0 }));
        let gradients = GeometryGradients {
            positions: array(&targets[0], 12),
            transforms: array(&targets[1], 48),
            ..GeometryGradients::default()
        };
        let buffers =
            MeshBuffers { transforms: array(&transforms, 48), gradients, ..MeshBuffers::new(vertices.whole(), PACKED) };
        let mut memory = Memory::new(&engine, &plan);
        let pass = bind(&rasterizer, &plan, &mut memory, &vec![buffers; meshes.len()]);
        memory.write_upstream(&pass, &upstream);
        // The pass runs twice, since gradients of a frame must not be added to those of the one before.
        run(&engine, &pass);
        run(&engine, &pass);
        assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
        [targets[0].floats(0, 3 * count as usize), targets[1].floats(0, 12)]
    };
    let one = gradients_of(&[PassMesh::new(count, indices(&model))]);
    let half = indices(&model).len() / 6 * 3;
    let parts = [&indices(&model)[..half], &indices(&model)[half..]].map(|part| PassMesh::new(count, part));
    let two = gradients_of(&parts);
    for (whole, sum) in one.iter().zip(&two) {
        let largest = whole.iter().fold(0.0f32, |most, g| most.max(g.abs()));
        assert!(largest > 1e-3);
        for (a, b) in whole.iter().zip(sum) {
            assert!((a - b).abs() <= 2e-6 * largest, "{a} and {b}");
        }
    }
    // Two draws with vertices between them that another mesh draws, and some that none does.
    let draw = |first_vertex| Draw { first_vertex, vertices: 10, first_index: 0, triangles: 1, instances: 1 };
    let apart = [vec![draw(0), draw(40)], vec![draw(20)]].map(|draws| PassMesh::of_draws(draws, &[0u32, 4, 9]));
    let words: Vec<u32> = gradients_of(&apart)[0].iter().map(|g| g.to_bits()).collect();
    for vertex in 0..count as usize {
        let drawn = [0..10, 20..30, 40..50].iter().any(|range| range.contains(&vertex));
        let kept = words[3 * vertex..3 * vertex + 3].iter().all(|&word| word == UNTOUCHED);
        assert_eq!(kept, !drawn, "vertex {vertex}");
    }
    drop((vertices, transforms, rasterizer));
    assert_silent(engine);
}

/// A buffer of the wrong kind, or one that gradients would overwrite, is refused with the mesh's number.
#[test]
fn buffers_that_cannot_be_are_refused_when_bound() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::cube().unwrap();
    let case = case(&model);
    let count = model.positions().len() as u32;
    let vertices = storage(&engine, bytemuck::cast_slice(model.positions()));
    let target = storage(&engine, &[0; 4096]);
    let mesh = PassMesh::new(count, indices(&model));
    let wanted = GradientRequest { colors: true, ..GradientRequest::default() };
    let plan = builder(&rasterizer, &[mesh.clone(), mesh], &case).gradients(wanted).build().unwrap();
    let memory = Memory::new(&engine, &plan);
    let bound = |change: &dyn Fn(&mut MeshBuffers, &mut PassMemory<'static>)| {
        let (mut second, mut refs) = (MeshBuffers::new(vertices.whole(), PACKED), memory.refs());
        let first = MeshBuffers {
            gradients: GeometryGradients { positions: Some((target.whole(), PACKED)), ..GeometryGradients::default() },
            ..second
        };
        change(&mut second, &mut refs);
        error(rasterizer.bind_pass(plan.clone(), refs, &[first, second]))
    };
    let at = |stride, offset| Some((target.whole(), Layout { stride, offset }));
    let raw = |buffer: &Buffer, usage| unsafe { BufferRef::new(buffer.raw, buffer.whole().range(), usage) };
    assert_eq!(bound(&|_, _| {}), "no error");
    assert_eq!(bound(&|mesh, _| mesh.gradients.positions = at(12, 0)), "no error");
    let says = |text: &str, change: &dyn Fn(&mut MeshBuffers, &mut PassMemory<'static>)| {
        let said = bound(change);
        assert!(said.contains(text), "{said} does not say {text}");
    };
    says("positions lie among those by positions", &|mesh, _| mesh.gradients.positions = at(16, 0));
    says("positions lie among those by colors", &|mesh, _| mesh.gradients.colors = at(12, 0));
    says("pass's own memory", &|mesh, memory| mesh.gradients.colors = Some((memory.device, PACKED)));
    says("what a mesh is read from", &|mesh, _| mesh.gradients.colors = Some((vertices.whole(), PACKED)));
    let null = unsafe { BufferRef::new(vk::Buffer::null(), 4096, vk::BufferUsageFlags::STORAGE_BUFFER) };
    says("mesh 1 of the pass: positions: the buffer is null", &|mesh, _| mesh.positions.0 = null);
    says("mesh 1 of the pass: the gradients: the buffer was made for", &|mesh, _| {
        mesh.gradients.colors = Some((raw(&target, vk::BufferUsageFlags::VERTEX_BUFFER), PACKED));
    });
    let part = target.whole().part(4, 1024).unwrap();
    says("mesh 1 of the pass: positions begins at byte 4", &|mesh, _| mesh.positions.0 = part);
    says("the upload buffer is null", &|_, memory| {
        memory.upload = unsafe { BufferRef::new(vk::Buffer::null(), 1 << 20, memory.upload.usage()) };
    });
    let four = rasterizer.pass(&[PassMesh::new(count, &[0u32, 1, 2, 3])]).cameras(&case.cameras).build();
    assert!(error(four).contains("there are 4 indices, and draws read 6"));
    // Each draw is looked at by itself: two of them have two instances together.
    let draw = |instances| Draw { vertices: count, triangles: 12, instances, ..Draw::default() };
    let drawn = |draws: [u32; 2]| {
        let mesh = PassMesh::of_draws(draws.map(draw).to_vec(), indices(&model));
        let plan = builder(&rasterizer, &[mesh], &case).build().unwrap();
        let memory = Memory::new(&engine, &plan);
        error(rasterizer.bind_pass(plan, memory.refs(), &[MeshBuffers::new(vertices.whole(), PACKED)]))
    };
    assert_eq!(drawn([1, 1]), "no error");
    assert!(drawn([2, 0]).contains("a draw of 2 instances and no transforms"));
    drop((memory, vertices, target, rasterizer));
    assert_silent(engine);
}

/// A pass of one mesh in its memory.
struct Bound {
    pass: Pass,
    memory: Memory,
    vertices: Buffer,
}

impl Bound {
    fn new(engine: &Engine, rasterizer: &Rasterizer, model: &Mesh, plan: PassBuilder) -> Self {
        let plan = plan.build().unwrap();
        let vertices = storage(engine, bytemuck::cast_slice(model.positions()));
        let mut memory = Memory::new(engine, &plan);
        let pass = bind(rasterizer, &plan, &mut memory, &[MeshBuffers::new(vertices.whole(), PACKED)]);
        Self { pass, memory, vertices }
    }

    fn color(&mut self, engine: &Engine) -> Vec<f32> {
        self.pass.write_frame(self.memory.upload.bytes_mut()).unwrap();
        run(engine, &self.pass);
        self.memory.floats(&self.pass, PassBuffer::Color)
    }
}

fn pass_mesh(model: &Mesh) -> PassMesh {
    PassMesh::new(model.positions().len() as u32, indices(model)).with_look(MeshLook::Color([0.75, 0.5, 0.25]))
}

/// Over memory of ones, gradients of a frame that was recorded but never executed end, are zero, and count as invalid.
#[test]
fn gradients_of_a_frame_that_never_ran_end() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case(&shapes::torus(0.7, 0.3, 12, 7).unwrap());
    let upstream = random_upstream(&case, case.settings.outputs);
    let plan = plan_backward(plan_of(&rasterizer, &case), &upstream, GradientRequest::default());
    let mut host = Host::new(&engine, &rasterizer, plan);
    host.memory.device.bytes_mut().fill(0xff);
    submit(&engine, |commands| host.pass.record_setup(commands).unwrap());
    let thrown_away = engine.commands().unwrap();
    thrown_away.begin().unwrap();
    host.pass.record_forward(&mut thrown_away.host()).unwrap();
    submit(&engine, |commands| host.pass.record_backward(commands).unwrap());
    assert_ne!(host.memory.whole_word(&host.pass), 1);
    assert!(host.floats(PassBuffer::VertexGradients).iter().all(|&g| g == 0.0));
    drop((thrown_away, host, rasterizer));
    assert_silent(engine);
}

/// A call that would read memory that nothing wrote, or store what was freed, is refused when it is recorded.
#[test]
fn orders_of_calls_that_cannot_be_are_refused() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::cube().unwrap();
    let case = case(&model);
    let plan = builder(&rasterizer, &[pass_mesh(&model)], &case).gradients(GradientRequest::default());
    let mut one = Bound::new(&engine, &rasterizer, &model, plan.clone());
    let other = Bound::new(&engine, &rasterizer, &model, plan.clone());
    let commands = engine.commands().unwrap();
    commands.begin().unwrap();
    let host = &mut commands.host();
    assert!(error(one.pass.record_forward(host)).contains("record_setup was not recorded"));
    assert!(error(one.pass.record_backward(host)).contains("record_forward was not recorded"));
    one.pass.record_setup(host).unwrap();
    assert!(error(one.pass.record_backward(host)).contains("record_forward was not recorded"));
    one.pass.record_forward(host).unwrap();
    one.pass.record_backward(host).unwrap();
    one.pass.set_settings(Settings { sigma: 1e-4, ..case.settings.clone() }).unwrap();
    assert!(
        error(one.pass.record_backward(host)).contains("record_forward was not recorded since the pass was bound or")
    );
    engine.end(&commands).unwrap();

    let image = FrameImage::Color { srgb: false };
    let size = one.pass.plan().image_size();
    after_store(&engine, ImageFormat::Rgba32Float, size, |target| {
        let (before, others) = [&one, &other].map(|bound| bound.pass.bind_image(image, 0, target).unwrap()).into();
        let memory = Memory::new(&engine, one.pass.plan());
        let buffers = [MeshBuffers::new(one.vertices.whole(), PACKED)];
        let old = one.pass.rebind(plan.build().unwrap(), memory.refs(), &buffers).unwrap();
        move |commands: &mut HostCommands| {
            let _keep = (&old, &memory);
            for stale in [&before, &others] {
                assert!(error(one.pass.record_store(commands, stale)).contains("another pass bound"));
            }
        }
    });
    drop((commands, other));
    drop(rasterizer);
    assert_silent(engine);
}

/// All that the guide calls changeable can change, as if it had been planned so, and without a heap allocation.
#[test]
fn what_changes_in_a_bound_pass_is_as_if_planned_so() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::icosphere(2).unwrap();
    let mut case = case(&model);
    case.settings.background = Background::Composite;
    let light = |x| Lights {
        directional: vec![DirectionalLight { direction: [x, 0.5, 1.0], ..Lights::official().directional[0] }],
        ..Lights::official()
    };
    let plan = builder(&rasterizer, &[pass_mesh(&model)], &case).lights(light(0.1));
    let fresh = |engine: &Engine, plan: PassBuilder| Bound::new(engine, &rasterizer, &model, plan).color(engine);
    let mut bound = Bound::new(&engine, &rasterizer, &model, plan.clone());
    let first = bound.color(&engine);

    let settings = Settings { sigma: 1e-4, gamma: 1e-3, background_color: [0.25, 0.5, 1.0], ..case.settings.clone() };
    let (changed, lights) = (settings.clone(), light(-0.7));
    let count = allocations(|| {
        bound.pass.set_settings(changed).unwrap();
        bound.pass.set_lights(lights).unwrap();
        bound.pass.set_cameras(&case.cameras).unwrap();
    });
    assert_eq!(count, 0);
    let second = bound.color(&engine);
    assert!(difference(&first, &second).is_some());
    assert_eq!(difference(&second, &fresh(&engine, plan.clone().settings(settings.clone()).lights(light(-0.7)))), None);
    // Lights that come after other settings have their radius of support.
    let wide = Settings { support: Support::Guaranteed, gamma: 0.05, ..settings.clone() };
    bound.pass.set_settings(wide.clone()).unwrap();
    bound.pass.set_lights(light(0.4)).unwrap();
    assert_eq!(
        difference(&bound.color(&engine), &fresh(&engine, plan.clone().settings(wide).lights(light(0.4)))),
        None
    );
    bound.pass.set_settings(settings.clone()).unwrap();
    bound.pass.set_lights(light(-0.7)).unwrap();
    // Another size of the same meshes is planned from the same tables.
    let larger = bound.pass.plan().builder().image_size(64, 48);
    let again = plan.clone().settings(Settings { width: 64, height: 48, ..settings.clone() }).lights(light(-0.7));
    assert_eq!(difference(&fresh(&engine, larger), &fresh(&engine, again)), None);

    // Storing a foreground uses the present background colour, even if the image was bound before it changed.
    let size = bound.pass.plan().image_size();
    let mut store = |color: [f64; 3]| {
        let bytes = after_store(&engine, ImageFormat::Rgba32Float, size, |target| {
            let image = FrameImage::Foreground { premultiplied: true, srgb: false };
            let image = bound.pass.bind_image(image, 0, target).unwrap();
            bound.pass.set_settings(Settings { background_color: color, ..settings.clone() }).unwrap();
            let pass = &bound.pass;
            move |commands: &mut HostCommands| {
                pass.record_forward(commands).unwrap();
                pass.record_store(commands, &image).unwrap();
            }
        });
        bytemuck::pod_collect_to_vec::<u8, f32>(&bytes)
    };
    let (blue, red) = (store([0.0, 0.0, 1.0]), store([1.0, 0.0, 0.0]));
    assert!(blue.iter().zip(&red).all(|(a, b)| (a - b).abs() < 1e-5));
    drop(bound);
    drop(rasterizer);
    assert_silent(engine);
}

/// Near and far are those of the matrices, when planned and when these change.
#[test]
fn planes_are_those_of_the_matrices() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::cube().unwrap();
    let case = case(&model);
    // Columns: looking along -z, depths 0 to 1, y up.
    let projection = |near: f64, far: f64| {
        let (a, b) = (far / (near - far), near * far / (near - far));
        [[2.0, 0.0, 0.0, 0.0], [0.0, 2.5, 0.0, 0.0], [0.0, 0.0, a, -1.0], [0.0, 0.0, b, 0.0]]
    };
    let view = DMat4::from_translation(DVec3::new(-0.1, -0.2, -3.0)).to_cols_array_2d();
    let matrices = |projection| CameraMatrices { view, projection };
    let nearest = 3.0 - model.positions().iter().fold(-1.0f64, |most, p| most.max(p[2].into()));
    let plan = |near, far| {
        let plan = rasterizer.pass(&[pass_mesh(&model)]).settings(case.settings.clone());
        plan.camera_matrices(&[matrices(projection(near, far))], ClipSpace { y_up: true, ..ClipSpace::default() })
    };
    let fresh = |plan: PassBuilder| Bound::new(&engine, &rasterizer, &model, plan).color(&engine);
    let mut bound = Bound::new(&engine, &rasterizer, &model, plan(0.1, 10.0));
    let near = bound.color(&engine);
    assert_eq!(difference(&near, &fresh(plan(0.1, 10.0).planes(0.1, 10.0))), None);
    let cut = fresh(plan(nearest + 0.2, 10.0));
    assert!(difference(&near, &cut).is_some());
    let clip = ClipSpace { y_up: true, ..ClipSpace::default() };
    bound.pass.set_camera_matrices(&[matrices(projection(nearest + 0.2, 10.0))], clip).unwrap();
    assert_eq!(difference(&bound.color(&engine), &cut), None);
    // Planes of earlier matrices leave no trace.
    let endless =
        || matrices([projection(0.1, 9.0)[0], projection(0.1, 9.0)[1], [0.0, 0.0, -1.0, -1.0], [0.0, 0.0, -0.1, 0.0]]);
    bound.pass.set_camera_matrices(&[matrices(projection(0.1, 2.9))], clip).unwrap();
    bound.pass.set_camera_matrices(&[endless()], clip).unwrap();
    let far_away = fresh(plan(0.1, 10.0).camera_matrices(&[endless()], clip));
    assert_eq!(difference(&bound.color(&engine), &far_away), None);
    assert_eq!(difference(&fresh(bound.pass.plan().builder()), &far_away), None);
    bound.pass.set_camera_matrices(&[matrices(projection(nearest + 0.2, 2.9))], clip).unwrap();
    bound.pass.set_cameras(&case.cameras).unwrap();
    assert_eq!(difference(&bound.color(&engine), &fresh(plan(0.1, 10.0).cameras(&case.cameras))), None);
    let (by_depth, at_eye) = (-0.1, 0.5);
    let parallel = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, by_depth, 0.0], [0.0, 0.0, at_eye, 1.0]];
    let behind = rasterizer.pass(&[pass_mesh(&model)]).camera_matrices(&[matrices(parallel)], clip);
    assert!(error(behind.clone().build()).contains("near plane = -5"));
    assert_eq!(error(behind.planes(0.5, 5.0).build()), "no error");
    drop(bound);
    drop(rasterizer);
    assert_silent(engine);
}

/// Every gradient that a pass computes can be read by its host, and is the simple API's.
#[test]
fn gradients_are_decoded_from_what_was_read_back() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::icosphere(1).unwrap();
    let mut case = case(&model);
    case.scene.lights = Lights::official();
    let wanted = GradientRequest { texels: false, uvs: false, ..GradientRequest::ALL };
    let upstream = random_upstream(&case, case.settings.outputs);
    let mut simple = renderer();
    let frame = simple.render(&case.scene, &case.cameras, &case.settings).unwrap();
    let expected = simple.backward(&frame, &upstream, &wanted).unwrap();
    let mesh = PassMesh::new(model.positions().len() as u32, indices(&model));
    let plan = builder(&rasterizer, &[mesh], &case).lights(Lights::official()).gradients(wanted).inside_planes();
    let read = |ids: &[PassBuffer]| {
        let mut bound = Bound::new(&engine, &rasterizer, &model, plan.clone().read_back(ids));
        bound.memory.write_upstream(&bound.pass, &upstream);
        run(&engine, &bound.pass);
        bound.pass.decode_gradients(bound.memory.readback.bytes()).unwrap()
    };
    let all = read(&[PassBuffer::Totals, PassBuffer::VertexGradients]);
    assert_eq!(crate::common::gradient::same_gradient_bits(&all, &expected), Ok(()));
    let totals = read(&[PassBuffer::Totals]);
    assert_eq!((totals.cameras, totals.lights), (expected.cameras, expected.lights));
    assert!(totals.meshes[0].positions.is_empty());
    drop(simple);
    drop(rasterizer);
    assert_silent(engine);
}

/// Indices that only the device knows never lead outside the mesh, whatever they are.
#[test]
fn indices_out_of_range_stay_in_their_mesh() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let model = shapes::cube().unwrap();
    let case = case(&model);
    let vertices = storage(&engine, bytemuck::cast_slice(model.positions()));
    let last = model.positions().len() as u32 - 1;
    let color = |out: u32| {
        let wild: Vec<u32> =
            indices(&model).iter().enumerate().map(|(i, &v)| if i % 5 == 0 { out } else { v }).collect();
        let on_device = storage(&engine, bytemuck::cast_slice(&wild));
        let plan = builder(&rasterizer, &[pass_mesh(&model)], &case).gradients(GradientRequest::default());
        let plan = plan.build().unwrap();
        let mut memory = Memory::new(&engine, &plan);
        let buffers = MeshBuffers {
            indices: Some((on_device.whole(), IndexFormat::Uint32)),
            ..MeshBuffers::new(vertices.whole(), PACKED)
        };
        let pass = bind(&rasterizer, &plan, &mut memory, &[buffers]);
        run(&engine, &pass);
        assert_eq!(pass.status(memory.readback.bytes()).unwrap(), PassStatus::Whole);
        memory.floats(&pass, PassBuffer::Color)
    };
    let expected = color(last);
    for out in [last + 1, 1 << 20, u32::MAX] {
        assert_eq!(difference(&color(out), &expected), None, "{out}");
    }
    drop((vertices, rasterizer));
    assert_silent(engine);
}

/// Passes of one queue may have one workspace: each frame is the same as in a workspace of its own. And a frame's cameras may be
/// copied into the upload buffer by the host, between two frames of one submission.
#[test]
fn passes_share_a_workspace_and_cameras_come_by_a_copy() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let (model, other) = (shapes::cube().unwrap(), shapes::icosphere(2).unwrap());
    let case = case(&model);
    let angles = |angle| Camera::from_angles(3.0, 20.0, angle, Projection::Perspective { fov_y: 0.8 }).unwrap();
    let plan_of = |model: &Mesh| {
        let plan = builder(&rasterizer, &[pass_mesh(model)], &case).gradients(GradientRequest::default());
        plan.usage(MemoryKind::Upload, vk::BufferUsageFlags::TRANSFER_DST).read_back(&[PassBuffer::Color])
    };
    let alone = |model: &Mesh, angle| {
        let mut bound = Bound::new(&engine, &rasterizer, model, plan_of(model).cameras(&[angles(angle)]));
        bound.color(&engine)
    };
    let mut one = Bound::new(&engine, &rasterizer, &model, plan_of(&model));
    let mut two = Bound::new(&engine, &rasterizer, &other, plan_of(&other));
    assert!(one.memory.device.whole().range() <= two.memory.device.whole().range());
    let refs = PassMemory { device: two.memory.device.whole(), ..one.memory.refs() };
    let plan = plan_of(&model).build().unwrap();
    let buffers = [MeshBuffers::new(one.vertices.whole(), PACKED)];
    let old = one.pass.rebind(plan, refs, &buffers).unwrap();
    for bound in [&mut one, &mut two] {
        bound.pass.write_inputs(bound.memory.upload.bytes_mut()).unwrap();
    }
    // Another camera, in a buffer of the host's.
    one.pass.set_cameras(&[angles(120.0)]).unwrap();
    let frame_bytes = one.pass.plan().frame_bytes();
    let mut bytes = vec![0; one.memory.upload.whole().range() as usize];
    one.pass.write_frame(&mut bytes).unwrap();
    let mut staged = engine.buffer(frame_bytes, vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu).unwrap();
    staged.write(0, &bytes[..frame_bytes as usize]);
    submit(&engine, |commands| {
        let copy = [vk::BufferCopy { src_offset: 0, dst_offset: 0, size: frame_bytes }];
        unsafe { engine.device().cmd_copy_buffer(commands.raw(), staged.raw, one.memory.upload.raw, &copy) };
        for bound in [&one, &two] {
            bound.pass.record_setup(commands).unwrap();
            bound.pass.record_forward(commands).unwrap();
            bound.pass.record_backward(commands).unwrap();
        }
    });
    for (bound, expected) in [(&one, alone(&model, 120.0)), (&two, alone(&other, 30.0))] {
        let (at, size) = bound.pass.plan().readback_part(PassBuffer::Color).unwrap();
        assert_eq!(
            difference(&bound.memory.readback.floats(at, size as usize / 4), &expected[..size as usize / 4]),
            None
        );
    }
    drop((old, staged, one, two));
    drop(rasterizer);
    assert_silent(engine);
}
