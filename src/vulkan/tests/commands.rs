//! A small kernel runs end to end with nothing said by the validation layer, reflection
//! knows the layouts, misuse and limits are errors, and objects may be dropped in any order.

use super::super::kernel::Member;
use super::{COUNT, LOCAL, Outcome, PUSH, Record, SelfTest, context, error, texel};
use crate::vulkan::{
    BindingKind, Buffer, BufferDesc, BufferPart, BufferRef, CacheFolder, CommandBuffer, Context, ContextOptions,
    DescriptorPool, Device, HostAdapter, HostCommands, HostDevice, Location, Pipeline, Recorder, SpecValue,
    TexelFormat, TimestampPool, kernels,
};

#[test]
fn a_kernel_runs_end_to_end() -> Outcome {
    let context = context()?;
    let log = context.validation_log();
    let test = SelfTest::new(&context)?;
    let mut commands = CommandBuffer::new(&context, "self test")?;
    commands.record(|recorder| test.record(recorder))?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    // Recorded once, submitted often; then recorded anew.
    commands.submit_and_wait()?;
    commands.record(|recorder| {
        recorder.fill(test.records.whole(), 0, test.records.size(), 0)?;
        recorder.barrier();
        test.record(recorder)
    })?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    drop((context, test, commands));
    assert_eq!(log.messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn fill_copy_and_timestamps() -> Outcome {
    let context = context()?;
    let test = SelfTest::new(&context)?;
    let arguments = Buffer::new(&context, &BufferDesc { name: "arguments", size: 32, ..Default::default() })?;
    let host = BufferDesc { name: "host", size: 32, location: Location::Readback, ..Default::default() };
    let host = Buffer::new(&context, &host)?;
    let times = TimestampPool::new(context.device(), context.queue_family(), 3)?;
    let mut commands = CommandBuffer::new(&context, "fill and copy")?;
    commands.record(|recorder| {
        if let Some(times) = &times {
            recorder.reset_timestamps(times)?;
            recorder.timestamp(times, 0)?;
        }
        recorder.fill(arguments.whole(), 4, 4, COUNT.div_ceil(LOCAL))?;
        recorder.fill(arguments.whole(), 8, 8, 1)?;
        recorder.barrier();
        let groups = [COUNT.div_ceil(LOCAL), 1, 1];
        recorder.dispatch(&test.pipeline, &test.set, bytemuck::bytes_of(&PUSH), groups)?;
        // One without workgroups is not recorded, so it does not count.
        recorder.dispatch(&test.pipeline, &test.set, bytemuck::bytes_of(&PUSH), [0, 1, 1])?;
        recorder.fill(arguments.whole(), 12, 4, 77)?;
        recorder.barrier();
        recorder.copy(arguments.whole(), 4, host.whole(), 16, 12)?;
        recorder.barrier_to_host();
        match &times {
            Some(times) => (1..3).try_for_each(|i| recorder.timestamp(times, i)),
            None => Ok(()),
        }
    })?;
    assert_eq!(commands.dispatches(), 1);
    commands.submit_and_wait()?;
    test.assert_result()?;
    let bytes = host.bytes(16, 12)?;
    assert_eq!(bytemuck::cast_slice::<u8, u32>(&bytes), [COUNT.div_ceil(LOCAL), 1, 77]);
    if let Some(times) = times {
        let ms = times.read(3)?;
        assert!(ms[0] == 0.0 && ms[1] > 0.0 && ms[2] >= ms[1] && ms[2] < 60_000.0, "{ms:?}");
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn parts_of_a_buffer_are_bound_by_offset() -> Outcome {
    let context = context()?;
    let test = SelfTest::new(&context)?;
    let (location, texels) = (Location::Upload, Some(TexelFormat::Float));
    let mut arena =
        Buffer::new(&context, &BufferDesc { name: "arena", size: 1 << 20, location, texels, ..Default::default() })?;
    let values: Vec<[f32; 4]> = (0..COUNT).map(texel).collect();
    arena.bytes_mut(1 << 16, 16 * u64::from(COUNT))?.copy_from_slice(bytemuck::cast_slice(&values));
    let part = arena.whole().part(1 << 16, u64::from(COUNT) * 16)?;
    let part = part.with_texels(context.device(), TexelFormat::Float4, "part")?;
    let set = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?.bind(
        &test.pipeline,
        &[("Records", test.records.whole()), ("texels", &part), ("indices", test.indices.whole())],
    )?;
    let test = SelfTest { set, ..test };
    let mut commands = CommandBuffer::new(&context, "part")?;
    commands.record(|recorder| test.record(recorder))?;
    // The command buffer keeps the arena and the view.
    drop((arena, part));
    commands.submit_and_wait()?;
    test.assert_result()?;
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn reflection_knows_the_interface() {
    let kernel = &kernels::SELFTEST;
    assert!(kernels::ALL.iter().any(|k| std::ptr::eq(*k, kernel)));
    assert_eq!((kernel.name, kernel.spirv[0]), ("selftest", 0x0723_0203));
    assert_eq!((kernel.local_size_ids, kernel.push_constant_bytes), ([Some(0), None, None], 16));
    assert_eq!((kernel.capabilities, kernel.shared_bytes), (&["Shader", "SampledBuffer"][..], 0));
    let bindings: Vec<_> = kernel.bindings.iter().map(|b| (b.name, b.binding, b.kind)).collect();
    let expected = [
        ("texels", 0, BindingKind::UniformTexelBufferFloat),
        ("indices", 1, BindingKind::UniformTexelBufferUint),
        ("Records", 2, BindingKind::StorageBuffer),
    ];
    assert_eq!(bindings, expected);
    let constants: Vec<_> = kernel.specialization.iter().map(|s| (s.name, s.id, s.default)).collect();
    let expected = [
        ("local_size_x", 0, SpecValue::Uint(1)),
        ("TAG", 1, SpecValue::Int(7)),
        ("ADD_OFFSET", 2, SpecValue::Bool(true)),
        ("FACTOR", 3, SpecValue::Float(1.5)),
    ];
    assert_eq!(constants, expected);
    let member = |name, offset, size, stride| Member { name, offset, size, stride };
    let push = [member("scale", 0, 4, 0), member("count", 4, 4, 0), member("offset", 8, 8, 0)];
    assert_eq!(kernel.push_members, push);
    let expected = [
        member("value", std::mem::offset_of!(Record, value) as u32, 16, 0),
        member("index", std::mem::offset_of!(Record, index) as u32, 4, 0),
        member("tag", std::mem::offset_of!(Record, tag) as u32, 4, 0),
        member("parts", std::mem::offset_of!(Record, parts) as u32, 12, 4),
        member("pair", std::mem::offset_of!(Record, pair) as u32, 8, 0),
    ];
    let record = kernel.structs.iter().find(|s| s.name == "Record").map(|s| (s.size, s.stride, s.members));
    assert_eq!(record, Some((48, size_of::<Record>() as u32, &expected[..])));
}

/// Creates and destroys devices while other threads make objects on theirs.
#[test]
fn contexts_work_and_go_beside_each_other() -> Outcome {
    let run = || -> crate::Result<()> {
        for _ in 0..8 {
            let context = context()?;
            let log = context.validation_log();
            let test = SelfTest::new(&context)?;
            let mut commands = CommandBuffer::new(&context, "one of several")?;
            commands.record(|recorder| test.record(recorder))?;
            for _ in 0..3 {
                commands.submit_and_wait()?;
            }
            test.assert_result()?;
            drop((context, test, commands));
            assert_eq!(log.messages(), Vec::<String>::new());
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let threads = [(); 4].map(|()| scope.spawn(run));
        threads.into_iter().try_for_each(|thread| Ok(thread.join().map_err(|_| "a thread panicked")??))
    })
}

#[test]
fn objects_may_be_dropped_in_any_order() -> Outcome {
    let context = context()?;
    let log = context.validation_log();
    let test = SelfTest::new(&context)?;
    let mut commands = CommandBuffer::new(&context, "last")?;
    commands.record(|recorder| test.record(recorder))?;
    let SelfTest { records, pipeline, set, .. } = test;
    drop((context, set, pipeline));
    commands.submit_and_wait()?;
    drop(commands);
    drop(records.bytes(0, 4)?);
    drop(records);
    assert_eq!(log.messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn the_pipeline_cache_is_kept_on_disk() -> Outcome {
    let scratch = tempfile::tempdir()?;
    let folder = scratch.path().join("deep/cache");
    let options = ContextOptions { cache: CacheFolder::At(folder.clone()), ..Default::default() };
    // Afterwards there is one file.
    let run = || -> Result<_, Box<dyn std::error::Error>> {
        let context = Context::new(&options)?;
        SelfTest::new(&context)?;
        assert_eq!(context.validation_messages(), Vec::<String>::new());
        drop(context);
        let files: Vec<_> = std::fs::read_dir(&folder)?.collect();
        assert_eq!(files.len(), 1, "temporary files are left");
        Ok(folder.join(files[0].as_ref().map_err(|e| e.to_string())?.file_name()))
    };
    let file = run()?;
    let written = std::fs::read(&file)?;
    assert_eq!(run()?, file);
    // Whatever lies there, a context opens, and a good file replaces it.
    for broken in [&written[..written.len() - 1], &written[..10], b"", b"something else altogether"] {
        std::fs::write(&file, broken)?;
        run()?;
        assert!(std::fs::read(&file)?.starts_with(b"softras1"), "not replaced");
    }
    Ok(())
}

/// A host's own device and command buffer: all that softras records through [`Device::from_host`], all else the host's.
#[test]
fn a_host_records_with_its_own_device() -> Outcome {
    let host = context()?;
    let test = SelfTest::new(&host)?;
    let functions = host.device();
    // SAFETY: opening the loader.
    let entry = unsafe { ash::Entry::load() }?;
    let (instance, device) = (functions.instance().handle(), functions.raw().handle());
    let get_instance_proc_addr = entry.static_fn().get_instance_proc_addr;
    // SAFETY: the handles are the context's, which outlives the device; validation needs debug_utils.
    let handles = unsafe {
        let adapter = HostAdapter::new(get_instance_proc_addr, instance, functions.physical_device());
        HostDevice::new(adapter, device).with_debug_utils()
    };
    let device = Device::from_host(&handles)?;
    assert_eq!(device.limits(), functions.limits());
    let specialization = [("local_size_x", LOCAL.into()), ("TAG", (-3).into()), ("FACTOR", 4.5.into())];
    let pipeline = Pipeline::new(&device, &kernels::SELFTEST, &specialization, None)?;
    let pool = DescriptorPool::new(&device, &[&kernels::SELFTEST])?;
    // SAFETY: the buffers are the test's, which outlive the set.
    let raw = |b: &BufferPart| unsafe { BufferRef::new(b.raw(), b.range(), b.usage()) };
    let (texels, indices) = (raw(test.texels.whole()), raw(test.indices.whole()));
    let records = BufferPart::of_host(&device, &raw(test.records.whole()));
    let texels_of = |at, format, name| BufferPart::of_host(&device, at).with_texels(&device, format, name);
    let texels = texels_of(&texels, TexelFormat::Float4, "the host's texels")?;
    let indices = texels_of(&indices, TexelFormat::Uint, "the host's indices")?;
    let useless = error(texels_of(&raw(test.records.whole()), TexelFormat::Uint, "records"));
    assert!(useless.contains("UNIFORM_TEXEL_BUFFER"), "{useless}");
    let set = pool.bind(&pipeline, &[("texels", &texels), ("indices", &indices), ("Records", &records)])?;
    let mut commands = CommandBuffer::new(&host, "host")?;
    commands.record(|recorder| {
        // SAFETY: the command buffer records; pipeline and set live to the end of the test.
        let mut commands = unsafe { HostCommands::new(recorder.raw()) };
        let mut ours = Recorder::on_host(&device, &mut commands);
        ours.barrier();
        let groups = [COUNT.div_ceil(LOCAL), 1, 1];
        ours.dispatch(&pipeline, &set, bytemuck::bytes_of(&PUSH), groups)?;
        recorder.barrier_to_host();
        Ok(())
    })?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    drop(commands);
    drop((set, pool, pipeline, texels, indices, device));
    // The host's device still works.
    let mut commands = CommandBuffer::new(&host, "after")?;
    commands.record(|recorder| test.record(recorder))?;
    commands.submit_and_wait()?;
    assert_eq!(host.validation_messages(), Vec::<String>::new());
    Ok(())
}
