//! Triangle counts that only the device knows, in one frame and in several in flight: images and gradients are the simple
//! API's, bit by bit, and nothing races from one submission to the next.

use super::devices::USUAL_LANES;
use crate::common::gradient::{random_upstream, same_gradient_bits};
use crate::common::scenes::{Case, Kind, random_case};
use crate::common::{renderer, tier, tolerance};
use crate::host::engine::Engine;
use crate::host::{
    Host, assert_silent, difference, engine, error, images, plan_backward, plan_of, rasterizer, run, submit,
};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{Counts, Pass, PassBuffer, PassMesh, PassStatus, Requirements};
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

/// A count that only the device knows draws what a mesh with that count of triangles draws, gradients included.
#[test]
fn a_count_that_only_the_device_knows_is_drawn() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut simple = renderer();
    // A mesh that is whole, and one cut by near. With two views the flat light's rows are summed in another order.
    let kinds = [(3.0, Lights::official(), 1), (1.2, Lights::official(), 2), (3.0, smooth(), 2)];
    for (distance, lights, views) in kinds.into_iter().take(tier(2, 3)) {
        let case = case(distance, lights, views);
        let upstream = random_upstream(&case, case.settings.outputs);
        let wanted = GradientRequest { uvs: false, texels: false, lights: views == 1, ..GradientRequest::ALL };
        let plan = plan_backward(plan_of(&rasterizer, &case).device_counts(), &upstream, wanted);
        let mut host = Host::new(&engine, &rasterizer, plan).with_upstream(&upstream);
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut word = engine.buffer(16, usage, MemoryLocation::CpuToGpu).unwrap();
        let at = word.whole().part(0, 4).unwrap();
        // A count above the mesh's comes first, so that later frames find old data that they must not read.
        for (count, of_indices) in [(1000, false), (600, true), (57, false), (320, false)] {
            word.write(0, bytemuck::bytes_of(&(count as u32)));
            host.pass.bind_counts(&Counts { buffer: at, stride: 4, of_indices }).unwrap();
            run(&engine, &host.pass);
            assert_eq!(host.status(), PassStatus::Whole);
            let live = if of_indices { count / 3 } else { count }.min(320);
            let scene = first_triangles(&case, live);
            let frame = simple.render(&scene, &case.cameras, &case.settings).unwrap();
            let due = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
            for ((name, image), due) in images(&case, &host).iter().zip(due) {
                assert_eq!(difference(image, &due.unwrap().data), None, "{name} of {live}");
            }
            let due = simple.backward(&frame, &upstream, &wanted).unwrap();
            assert_eq!(same_gradient_bits(&due, &host.gradients()), Ok(()), "{live} at {distance}");
        }
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
    let mut host = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case).device_counts());
    let mut words = engine.buffer(16, vk::BufferUsageFlags::STORAGE_BUFFER, MemoryLocation::CpuToGpu).unwrap();
    // The words between are not counts.
    words.write(0, bytemuck::bytes_of(&[57u32, 9, 9, 200]));
    let counts = |bytes, stride| Counts { buffer: words.whole().part(0, bytes).unwrap(), stride, of_indices: false };
    host.pass.bind_counts(&counts(16, 12)).unwrap();
    run(&engine, &host.pass);
    let mut scene = first_triangles(&case, 57);
    scene.meshes.extend(first_triangles(&case, 200).meshes);
    let frame = renderer().render(&scene, &case.cameras, &case.settings).unwrap();
    let due = [frame.color(), frame.silhouette(), frame.depth(), frame.normal()];
    // The two frames' kernels differ in constants. With vector units of unusual width that changes a last place.
    let device = Requirements::new().validate(&engine.host_adapter()).unwrap();
    let has_usual_lanes = device.limits.subgroup_size == USUAL_LANES;
    let is_off = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance::BY_HAND as f32 * b.abs().max(1.0);
    for ((name, image), due) in images(&case, &host).iter().zip(due) {
        let due = &due.unwrap().data;
        assert!(image.len() == due.len() && !image.iter().zip(due).any(is_off), "{name}");
        assert!(!has_usual_lanes || difference(image, due).is_none(), "{name}");
    }

    // An error names a buffer that does not fit.
    let misfit = |pass: &mut Pass, counts| error(pass.bind_counts(&counts));
    let short = misfit(&mut host.pass, counts(12, 12));
    assert!(short.contains("2 counts 12 bytes apart in 12 bytes"), "{short}");
    assert!(misfit(&mut host.pass, counts(16, 3)).contains("multiple of four"));
    let mut plain = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case));
    assert!(misfit(&mut plain.pass, counts(16, 4)).contains("device_counts"));
    let uncounted = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case).device_counts());
    submit(&engine, |commands| {
        uncounted.pass.record_setup(commands).unwrap();
        assert!(error(uncounted.pass.record_forward(commands)).contains("bind_counts"));
    });
    let triangle = PassMesh::new(3, &[0u32, 1, 2]);
    let shared = rasterizer.pass(&[triangle.clone(), triangle]).cameras(&case.cameras).device_counts();
    assert!(error(shared.build()).contains("one mesh of one draw"));
    drop((host, plain, uncounted, rasterizer));
    assert_silent(engine);
}

const COUNTS: [u32; 6] = [5, 320, 40, 1000, 0, 177];

/// In every frame a copy writes the count that it reads. Its status is read when its memory is used again.
#[test]
fn frames_in_flight_are_each_their_own() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = case(3.0, Lights::official(), 1);
    let mut script = engine.buffer(24, vk::BufferUsageFlags::TRANSFER_SRC, MemoryLocation::CpuToGpu).unwrap();
    script.write(0, bytemuck::cast_slice(&COUNTS));
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
    let word = engine.buffer(4, usage, MemoryLocation::GpuOnly).unwrap();
    let flights = [0, 1].map(|_| {
        let plan = plan_of(&rasterizer, &case).device_counts().read_back(&[PassBuffer::Depths]);
        let mut host = Host::new(&engine, &rasterizer, plan);
        host.pass.bind_counts(&Counts { buffer: word.whole(), stride: 4, of_indices: false }).unwrap();
        submit(&engine, |commands| host.pass.record_setup(commands).unwrap());
        (engine.commands().unwrap(), host)
    });
    let mut simple = renderer();
    for frame in 0..COUNTS.len() + 2 {
        let (commands, host) = &flights[frame % 2];
        let raw = commands.begin().unwrap();
        if let Some(&count) = frame.checked_sub(2).and_then(|last| COUNTS.get(last)) {
            assert_eq!(host.status(), PassStatus::Whole);
            let due = simple.render(&first_triangles(&case, 320.min(count as usize)), &case.cameras, &case.settings);
            let depth = due.unwrap().depth().unwrap().data.clone();
            let (at, _) = host.pass.plan().readback_part(PassBuffer::Depths).unwrap();
            let found = host.memory.readback.floats(at, depth.len());
            assert_eq!(difference(&found, &depth), None, "{count}");
        }
        if frame < COUNTS.len() {
            let copy = [vk::BufferCopy { src_offset: 4 * frame as u64, dst_offset: 0, size: 4 }];
            unsafe { engine.device().cmd_copy_buffer(raw, script.raw, word.raw, &copy) };
            host.pass.record_forward(&mut commands.host()).unwrap();
            to_host(&engine, raw);
        }
        engine.submit(commands).unwrap();
    }
    engine.wait_idle().unwrap();
    drop((flights, script, word, rasterizer));
    assert_silent(engine);
}

fn to_host(engine: &Engine, commands: vk::CommandBuffer) {
    use vk::{AccessFlags as A, PipelineStageFlags as S};
    let barrier = [vk::MemoryBarrier::default().src_access_mask(A::TRANSFER_WRITE).dst_access_mask(A::HOST_READ)];
    let none = vk::DependencyFlags::empty();
    unsafe { engine.device().cmd_pipeline_barrier(commands, S::TRANSFER, S::HOST, none, &barrier, &[], &[]) };
}
