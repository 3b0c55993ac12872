//! Safe code cannot make this folder break a rule: what would be undefined behaviour is an error, on either side.

use super::{Outcome, PUSH, SelfTest, context, error};
use crate::Error;
use crate::vulkan::{
    Buffer, BufferDesc, CommandBuffer, Context, DescriptorPool, Location, Pipeline, TexelFormat, TimestampPool,
    kernels, vk,
};

const SIZE: u64 = 1 << 20;

/// A buffer that the host maps on every device.
fn mapped(context: &Context) -> crate::Result<Buffer> {
    Buffer::new(context, &BufferDesc { name: "mapped", size: SIZE, location: Location::Readback, ..Default::default() })
}

/// Commands that fill a buffer with a word, many times.
fn fills(context: &Context, buffer: &Buffer, word: u32) -> crate::Result<CommandBuffer> {
    let mut commands = CommandBuffer::new(context, "fills")?;
    commands.record(|recorder| {
        for word in [!word; 50].into_iter().chain([word]) {
            recorder.fill(buffer.whole(), 0, SIZE, word)?;
            recorder.barrier();
        }
        recorder.barrier_to_host();
        Ok(())
    })?;
    Ok(commands)
}

#[test]
fn a_slice_of_a_mapping_and_pending_work_exclude_each_other() -> Outcome {
    let context = context()?;
    let mut buffer = mapped(&context)?;
    let mut commands = fills(&context, &buffer, 7)?;
    let slice = buffer.bytes(0, 16)?;
    let refused = error(commands.submit());
    assert!(refused.contains("`mapped`") && refused.contains("slice"), "{refused}");
    drop(slice);
    commands.submit()?;
    for refused in [error(buffer.bytes(0, 16)), error(buffer.bytes_mut(0, 16))] {
        assert!(refused.contains("`mapped`") && refused.contains("pending"), "{refused}");
    }
    // A buffer may be in several pending command buffers.
    let mut more = fills(&context, &buffer, 9)?;
    more.submit()?;
    commands.settle()?;
    assert!(buffer.bytes(0, 16).is_err(), "one of two is still pending");
    more.settle()?;
    assert!(buffer.bytes(0, SIZE)?.iter().step_by(4).all(|&byte| byte == 9));
    buffer.bytes_mut(0, 4)?.copy_from_slice(&[1, 2, 3, 4]);
    assert_eq!(buffer.bytes(0, 4)?[..], [1, 2, 3, 4]);
    // A slice that is leaked is never dropped.
    std::mem::forget(buffer.bytes(0, 16)?);
    assert!(error(commands.submit()).contains("slice"));
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

/// A buffer counts wherever commands name it: through a descriptor set, a texel view, and in the command buffer that is
/// submitted before.
#[test]
fn every_way_to_name_a_buffer_is_seen() -> Outcome {
    let context = context()?;
    let desc =
        |texels| BufferDesc { name: "mapped", size: 48_000, location: Location::Upload, texels, ..Default::default() };
    let (texels, indices) =
        (Buffer::new(&context, &desc(Some(TexelFormat::Float4)))?, Buffer::new(&context, &desc(None))?);
    let records = Buffer::new(&context, &desc(None))?;
    let indices_usage = BufferDesc { usage: vk::BufferUsageFlags::UNIFORM_TEXEL_BUFFER, ..desc(None) };
    let viewed = Buffer::new(&context, &indices_usage)?;
    let test = SelfTest::new(&context)?;
    let view = viewed.whole().part(0, 4_000)?.with_texels(context.device(), TexelFormat::Uint, "view")?;
    let pool = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?;
    let parts = [("texels", texels.whole()), ("indices", &view), ("Records", records.whole())];
    let set = pool.bind(&test.pipeline, &parts)?;
    let mut before = CommandBuffer::new(&context, "before")?;
    before.record(|r| r.dispatch(&test.pipeline, &set, bytemuck::bytes_of(&PUSH), [1; 3]))?;
    let mut commands = fills(&context, &mapped(&context)?, 1)?;
    for buffer in [&texels, &viewed, &records] {
        let slice = buffer.bytes(0, 16)?;
        assert!(error(before.submit()).contains("slice"));
        assert!(error(commands.submit_and_wait_after(Some(&mut before))).contains("slice"));
        drop(slice);
        commands.submit_and_wait_after(Some(&mut before))?;
    }
    drop(indices);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn objects_of_another_device_are_refused() -> Outcome {
    let (ours, theirs) = (context()?, context()?);
    let (mine, other) = (mapped(&ours)?, mapped(&theirs)?);
    let mut commands = CommandBuffer::new(&ours, "ours")?;
    let (mine, other) = (mine.whole(), other.whole());
    let pool = TimestampPool::new(theirs.device(), theirs.queue_family(), 2)?;
    let mut refused = vec![
        error(commands.record(|r| r.copy(mine, 0, other, 0, 16))),
        error(commands.record(|r| r.copy(other, 0, mine, 0, 16))),
        error(commands.record(|r| r.fill(other, 0, 16, 1))),
        error(commands.record(|r| r.update(other, 0, &[0; 16]))),
        error(Pipeline::new(ours.device(), &kernels::SELFTEST, &[], Some(theirs.pipeline_cache()))),
    ];
    let test = SelfTest::new(&ours)?;
    let set = DescriptorPool::new(ours.device(), &[&kernels::SELFTEST])?;
    let parts = [("texels", test.texels.whole()), ("indices", test.indices.whole()), ("Records", other)];
    refused.push(error(set.bind(&test.pipeline, &parts)));
    if let Some(pool) = pool {
        refused.push(error(commands.record(|r| r.reset_timestamps(&pool))));
    }
    commands.record(|r| r.fill(mine, 0, 16, 2))?;
    let mut before = CommandBuffer::new(&theirs, "theirs")?;
    before.record(|r| r.fill(other, 0, 16, 3))?;
    refused.push(error(commands.submit_and_wait_after(Some(&mut before))));
    for refused in refused {
        assert!(refused.contains("another device"), "{refused}");
    }
    for context in [ours, theirs] {
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
    Ok(())
}

#[test]
fn usages_and_sizes_are_validated() -> Outcome {
    let context = context()?;
    for usage in [
        vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
        vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR,
        vk::BufferUsageFlags::from_raw(1 << 30),
    ] {
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER | usage;
        let refused = error(Buffer::new(&context, &BufferDesc { name: "odd", size: 64, usage, ..Default::default() }));
        assert!(refused.contains("`odd`") && refused.contains("usage"), "{refused}");
    }
    let endless = Buffer::new(&context, &BufferDesc { size: u64::MAX, ..Default::default() });
    assert!(matches!(endless, Err(Error::Limit { needed: u64::MAX, .. })), "{endless:?}");
    let empty = Pipeline::new(context.device(), &kernels::SELFTEST, &[("local_size_x", 0u32.into())], None);
    assert!(error(empty).contains("without invocations"));

    // The kernel reads floats where the buffer's texels are integers.
    let test = SelfTest::new(&context)?;
    let pool = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?;
    let indices = test.indices.whole();
    let refused = error(
        pool.bind(&test.pipeline, &[("texels", indices), ("indices", indices), ("Records", test.records.whole())]),
    );
    assert!(refused.contains("`texels`") && refused.contains("Uint"), "{refused}");
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn timestamps_are_written_once_in_order_and_read_afterwards() -> Outcome {
    let context = context()?;
    let Some(times) = TimestampPool::new(context.device(), context.queue_family(), 2)? else { return Ok(()) };
    assert!(error(times.read(2)).contains("NOT_READY"));
    let mut commands = CommandBuffer::new(&context, "times")?;
    assert!(error(commands.record(|r| r.timestamp(&times, 0))).contains("not reset"));
    let twice = commands.record(|r| {
        r.reset_timestamps(&times)?;
        r.timestamp(&times, 1)?;
        r.timestamp(&times, 1)
    });
    assert!(error(twice).contains("timestamp 1"));
    commands.record(|r| {
        r.reset_timestamps(&times)?;
        // A label that was never begun is not ended.
        r.end_label();
        (0..2).try_for_each(|i| r.timestamp(&times, i))
    })?;
    assert!(error(times.read(2)).contains("NOT_READY"), "nothing was executed");
    commands.submit_and_wait()?;
    assert_eq!(times.read(2)?.len(), 2);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}
