//! Offsets of a host's buffers: what the device's limits ask for is checked where a buffer comes in, before Vulkan sees it.

use super::facade::Scenery;
use super::geometry::{POSITION, VERTEX, storage};
use crate::common::gradient::random_upstream;
use crate::common::scenes::{Kind, random_case};
use crate::host::{Host, Memory, assert_silent, engine, plan_backward, plan_of, rasterizer};
use gpu_allocator::MemoryLocation;
use softras::embed::{BufferRef, Counts, GeometryGradients, PassBuffer, PassMemory, Requirements};
use softras::{Error, GradientRequest};

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

/// Every buffer that a host may use, one after the other, in a buffer of the host's own.
#[test]
fn every_buffer_of_a_pass_lies_as_its_plan_says() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let case = random_case(0, Kind::Plain);
    let upstream = random_upstream(&case, case.settings.outputs);
    let plan = plan_backward(plan_of(&rasterizer, &case), &upstream, GradientRequest::default());
    let host = Host::new(&engine, &rasterizer, plan.clone());
    let mut tried = 0;
    for id in PassBuffer::ALL.iter().copied().filter(|&id| host.pass.buffer(id).is_some()) {
        let plan = plan.clone().own_buffers(&[id]).build().unwrap();
        let memory = Memory::new(&engine, &plan);
        let [(_, requirement)] = plan.own_buffers() else { panic!("{id} is not the host's") };
        let size = requirement.size + 2 * requirement.alignment;
        let buffer = engine.buffer(size, requirement.usage, MemoryLocation::GpuToCpu).unwrap();
        let bind = |by: u64| {
            let own = [(id, buffer.whole().part(by, buffer.whole().range() - by).unwrap())];
            rasterizer.bind_pass(plan.clone(), PassMemory { own: &own, ..memory.refs() }, &[]).map(drop)
        };
        for by in [1, 4, requirement.alignment / 2] {
            assert_misaligned(bind(by), id.name());
        }
        bind(requirement.alignment).unwrap();
        tried += 1;
    }
    assert!(tried >= 5, "{tried} buffers");
    drop((host, rasterizer));
    assert_silent(engine);
}

/// The other buffers of a host: vertices, gradients and counts, and the three buffers of a pass. The multiples are
/// those that the device itself names.
#[test]
fn offsets_of_a_hosts_own_buffers_are_multiples_of_the_devices_limits() {
    let engine = engine();
    let rasterizer = rasterizer(&engine);
    let storage_alignment =
        Requirements::new().validate(&engine.host_adapter()).unwrap().limits.storage_offset_alignment;
    let scenery = Scenery::new(&engine);
    let case = scenery.engines.case();
    let plan = rasterizer
        .pass(&scenery.meshes())
        .settings(case.settings.clone())
        .cameras(&case.cameras)
        .gradients(GradientRequest { colors: true, ..GradientRequest::default() })
        .build()
        .unwrap();
    let memory = Memory::new(&engine, &plan);
    let [room, gradients] =
        [0; 2].map(|_| storage(&engine, &vec![0; 4096 + VERTEX as usize * scenery.engines.vertices().len()]));
    let part = |whole: BufferRef, at: u64| whole.part(at, whole.range() - at).unwrap();
    let bind = |vertices_at: u64, gradients_at: u64| {
        let mut buffers = scenery.buffers(false);
        buffers[0].positions = (part(room.whole(), vertices_at), POSITION);
        buffers[0].gradients = GeometryGradients {
            positions: Some((part(gradients.whole(), gradients_at), POSITION)),
            ..Default::default()
        };
        rasterizer.bind_pass(plan.clone(), memory.refs(), &buffers).map(drop)
    };
    let mut counted = Host::new(&engine, &rasterizer, plan_of(&rasterizer, &case).device_counts());
    for by in [0u64, 1, 2, 4, 8, storage_alignment / 2, storage_alignment, 256] {
        let expected = |found: softras::Result<()>, name: &str| match by.is_multiple_of(storage_alignment.max(1)) {
            true => found.unwrap(),
            false => assert_misaligned(found, name),
        };
        expected(bind(by, 0), "positions");
        expected(bind(0, by), "the gradients");
        let counts = Counts { buffer: part(room.whole(), by), stride: 4, of_indices: false };
        expected(counted.pass.bind_counts(&counts), "counts");
    }

    let buffers = plan.memory().map(|needed| {
        engine.buffer(needed.size + 2 * needed.alignment, needed.usage, MemoryLocation::GpuToCpu).unwrap()
    });
    let bind = |which: usize, by: u64| {
        let mut refs = memory.refs();
        let given = [&mut refs.upload, &mut refs.device, &mut refs.readback];
        *given[which] = part(buffers[which].whole(), by);
        rasterizer.bind_pass(plan.clone(), refs, &scenery.buffers(false)).map(drop)
    };
    for (which, name) in ["upload", "device", "readback"].into_iter().enumerate() {
        let alignment = plan.memory()[which].alignment;
        for by in [1, 2, alignment / 2] {
            assert_misaligned(bind(which, by), name);
        }
        bind(which, alignment).unwrap();
    }
    drop((counted, buffers, memory, room, gradients, scenery, rasterizer));
    assert_silent(engine);
}
