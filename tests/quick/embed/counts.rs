//! Triangle counts that only the device knows, in one frame and in several in flight: images and gradients are the simple
//! API's, bit by bit, and nothing races from one submission to the next.

use super::devices::USUAL_LANES;
use crate::common::gradient::{random_upstream, same_gradient_bits};
use crate::common::scenes::{Case, Kind, random_case};
use crate::common::{renderer, tier, tolerance};
use crate::host::engine::{Buffer, Commands, Engine};
use crate::host::{Backward, Host, assert_silent, difference, engine, error, images, rasterizer, submit};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{Arena, BufferId, Counts, FrameBindings, FrameShape, Inputs, Requirements, Role, Status};
use softras::scene::{Appearance, Outputs, Shading};
use softras::{Camera, GradientRequest, Lights, Mesh, Projection, Scene, shapes};

/// An icosphere of 320 triangles from one or two sides.
fn case(distance: f64, lights: Lights, views: usize) -> Case {
    let mut case = random_case(2, Kind::Plain);
    let mesh = shapes::icosphere(2).unwrap();
    let color = |vertex: usize| [0, 1, 2].map(|c| (vertex * (c + 3) % 11) as f32 / 11.0);
    let colors = (0..mesh.positions().len()).map(color).collect();
    case.scene = Scene::new(mesh.with_appearance(Appearance::VertexColors(colors)).unwrap()).with_lights(lights);
    let camera = |a| Camera::from_angles(distance, 20.0, a, Projection::Perspective { fov_y: 0.8 }).unwrap();
    case.cameras = vec![camera(10.0), camera(130.0)];
    case.cameras.truncate(views);
    case.settings = softras::Settings {
        width: 40,
        height: 32,
        sigma: 1e-3,
        save: true,
        outputs: Outputs::ALL,
        ..Default::default()
    };
    case
}

fn smooth() -> Lights {
    Lights { shading: Shading::Smooth, ..Lights::official() }
}

/// The first triangles of a mesh.
fn first_triangles(case: &Case, count: usize) -> Scene {
    let mesh = &case.scene.meshes[0];
    let fewer = Mesh::new(mesh.positions().to_vec(), mesh.triangles()[..count].to_vec()).unwrap();
    let fewer = fewer.with_appearance(mesh.appearance().clone()).unwrap();
    Scene { meshes: vec![fewer], ..case.scene.clone() }
}

/// A count that only the device knows draws what a mesh of so many triangles draws, gradients included.
#[test]
fn a_count_that_only_the_device_knows_is_drawn() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut simple = renderer();
    // Whole, and cut by the near plane. Of two views the flat light's rows lie, and are summed, in another order.
    let kinds = [(3.0, Lights::official(), 1), (1.2, Lights::official(), 2), (3.0, smooth(), 2)];
    for (distance, lights, views) in kinds.into_iter().take(tier(2, 3)) {
        let case = case(distance, lights, views);
        let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        shape.device_counts = true;
        let host = Host::of_shape(&engine, &rasterizer, &case, &shape);
        let upstream = random_upstream(&case, case.settings.outputs);
        let wanted = GradientRequest { uvs: false, texels: false, lights: views == 1, ..GradientRequest::ALL };
        let backward = Backward::new(&engine, &rasterizer, &host, &upstream, wanted);
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut word = engine.buffer(16, usage, MemoryLocation::CpuToGpu).unwrap();
        let at = word.whole().part(0, 4).unwrap();
        let bind = |of_indices| {
            let counts = Counts { buffer: at, stride: 4, of_indices };
            rasterizer.bind_counts(&host.plan, &host.bindings, &counts).unwrap()
        };
        // More than there is first, so that the frames of fewer find what they must not look at.
        for (count, of_indices) in [(1000, false), (600, true), (57, false), (320, false)] {
            word.write(0, bytemuck::bytes_of(&(count as u32)));
            let counts = bind(of_indices);
            submit(&engine, |commands| {
                rasterizer.record_counts(commands, &counts).unwrap();
                rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap();
                backward.record(&rasterizer, commands);
            });
            assert_eq!(host.status().validate(&host.plan).unwrap(), None);
            let live = if of_indices { count / 3 } else { count }.min(320);
            let scene = first_triangles(&case, live);
            let frame = simple.render(&scene, &case.cameras, &case.settings).unwrap();
            let due = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
            for ((name, image), due) in images(&case, &host).iter().zip(due) {
                assert_eq!(difference(image, &due.unwrap().data), None, "{name} of {live}");
            }
            let due = simple.backward(&frame, &upstream, &wanted).unwrap();
            let made = backward.decode(&host, &case, &scene);
            assert_eq!(same_gradient_bits(&due, &made), Ok(()), "{live} at {distance}");
        }
        let misfit = |counts| error(rasterizer.bind_counts(&host.plan, &host.bindings, &counts));
        assert!(misfit(Counts { buffer: at, stride: 3, of_indices: false }).contains("multiple of four"));
        // More than is needed is enough.
        let roomy = Counts { buffer: word.whole(), stride: 12, of_indices: false };
        rasterizer.bind_counts(&host.plan, &host.bindings, &roomy).unwrap();
        let plain = Host::new(&engine, &rasterizer, &case);
        let counts = Counts { buffer: at, stride: 4, of_indices: false };
        let unplanned = error(rasterizer.bind_counts(&plain.plan, &plain.bindings, &counts));
        assert!(unplanned.contains("device_counts"), "{unplanned}");
        // A frame that was bound for less than is planned.
        let mut larger = case.settings.clone();
        larger.height *= 4;
        let larger = rasterizer.plan(&shape, &larger).unwrap();
        assert!(error(rasterizer.bind_counts(&larger, &host.bindings, &counts)).contains("bytes is bound"));
    }
    drop(rasterizer);
    assert_silent(engine);
}

#[test]
fn counts_of_several_meshes_lie_a_stride_apart() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut case = case(3.0, Lights::official(), 2);
    case.scene.meshes.push(case.scene.meshes[0].clone());
    let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    shape.device_counts = true;
    let host = Host::of_shape(&engine, &rasterizer, &case, &shape);
    let mut words = engine.buffer(16, vk::BufferUsageFlags::STORAGE_BUFFER, MemoryLocation::CpuToGpu).unwrap();
    // The words between are not counts.
    words.write(0, bytemuck::bytes_of(&[57u32, 9, 9, 200]));
    let bind = |bytes| {
        let counts = Counts { buffer: words.whole().part(0, bytes).unwrap(), stride: 12, of_indices: false };
        rasterizer.bind_counts(&host.plan, &host.bindings, &counts)
    };
    let message = error(bind(12));
    assert!(message.contains("2 counts 12 bytes apart in 12 bytes"), "{message}");
    let counts = bind(16).unwrap();
    submit(&engine, |commands| {
        rasterizer.record_counts(commands, &counts).unwrap();
        rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap();
    });
    let mut scene = first_triangles(&case, 57);
    scene.meshes.extend(first_triangles(&case, 200).meshes);
    let frame = renderer().render(&scene, &case.cameras, &case.settings).unwrap();
    let due = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    // The two frames' kernels are compiled for other constants. With other vectors than usual that moves a last place.
    let device = Requirements::new().validate(&engine.host_adapter()).unwrap();
    let has_usual_lanes = device.limits.subgroup_size == USUAL_LANES;
    let is_off = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance::BY_HAND as f32 * b.abs().max(1.0);
    for ((name, image), due) in images(&case, &host).iter().zip(due) {
        let due = &due.unwrap().data;
        assert!(image.len() == due.len() && !image.iter().zip(due).any(is_off), "{name}");
        assert!(!has_usual_lanes || difference(image, due).is_none(), "{name}");
    }
    drop((host, rasterizer));
    assert_silent(engine);
}

/// One of two frames in flight: what it does not share.
struct Flight {
    commands: Commands,
    arena: Arena,
    buffer: Buffer,
    forward: FrameBindings,
}

const COUNTS: [u32; 6] = [5, 320, 40, 1000, 0, 177];

/// Every frame a copy writes the count that the frame reads; its status is looked at when its memory is used again.
#[test]
fn frames_in_flight_are_each_their_own() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case(3.0, Lights::official(), 1);
    let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    shape.device_counts = true;
    let plan = rasterizer.plan(&shape, &case.settings).unwrap();
    let is_input = |id: BufferId| plan.buffer(id).is_some_and(|b| b.role == Role::Input);
    let inputs = Arena::of(plan.buffers().iter().filter(|b| is_input(b.id)));
    let mut shared = engine.buffer(inputs.size, inputs.usage, MemoryLocation::CpuToGpu).unwrap();
    for (name, bytes) in Inputs::new(&case.scene, &case.cameras, &case.settings, &plan).all() {
        if let Some((offset, _)) = inputs.part(name) {
            shared.write(offset, bytes);
        }
    }
    let mut script = engine.buffer(24, vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu).unwrap();
    script.write(0, bytemuck::cast_slice(&COUNTS));
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
    let word = engine.buffer(4, usage, MemoryLocation::GpuOnly).unwrap();
    let counts = Counts { buffer: word.whole(), stride: 4, of_indices: false };
    let flights = [0, 1].map(|_| {
        let arena = Arena::of(plan.buffers().iter().filter(|b| !is_input(b.id)));
        let buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
        let mut refs = inputs.refs(&shared.whole()).unwrap();
        refs.extend(arena.refs(&buffer.whole()).unwrap());
        let forward = rasterizer.bind(&plan, &refs).unwrap();
        Flight { commands: engine.commands().unwrap(), arena, buffer, forward }
    });
    let counted = flights.each_ref().map(|f| rasterizer.bind_counts(&plan, &f.forward, &counts).unwrap());
    let mut simple = renderer();
    for frame in 0..COUNTS.len() + 2 {
        let Flight { commands, arena, buffer, forward } = &flights[frame % 2];
        let raw = commands.begin().unwrap();
        if let Some(&count) = frame.checked_sub(2).and_then(|last| COUNTS.get(last)) {
            let part = |id: BufferId| &buffer.bytes()[arena.part(id).unwrap().0 as usize..];
            let status = Status::from_bytes(part(BufferId::Status).first_chunk().unwrap());
            assert_eq!(status.validate(&plan).unwrap(), None);
            let due = simple.render(&first_triangles(&case, 320.min(count as usize)), &case.cameras, &case.settings);
            let depth = due.unwrap().depth().unwrap().data.clone();
            assert_eq!(part(BufferId::Depths)[..4 * depth.len()], *bytemuck::cast_slice::<f32, u8>(&depth), "{count}");
        }
        if frame < COUNTS.len() {
            let copy = [vk::BufferCopy { src_offset: 4 * frame as u64, dst_offset: 0, size: 4 }];
            unsafe { engine.device().cmd_copy_buffer(raw, script.raw, word.raw, &copy) };
            let mut host = commands.host();
            rasterizer.record_counts(&mut host, &counted[frame % 2]).unwrap();
            rasterizer.record_forward(&mut host, &plan, forward).unwrap();
            to_host(&engine, raw);
        }
        engine.submit(commands).unwrap();
    }
    engine.wait_idle().unwrap();
    drop((counted, flights, shared, script, word, rasterizer));
    assert_silent(engine);
}

fn to_host(engine: &Engine, commands: vk::CommandBuffer) {
    use vk::{AccessFlags as A, PipelineStageFlags as S};
    let barrier = [vk::MemoryBarrier::default().src_access_mask(A::SHADER_WRITE).dst_access_mask(A::HOST_READ)];
    let none = vk::DependencyFlags::empty();
    unsafe { engine.device().cmd_pipeline_barrier(commands, S::COMPUTE_SHADER, S::HOST, none, &barrier, &[], &[]) };
}
