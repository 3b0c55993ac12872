//! "No message" of the validation layers means something only if a fault gives one.

use crate::engine::Engine;
use crate::selftest::{Outcome, PUSH, SelfTest};
use ash::vk;
use gpu_allocator::MemoryLocation;
use softras::internals::vulkan::{CacheFolder, CommandBuffer, Context, ContextOptions};

#[test]
fn a_missing_barrier_is_reported() -> Outcome {
    let context =
        Context::new(&ContextOptions { validation: true, cache: CacheFolder::Nowhere, ..Default::default() })?;
    let test = SelfTest::new(&context)?;
    let mut commands = CommandBuffer::new(&context, "hazard")?;
    commands.record(|recorder| {
        recorder.fill(test.records.whole(), 0, test.records.buffer().size(), 0)?;
        recorder.dispatch(&test.pipeline, &test.set, bytemuck::bytes_of(&PUSH), [1, 1, 1])
    })?;
    let messages = context.validation_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
    Ok(())
}

/// Needs a layer that looks from one submission to the next, which `VK_LAYER_ENABLES` turns on in that of Debian 12.
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
