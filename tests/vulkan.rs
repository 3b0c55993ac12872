//! The Vulkan folder by itself: a small kernel runs end to end with nothing said by the validation layer, reflection
//! knows the layouts, misuse and limits are errors, and objects may be dropped in any order.

use softras::Error;
use softras::vulkan::{
    BindingKind, Buffer, BufferDesc, BufferPart, CacheFolder, CommandBuffer, Context, ContextOptions, DescriptorPool,
    DescriptorSet, Device, HostDevice, Location, Member, Pipeline, Recorder, SharedBuffer, SpecValue, TexelFormat,
    TimestampPool, constants, kernels, vk,
};

type Outcome = Result<(), Box<dyn std::error::Error>>;

const COUNT: u32 = 1000;
const LOCAL: u32 = constants::SELFTEST_LOCAL_SIZE;

/// The record of glsl/selftest.comp.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Record {
    value: [f32; 4],
    index: u32,
    tag: i32,
    parts: [f32; 3],
    padding: u32,
    pair: [u32; 2],
}

/// The push constants of glsl/selftest.comp.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    scale: f32,
    count: u32,
    offset: [f32; 2],
}

const PUSH: Push = Push { scale: 2.0, count: COUNT, offset: [0.25, -0.75] };

fn context() -> softras::Result<Context> {
    Context::new(&ContextOptions { validation: true, cache: CacheFolder::Nowhere, ..Default::default() })
}

fn error<T>(result: softras::Result<T>) -> String {
    result.map_or_else(|e| e.to_string(), |_| "no error".to_string())
}

/// Buffers, pipeline and set of the self test.
struct SelfTest {
    texels: SharedBuffer,
    indices: SharedBuffer,
    records: SharedBuffer,
    pipeline: Pipeline,
    set: DescriptorSet,
}

impl SelfTest {
    fn new(context: &Context) -> softras::Result<Self> {
        let buffer =
            |name, size, texels| BufferDesc { name, size: u64::from(COUNT) * size, texels, ..Default::default() };
        let mut texels = SharedBuffer::for_upload(context, &buffer("texels", 16, Some(TexelFormat::Float4)))?;
        let mut indices = SharedBuffer::for_upload(context, &buffer("indices", 4, Some(TexelFormat::Uint)))?;
        let records = SharedBuffer::for_download(context, &buffer("records", 48, None))?;
        let values: Vec<[f32; 4]> = (0..COUNT).map(texel).collect();
        let order: Vec<u32> = (0..COUNT).map(|i| COUNT - 1 - i).collect();
        texels.write(0, bytemuck::cast_slice(&values))?;
        indices.write(0, bytemuck::cast_slice(&order))?;
        let specialization = [("local_size_x", LOCAL.into()), ("TAG", (-3).into()), ("FACTOR", 4.5.into())];
        let cache = Some(context.pipeline_cache());
        let pipeline = Pipeline::new(context.device(), &kernels::SELFTEST, &specialization, cache)?;
        let pool = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?;
        let parts = [("texels", texels.whole()), ("indices", indices.whole()), ("Records", records.whole())];
        let set = pool.bind(&pipeline, &parts)?;
        Ok(Self { texels, indices, records, pipeline, set })
    }

    fn record(&self, recorder: &mut Recorder<'_>) -> softras::Result<()> {
        recorder.begin_label("self test");
        self.texels.record_upload(recorder)?;
        self.indices.record_upload(recorder)?;
        recorder.barrier();
        let groups = [COUNT.div_ceil(LOCAL), 1, 1];
        recorder.dispatch(&self.pipeline, &self.set, bytemuck::bytes_of(&PUSH), groups)?;
        recorder.barrier();
        self.records.record_download(recorder)?;
        recorder.barrier_to_host();
        recorder.end_label();
        Ok(())
    }

    fn assert_result(&self) -> softras::Result<()> {
        let mut records = vec![bytemuck::Zeroable::zeroed(); COUNT as usize];
        self.records.read(0, bytemuck::cast_slice_mut::<Record, u8>(&mut records))?;
        for (i, record) in (0..).zip(records) {
            let index = COUNT - 1 - i;
            let expected = Record {
                value: texel(index).map(|v| PUSH.scale * v + constants::SELFTEST_OFFSET),
                index,
                tag: -3,
                parts: [4.5, 0.25, -0.75],
                padding: record.padding,
                pair: [i, COUNT],
            };
            assert_eq!(record, expected, "record {i}");
        }
        Ok(())
    }
}

fn texel(i: u32) -> [f32; 4] {
    [i as f32, 0.5 * i as f32, -(i as f32), 1.0]
}

#[test]
fn a_kernel_runs_end_to_end() -> Outcome {
    let context = context()?;
    assert!(context.validates());
    let log = context.validation_log();
    let test = SelfTest::new(&context)?;
    assert_eq!(test.pipeline.local_size(), [LOCAL, 1, 1]);
    let mut commands = CommandBuffer::new(&context, "self test")?;
    commands.record(|recorder| test.record(recorder))?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    // Recorded once, submitted often; then recorded anew.
    commands.submit_and_wait()?;
    commands.record(|recorder| {
        recorder.fill(test.records.whole(), 0, test.records.buffer().size(), 0)?;
        recorder.barrier();
        test.record(recorder)
    })?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    drop((context, test, commands));
    assert_eq!(log.messages(), Vec::<String>::new());
    Ok(())
}

/// What a discrete GPU must do: on shared memory nothing is copied.
#[test]
fn host_data_is_staged_where_memory_is_not_shared() -> Outcome {
    let options = ContextOptions { validation: true, staging: true, cache: CacheFolder::Nowhere, ..Default::default() };
    let context = Context::new(&options)?;
    let mut test = SelfTest::new(&context)?;
    assert!(!test.records.is_direct() && !test.texels.is_direct() && !test.records.buffer().is_mapped());
    let mut commands = CommandBuffer::new(&context, "staged")?;
    commands.record(|recorder| test.record(recorder))?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    // The host's writes between two submissions arrive.
    test.texels.write(0, &[0; 16])?;
    commands.submit_and_wait()?;
    let mut last = [1.0f32; 4];
    test.records.read(u64::from(COUNT - 1) * 48, bytemuck::cast_slice_mut(&mut last))?;
    assert_eq!(last, [constants::SELFTEST_OFFSET; 4]);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn fill_copy_indirect_and_timestamps() -> Outcome {
    let context = context()?;
    let test = SelfTest::new(&context)?;
    let usage = vk::BufferUsageFlags::INDIRECT_BUFFER;
    let arguments = Buffer::new(&context, &BufferDesc { name: "arguments", size: 32, usage, ..Default::default() })?;
    let host = BufferDesc { name: "host", size: 32, location: Location::Readback, ..Default::default() };
    let host = Buffer::new(&context, &host)?;
    let times = TimestampPool::new(context.device(), context.queue_family(), 3)?;
    let mut commands = CommandBuffer::new(&context, "indirect")?;
    commands.record(|recorder| {
        if let Some(times) = &times {
            recorder.reset_timestamps(times);
            recorder.timestamp(times, 0)?;
        }
        test.texels.record_upload(recorder)?;
        test.indices.record_upload(recorder)?;
        recorder.fill(arguments.whole(), 4, 4, COUNT.div_ceil(LOCAL))?;
        recorder.fill(arguments.whole(), 8, 8, 1)?;
        recorder.barrier();
        recorder.dispatch_indirect(&test.pipeline, &test.set, bytemuck::bytes_of(&PUSH), arguments.whole(), 4)?;
        recorder.barrier();
        // The arguments may be overwritten behind a barrier.
        recorder.fill(arguments.whole(), 12, 4, 77)?;
        recorder.barrier();
        recorder.copy(arguments.whole(), 4, host.whole(), 16, 12)?;
        test.records.record_download(recorder)?;
        recorder.barrier_to_host();
        match &times {
            Some(times) => (1..3).try_for_each(|i| recorder.timestamp(times, i)),
            None => Ok(()),
        }
    })?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    let mut words = [0u32; 3];
    host.read(16, bytemuck::cast_slice_mut(&mut words))?;
    assert_eq!(words, [COUNT.div_ceil(LOCAL), 1, 77]);
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
    let desc = BufferDesc { name: "arena", size: 1 << 20, texels: Some(TexelFormat::Float), ..Default::default() };
    let mut arena = SharedBuffer::for_upload(&context, &desc)?;
    let values: Vec<[f32; 4]> = (0..COUNT).map(texel).collect();
    arena.write(1 << 16, bytemuck::cast_slice(&values))?;
    let part = arena.buffer().texel_part(1 << 16, u64::from(COUNT) * 16, TexelFormat::Float4)?;
    let set = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?.bind(
        &test.pipeline,
        &[("Records", test.records.whole()), ("texels", &part), ("indices", test.indices.whole())],
    )?;
    let test = SelfTest { set, ..test };
    let mut commands = CommandBuffer::new(&context, "part")?;
    commands.record(|recorder| {
        arena.record_upload(recorder)?;
        test.record(recorder)
    })?;
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
    let record = kernel.record("Record").map(|s| (s.size, s.stride, s.members));
    assert_eq!(record, Some((48, size_of::<Record>() as u32, &expected[..])));
}

#[test]
fn devices_are_listed_and_selected() -> Outcome {
    let devices = Context::devices()?;
    let first = devices.first().ok_or("no device")?;
    assert!(first.limits.max_workgroup_invocations >= 128 && first.limits.subgroups.size > 0, "{first:?}");
    for selector in [first.index.to_string(), first.name.to_uppercase()] {
        let options = ContextOptions { device: Some(selector), cache: CacheFolder::Nowhere, ..Default::default() };
        assert_eq!(Context::new(&options)?.info().index, first.index);
    }
    for selector in ["no such device", "4000000000"] {
        let options = ContextOptions { device: Some(selector.to_string()), ..Default::default() };
        match Context::new(&options) {
            Err(Error::NoDevice { what, mend }) => {
                assert!(what.contains(selector), "{what}");
                assert!(devices.iter().all(|d| mend.contains(&d.name)), "{mend}");
            }
            other => return Err(format!("not NoDevice: {other:?}").into()),
        }
    }
    Ok(())
}

#[test]
fn two_contexts_work_at_once() -> Outcome {
    let run = || -> softras::Result<Vec<String>> {
        let context = context()?;
        let test = SelfTest::new(&context)?;
        let mut commands = CommandBuffer::new(&context, "one of two")?;
        commands.record(|recorder| test.record(recorder))?;
        for _ in 0..10 {
            commands.submit_and_wait()?;
        }
        test.assert_result()?;
        Ok(context.validation_messages())
    };
    let both = std::thread::scope(|scope| [scope.spawn(run), scope.spawn(run)].map(|thread| thread.join()));
    for one in both {
        assert_eq!(one.map_err(|_| "a thread panicked")??, Vec::<String>::new());
    }
    Ok(())
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
    let mut first = [0; 4];
    records.read(0, &mut first)?;
    drop(records);
    assert_eq!(log.messages(), Vec::<String>::new());
    Ok(())
}

/// "No message" means something only if a fault gives one.
#[test]
fn a_missing_barrier_is_reported() -> Outcome {
    let context = context()?;
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

#[test]
fn misuse_is_an_error_that_names_it() -> Outcome {
    let context = context()?;
    let device = context.device();
    let test = SelfTest::new(&context)?;
    let pipeline = |constants: &[(&str, SpecValue)]| Pipeline::new(device, &kernels::SELFTEST, constants, None);
    let unknown = error(pipeline(&[("SIZE", 1u32.into())]));
    assert!(unknown.contains("selftest") && unknown.contains("`SIZE`") && unknown.contains("FACTOR"), "{unknown}");
    let mistyped = error(pipeline(&[("TAG", 1u32.into())]));
    assert!(mistyped.contains("`TAG`") && mistyped.contains("Int"), "{mistyped}");
    let large = pipeline(&[("local_size_x", (1u32 << 20).into())]);
    assert!(matches!(large, Err(Error::Limit { needed: 0x10_0000, .. })), "{large:?}");

    let bind = |buffers: &[(&str, &BufferPart)]| {
        DescriptorPool::new(device, &[&kernels::SELFTEST]).and_then(|pool| pool.bind(&test.pipeline, buffers))
    };
    let (texels, indices, records) = (test.texels.whole(), test.indices.whole(), test.records.whole());
    let missing = error(bind(&[("texels", texels), ("indices", indices)]));
    assert!(missing.contains("`Records` has no buffer"), "{missing}");
    let all = [("texels", texels), ("indices", indices), ("Records", records)];
    let extra = error(bind(&[&all[..], &[("pixels", texels)]].concat()));
    assert!(extra.contains("no binding `pixels`"), "{extra}");
    let twice = error(bind(&[&all[..], &all[..1]].concat()));
    assert!(twice.contains("`texels` is given twice"), "{twice}");
    let viewless = error(bind(&[("texels", records), ("indices", indices), ("Records", records)]));
    assert!(viewless.contains("no texel view"), "{viewless}");

    let mut commands = CommandBuffer::new(&context, "misuse")?;
    assert!(error(commands.submit_and_wait()).contains("nothing was recorded"));
    let push = bytemuck::bytes_of(&PUSH);
    let mut recording = |work: &dyn Fn(&mut Recorder<'_>) -> softras::Result<()>| error(commands.record(|r| work(r)));
    let short = recording(&|r| r.dispatch(&test.pipeline, &test.set, &push[..12], [1; 3]));
    assert!(short.contains("12 bytes") && short.contains("16"), "{short}");
    let many = recording(&|r| r.dispatch(&test.pipeline, &test.set, push, [1, u32::MAX, 1]));
    assert!(many.contains("maxComputeWorkGroupCount"), "{many}");
    let outside = recording(&|r| r.fill(records, records.range() - 4, 8, 0));
    assert!(outside.contains("outside"), "{outside}");
    let crooked = recording(&|r| r.copy(records, 2, texels, 0, 4));
    assert!(crooked.contains("aligned"), "{crooked}");
    let onto_itself = recording(&|r| r.copy(records, 0, records, 4, 8));
    assert!(onto_itself.contains("overlap"), "{onto_itself}");
    assert_eq!(recording(&|r| r.dispatch(&test.pipeline, &test.set, push, [0, 1, 1])), "no error");

    let other = self::context()?;
    let foreign = SelfTest::new(&other)?;
    let foreign = recording(&|r| r.dispatch(&foreign.pipeline, &foreign.set, push, [1; 3]));
    assert!(foreign.contains("another device"), "{foreign}");
    let buffer = test.records.buffer();
    assert!(error(buffer.part(8, u64::MAX)).contains("outside"));
    assert!(error(buffer.texel_part(0, 16, TexelFormat::Uint)).contains("UNIFORM_TEXEL_BUFFER"));
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn limits_and_memory_are_errors() -> Outcome {
    let context = context()?;
    let limits = *context.device().limits();
    let size = limits.max_storage_buffer_range + 16;
    let large = Buffer::new(&context, &BufferDesc { name: "large", size, ..Default::default() });
    match large {
        Err(Error::Limit { what, limit_name: "maxStorageBufferRange", .. }) => assert!(what.contains("large")),
        other => return Err(format!("not a limit: {other:?}").into()),
    }
    let (usage, texels) = (vk::BufferUsageFlags::empty(), Some(TexelFormat::Float));
    let size = 4 * (limits.max_texel_buffer_elements + 4);
    let texels = Buffer::new(&context, &BufferDesc { name: "texels", size, usage, texels, ..Default::default() });
    assert!(matches!(texels, Err(Error::Limit { limit_name: "maxTexelBufferElements", .. })), "{texels:?}");
    // More than the heap holds.
    let size = limits.max_memory_allocation_size;
    if size > limits.device_heap {
        let huge = Buffer::new(&context, &BufferDesc { name: "huge", size, usage, ..Default::default() });
        assert!(matches!(huge, Err(Error::OutOfMemory { .. } | Error::Limit { .. })), "{huge:?}");
    }
    // Nothing is as good as sixteen bytes.
    assert_eq!(Buffer::new(&context, &BufferDesc { size: 0, ..Default::default() })?.size(), 16);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}

#[test]
fn the_pipeline_cache_is_kept_on_disk() -> Outcome {
    let folder = tempfile::tempdir()?;
    let cache = CacheFolder::At(folder.path().join("deep/cache"));
    let options = ContextOptions { validation: true, cache, ..Default::default() };
    let run = || -> Result<_, Box<dyn std::error::Error>> {
        let context = Context::new(&options)?;
        SelfTest::new(&context)?;
        let file = context.pipeline_cache().file().map(std::path::Path::to_path_buf).ok_or("no file")?;
        let messages = context.validation_messages();
        drop(context);
        assert_eq!(messages, Vec::<String>::new());
        Ok(file)
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
    let others = std::fs::read_dir(file.parent().ok_or("no folder")?)?.count();
    assert_eq!(others, 1, "temporary files are left");
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
    let mut handles = HostDevice::new(get_instance_proc_addr, instance, functions.physical_device(), device);
    handles.debug_utils = true;
    // SAFETY: the handles are the context's, which outlives the device; validation needs debug_utils.
    let device = unsafe { Device::from_host(&handles) }?;
    assert_eq!(device.limits(), functions.limits());
    let specialization = [("local_size_x", LOCAL.into()), ("TAG", (-3).into()), ("FACTOR", 4.5.into())];
    let pipeline = Pipeline::new(&device, &kernels::SELFTEST, &specialization, None)?;
    let pool = DescriptorPool::new(&device, &[&kernels::SELFTEST])?;
    // SAFETY: the buffers are the test's, which outlive the set.
    let raw = |b: &BufferPart| unsafe { BufferPart::from_raw(b.raw(), b.offset(), b.range(), b.view()) };
    let (texels, indices, records) = (raw(test.texels.whole()), raw(test.indices.whole()), raw(test.records.whole()));
    // SAFETY: the buffer is of this device, has the usage and outlives the view.
    let texels = unsafe { texels.with_view(&device, TexelFormat::Float4, "the host's texels") }?;
    let set = pool.bind(&pipeline, &[("texels", &texels), ("indices", &indices), ("Records", &records)])?;
    let mut commands = CommandBuffer::new(&host, "host")?;
    commands.record(|recorder| {
        test.texels.record_upload(recorder)?;
        test.indices.record_upload(recorder)?;
        // SAFETY: the command buffer records; pipeline and set live to the end of the test.
        let mut ours = unsafe { Recorder::from_raw(&device, recorder.raw()) };
        ours.barrier();
        let groups = [COUNT.div_ceil(LOCAL), 1, 1];
        ours.dispatch(&pipeline, &set, bytemuck::bytes_of(&PUSH), groups)?;
        ours.barrier();
        test.records.record_download(recorder)?;
        recorder.barrier_to_host();
        Ok(())
    })?;
    commands.submit_and_wait()?;
    test.assert_result()?;
    drop(commands);
    drop((set, pool, pipeline, texels, device));
    // The host's device still works.
    let mut commands = CommandBuffer::new(&host, "after")?;
    commands.record(|recorder| test.record(recorder))?;
    commands.submit_and_wait()?;
    assert_eq!(host.validation_messages(), Vec::<String>::new());
    Ok(())
}
