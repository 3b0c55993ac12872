//! Common parts of the tests of the embedded API: the examples' engine, a pass in its memory, a submission.
// It plays the host and passes raw Vulkan handles. Not every test needs every part.
#![allow(unsafe_code, dead_code, clippy::undocumented_unsafe_blocks)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../examples/engine/mod.rs"]
pub mod engine;
pub mod memory;
pub mod shim;

use crate::common::{gradient::same_gradient_bits, scenes::Case, validates};
use ash::vk;
use engine::{Buffer, Engine};
use gpu_allocator::MemoryLocation;
use softras::embed::{
    Capacity, HostCommands, MeshBuffers, Pass, PassBuffer, PassBuilder, PassMemory, PassPlan, PassStatus, Rasterizer,
};
use softras::scene::Outputs;
use softras::{Frame, GradientRequest, Gradients, ImageGradient};

pub type Messages = Vec<String>;

pub fn engine() -> Engine {
    Engine::new(validates()).expect("a Vulkan device")
}

/// Drops the engine. The validation layers must have reported nothing, leaks included.
pub fn assert_silent(engine: Engine) {
    let log = engine.log();
    drop(engine);
    assert_eq!(*log.lock().unwrap(), Messages::new());
}

pub fn rasterizer(engine: &Engine) -> Rasterizer {
    Rasterizer::new(&engine.host_device()).expect("a rasterizer")
}

pub fn error<T>(result: softras::Result<T>) -> String {
    result.map_or_else(|e| e.to_string(), |_| "no error".to_string())
}

/// The three buffers of a pass, all of them mapped so that a test sees everything.
pub struct Memory {
    pub upload: Buffer,
    pub device: Buffer,
    pub readback: Buffer,
}

impl Memory {
    pub fn new(engine: &Engine, plan: &PassPlan) -> Self {
        let [upload, device, readback] = plan.memory().map(|needed| {
            let mut buffer = engine.buffer(needed.size, needed.usage, MemoryLocation::GpuToCpu).unwrap();
            // The pass must not depend on bytes that nobody wrote.
            buffer.bytes_mut().fill(0xcd);
            buffer
        });
        Self { upload, device, readback }
    }

    pub fn refs(&self) -> PassMemory<'static> {
        let [upload, device, readback] = [&self.upload, &self.device, &self.readback].map(Buffer::whole);
        PassMemory { upload, device, readback, own: &[] }
    }

    pub fn floats(&self, pass: &Pass, id: PassBuffer) -> Vec<f32> {
        let at = pass.buffer(id).unwrap();
        self.device.floats(at.offset(), at.range() as usize / 4)
    }

    pub fn whole_word(&self, pass: &Pass) -> u32 {
        let at = pass.buffer(PassBuffer::Status).unwrap().offset() + PassStatus::WHOLE_OFFSET;
        self.device.floats(at, 1)[0].to_bits()
    }

    pub fn write_upstream(&mut self, pass: &Pass, upstream: &ImageGradient) {
        for (id, values) in upstream_bytes(upstream) {
            self.device.write(pass.buffer(id).unwrap().offset(), bytemuck::cast_slice(&values));
        }
    }
}

pub fn bind(rasterizer: &Rasterizer, plan: &PassPlan, memory: &mut Memory, meshes: &[MeshBuffers]) -> Pass {
    let pass = rasterizer.bind_pass(plan.clone(), memory.refs(), meshes).unwrap();
    pass.write_inputs(memory.upload.bytes_mut()).unwrap();
    pass
}

/// All that a pass records.
pub fn record(pass: &Pass, commands: &mut HostCommands) {
    pass.record_setup(commands).unwrap();
    pass.record_forward(commands).unwrap();
    if pass.plan().has_gradients() {
        pass.record_backward(commands).unwrap();
    }
}

pub fn run(engine: &Engine, pass: &Pass) {
    submit(engine, |commands| record(pass, commands));
}

/// The plan of a case's frame, to be changed and built.
pub fn plan_of(rasterizer: &Rasterizer, case: &Case) -> PassBuilder {
    rasterizer.scene_pass(&case.scene).settings(case.settings.clone()).cameras(&case.cameras)
}

/// The plan with gradients, which are read back.
pub fn plan_backward(plan: PassBuilder, upstream: &ImageGradient, wanted: GradientRequest) -> PassBuilder {
    let color = upstream.color.iter().flat_map(|image| &image.data);
    let largest = color.fold(0.0f64, |m, &x| m.max(f64::from(x.abs())));
    plan.gradients(wanted).upstream(upstream.outputs()).largest_upstream(largest).read_back_gradients()
}

/// A case's pass in its memory.
pub struct Host {
    pub pass: Pass,
    pub memory: Memory,
}

impl Host {
    pub fn new(engine: &Engine, rasterizer: &Rasterizer, plan: PassBuilder) -> Self {
        let plan = plan.build().unwrap();
        let mut memory = Memory::new(engine, &plan);
        let pass = bind(rasterizer, &plan, &mut memory, &[]);
        Self { pass, memory }
    }

    /// With upstream gradients.
    pub fn with_upstream(mut self, upstream: &ImageGradient) -> Self {
        self.memory.write_upstream(&self.pass, upstream);
        self
    }

    /// A host that has executed the pass with room in its lists.
    pub fn whole(engine: &Engine, rasterizer: &Rasterizer, mut plan: PassBuilder, upstream: &ImageGradient) -> Self {
        loop {
            let host = Self::new(engine, rasterizer, plan.clone()).with_upstream(upstream);
            run(engine, &host.pass);
            match host.pass.plan().next_plan(host.memory.readback.bytes()).unwrap() {
                None => return host,
                Some(larger) => plan = larger.builder(),
            }
        }
    }

    pub fn floats(&self, id: PassBuffer) -> Vec<f32> {
        self.memory.floats(&self.pass, id)
    }

    pub fn status(&self) -> PassStatus {
        self.pass.status(self.memory.readback.bytes()).unwrap()
    }

    pub fn gradients(&self) -> Gradients {
        self.pass.decode_gradients(self.memory.readback.bytes()).unwrap()
    }
}

pub fn submit(engine: &Engine, record: impl FnOnce(&mut HostCommands)) {
    let frame = engine.commands().unwrap();
    let commands = frame.begin().unwrap();
    record(&mut frame.host());
    let barrier = [vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::SHADER_WRITE | vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ)];
    let from = vk::PipelineStageFlags::COMPUTE_SHADER | vk::PipelineStageFlags::TRANSFER;
    let (to, none) = (vk::PipelineStageFlags::HOST, vk::DependencyFlags::empty());
    unsafe { engine.device().cmd_pipeline_barrier(commands, from, to, none, &barrier, &[], &[]) };
    engine.submit(&frame).unwrap();
    frame.wait().unwrap();
}

/// Images as the simple API packs them.
pub fn images(case: &Case, host: &Host) -> Vec<(&'static str, Vec<f32>)> {
    let Outputs { color, silhouette, depth, normal, features } = case.settings.outputs;
    let rgb = |texels: &[f32]| texels.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>();
    let pixels = case.cameras.len() * (case.settings.width * case.settings.height) as usize;
    let mut images = Vec::new();
    if color {
        let texels = host.floats(PassBuffer::Color);
        images.push(("color", rgb(&texels[..4 * pixels])));
        if silhouette {
            images.push(("silhouette", texels.chunks_exact(4).map(|t| t[3]).take(pixels).collect()));
        }
    } else if silhouette {
        images.push(("silhouette", host.floats(PassBuffer::Silhouette)[..pixels].to_vec()));
    }
    if depth {
        images.push(("depth", host.floats(PassBuffer::Depths)[..pixels].to_vec()));
    }
    if normal {
        images.push(("normal", rgb(&host.floats(PassBuffer::Normals)[..4 * pixels])));
    }
    if features {
        let channels = case.scene.meshes[0].feature_channels() as usize;
        let rows = host.floats(PassBuffer::FeatureImage);
        let rows = rows.chunks_exact(channels.next_multiple_of(4)).take(pixels);
        images.push(("features", rows.flat_map(|row| row[..channels].to_vec()).collect()));
    }
    images
}

/// A host that plans frames with any room for their lists.
pub struct Planner {
    // Dropped first: a test that fails unwinds.
    rasterizer: Rasterizer,
    engine: Engine,
}

/// The images and gradients of a frame, from a [`Planner`] or from a renderer to compare with.
pub struct Planned {
    pub images: Vec<(&'static str, Vec<f32>)>,
    pub gradients: Gradients,
}

impl Planner {
    pub fn new() -> Self {
        let engine = engine();
        let rasterizer = rasterizer(&engine);
        Self { engine, rasterizer }
    }

    pub fn with_lanes(self, lanes: u32) -> Self {
        Self { rasterizer: self.rasterizer.with_lanes(lanes).unwrap(), ..self }
    }

    /// One frame of a case and its gradients, whatever its lists lack.
    pub fn render(
        &self,
        case: &Case,
        upstream: &ImageGradient,
        wanted: GradientRequest,
        capacity: Capacity,
    ) -> Planned {
        let (engine, rasterizer) = (&self.engine, &self.rasterizer);
        let plan = plan_backward(plan_of(rasterizer, case).capacity(capacity), upstream, wanted);
        let host = Host::new(engine, rasterizer, plan).with_upstream(upstream);
        run(engine, &host.pass);
        Planned { images: images(case, &host), gradients: host.gradients() }
    }

    /// The validation layers had nothing to say.
    pub fn assert_silent(self) {
        drop(self.rasterizer);
        assert_silent(self.engine);
    }
}

impl Planned {
    /// A renderer's frame with its gradients, to compare with.
    pub fn of(frame: &Frame, gradients: Gradients) -> Self {
        let images = frame.images().map(|(name, image)| (name, image.data.clone())).collect();
        Self { images, gradients }
    }

    /// Where the bits of another frame differ.
    pub fn difference(&self, other: &Self) -> Option<String> {
        assert_eq!(self.images.len(), other.images.len());
        for ((name, ours), (_, theirs)) in self.images.iter().zip(&other.images) {
            if let Some(at) = difference(ours, theirs) {
                return Some(format!("{name} at {at}"));
            }
        }
        same_gradient_bits(&self.gradients, &other.gradients).err()
    }
}

/// The first value whose bits differ.
pub fn difference(a: &[f32], b: &[f32]) -> Option<usize> {
    let equal = a.len() == b.len();
    let at = a.iter().zip(b).position(|(a, b)| a.to_bits() != b.to_bits());
    at.or_else(|| (!equal).then_some(a.len().min(b.len())))
}

/// Upstream gradients as the kernels read them.
pub fn upstream_bytes(upstream: &ImageGradient) -> Vec<(PassBuffer, Vec<f32>)> {
    let mut buffers = Vec::new();
    let alpha = upstream.silhouette.as_ref();
    if let Some(color) = &upstream.color {
        let texel = |(i, c): (usize, &[f32])| [c[0], c[1], c[2], alpha.map_or(0.0, |a| a.data[i])];
        buffers.push((PassBuffer::UpstreamColor, color.data.chunks_exact(3).enumerate().flat_map(texel).collect()));
    } else if let Some(alpha) = alpha {
        buffers.push((PassBuffer::UpstreamSilhouette, alpha.data.clone()));
    }
    if let Some(depth) = &upstream.depth {
        buffers.push((PassBuffer::UpstreamDepths, depth.data.clone()));
    }
    if let Some(features) = &upstream.features {
        let zeros = [0.0; 3];
        let padding = &zeros[..features.channels.next_multiple_of(4) - features.channels];
        let texels = features.data.chunks_exact(features.channels).flat_map(|f| [f, padding].concat());
        buffers.push((PassBuffer::UpstreamFeatures, texels.collect()));
    }
    if let Some(normal) = &upstream.normal {
        let texels = normal.data.chunks_exact(3).flat_map(|n| [n[0], n[1], n[2], 0.0]);
        buffers.push((PassBuffer::UpstreamNormals, texels.collect()));
    }
    buffers
}
