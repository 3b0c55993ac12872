//! "No message" of the validation layers means something only if a fault gives one.

use crate::engine::Engine;
use crate::shim;
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::{CacheFolder, Camera, Error, Renderer, RendererOptions, Scene, Settings, shapes};

/// The layer checks commands when they are recorded, so the frame without barriers need not be executed.
#[test]
fn a_missing_barrier_is_reported() {
    let _turn = shim::lock();
    let (loader, cache) = (Some(shim::loader()), CacheFolder::Nowhere);
    let options = RendererOptions { validation: true, loader, cache, ..Default::default() };
    let mut renderer = Renderer::with_options(&options).unwrap();
    assert_eq!(renderer.validation_messages(), [""; 0]);
    shim::adapter::drop_barriers();
    shim::allow_submits(0);
    let frame = renderer.render(&Scene::new(shapes::cube().unwrap()), &[Camera::screen()], &Settings::default());
    assert!(matches!(frame, Err(Error::DeviceLost { .. })), "{frame:?}");
    let messages = renderer.validation_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
}

/// Needs checks across submissions. In the layer of Debian 12 the variable `VK_LAYER_ENABLES` turns them on.
#[test]
fn a_race_between_submissions_is_reported() {
    let engine = Engine::new(true).unwrap();
    let buffer = engine.buffer(64, vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuOnly).unwrap();
    let frames = [0, 1].map(|_| engine.commands().unwrap());
    for frame in &frames {
        let raw = frame.begin().unwrap();
        unsafe { engine.device().cmd_fill_buffer(raw, buffer.raw, 0, 64, 7) };
        engine.submit(frame).unwrap();
    }
    engine.wait_idle().unwrap();
    let said = engine.log().lock().unwrap().join("\n");
    assert!(said.contains("SYNC-HAZARD-WRITE-AFTER-WRITE"), "{said}");
}
