//! Tests of this folder by itself, all on the kernel glsl/selftest.comp.
#![allow(clippy::unwrap_used)]

mod commands;
mod misuse;
mod soundness;

use super::{
    Buffer, BufferDesc, CacheFolder, Context, ContextOptions, DescriptorPool, DescriptorSet, Location, Pipeline,
    Recorder, TexelFormat, constants, kernels,
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
struct TestPush {
    scale: f32,
    count: u32,
    offset: [f32; 2],
}

const PUSH: TestPush = TestPush { scale: 2.0, count: COUNT, offset: [0.25, -0.75] };

fn context() -> crate::Result<Context> {
    Context::new(&ContextOptions { cache: CacheFolder::Nowhere, ..Default::default() })
}

fn error<T>(result: crate::Result<T>) -> String {
    result.map_or_else(|e| e.to_string(), |_| "no error".to_string())
}

/// Buffers, pipeline and set of the self test.
struct SelfTest {
    texels: Buffer,
    indices: Buffer,
    records: Buffer,
    pipeline: Pipeline,
    set: DescriptorSet,
}

impl SelfTest {
    fn new(context: &Context) -> crate::Result<Self> {
        let buffer = |name, size, texels, location| {
            Buffer::new(
                context,
                &BufferDesc { name, size: u64::from(COUNT) * size, texels, location, ..Default::default() },
            )
        };
        let mut texels = buffer("texels", 16, Some(TexelFormat::Float4), Location::Upload)?;
        let mut indices = buffer("indices", 4, Some(TexelFormat::Uint), Location::Upload)?;
        let records = buffer("records", 48, None, Location::Readback)?;
        let values: Vec<[f32; 4]> = (0..COUNT).map(texel).collect();
        let order: Vec<u32> = (0..COUNT).map(|i| COUNT - 1 - i).collect();
        texels.bytes_mut(0, 16 * u64::from(COUNT))?.copy_from_slice(bytemuck::cast_slice(&values));
        indices.bytes_mut(0, 4 * u64::from(COUNT))?.copy_from_slice(bytemuck::cast_slice(&order));
        let specialization = [("local_size_x", LOCAL.into()), ("TAG", (-3).into()), ("FACTOR", 4.5.into())];
        let cache = Some(context.pipeline_cache());
        let pipeline = Pipeline::new(context.device(), &kernels::SELFTEST, &specialization, cache)?;
        let pool = DescriptorPool::new(context.device(), &[&kernels::SELFTEST])?;
        let parts = [("texels", texels.whole()), ("indices", indices.whole()), ("Records", records.whole())];
        let set = pool.bind(&pipeline, &parts)?;
        Ok(Self { texels, indices, records, pipeline, set })
    }

    fn record(&self, recorder: &mut Recorder<'_>) -> crate::Result<()> {
        recorder.begin_label("self test");
        let groups = [COUNT.div_ceil(LOCAL), 1, 1];
        recorder.dispatch(&self.pipeline, &self.set, bytemuck::bytes_of(&PUSH), groups)?;
        recorder.barrier_to_host();
        recorder.end_label();
        Ok(())
    }

    fn assert_result(&self) -> crate::Result<()> {
        let bytes = self.records.bytes(0, 48 * u64::from(COUNT))?;
        for (i, &record) in (0..).zip(bytemuck::cast_slice::<u8, Record>(&bytes)) {
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
