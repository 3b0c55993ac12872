//! softras in an engine on vulkanalia, which knows nothing of ash: handles, sizes and usages cross as plain numbers.
//!
//! The engine records one command buffer (softras renders, a kernel of the engine compares with the goal, softras
//! differentiates, a kernel of the engine moves the vertices) and submits it again and again without a wait, so that a sphere
//! becomes the goal.
//!
//! `cargo run -p embed-vulkanalia [PICTURE.png]`
// Raw Vulkan has no other way. All objects live until the process or the test ends: see `run`.
#![allow(unsafe_code, dead_code, missing_docs, clippy::undocumented_unsafe_blocks)]

mod engine;

use engine::{Buffer, Engine, Kernel, Outcome};
use softras::embed::{
    BufferRef, HostAdapter, HostCommands, HostDevice, Layout, MemoryKind, MeshBuffers, MeshLook, Pass, PassBuffer,
    PassMemory, PassMesh, PassStatus, Rasterizer, Requirements,
};
use softras::scene::Background;
use softras::{Camera, GradientRequest, Lights, Mesh, Projection, Settings, shapes};
use std::path::Path;
use vulkanalia::prelude::v1_1::*;

const SIZE: u32 = 96;
const STEPS: usize = 100;
/// x, y, z of each vertex, one after the other.
const PACKED: Layout = Layout { stride: 12, offset: 0 };

/// dL/dcolour and dL/dsilhouette of L = the mean square difference from the goal.
const LOSS: &str = "
@group(0) @binding(0) var<storage, read> image: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> goal: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> upstream: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixels = arrayLength(&goal);
    if id.x < pixels {
        upstream[id.x] = 2.0 / f32(pixels) * (image[id.x] - goal[id.x]);
    }
}";

/// A step of Adam on each coordinate, with one rate for all of them. Nothing moves after a frame that is not whole.
const ADAM: &str = "
@group(0) @binding(0) var<storage, read> gradients: array<f32>;
@group(0) @binding(1) var<storage, read_write> positions: array<f32>;
@group(0) @binding(2) var<storage, read_write> moments: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> status: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&positions) || status[WHOLE] != 1u {
        return;
    }
    let g = gradients[id.x];
    let old = moments[id.x];
    let step = old.z + 1.0;
    let m = 0.9 * old.x + 0.1 * g;
    let v = 0.99 * old.y + 0.01 * g * g;
    positions[id.x] -= 0.008 * (m / (1.0 - pow(0.9, step))) / (sqrt(v / (1.0 - pow(0.99, step))) + 1e-6);
    moments[id.x] = vec4(m, v, step, 0.0);
}";

/// The goal: the sphere flattened, with a dent.
fn goal_of(sphere: &Mesh) -> Vec<[f32; 3]> {
    let moved = |&[x, y, z]: &[f32; 3]| {
        let dent = 0.35 * (-8.0 * ((x - 0.6).powi(2) + (y - 0.6).powi(2))).exp();
        [1.15 * x - dent, 0.75 * y - dent, 0.9 * z]
    };
    sphere.positions().iter().map(moved).collect()
}

fn cameras() -> softras::Result<Vec<Camera>> {
    let angles = [(15.0, 0.0), (-20.0, 60.0), (20.0, 120.0), (-15.0, 180.0), (20.0, 240.0), (-20.0, 300.0)];
    let projection = Projection::Perspective { fov_y: 0.8 };
    angles.iter().map(|&(elevation, azimuth)| Camera::from_angles(3.0, elevation, azimuth, projection)).collect()
}

/// softras on the engine's device.
fn rasterizer(engine: &Engine) -> Outcome<Rasterizer> {
    // The engine outlives what is made here.
    let host = unsafe {
        let (instance, physical) = (engine.instance.handle().as_raw(), engine.physical.as_raw());
        let adapter = HostAdapter::from_raw(engine.get_instance_proc_addr, instance as u64, physical as u64)?;
        println!("softras on {}", Requirements::new().validate(&adapter)?.name);
        let device = HostDevice::from_raw(adapter, engine.device.handle().as_raw() as u64)?;
        if engine.validates() { device.with_debug_utils().with_label_prefix("soft ") } else { device }
    };
    Ok(Rasterizer::new(&host)?)
}

/// A buffer as softras takes it.
fn whole(buffer: &Buffer) -> BufferRef {
    unsafe { BufferRef::from_raw(buffer.raw.as_raw(), buffer.size, buffer.usage) }
}

/// The pass, what it was bound to, and its commands.
struct Fit {
    pass: Pass,
    readback: Buffer,
    vertices: Buffer,
    goal: Buffer,
    commands: vk::CommandBuffer,
}

impl Fit {
    fn new(engine: &Engine, rasterizer: &Rasterizer, sphere: &Mesh) -> Outcome<Self> {
        let count = sphere.positions().len() as u32;
        let settings = Settings { width: SIZE, height: SIZE, background: Background::Composite, ..Settings::default() };
        let plan = rasterizer
            .pass(&[PassMesh::new(count, sphere.triangles().as_flattened()).with_look(MeshLook::Color([0.8; 3]))])
            .settings(settings.with_blur_pixels(2.5))
            .cameras(&cameras()?)
            .lights(Lights::official())
            .gradients(GradientRequest::default())
            .read_back(&[PassBuffer::Color])
            .build()?;
        let memory = plan.memory().map(|needs| {
            let mapped = needs.kind != MemoryKind::Device;
            engine.buffer(needs.size, needs.usage.as_raw(), mapped)
        });
        let [upload, device, readback] = memory;
        let (mut upload, device, readback) = (upload?, device?, readback?);
        let storage = vk::BufferUsageFlags::STORAGE_BUFFER.bits();
        let made = |bytes: u64| engine.buffer(bytes, storage, true);
        let coordinates = 12 * u64::from(count);
        let (vertices, gradients, moments) = (made(coordinates)?, made(coordinates)?, made(4 * coordinates)?);
        let mut buffers = MeshBuffers::new(whole(&vertices), PACKED);
        buffers.gradients.positions = Some((whole(&gradients), PACKED));
        let memory =
            PassMemory { upload: whole(&upload), device: whole(&device), readback: whole(&readback), own: &[] };
        let pass = rasterizer.bind_pass(plan, memory, &[buffers])?;
        pass.write_inputs(upload.bytes())?;

        // softras' buffers that the engine's kernels read and write lie in the buffer for the device.
        let part = |id| -> Outcome<(vk::Buffer, u64, u64)> {
            let at = pass.buffer(id).ok_or("the pass has no such buffer")?;
            Ok((device.raw, at.offset(), at.range()))
        };
        let own = |buffer: &Buffer| (buffer.raw, 0, buffer.size);
        let (color, upstream) = (part(PassBuffer::Color)?, part(PassBuffer::UpstreamColor)?);
        let goal = made(color.2)?;
        let loss = engine.kernel(LOSS, &[color, own(&goal), upstream])?;
        let adam = ADAM.replace("WHOLE", &(PassStatus::WHOLE_OFFSET / 4).to_string());
        let adam =
            engine.kernel(&adam, &[own(&gradients), own(&vertices), own(&moments), part(PassBuffer::Status)?])?;
        let commands = Self::record(engine, &pass, [(&loss, color.2 / 16), (&adam, coordinates / 4)])?;
        Ok(Self { pass, readback, vertices, goal, commands })
    }

    /// One step of the fit. softras' own barriers order its work and that of the kernels beside it.
    fn record(engine: &Engine, pass: &Pass, kernels: [(&Kernel, u64); 2]) -> Outcome<vk::CommandBuffer> {
        let setup = engine.begin()?;
        pass.record_setup(&mut unsafe { HostCommands::from_raw(setup.as_raw() as u64) })?;
        engine.submit(setup)?;
        let commands = engine.begin()?;
        let mut host = unsafe { HostCommands::from_raw(commands.as_raw() as u64) };
        pass.record_forward(&mut host)?;
        engine.dispatch(commands, kernels[0]);
        pass.record_backward(&mut host)?;
        engine.dispatch(commands, kernels[1]);
        engine.barrier_to_host(commands);
        Ok(commands)
    }

    /// Linear r, g, b and silhouette of all views in the frame rendered last.
    fn images(&mut self) -> Outcome<&[f32]> {
        self.pass.status(self.readback.bytes())?;
        let (at, size) = self.pass.plan().readback_part(PassBuffer::Color).ok_or("no colour")?;
        Ok(bytemuck::cast_slice(&self.readback.bytes()[at as usize..(at + size) as usize]))
    }
}

/// The result of a run.
pub struct Report {
    /// Mean square differences from the goal before and after the fit.
    pub losses: [f32; 2],
    /// The messages of the validation layer.
    pub messages: Vec<String>,
}

/// Runs the example: goal, sphere and fitted mesh from the first camera go to `path`, side by side.
pub fn run(path: &Path, validation: bool) -> Outcome<Report> {
    let engine = Engine::new(validation)?;
    let sphere = shapes::icosphere(3)?;
    let rasterizer = rasterizer(&engine)?;
    let mut fit = Fit::new(&engine, &rasterizer, &sphere)?;
    // A first step renders the goal. It moves the vertices too, which are then put back.
    fit.vertices.write(bytemuck::cast_slice(&goal_of(&sphere)));
    engine.end(fit.commands)?;
    engine.run(fit.commands, 1)?;
    let goal = fit.images()?.to_vec();
    fit.goal.write(bytemuck::cast_slice(&goal));
    fit.vertices.write(bytemuck::cast_slice(sphere.positions()));
    engine.run(fit.commands, 1)?;
    let before = fit.images()?.to_vec();
    engine.run(fit.commands, STEPS)?;
    let after = fit.images()?.to_vec();
    save(path, &[&goal, &before, &after])?;
    let loss =
        |images: &[f32]| images.iter().zip(&goal).map(|(a, b)| (a - b).powi(2)).sum::<f32>() / (goal.len() / 4) as f32;
    let losses = [loss(&before), loss(&after)];
    drop((fit, rasterizer));
    Ok(Report { losses, messages: engine.close() })
}

/// The first views of several frames, side by side, as a PNG in sRGB.
fn save(path: &Path, frames: &[&[f32]]) -> Outcome<()> {
    let encode = |x: f32| {
        let x = x.clamp(0.0, 1.0);
        let x = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (255.0 * x).round() as u8
    };
    let row = 4 * SIZE as usize;
    let rows = (0..SIZE as usize).flat_map(|y| frames.iter().map(move |frame| &frame[row * y..row * (y + 1)]));
    let bytes: Vec<u8> =
        rows.flat_map(|row| row.chunks_exact(4)).flat_map(|p| [0, 1, 2].map(|k| encode(p[k]))).collect();
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, frames.len() as u32 * SIZE, SIZE);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    Ok(encoder.write_header()?.write_image_data(&bytes)?)
}

fn main() -> Outcome<()> {
    let path = std::env::args_os().nth(1).map_or_else(|| "embed_vulkanalia.png".into(), std::path::PathBuf::from);
    let validation = std::env::var_os("SOFTRAS_VALIDATION").is_some_and(|v| v != "0");
    let Report { losses: [before, after], messages } = run(&path, validation)?;
    println!("mean square difference {before:.5} before and {after:.5} after the fit; picture in {}", path.display());
    messages.iter().for_each(|message| println!("{message}"));
    Ok(())
}
