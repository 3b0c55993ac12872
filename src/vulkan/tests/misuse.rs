//! Misuse, limits and devices that are not there are errors that name what is wrong.

use super::{Outcome, PUSH, SelfTest, context, error};
use crate::Error;
use crate::vulkan::{
    Buffer, BufferDesc, BufferPart, CacheFolder, CommandBuffer, Context, ContextOptions, DescriptorPool, Pipeline,
    Recorder, SpecValue, TexelFormat, kernels, vk,
};

#[test]
fn devices_are_listed_and_selected() -> Outcome {
    let devices = Context::devices(None)?;
    let first = devices.first().ok_or("no device")?;
    assert!(first.limits.max_workgroup_invocations >= 128 && first.limits.subgroup_size > 0, "{first:?}");
    // `RTX 4090` is found by `4090`, which is no device's index.
    let number = first.name.split(|c: char| !c.is_ascii_digit()).find(|digits| digits.len() > 1);
    let number = number.unwrap_or(&first.name).to_owned();
    for selector in [first.index.to_string(), first.name.to_uppercase(), number] {
        let options = ContextOptions { device: Some(selector), cache: CacheFolder::Nowhere, ..Default::default() };
        assert_eq!(Context::new(&options)?.info().index, first.index);
    }
    for selector in ["no such device", "4000000000"] {
        let options = ContextOptions { device: Some(selector.to_string()), ..Default::default() };
        match Context::new(&options) {
            Err(Error::NoDevice { what, fix }) => {
                assert!(what.contains(selector), "{what}");
                assert!(devices.iter().all(|d| fix.contains(&d.name)), "{fix}");
            }
            other => return Err(format!("not NoDevice: {other:?}").into()),
        }
    }
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
    let mut recording = |work: &dyn Fn(&mut Recorder<'_>) -> crate::Result<()>| error(commands.record(|r| work(r)));
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

    let other = super::context()?;
    let foreign = SelfTest::new(&other)?;
    let foreign = recording(&|r| r.dispatch(&foreign.pipeline, &foreign.set, push, [1; 3]));
    assert!(foreign.contains("another device"), "{foreign}");
    let part = test.records.whole();
    assert!(error(part.part(8, u64::MAX)).contains("outside"));
    let texels = |device| error(part.with_texels(device, TexelFormat::Uint, "records"));
    assert!(texels(context.device()).contains("UNIFORM_TEXEL_BUFFER"));
    let of_another = test.texels.whole().with_texels(other.device(), TexelFormat::Uint, "texels");
    assert!(error(of_another).contains("another device"));
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
    // A size of 0 is rounded up to 16.
    assert_eq!(Buffer::new(&context, &BufferDesc { size: 0, ..Default::default() })?.size(), 16);
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    Ok(())
}
