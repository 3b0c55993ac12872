//! What the tests of the embedded API share: the examples' engine, a frame in its memory, a submission.
// A host's half of a contract of raw handles. Not every test needs every part.
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
    Arena, BufferId, Capacity, Decoder, Differentiate, FrameBindings, FramePlan, FrameShape, GradientBindings,
    GradientPlan, HostCommands, Inputs, Rasterizer, Status,
};
use softras::scene::Outputs;
use softras::{Frame, GradientRequest, Gradients, ImageGradient, Scene};

pub type Messages = Vec<String>;

pub fn engine() -> Engine {
    Engine::new(validates()).expect("a Vulkan device")
}

/// The engine goes; the layers must have had nothing to say, leaks included.
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

/// A case's frame with every buffer in one, mapped.
pub struct Host {
    pub plan: FramePlan,
    pub arena: Arena,
    pub buffer: Buffer,
    pub bindings: FrameBindings,
}

impl Host {
    pub fn new(engine: &Engine, rasterizer: &Rasterizer, case: &Case) -> Self {
        let shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        Self::of_shape(engine, rasterizer, case, &shape)
    }

    pub fn of_shape(engine: &Engine, rasterizer: &Rasterizer, case: &Case, shape: &FrameShape) -> Self {
        let plan = rasterizer.plan(shape, &case.settings).unwrap();
        let arena = Arena::of(plan.buffers());
        let mut buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
        // What the device does not write itself must not matter.
        buffer.bytes_mut().fill(0xcd);
        let inputs = Inputs::new(&case.scene, &case.cameras, &case.settings, &plan);
        for (name, bytes) in inputs.all() {
            match arena.part(name) {
                Some((offset, size)) => {
                    assert_eq!(plan.buffer(name).unwrap().size, bytes.len() as u64, "{name}: {case:?}");
                    assert!(size >= bytes.len() as u64);
                    buffer.write(offset, bytes);
                }
                None => assert!(bytes.is_empty(), "{name} has bytes and no buffer"),
            }
        }
        let bindings = rasterizer.bind(&plan, &arena.refs(&buffer.whole()).unwrap()).unwrap();
        Self { plan, arena, buffer, bindings }
    }

    /// A frame, executed, whose lists have had room.
    pub fn whole_frame(engine: &Engine, rasterizer: &Rasterizer, case: &Case) -> Self {
        let mut shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        loop {
            let host = Self::of_shape(engine, rasterizer, case, &shape);
            forward(engine, rasterizer, &host);
            match host.status().validate(&host.plan).unwrap() {
                None => return host,
                capacity => shape.capacity = capacity,
            }
        }
    }

    pub fn floats(&self, id: BufferId) -> Vec<f32> {
        let (offset, size) = self.arena.part(id).unwrap();
        self.buffer.floats(offset, size as usize / 4)
    }

    pub fn status(&self) -> Status {
        let (offset, _) = self.arena.part(BufferId::Status).unwrap();
        let bytes = &self.buffer.bytes()[offset as usize..];
        Status::from_bytes(bytes.first_chunk().unwrap())
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

pub fn forward(engine: &Engine, rasterizer: &Rasterizer, host: &Host) {
    submit(engine, |commands| rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap());
}

/// Images as the simple API packs them.
pub fn images(case: &Case, host: &Host) -> Vec<(&'static str, Vec<f32>)> {
    let Outputs { color, silhouette, depth, normal } = case.settings.outputs;
    let rgb = |texels: &[f32]| texels.chunks_exact(4).flat_map(|t| [t[0], t[1], t[2]]).collect::<Vec<_>>();
    let pixels = case.cameras.len() * (case.settings.width * case.settings.height) as usize;
    let mut images = Vec::new();
    if color {
        let texels = host.floats(BufferId::Color);
        images.push(("color", rgb(&texels[..4 * pixels])));
        if silhouette {
            images.push(("silhouette", texels.chunks_exact(4).map(|t| t[3]).take(pixels).collect()));
        }
    } else if silhouette {
        images.push(("silhouette", host.floats(BufferId::Silhouette)[..pixels].to_vec()));
    }
    if depth {
        images.push(("depth", host.floats(BufferId::Depths)[..pixels].to_vec()));
    }
    if normal {
        images.push(("normal", rgb(&host.floats(BufferId::Normals)[..4 * pixels])));
    }
    images
}

/// A host that plans frames with any room for their lists.
pub struct Planner {
    // Dropped first: a test that fails unwinds.
    rasterizer: Rasterizer,
    engine: Engine,
}

/// What a [`Planner`] rendered: images, gradients, and the entries that the tiles' lists would have needed.
pub struct Planned {
    pub images: Vec<(&'static str, Vec<f32>)>,
    pub gradients: Gradients,
    pub list_entries: u32,
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

    /// One frame of a saved case and its gradients, whatever its lists lack.
    pub fn render(
        &self,
        case: &Case,
        upstream: &ImageGradient,
        wanted: GradientRequest,
        capacity: Capacity,
    ) -> Planned {
        let (engine, rasterizer) = (&self.engine, &self.rasterizer);
        let shape = FrameShape::of(&case.scene, &case.cameras, &case.settings).unwrap();
        let host = Host::of_shape(engine, rasterizer, case, &FrameShape { capacity: Some(capacity), ..shape });
        let backward = Backward::new(engine, rasterizer, &host, upstream, wanted);
        submit(engine, |commands| {
            rasterizer.record_forward(commands, &host.plan, &host.bindings).unwrap();
            backward.record(rasterizer, commands);
        });
        let gradients = backward.decode(&host, case, &case.scene);
        Planned { images: images(case, &host), gradients, list_entries: host.status().needed.list }
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
        Self { images, gradients, list_entries: 0 }
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
pub fn upstream_bytes(upstream: &ImageGradient) -> Vec<(BufferId, Vec<f32>)> {
    let mut buffers = Vec::new();
    let alpha = upstream.silhouette.as_ref();
    if let Some(color) = &upstream.color {
        let texel = |(i, c): (usize, &[f32])| [c[0], c[1], c[2], alpha.map_or(0.0, |a| a.data[i])];
        buffers.push((BufferId::UpstreamColor, color.data.chunks_exact(3).enumerate().flat_map(texel).collect()));
    } else if let Some(alpha) = alpha {
        buffers.push((BufferId::UpstreamSilhouette, alpha.data.clone()));
    }
    if let Some(depth) = &upstream.depth {
        buffers.push((BufferId::UpstreamDepths, depth.data.clone()));
    }
    if let Some(normal) = &upstream.normal {
        let texels = normal.data.chunks_exact(3).flat_map(|n| [n[0], n[1], n[2], 0.0]);
        buffers.push((BufferId::UpstreamNormals, texels.collect()));
    }
    buffers
}

/// A backward pass of a frame, its own buffers in one, mapped.
pub struct Backward {
    pub plan: GradientPlan,
    pub arena: Arena,
    pub buffer: Buffer,
    pub bindings: GradientBindings,
    pub wanted: GradientRequest,
}

impl Backward {
    pub fn new(
        engine: &Engine,
        rasterizer: &Rasterizer,
        host: &Host,
        upstream: &ImageGradient,
        wanted: GradientRequest,
    ) -> Self {
        let color = upstream.color.iter().flat_map(|image| &image.data);
        let largest_upstream = color.fold(0.0f64, |m, &x| m.max(f64::from(x.abs())));
        let differentiate = Differentiate { upstream: upstream.outputs(), wanted, largest_upstream };
        let plan = rasterizer.plan_backward(&host.plan, &differentiate).unwrap();
        let arena = Arena::of(plan.buffers());
        let mut buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuToCpu).unwrap();
        buffer.bytes_mut().fill(0xcd);
        for (id, values) in upstream_bytes(upstream) {
            buffer.write(arena.part(id).unwrap().0, bytemuck::cast_slice(&values));
        }
        let refs = arena.refs(&buffer.whole()).unwrap();
        let bindings = rasterizer.bind_backward(&plan, &host.bindings, &refs).unwrap();
        Self { plan, arena, buffer, bindings, wanted }
    }

    pub fn record(&self, rasterizer: &Rasterizer, commands: &mut HostCommands) {
        rasterizer.record_backward(commands, &self.plan, &self.bindings).unwrap();
    }

    /// The bytes of one of its buffers.
    pub fn part(&self, id: BufferId) -> Option<&[u8]> {
        self.arena.part(id).map(|(at, size)| &self.buffer.bytes()[at as usize..][..size as usize])
    }

    /// What it computed, of a scene that is the case's but for its meshes, from what `cut` leaves of each buffer's bytes.
    pub fn decode_cut<'a>(
        &'a self,
        host: &Host,
        case: &Case,
        scene: &Scene,
        cut: impl Fn(&'a [u8]) -> Option<&'a [u8]>,
    ) -> softras::Result<Gradients> {
        let decoder = Decoder {
            frame: &host.plan,
            plan: &self.plan,
            wanted: &self.wanted,
            tables: &Inputs::new(scene, &case.cameras, &case.settings, &host.plan).tables,
            cameras: &case.cameras,
            settings: &case.settings,
            lights: &scene.lights,
        };
        decoder.decode(|name| cut(self.part(name)?))
    }

    pub fn decode(&self, host: &Host, case: &Case, scene: &Scene) -> Gradients {
        self.decode_cut(host, case, scene, Some).unwrap()
    }
}
