//! softras inside vk-graph, a published render-graph engine on ash: softras' passes are commands of the engine's graph.
//!
//! A sphere becomes a mesh (softras' fish, or any OBJ) by gradient descent on the device: in each graph softras renders
//! the engine's vertex buffer from several views, a kernel of the engine compares the images with the goal, softras
//! differentiates, and a kernel of the engine moves the vertices. Before and after the fit the engine composites softras'
//! image by depth with a triangle of its own.
//!
//! `cargo run -p embed-vk-graph [PICTURE.png [MESH.obj]]`
// Raw handles cross the border between the engine and softras; each block states what its call asks for.
#![allow(unsafe_code, dead_code, missing_docs)]

mod engine;
mod picture;

use engine::{Engine, Mesh, Soft, shader};
use picture::Picture;
use softras::embed::{Pass, PassBuffer, PassStatus};
use softras::glam::DVec3;
use softras::scene::{Background, Outputs};
use softras::{Camera, GradientRequest, Lights, Projection, Renderer, Scene, Settings, shapes};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vk_graph::Graph;
use vk_graph::driver::ash::vk::BufferUsageFlags as Usage;
use vk_graph::driver::buffer::{Buffer, BufferInfo};
use vk_graph::driver::compute::ComputePipeline;
use vk_graph::driver::sync::AccessType;
use vk_graph::node::BufferNode;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Pixels along an edge of the images that are compared.
const SIZE: u32 = 96;
/// Steps of the fit between two looks at its loss.
const ROUND: u32 = 25;
const ROUNDS: u32 = 8;
/// Weight of each vertex's distance from the mean of its neighbours.
const SMOOTHNESS: f32 = 0.03;

fn settings(size: u32, blur_pixels: f64) -> Settings {
    let settings = Settings { width: size, height: size, background: Background::Composite, ..Settings::default() };
    settings.with_blur_pixels(blur_pixels)
}

fn cameras() -> softras::Result<Vec<Camera>> {
    let angles = [(15.0, 0.0), (-20.0, 60.0), (20.0, 120.0), (-15.0, 180.0), (20.0, 240.0), (-20.0, 300.0)];
    let projection = Projection::Perspective { fov_y: 0.75 };
    angles.iter().map(|&(elevation, azimuth)| Camera::from_angles(3.0, elevation, azimuth, projection)).collect()
}

/// The mesh to fit, moved to the origin and scaled into the unit sphere.
fn goal_mesh(path: Option<&Path>) -> Outcome<softras::Mesh> {
    let mesh = match path {
        Some(path) => softras_io::load(path)?,
        None => shapes::fish()?,
    };
    let points = || mesh.positions().iter().map(|p| DVec3::from(p.map(f64::from)));
    let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let center = (low + high) / 2.0;
    let radius = points().map(|p| p.distance(center)).fold(1e-9, f64::max);
    let moved = points().map(|p| ((p - center) * 0.9 / radius).as_vec3().to_array()).collect();
    Ok(softras::Mesh::new(moved, mesh.triangles().to_vec())?.with_appearance(mesh.appearance().clone())?)
}

/// Red, green, blue and silhouette of the goal from every view. softras' simple API, on a device of its own, stands in for
/// a photographer.
fn goal_images(path: Option<&Path>) -> Outcome<Vec<f32>> {
    let scene = Scene::new(goal_mesh(path)?).with_lights(Lights::official());
    let frame = Renderer::new()?.render(&scene, &cameras()?, &settings(SIZE, BLUR))?;
    let (color, silhouette) = (frame.color()?, frame.silhouette()?);
    let pixels = color.data.chunks_exact(3).zip(&silhouette.data);
    Ok(pixels.flat_map(|(rgb, a)| [rgb[0], rgb[1], rgb[2], *a]).collect())
}

/// How far a triangle's influence reaches beyond its edge in the images that are compared, in pixels.
const BLUR: f64 = 2.5;

/// The pass, the kernels and the buffers of a step of the fit.
struct Fit {
    soft: Soft,
    loss: ComputePipeline,
    adam: ComputePipeline,
    goal: Arc<Buffer>,
    losses: Arc<Buffer>,
    moments: Arc<Buffer>,
    moved: Arc<Buffer>,
}

impl Fit {
    fn new(engine: &mut Engine, mesh: &Mesh, goal: &[f32]) -> Outcome<Self> {
        let outputs = Outputs { color: true, silhouette: true, ..Outputs::NOTHING };
        let plan =
            engine.rasterizer.pass(std::slice::from_ref(&mesh.shape)).settings(settings(SIZE, BLUR)).outputs(outputs);
        let plan = plan.cameras(&cameras()?).lights(Lights::official()).inside_planes();
        let plan = plan
            .gradients(GradientRequest { colors: true, ..GradientRequest::default() })
            .alignment(engine.storage_alignment());
        let bytes = mesh.vertices.info.size;
        let partial_sums = BufferInfo::host_mem(4 * (goal.len() as u64 / 4).div_ceil(64), Usage::STORAGE_BUFFER);
        let moved = BufferInfo::device_mem(bytes, Usage::STORAGE_BUFFER | Usage::TRANSFER_SRC);
        Ok(Self {
            soft: engine.bind(plan.build()?, &mesh.buffers())?,
            loss: engine.compute(shader!("loss.comp"))?,
            adam: engine.compute(shader!("adam.comp"))?,
            goal: engine.upload(Usage::STORAGE_BUFFER, bytemuck::cast_slice(goal))?,
            losses: Arc::new(Buffer::create(&engine.device, partial_sums)?),
            moments: engine.upload(Usage::STORAGE_BUFFER, &vec![0; 2 * bytes as usize])?,
            moved: Arc::new(Buffer::create(&engine.device, moved)?),
        })
    }

    /// One step as the commands of a graph: render, compare, differentiate, move.
    fn graph(&self, engine: &Engine, mesh: &Mesh, step: u32) -> Outcome<Graph> {
        let mut graph = Graph::default();
        let (frame, readback) = (graph.bind_resource(&self.soft.device), graph.bind_resource(&self.soft.readback));
        let (vertices, gradients) = (graph.bind_resource(&mesh.vertices), graph.bind_resource(&mesh.gradients));
        graph
            .begin_cmd()
            .debug_name("softras forward")
            .resource_access(frame, AccessType::ComputeShaderReadWrite)
            .resource_access(vertices, AccessType::ComputeShaderReadOther)
            .resource_access(readback, AccessType::TransferWrite)
            .record_cmd(engine.record(&self.soft.pass, Pass::record_forward));
        self.compare(&mut graph, frame)?;
        graph
            .begin_cmd()
            .debug_name("softras backward")
            .resource_access(frame, AccessType::ComputeShaderReadWrite)
            .resource_access(gradients, AccessType::ComputeShaderReadWrite)
            .record_cmd(engine.record(&self.soft.pass, Pass::record_backward));
        self.step(&mut graph, mesh, step, [frame, vertices, gradients])?;
        // The host reads it once it has waited for the fence.
        graph.begin_cmd().resource_access(readback, AccessType::HostRead).record_cmd(|_| ());
        Ok(graph)
    }

    /// The engine's loss kernel between softras' passes: from the images to their gradients.
    fn compare(&self, graph: &mut Graph, frame: BufferNode) -> Outcome<()> {
        let (goal, losses) = (graph.bind_resource(&self.goal), graph.bind_resource(&self.losses));
        let pixels = self.goal.info.size as u32 / 16;
        graph
            .begin_cmd()
            .debug_name("loss")
            .bind_pipeline(&self.loss)
            .shader_subresource_access(0, frame, self.soft.part(PassBuffer::Color)?, AccessType::ComputeShaderReadOther)
            .shader_resource_access(1, goal, AccessType::ComputeShaderReadOther)
            .shader_subresource_access(
                2,
                frame,
                self.soft.part(PassBuffer::UpstreamColor)?,
                AccessType::ComputeShaderWrite,
            )
            .shader_resource_access(3, losses, AccessType::ComputeShaderWrite)
            .record_cmd(move |cmd| {
                cmd.push_constants(0, bytemuck::bytes_of(&pixels)).dispatch(pixels.div_ceil(64), 1, 1);
            });
        graph.begin_cmd().resource_access(losses, AccessType::HostRead).record_cmd(|_| ());
        Ok(())
    }

    /// The engine's Adam kernel: from gradients in the layout of the vertices to other vertices.
    fn step(&self, graph: &mut Graph, mesh: &Mesh, step: u32, nodes: [BufferNode; 3]) -> Outcome<()> {
        let [frame, vertices, gradients] = nodes;
        let (moments, moved) = (graph.bind_resource(&self.moments), graph.bind_resource(&self.moved));
        let neighbours = graph.bind_resource(&mesh.neighbours);
        let (count, rate) = (mesh.count, if step > ROUNDS * ROUND / 2 { 0.003f32 } else { 0.01 });
        graph
            .begin_cmd()
            .debug_name("adam")
            .bind_pipeline(&self.adam)
            .shader_resource_access(0, vertices, AccessType::ComputeShaderReadOther)
            .shader_resource_access(1, gradients, AccessType::ComputeShaderReadOther)
            .shader_resource_access(2, moments, AccessType::ComputeShaderReadWrite)
            .shader_resource_access(3, neighbours, AccessType::ComputeShaderReadOther)
            .shader_resource_access(4, moved, AccessType::ComputeShaderWrite)
            .shader_subresource_access(
                5,
                frame,
                self.soft.part(PassBuffer::Status)?,
                AccessType::ComputeShaderReadOther,
            )
            .record_cmd(move |cmd| {
                let [smoothness, rate, color_rate] = [SMOOTHNESS, rate, 2.0 * rate].map(f32::to_bits);
                let push = [count, step, smoothness, rate, color_rate, PassStatus::WHOLE_OFFSET as u32 / 4];
                cmd.push_constants(0, bytemuck::cast_slice(&push)).dispatch(count.div_ceil(64), 1, 1);
            });
        graph.copy_buffer(moved, vertices);
        Ok(())
    }

    /// The loss of the last step. If the lists of its frame were too small, they grow, so that the next steps are faster.
    fn look(&mut self, engine: &mut Engine, mesh: &Mesh) -> Outcome<f32> {
        if let Some(larger) = self.soft.pass.plan().next_plan(self.soft.readback.mapped_slice())? {
            self.soft = engine.bind(larger, &mesh.buffers())?;
        }
        Ok(bytemuck::cast_slice::<u8, f32>(self.losses.mapped_slice()).iter().sum())
    }
}

/// Runs the example: the picture after the fit goes to `path`, that before it beside it. Returns the loss of the first step
/// and that after each round.
pub fn run(path: &Path, goal: Option<&Path>, rounds: u32, validation: bool) -> Outcome<Vec<f32>> {
    let mut engine = Engine::new(validation)?;
    let mesh = Mesh::new(&engine, &shapes::icosphere(4)?, 0.5)?;
    let mut fit = Fit::new(&mut engine, &mesh, &goal_images(goal)?)?;
    let picture = Picture::new(&mut engine, &mesh)?;
    picture.draw(&mut engine, &mesh, &path.with_extension("start.png"))?;
    let mut losses = Vec::new();
    for step in 1..=rounds * ROUND {
        let graph = fit.graph(&engine, &mesh, step)?;
        // The host waits for the device where it looks at the loss; in between it only submits.
        let look = step == 1 || step % ROUND == 0;
        engine.submit(graph, look)?;
        if look {
            losses.push(fit.look(&mut engine, &mesh)?);
        }
    }
    picture.draw(&mut engine, &mesh, path)?;
    Ok(losses)
}

fn main() -> Outcome<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let path = arguments.next().unwrap_or_else(|| "embed_vk_graph.png".into());
    let validation = std::env::var_os("SOFTRAS_VALIDATION").is_some_and(|v| v != "0");
    let losses = run(&path, arguments.next().as_deref(), ROUNDS, validation)?;
    println!("loss every {ROUND} steps: {losses:.5?}; picture in {}", path.display());
    Ok(())
}
