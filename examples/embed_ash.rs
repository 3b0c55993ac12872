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
    Arena, BufferId, BufferRef, Differentiate, FrameBindings, FrameImage, FramePlan, GradientBindings, GradientPlan,
    ImageBindings, ImageFormat, ImageRef, Inputs, Rasterizer, Shape, Status, requirements,
};
use softras::scene::{Appearance, Background, Outputs};
use softras::{Camera, Mesh, Projection, Scene, Settings, Wanted};
use std::path::Path;

const SIZE: u32 = 256;
const STEPS: usize = 120;
const IN_FLIGHT: usize = 2;
/// Where the first vertex is to go, and where it starts.
const TARGET: [f32; 3] = [0.7, 0.8, 0.0];
const START: [f32; 3] = [-0.1, 0.5, 0.0];

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
@group(0) @binding(0) var<storage, read> gradients: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> positions: array<f32>;
@group(0) @binding(2) var<storage, read_write> state: array<f32>;

@compute @workgroup_size(1)
fn main() {
    let step = state[4] + 1.0;
    for (var axis = 0u; axis < 2u; axis++) {
        let g = gradients[0][axis];
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

/// What came out.
pub struct Report {
    /// Where the first vertex ended.
    pub vertex: [f32; 3],
    /// Where it should.
    pub target: [f32; 3],
    /// The last frame's image with the engine's triangles: linear RGBA.
    pub pixels: Vec<f32>,
    /// What the validation layer said, destruction included.
    pub messages: Vec<String>,
}

/// One frame in flight: its commands, softras' workspace and bindings, the engine's image.
struct Flight {
    commands: Commands,
    workspace: Buffer,
    status: Buffer,
    forward: FrameBindings,
    backward: GradientBindings,
    loss: vk::DescriptorSet,
    adam: vk::DescriptorSet,
    image: Image,
    stored: ImageBindings,
    framebuffer: vk::Framebuffer,
    picture: Buffer,
}

/// What all frames share.
struct Shared {
    /// Read by softras, moved by Adam, drawn by the engine.
    positions: Buffer,
    state: Buffer,
    goal: Buffer,
    inputs: Buffer,
    inputs_arena: Arena,
    plan: FramePlan,
    gradient_plan: GradientPlan,
    loss: Compute,
    adam: Compute,
    overlay: Overlay,
}

fn mesh(first: [f32; 3]) -> softras::Result<Mesh> {
    let positions = vec![first, [-0.8, -0.4, 0.0], [0.0, -0.9, 0.0], [0.8, -0.3, 0.0]];
    let colors = vec![[0.9, 0.2, 0.2], [0.2, 0.7, 0.3], [0.2, 0.3, 0.9], [0.9, 0.9, 0.9]];
    Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]])?.with_appearance(Appearance::VertexColors(colors))
}

fn settings() -> Settings {
    Settings {
        width: SIZE,
        height: SIZE,
        sigma: 1e-3,
        background: Background::Composite,
        outputs: Outputs { color: true, silhouette: true, depth: false, normal: false },
        save: true,
        ..Settings::default()
    }
}

/// Runs the whole example; the picture goes to `path`.
pub fn run(path: Option<&Path>, validation: bool) -> Outcome<Report> {
    let engine = Engine::new(validation)?;
    let log = engine.log();
    // Could be asked before there is a device.
    let about = requirements().judge(&engine.host_adapter())?;
    println!("softras on {}", about.name);
    let rasterizer = Rasterizer::new(&engine.host_device())?;

    let camera = Camera::look_at(4.0 * DVec3::Z, DVec3::ZERO, DVec3::Y, Projection::Perspective { fov_y: 0.6 })?;
    let goal = target(&engine, &rasterizer, &camera)?;
    let shared = Shared::new(&engine, &rasterizer, &camera, goal)?;
    let flights = (0..IN_FLIGHT).map(|_| Flight::new(&engine, &rasterizer, &shared)).collect::<Outcome<Vec<_>>>()?;
    for step in 0..STEPS {
        let flight = &flights[step % IN_FLIGHT];
        let commands = flight.commands.begin()?;
        // The frame that used this workspace before is done, so its status can be read without a wait.
        if step >= IN_FLIGHT && flight.status(&shared.plan)?.is_some() {
            return Err("the lists were too small: plan again with the capacity that the status tells".into());
        }
        record(&engine, &rasterizer, &shared, flight, commands)?;
        engine.submit(&flight.commands)?;
    }
    engine.wait_idle()?;

    let last = &flights[(STEPS - 1) % IN_FLIGHT];
    let pixels = last.picture.floats(0, (4 * SIZE * SIZE) as usize);
    if let Some(path) = path {
        save(path, &pixels)?;
    }
    let vertex = shared.positions.floats(0, 3);
    for flight in &flights {
        shared.overlay.destroy_framebuffer(flight.framebuffer);
    }
    drop((flights, shared, rasterizer, engine));
    let messages = log.lock().map_err(|e| e.to_string())?.clone();
    Ok(Report { vertex: [vertex[0], vertex[1], vertex[2]], target: TARGET, pixels, messages })
}

/// One frame.
fn record(
    engine: &Engine,
    rasterizer: &Rasterizer,
    shared: &Shared,
    flight: &Flight,
    commands: vk::CommandBuffer,
) -> Outcome<()> {
    use vk::{AccessFlags as A, ImageLayout as L, PipelineStageFlags as S};
    let device = engine.device();
    let mut host = flight.commands.host();
    rasterizer.record_forward(&mut host, &shared.plan, &flight.forward)?;
    // softras' own barriers order compute and copies before and after it; so none is needed around these kernels.
    shared.loss.dispatch(commands, flight.loss, (SIZE * SIZE).div_ceil(64));
    rasterizer.record_backward(&mut host, &shared.gradient_plan, &flight.backward)?;
    shared.adam.dispatch(commands, flight.adam, 1);

    // softras' image straight into the engine's.
    let image = |from, to, source, target| image_barrier(device, commands, flight.image.raw, from, to, source, target);
    let stored = (S::COMPUTE_SHADER, A::SHADER_WRITE);
    image(L::UNDEFINED, L::GENERAL, (S::TRANSFER, A::empty()), stored);
    rasterizer.record_image(&mut host, &flight.stored)?;
    // The engine's own triangles from the vertices that Adam just moved.
    let moved =
        [vk::MemoryBarrier::default().src_access_mask(A::SHADER_WRITE).dst_access_mask(A::VERTEX_ATTRIBUTE_READ)];
    let none = vk::DependencyFlags::empty();
    unsafe { device.cmd_pipeline_barrier(commands, S::COMPUTE_SHADER, S::VERTEX_INPUT, none, &moved, &[], &[]) };
    let drawn = (S::COLOR_ATTACHMENT_OUTPUT, A::COLOR_ATTACHMENT_READ | A::COLOR_ATTACHMENT_WRITE);
    image(L::GENERAL, L::COLOR_ATTACHMENT_OPTIMAL, stored, drawn);
    let indices = shared.inputs_arena.part(BufferId::Indices).ok_or("no indices")?.0;
    shared.overlay.draw(commands, flight.framebuffer, (shared.positions.raw, 0), (shared.inputs.raw, indices, 6));

    // For the host to look at.
    image(L::COLOR_ATTACHMENT_OPTIMAL, L::TRANSFER_SRC_OPTIMAL, drawn, (S::TRANSFER, A::TRANSFER_READ));
    let copy = shared.plan.image_copy(BufferId::Color, 0, &flight.picture.whole()).ok_or("no colour")?;
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

impl Shared {
    fn new(engine: &Engine, rasterizer: &Rasterizer, camera: &Camera, goal: Buffer) -> Outcome<Self> {
        let (scene, settings, cameras) = (Scene::new(mesh(START)?), settings(), [*camera]);
        let shape = Shape::of(&scene, &cameras, &settings)?;
        let plan = rasterizer.plan(&shape, &settings)?;
        let gradient_plan = rasterizer.plan_backward(
            &plan,
            &Differentiate { upstream: settings.outputs, wanted: Wanted::default(), largest_upstream: 1.0 },
        )?;
        let inputs = Inputs::new(&scene, &cameras, &settings, &plan);
        let is_arena = |id: BufferId| id != BufferId::Positions && inputs.get(id).is_some();
        let inputs_arena = Arena::of(plan.buffers().iter().filter(|b| is_arena(b.id)));
        let usage = inputs_arena.usage | vk::BufferUsageFlags::INDEX_BUFFER;
        let mut buffer = engine.buffer(inputs_arena.size, usage, MemoryLocation::CpuToGpu)?;
        for &(name, offset, _) in &inputs_arena.parts {
            buffer.write(offset, inputs.get(name).unwrap_or_default());
        }
        let needed = plan.buffer(BufferId::Positions).ok_or("no positions")?;
        let usage = needed.usage | vk::BufferUsageFlags::VERTEX_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER;
        let mut positions = engine.buffer(needed.size, usage, MemoryLocation::CpuToGpu)?;
        positions.write(0, inputs.get(BufferId::Positions).ok_or("no positions")?);
        let mut state = engine.buffer(32, vk::BufferUsageFlags::STORAGE_BUFFER, MemoryLocation::CpuToGpu)?;
        state.write(0, &[0; 32]);
        Ok(Self {
            positions,
            state,
            goal,
            inputs: buffer,
            inputs_arena,
            plan,
            gradient_plan,
            loss: Compute::new(engine, LOSS, 3, IN_FLIGHT as u32)?,
            adam: Compute::new(engine, ADAM, 3, IN_FLIGHT as u32)?,
            overlay: Overlay::new(engine, OVERLAY, (SIZE, SIZE))?,
        })
    }
}

impl Flight {
    fn new(engine: &Engine, rasterizer: &Rasterizer, shared: &Shared) -> Outcome<Self> {
        let is_shared = |id: BufferId| id == BufferId::Positions || shared.inputs_arena.part(id).is_some();
        let own = shared.plan.buffers().iter().filter(|b| !is_shared(b.id) && b.id != BufferId::Status);
        let arena = Arena::of(own.chain(shared.gradient_plan.buffers()));
        let workspace = engine.buffer(arena.size, arena.usage, MemoryLocation::GpuOnly)?;
        let needed = shared.plan.buffer(BufferId::Status).ok_or("no status")?;
        let status = engine.buffer(needed.size, needed.usage, MemoryLocation::GpuToCpu)?;
        let refs = arena.refs(&workspace.whole())?;
        let part = |id: BufferId| refs.iter().find(|(i, _)| *i == id).map(|(_, at)| *at).ok_or("no such buffer");

        let of_gradients = |id: BufferId| shared.gradient_plan.buffer(id).is_some();
        let mut buffers = shared.inputs_arena.refs(&shared.inputs.whole())?;
        buffers.extend(refs.iter().filter(|(id, _)| !of_gradients(*id)));
        buffers.extend([(BufferId::Positions, shared.positions.whole()), (BufferId::Status, status.whole())]);
        let forward = rasterizer.bind(&shared.plan, &buffers)?;
        let buffers: Vec<_> = refs.iter().copied().filter(|(id, _)| of_gradients(*id)).collect();
        let backward = rasterizer.bind_backward(&shared.gradient_plan, &forward, &buffers)?;

        let triple = |at: BufferRef| (at.raw(), at.offset(), at.range());
        let whole = |buffer: &Buffer| (buffer.raw, 0, buffer.size);
        let (color, upstream) = (part(BufferId::Color)?, part(BufferId::UpstreamColor)?);
        let loss = shared.loss.bind(&[triple(color), whole(&shared.goal), triple(upstream)])?;
        let gradients = triple(part(BufferId::VertexGradients)?);
        let adam = shared.adam.bind(&[gradients, whole(&shared.positions), whole(&shared.state)])?;
        let image = engine.image(SIZE, SIZE)?;
        let target = unsafe { ImageRef::new(image.view, ImageFormat::Rgba32Float, SIZE, SIZE) };
        let color = FrameImage::Color { srgb: false };
        let stored = rasterizer.bind_image(&shared.plan, &forward, color, 0, &target)?;
        let framebuffer = shared.overlay.framebuffer(&image)?;
        let size = u64::from(16 * SIZE * SIZE);
        let picture = engine.buffer(size, vk::BufferUsageFlags::TRANSFER_DST, MemoryLocation::GpuToCpu)?;
        let commands = engine.commands()?;
        Ok(Self { commands, workspace, status, forward, backward, loss, adam, image, stored, framebuffer, picture })
    }

    /// What the last frame says; the room it needs, if it had too little.
    fn status(&self, plan: &FramePlan) -> Outcome<Option<softras::internals::plan::Capacity>> {
        let bytes = self.status.bytes().first_chunk::<{ Status::BYTES }>().ok_or("no status")?;
        Ok(Status::from_bytes(bytes).judge(plan)?)
    }
}

/// The image of the mesh as it should be, by softras itself: colour and silhouette, 16 bytes a pixel.
fn target(engine: &Engine, rasterizer: &Rasterizer, camera: &Camera) -> Outcome<Buffer> {
    let (scene, cameras) = (Scene::new(mesh(TARGET)?), [*camera]);
    let settings = Settings { save: false, ..settings() };
    let plan = rasterizer.plan(&Shape::of(&scene, &cameras, &settings)?, &settings)?;
    let inputs = Inputs::new(&scene, &cameras, &settings, &plan);
    let arena = Arena::of(plan.buffers());
    let mut buffer = engine.buffer(arena.size, arena.usage, MemoryLocation::CpuToGpu)?;
    for &(name, offset, _) in &arena.parts {
        buffer.write(offset, inputs.get(name).unwrap_or_default());
    }
    let bindings = rasterizer.bind(&plan, &arena.refs(&buffer.whole())?)?;
    let (offset, size) = arena.part(BufferId::Color).ok_or("no colour")?;
    let usage = vk::BufferUsageFlags::STORAGE_BUFFER | vk::BufferUsageFlags::TRANSFER_DST;
    let goal = engine.buffer(size, usage, MemoryLocation::GpuOnly)?;
    let flight = engine.commands()?;
    let commands = flight.begin()?;
    rasterizer.record_forward(&mut flight.host(), &plan, &bindings)?;
    unsafe {
        let copy = [vk::BufferCopy { src_offset: offset, dst_offset: 0, size }];
        engine.device().cmd_copy_buffer(commands, buffer.raw, goal.raw, &copy);
    }
    engine.submit(&flight)?;
    flight.wait()?;
    Ok(goal)
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
