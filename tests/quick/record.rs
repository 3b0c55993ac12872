//! Recording a frame and its gradients takes no heap allocation at all.

use crate::heap::allocations;
use crate::host::{assert_silent, engine};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::embed::{Layout as Lie, MeshBuffers, PassBuffer, PassMemory, PassMesh, Rasterizer};
use softras::{Camera, GradientRequest, Lights, Projection, Settings, shapes};

#[test]
fn an_allocation_is_counted() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1; 10].clone()))), 2);
}

/// A pass's setup, frame and gradients, into a host's own vertices and into the readback buffer. The gate repeats it under the
/// validation layers.
#[test]
fn recording_a_pass_allocates_nothing() {
    let engine = engine();
    let rasterizer = Rasterizer::new(&engine.host_device()).unwrap();
    let mesh = shapes::icosphere(2).unwrap();
    let cameras =
        [0.0, 90.0].map(|a| Camera::from_angles(3.0, 20.0, a, Projection::Perspective { fov_y: 1.0 }).unwrap());
    let vertices = mesh.positions().len();
    let plan = rasterizer
        .pass(&[PassMesh::new(vertices as u32, mesh.triangles().as_flattened())])
        .settings(Settings { sigma: 1e-4, ..Settings::default() })
        .cameras(&cameras)
        .lights(Lights::official())
        .gradients(GradientRequest::ALL)
        .read_back(&[PassBuffer::Color, PassBuffer::Totals])
        .build()
        .unwrap();
    let memory = plan.memory().map(|m| engine.buffer(m.size, m.usage, MemoryLocation::CpuToGpu).unwrap());
    let [upload, device, readback] = memory.each_ref().map(|buffer| buffer.whole());
    let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
    let [source, target] =
        [0; 2].map(|_| engine.buffer(12 * vertices as u64, storage, MemoryLocation::GpuOnly).unwrap());
    let packed = Lie { stride: 12, offset: 0 };
    let mut buffers = MeshBuffers::new(source.whole(), packed);
    buffers.gradients.positions = Some((target.whole(), packed));
    let memories = PassMemory { upload, device, readback, own: &[] };
    let pass = rasterizer.bind_pass(plan, memories, &[buffers]).unwrap();
    let frame = engine.commands().unwrap();
    frame.begin().unwrap();
    let mut commands = frame.host();
    let count = allocations(|| {
        for _ in 0..10 {
            pass.record_setup(&mut commands).unwrap();
            pass.record_forward(&mut commands).unwrap();
            pass.record_backward(&mut commands).unwrap();
        }
    });
    assert_eq!(count, 0);
    drop((frame, pass, memory, source, target, rasterizer));
    assert_silent(engine);
}
