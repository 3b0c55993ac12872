//! softras inside an engine of one's own: its device, its memory, its command buffers, two frames in flight.
//!
//! Every frame records, into one command buffer: softras' forward pass over the engine's own vertex and index buffers; the
//! engine's loss kernel, which compares with a target; softras' backward pass; the engine's Adam kernel, which moves a
//! vertex; softras' image, stored into the engine's VkImage; and the engine's own triangles, drawn on top of it.
//!
//! `cargo run --example embed_ash [PICTURE.png]`
// An example of raw Vulkan has no other way: see examples/engine/mod.rs.
#![allow(unsafe_code, dead_code, missing_docs, clippy::undocumented_unsafe_blocks)]

#[path = "engine/mod.rs"]
pub mod engine;

use ash::vk;
use engine::{Buffer, Commands, Compute, Engine, Image, Outcome, Overlay};
use glam::DVec3;
use gpu_allocator::MemoryLocation;
use softras::embed::{
    FrameImage, GeometryGradients, ImageBindings, ImageFormat, ImageRef, Layout, MemoryKind, MeshBuffers, MeshLook,
    Pass, PassBuffer, PassMemory, PassMesh, PassPlan, PassStatus, Rasterizer, Requirements,
};
use softras::scene::Background;
use softras::{Camera, GradientRequest, Projection, Settings};
use std::path::Path;

const SIZE: u32 = 256;
const STEPS: usize = 120;
const IN_FLIGHT: usize = 2;
/// Where the first vertex is to go, and where it starts.
const TARGET: [f32; 3] = [0.7, 0.8, 0.0];
const START: [f32; 3] = [-0.1, 0.5, 0.0];
const COLOR: [f32; 3] = [0.9, 0.2, 0.2];
/// x, y, z, r, g, b of the other vertices, and two triangles.
const REST: [[f32; 6]; 3] =
    [[-0.8, -0.4, 0.0, 0.2, 0.7, 0.3], [0.0, -0.9, 0.0, 0.2, 0.3, 0.9], [0.8, -0.3, 0.0, 0.9, 0.9, 0.9]];
const INDICES: [u32; 6] = [0, 1, 2, 0, 2, 3];
const POSITIONS: Layout = Layout { stride: 24, offset: 0 };
const COLORS: Layout = Layout { stride: 24, offset: 12 };

/// dL/dcolour and dL/dsilhouette of L = the mean square difference from the target.
const LOSS: &str = "
@group(0) @binding(0) var<storage, read> color: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> goal: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> upstream: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixels = arrayLength(&upstream);
    if id.x < pixels {
        upstream[id.x] = 2.0 / f32(4u * pixels) * (color[id.x] - goal[id.x]);
    }
}";

/// One step of Adam on x and y of the first vertex.
const ADAM: &str = "
@group(0) @binding(0) var<storage, read> gradients: array<f32>;
@group(0) @binding(1) var<storage, read_write> positions: array<f32>;
@group(0) @binding(2) var<storage, read_write> state: array<f32>;

@compute @workgroup_size(1)
fn main() {
    let step = state[4] + 1.0;
    for (var axis = 0u; axis < 2u; axis++) {
        let g = gradients[axis];
        let m = 0.9 * state[axis] + 0.1 * g;
        let v = 0.99 * state[2u + axis] + 0.01 * g * g;
        positions[axis] -= 0.03 * (m / (1.0 - pow(0.9, step))) / (sqrt(v / (1.0 - pow(0.99, step))) + 1e-8);
        state[axis] = m;
        state[2u + axis] = v;
    }
    state[4] = step;
}";

/// The engine's own triangles: the mesh once more, small, in the lower left corner.
const OVERLAY: &str = "
@vertex
fn vertex(@location(0) position: vec3<f32>) -> @builtin(position) vec4<f32> {
    return vec4(0.25 * position.x - 0.7, 0.7 - 0.25 * position.y, 0.5, 1.0);
}

@fragment
fn fragment() -> @location(0) vec4<f32> {
    return vec4(1.0, 0.8, 0.1, 1.0);
}";

/// The results of a run.
pub struct Report {
    /// Where the first vertex ended.
    pub vertex: [f32; 3],
    /// Where it should.
    pub target: [f32; 3],
    /// The last frame's image with the engine's triangles: linear RGBA.
    pub pixels: Vec<f32>,
    /// The messages of the validation layer, those on destruction included.
    pub messages: Vec<String>,
}

/// A pass of softras' and the memory that the engine made for it.
struct Soft {
    pass: Pass,
    device: Buffer,
    upload: Buffer,
    readback: Buffer,
}

/// One frame in flight: its commands, softras' pass, the engine's descriptor sets and image.
struct Flight {
    commands: Commands,
    soft: Soft,
    gradients: Buffer,
    loss: vk::DescriptorSet,
    adam: vk::DescriptorSet,
    image: Image,
    stored: ImageBindings,
    framebuffer: vk::Framebuffer,
    picture: Buffer,
}

/// The objects that all frames share.
struct Shared {
    /// Read by softras, moved by Adam, drawn by the engine.
    vertices: Buffer,
    indices: Buffer,
    state: Buffer,
    goal: Buffer,
    plan: PassPlan,
    loss: Compute,
    adam: Compute,
    overlay: Overlay,
}

/// Runs the whole example; the picture goes to `path`.
pub fn run(path: Option<&Path>, validation: bool) -> Outcome<Report> {
    let engine = Engine::new(validation)?;
    let log = engine.log();
    // This check could run before a device is made.
    let about = Requirements::new().validate(&engine.host_adapter())?;
    println!("softras on {}", about.name);
    let rasterizer = Rasterizer::new(&engine.host_device())?;

    let mut shared = Shared::new(&engine, &rasterizer)?;
    let flights = (0..IN_FLIGHT).map(|_| Flight::new(&engine, &rasterizer, &shared)).collect::<Outcome<Vec<_>>>()?;
    shared.render_goal(&engine, &flights[0])?;
    for step in 0..STEPS {
        let flight = &flights[step % IN_FLIGHT];
        let commands = flight.commands.begin()?;
        // The frame that used this workspace before is done, so its status can be read without a wait.
        let readback = flight.soft.readback.bytes();
        if step == IN_FLIGHT
            && let PassStatus::Grow(capacity) = flight.soft.pass.status(readback)?
        {
            println!("a plan with {capacity:?} would be faster");
        }
        record(&engine, &shared, flight, commands)?;
        engine.submit(&flight.commands)?;
    }
    engine.wait_idle()?;

    let last = &flights[(STEPS - 1) % IN_FLIGHT];
    let pixels = last.picture.floats(0, (4 * SIZE * SIZE) as usize);
    if let Some(path) = path {
        save(path, &pixels)?;
    }
    let vertex = shared.vertices.floats(0, 3);
    for flight in &flights {
        shared.overlay.destroy_framebuffer(flight.framebuffer);
    }
    drop((flights, shared, rasterizer, engine));
    let messages = log.lock().map_err(|e| e.to_string())?.clone();
    Ok(Report { vertex: [vertex[0], vertex[1], vertex[2]], target: TARGET, pixels, messages })
}

/// Records one frame.
fn record(engine: &Engine, shared: &Shared, flight: &Flight, commands: vk::CommandBuffer) -> Outcome<()> {
    use vk::{AccessFlags as A, ImageLayout as L, PipelineStageFlags as S};
    let (device, pass) = (engine.device(), &flight.soft.pass);
    let mut host = flight.commands.host();
    pass.record_forward(&mut host)?;
    // softras' own barriers order compute and copies before and after it; so none is needed around these kernels.
    shared.loss.dispatch(commands, flight.loss, (SIZE * SIZE).div_ceil(64));
    pass.record_backward(&mut host)?;
    shared.adam.dispatch(commands, flight.adam, 1);

    // softras stores its image into the engine's image.
    let image = |from, to, source, target| image_barrier(device, commands, flight.image.raw, from, to, source, target);
    let stored = (S::COMPUTE_SHADER, A::SHADER_WRITE);
    image(L::UNDEFINED, L::GENERAL, (S::TRANSFER, A::empty()), stored);
    pass.record_store(&mut host, &flight.stored)?;
    // The engine draws its own triangles from the vertices that Adam just moved.
    let moved =
        [vk::MemoryBarrier::default().src_access_mask(A::SHADER_WRITE).dst_access_mask(A::VERTEX_ATTRIBUTE_READ)];
    let none = vk::DependencyFlags::empty();
    unsafe { device.cmd_pipeline_barrier(commands, S::COMPUTE_SHADER, S::VERTEX_INPUT, none, &moved, &[], &[]) };
    let drawn = (S::COLOR_ATTACHMENT_OUTPUT, A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE);
    image(L::GENERAL, L::COLOR_ATTACHMENT_OPTIMAL, stored, drawn);
    let indices = (shared.indices.raw, 0, INDICES.len() as u32);
    shared.overlay.draw(commands, flight.framebuffer, (shared.vertices.raw, 0), indices);

    // The image is copied to where the host can read it.
    image(L::COLOR_ATTACHMENT_OPTIMAL, L::TRANSFER_SRC_OPTIMAL, drawn, (S::TRANSFER, A::TRANSFER_READ));
    let copy = pass.plan().image_copy(PassBuffer::Color, 0, &flight.picture.whole()).ok_or("no colour")?;
    unsafe {
        let layout = L::TRANSFER_SRC_OPTIMAL;
        device.cmd_copy_image_to_buffer(commands, flight.image.raw, layout, flight.picture.raw, &[copy]);
    }
    let host = [vk::MemoryBarrier::default()
        .src_access_mask(A::TRANSFER_WRITE | A::SHADER_WRITE)
        .dst_access_mask(A::HOST_READ)];
    unsafe { device.cmd_pipeline_barrier(commands, S::TRANSFER | S::COMPUTE_SHADER, S::HOST, none, &host, &[], &[]) };
    Ok(())
}

type Access = (vk::PipelineStageFlags, vk::AccessFlags);

fn image_barrier(
    device: &ash::Device,
    commands: vk::CommandBuffer,
    image: vk::Image,
    from: vk::ImageLayout,
    to: vk::ImageLayout,
    source: Access,
    target: Access,
) {
    let barrier = [vk::ImageMemoryBarrier::default()
        .image(image)
        .subresource_range(engine::color_range())
        .old_layout(from)
        .new_layout(to)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .src_access_mask(source.1)
        .dst_access_mask(target.1)];
    let none = vk::DependencyFlags::empty();
    unsafe { device.cmd_pipeline_barrier(commands, source.0, target.0, none, &[], &[], &barrier) };
}

impl Soft {
    /// Makes a plan's memory, binds it and runs its setup.
    fn new(engine: &Engine, rasterizer: &Rasterizer, plan: PassPlan, mesh: MeshBuffers) -> Outcome<Self> {
        let [upload, device, readback] = plan.memory().map(|needs| {
            let location = match needs.kind {
                MemoryKind::Upload => MemoryLocation::CpuToGpu,
                MemoryKind::Device => MemoryLocation::GpuOnly,
                MemoryKind::Readback => MemoryLocation::GpuToCpu,
            };
            engine.buffer(needs.size, needs.usage, location)
        });
        let (mut upload, device, readback) = (upload?, device?, readback?);
        let memory =
            PassMemory { upload: upload.whole(), device: device.whole(), readback: readback.whole(), own: &[] };
        let pass = rasterizer.bind_pass(plan, memory, &[mesh])?;
        pass.write_inputs(upload.bytes_mut())?;
        let commands = engine.commands()?;
        commands.begin()?;
        pass.record_setup(&mut commands.host())?;
        engine.submit(&commands)?;
        commands.wait()?;
        Ok(Self { pass, device, upload, readback })
    }

    /// One of the pass's buffers as the engine binds it.
    fn part(&self, id: PassBuffer) -> Outcome<(vk::Buffer, u64, u64)> {
        let part = self.pass.buffer(id).ok_or_else(|| format!("the pass has no buffer {id}"))?;
        Ok((part.raw(), part.offset(), part.range()))
    }
}

impl Shared {
    fn new(engine: &Engine, rasterizer: &Rasterizer) -> Outcome<Self> {
        type Usage = vk::BufferUsageFlags;
        let filled = |usage, bytes: &[u8]| -> Outcome<Buffer> {
            let mut made = engine.buffer(bytes.len() as u64, usage, MemoryLocation::CpuToGpu)?;
            made.write(0, bytes);
            Ok(made)
        };
        let [[x, y, z], [r, g, b]] = [TARGET, COLOR];
        let vertices = [[x, y, z, r, g, b], REST[0], REST[1], REST[2]];
        let image = u64::from(16 * SIZE * SIZE);
        let camera = Camera::look_at(4.0 * DVec3::Z, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.6 })?;
        let plan = rasterizer
            .pass(&[PassMesh::new(4, &INDICES).with_look(MeshLook::VertexColors)])
            .settings(Settings { sigma: 1e-3, background: Background::Composite, ..Settings::default() })
            .image_size(SIZE, SIZE)
            .cameras(&[camera])
            .gradients(GradientRequest::default())
            .build()?;
        Ok(Self {
            vertices: filled(Usage::STORAGE_BUFFER | Usage::VERTEX_BUFFER, bytemuck::cast_slice(&vertices))?,
            indices: filled(Usage::INDEX_BUFFER, bytemuck::cast_slice(&INDICES))?,
            state: filled(Usage::STORAGE_BUFFER, &[0; 32])?,
            goal: engine.buffer(image, Usage::STORAGE_BUFFER | Usage::TRANSFER_DST, MemoryLocation::GpuOnly)?,
            plan,
            loss: Compute::new(engine, LOSS, 3, IN_FLIGHT as u32)?,
            adam: Compute::new(engine, ADAM, 3, IN_FLIGHT as u32)?,
            overlay: Overlay::new(engine, OVERLAY, POSITIONS.stride, (SIZE, SIZE))?,
        })
    }

    /// Renders the mesh as it should be, by softras itself, and moves its first vertex to where it starts.
    fn render_goal(&mut self, engine: &Engine, flight: &Flight) -> Outcome<()> {
        let commands = flight.commands.begin()?;
        flight.soft.pass.record_forward(&mut flight.commands.host())?;
        let (color, src_offset, size) = flight.soft.part(PassBuffer::Color)?;
        let copy = [vk::BufferCopy { src_offset, dst_offset: 0, size }];
        unsafe { engine.device().cmd_copy_buffer(commands, color, self.goal.raw, &copy) };
        engine.submit(&flight.commands)?;
        flight.commands.wait()?;
        self.vertices.write(0, bytemuck::cast_slice(&START));
        Ok(())
    }
}

impl Flight {
    fn new(engine: &Engine, rasterizer: &Rasterizer, shared: &Shared) -> Outcome<Self> {
        let vertices = &shared.vertices;
        let gradients = engine.buffer(vertices.size, vk::BufferUsageFlags::STORAGE_BUFFER, MemoryLocation::GpuOnly)?;
        let positions = Some((gradients.whole(), POSITIONS));
        let mesh = MeshBuffers {
            colors: Some((vertices.whole(), COLORS)),
            gradients: GeometryGradients { positions, ..GeometryGradients::default() },
            ..MeshBuffers::new(vertices.whole(), POSITIONS)
        };
        let soft = Soft::new(engine, rasterizer, shared.plan.clone(), mesh)?;
        let whole = |buffer: &Buffer| (buffer.raw, 0, buffer.size);
        let (color, upstream) = (soft.part(PassBuffer::Color)?, soft.part(PassBuffer::UpstreamColor)?);
        let loss = shared.loss.bind(&[color, whole(&shared.goal), upstream])?;
        let adam = shared.adam.bind(&[whole(&gradients), whole(vertices), whole(&shared.state)])?;
        let image = engine.image(SIZE, SIZE)?;
        let target = unsafe { ImageRef::new(image.view, ImageFormat::Rgba32Float, SIZE, SIZE) };
        let stored = soft.pass.bind_image(FrameImage::Color { srgb: false }, 0, &target)?;
        let framebuffer = shared.overlay.framebuffer(&image)?;
        let size = u64::from(16 * SIZE * SIZE);
        let picture = engine.buffer(size, vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu)?;
        let commands = engine.commands()?;
        Ok(Self { commands, soft, gradients, loss, adam, image, stored, framebuffer, picture })
    }
}

/// Linear RGBA floats as an opaque PNG in sRGB.
pub fn save(path: &Path, pixels: &[f32]) -> Outcome<()> {
    let encode = |x: f32| {
        let x = x.clamp(0.0, 1.0);
        let x = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (255.0 * x).round() as u8
    };
    let bytes: Vec<u8> = pixels.chunks_exact(4).flat_map(|p| [encode(p[0]), encode(p[1]), encode(p[2])]).collect();
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(std::fs::File::create(path)?), SIZE, SIZE);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    Ok(encoder.write_header()?.write_image_data(&bytes)?)
}

fn main() -> Outcome<()> {
    let path = std::env::args_os().nth(1).map_or_else(|| "embed_ash.png".into(), std::path::PathBuf::from);
    let validation = std::env::var_os("SOFTRAS_VALIDATION").is_some_and(|v| v != "0");
    let report = run(Some(&path), validation)?;
    println!("the vertex is at {:?}, its target at {:?}; picture in {}", report.vertex, report.target, path.display());
    Ok(())
}
