//! Offsets of a host's buffers: what the device's limits ask for is checked where a buffer comes in, before Vulkan sees it.

use super::facade::{Memory, Scenery};
use super::geometry::{POSITION, storage};
use crate::common::gradient::random_upstream;
use crate::common::scenes::{Kind, random_case};
use crate::host::{Backward, Host, assert_silent, engine, rasterizer};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    BufferId, BufferRef, Counts, FrameShape, Geometry, GeometryBuffers, GeometryGradients, Requirements,
};
use softras::{Error, GradientRequest};

/// The part of a buffer that lies `by` bytes further on.
fn moved(whole: &BufferRef, at: &BufferRef, by: u64) -> BufferRef {
    whole.part(at.offset() + by, at.range().min(whole.range() - at.offset() - by)).unwrap()
}

/// The offset of a named buffer was refused by a typed error.
#[track_caller]
fn assert_misaligned<T: std::fmt::Debug>(result: softras::Result<T>, name: &str) {
    let refused = result.map(drop).expect_err(name);
    let typed = matches!(refused, Error::Host { .. } | Error::Vulkan { .. });
    let text = refused.to_string();
    let told = text.contains("multiple of") || text.contains("misaligned");
    assert!(typed && told && text.contains(name), "{name}: {text}");
}

#[test]
#[should_panic(expected = "names_another")]
fn an_error_of_another_buffer_is_noticed() {
    let what = "buffer `b` lies at 3, no multiple of 16".to_string();
    assert_misaligned::<()>(Err(Error::Host { what, fix: String::new() }), "names_another");
}

/// Every buffer of a frame and of its gradients, one after the other, in one buffer of the host's.
#[test]
fn every_buffer_of_a_frame_lies_as_its_plan_says() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let mut case = random_case(0, Kind::Plain);
    case.settings.save = true;
    let host = Host::new(&engine, &rasterizer, &case);
    let upstream = random_upstream(&case, case.settings.outputs);
    let backward = Backward::new(&engine, &rasterizer, &host, &upstream, GradientRequest::default());
    let both = host.plan.buffers().iter().map(|r| (r, true)).chain(backward.plan.buffers().iter().map(|r| (r, false)));
    let mut tried = 0;
    for (requirement, is_frame) in both {
        let arena = if is_frame { &host.arena } else { &backward.arena };
        let size = arena.size + 2 * requirement.alignment;
        let buffer = engine.buffer(size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
        let refs = arena.refs(&buffer.whole()).unwrap();
        let bind = |by: u64| {
            let moved = |(id, at): &(BufferId, BufferRef)| match *id == requirement.id {
                true => (*id, moved(&buffer.whole(), at, by)),
                false => (*id, *at),
            };
            let refs: Vec<_> = refs.iter().map(moved).collect();
            match is_frame {
                true => rasterizer.bind(&host.plan, &refs).map(drop),
                false => rasterizer.bind_backward(&backward.plan, &host.bindings, &refs).map(drop),
            }
        };
        for by in [1, 4, requirement.alignment / 2] {
            assert_misaligned(bind(by), requirement.id.name());
        }
        bind(requirement.alignment).unwrap();
        tried += 1;
    }
    assert!(tried > 20, "{tried} buffers");
    drop((backward, host, rasterizer));
    assert_silent(engine);
}

/// What a host gives besides: tables of draws, which are read as texels, vertices and counts, which are storage, and the three
/// buffers of a pass. The multiples are those that the device itself names.
#[test]
fn offsets_of_a_hosts_own_buffers_are_multiples_of_the_devices_limits() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let limits = Requirements::new().validate(&engine.host_adapter()).unwrap().limits;
    let scenery = Scenery::new(&engine);
    let case = scenery.engines.case();
    let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
    shape.device_counts = true;
    let host = Host::of_shape(&engine, &rasterizer, &case, &shape);
    let upstream = random_upstream(&case, case.settings.outputs);
    let backward = Backward::new(&engine, &rasterizer, &host, &upstream, GradientRequest::default());

    let geometry = Geometry::new(scenery.engines.draws.clone()).unwrap();
    let (table, vertices) = (geometry.table(), scenery.engines.vertices());
    let texels = vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER;
    let draws = engine.buffer(4096, texels, MemoryLocation::CpuToGpu).unwrap();
    let [room, gradients] = [4096, 0].map(|more| storage(&engine, &vec![0; more + 4096 + 40 * vertices.len()]));
    let transforms = Some((scenery.transforms.whole(), super::geometry::TRANSFORM));
    let bind = |draws_at: u64, vertices_at: u64, gradients_at: u64, counts_at: u64| -> softras::Result<()> {
        let part = |whole: BufferRef, at: u64| whole.part(at, whole.range() - at).unwrap();
        let buffers = GeometryBuffers {
            draws: part(draws.whole(), draws_at),
            positions: (part(room.whole(), vertices_at), POSITION),
            colors: None,
            indices: None,
            transforms,
        };
        let placed = rasterizer.bind_geometry(&geometry, &buffers, &host.bindings)?;
        let positions = Some((part(gradients.whole(), gradients_at), POSITION));
        let back = GeometryGradients { positions, ..Default::default() };
        rasterizer.bind_geometry_gradients(&placed, &back, &backward.bindings)?;
        let counts = Counts { buffer: part(room.whole(), counts_at), stride: 4, of_indices: false };
        rasterizer.bind_counts(&host.plan, &host.bindings, &counts).map(drop)
    };
    assert!(table.len() * 32 < 2048);
    let (texel, storage) = (limits.texel_offset_alignment, limits.storage_offset_alignment);
    for by in [0u64, 1, 2, 4, 8, texel / 2, storage / 2, texel, storage, 256] {
        let expected =
            |alignment: u64, found: softras::Result<()>, name: &str| match by.is_multiple_of(alignment.max(1)) {
                true => found.unwrap(),
                false => assert_misaligned(found, name),
            };
        expected(texel, bind(by, 0, 0, 0), "draws");
        expected(storage, bind(0, by, 0, 0), "positions");
        expected(storage, bind(0, 0, by, 0), "the gradients");
        expected(storage, bind(0, 0, 0, by), "Counts");
    }
    drop((backward, host));

    let plan = rasterizer
        .pass(&scenery.meshes())
        .settings(case.settings.clone())
        .cameras(&case.cameras)
        .gradients(GradientRequest { colors: true, ..GradientRequest::default() })
        .build()
        .unwrap();
    let memory = Memory::new(&engine, &plan);
    let buffers = plan.memory().map(|needed| {
        engine.buffer(needed.size + 2 * needed.alignment, needed.usage, MemoryLocation::GpuToCpu).unwrap()
    });
    let bind = |which: usize, by: u64| {
        let mut refs = memory.refs();
        let given = [&mut refs.upload, &mut refs.device, &mut refs.readback];
        *given[which] = buffers[which].whole().part(by, buffers[which].whole().range() - by).unwrap();
        rasterizer.bind_pass(plan.clone(), refs, &scenery.buffers(false)).map(drop)
    };
    for (which, name) in ["upload", "device", "readback"].into_iter().enumerate() {
        let alignment = plan.memory()[which].alignment;
        for by in [1, 2, alignment / 2] {
            assert_misaligned(bind(which, by), name);
        }
        bind(which, alignment).unwrap();
    }
    drop((buffers, memory, draws, room, gradients, scenery, rasterizer));
    assert_silent(engine);
}
