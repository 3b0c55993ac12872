//! The engine's side: its device, its buffers, its pipelines, and softras' passes in its graphs.

use super::Outcome;
use softras::embed::{
    BufferRef, GeometryGradients, HostAdapter, HostCommands, HostDevice, Layout, MeshBuffers, MeshLook, Pass,
    PassBuffer, PassMemory, PassMesh, PassPlan, Rasterizer, Requirements,
};
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use vk_graph::Graph;
use vk_graph::cmd::CommandRef;
use vk_graph::driver::ash::vk::BufferUsageFlags as Usage;
use vk_graph::driver::buffer::{Buffer, BufferInfo};
use vk_graph::driver::compute::{ComputePipeline, ComputePipelineInfo};
use vk_graph::driver::device::{Device, DeviceInfo};
use vk_graph::driver::instance::Instance;
use vk_graph::driver::sync::AccessType;
use vk_graph::pool::hash::HashPool;

/// A shader's SPIR-V, as the build script compiled it.
macro_rules! shader {
    ($name:literal) => {
        include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".spv")).as_slice()
    };
}
pub(crate) use shader;

pub struct Engine {
    pub rasterizer: Rasterizer,
    /// The first error that occurred while a graph was recorded.
    failure: Arc<OnceLock<softras::Error>>,
    pool: HashPool,
    pub device: Device,
}

impl Engine {
    pub fn new(validation: bool) -> Outcome<Self> {
        let device = Device::create(DeviceInfo::builder().debug(validation))?;
        let instance = &device.physical.instance;
        let get_instance_proc_addr = Instance::entry(instance).static_fn().get_instance_proc_addr;
        // SAFETY: the handles are the engine's, whose device outlives the rasterizer and the passes.
        let host = unsafe {
            let adapter = HostAdapter::new(get_instance_proc_addr, instance.handle(), device.physical.handle);
            Requirements::new().validate(&adapter)?;
            HostDevice::new(adapter, device.handle())
        };
        Ok(Self { rasterizer: Rasterizer::new(&host)?, failure: Arc::default(), pool: HashPool::new(&device), device })
    }

    /// The alignment that the engine's own descriptors need of parts of softras' buffer.
    pub fn storage_alignment(&self) -> u64 {
        self.device.physical.properties_v1_0.limits.min_storage_buffer_offset_alignment
    }

    pub fn upload(&self, usage: Usage, bytes: &[u8]) -> Outcome<Arc<Buffer>> {
        Ok(Arc::new(Buffer::create_from_slice(&self.device, usage, bytes)?))
    }

    pub fn compute(&self, spirv: &[u8]) -> Outcome<ComputePipeline> {
        Ok(ComputePipeline::create(&self.device, ComputePipelineInfo::default(), spirv)?)
    }

    /// Makes a pass's memory, binds it and runs its setup.
    pub fn bind(&mut self, plan: PassPlan, mesh: &MeshBuffers) -> Outcome<Soft> {
        let [upload, device, readback] = plan.memory();
        let mut upload = Buffer::create(&self.device, BufferInfo::host_mem(upload.size, upload.usage))?;
        let device = Buffer::create(&self.device, BufferInfo::device_mem(device.size, device.usage))?;
        let readback = Buffer::create(&self.device, BufferInfo::host_mem(readback.size, readback.usage))?;
        let memory =
            PassMemory { upload: whole(&upload), device: whole(&device), readback: whole(&readback), own: &[] };
        let pass = Arc::new(self.rasterizer.bind_pass(plan, memory, &[*mesh])?);
        pass.write_inputs(upload.mapped_slice_mut())?;
        let soft = Soft { pass, upload: Arc::new(upload), device: Arc::new(device), readback: Arc::new(readback) };
        let mut graph = Graph::default();
        let frame = graph.bind_resource(&soft.device);
        let setup =
            graph.begin_cmd().debug_name("softras setup").resource_access(frame, AccessType::ComputeShaderWrite);
        setup.record_cmd(self.record(&soft.pass, Pass::record_setup));
        self.submit(graph, true)?;
        Ok(soft)
    }

    /// The recording of a part of softras' pass as a command of a graph; [`submit`](Self::submit) returns its error.
    pub fn record(
        &self,
        pass: &Arc<Pass>,
        part: impl FnOnce(&Pass, &mut HostCommands) -> softras::Result<()> + Send + 'static,
    ) -> impl FnOnce(CommandRef<'_>) + Send + 'static {
        let (pass, failure) = (pass.clone(), self.failure.clone());
        move |cmd| {
            // SAFETY: the graph records the command buffer for a queue that computes, and keeps it outside of a render pass.
            let mut commands = unsafe { HostCommands::new(cmd.handle) };
            if let Err(error) = part(&pass, &mut commands) {
                _ = failure.set(error);
            }
        }
    }

    pub fn submit(&mut self, graph: Graph, wait: bool) -> Outcome<()> {
        let mut fence = graph.finalize().queue_submit(&mut self.pool, 0, 0)?;
        if wait {
            fence.wait()?;
        }
        self.failure.get().map_or(Ok(()), |error| Err(error.to_string().into()))
    }
}

fn whole(buffer: &Buffer) -> BufferRef {
    // SAFETY: the handle, size and usage are the buffer's own, and it outlives the pass that it is bound to.
    unsafe { BufferRef::new(buffer.handle, buffer.info.size, buffer.info.usage) }
}

/// A pass of softras' and the memory that the engine made for it.
pub struct Soft {
    pub pass: Arc<Pass>,
    upload: Arc<Buffer>,
    pub device: Arc<Buffer>,
    pub readback: Arc<Buffer>,
}

impl Soft {
    /// Where one of the pass's buffers lies in `device`.
    pub fn part(&self, id: PassBuffer) -> Outcome<Range<u64>> {
        let part = self.pass.buffer(id).ok_or_else(|| format!("the pass has no buffer {id}"))?;
        Ok(part.offset()..part.offset() + part.range())
    }
}

/// A mesh in the engine's buffers.
pub struct Mesh {
    pub count: u32,
    /// Its counts, indices and look, from which softras plans a pass.
    pub shape: PassMesh,
    /// x, y, z, r, g, b of every vertex.
    pub vertices: Arc<Buffer>,
    /// The loss's derivatives by each of them.
    pub gradients: Arc<Buffer>,
    /// For each vertex the start of its row, and the end of the last one; then the rows.
    pub neighbours: Arc<Buffer>,
}

impl Mesh {
    pub fn new(engine: &Engine, mesh: &softras::Mesh, scale: f32) -> Outcome<Self> {
        let vertex = |p: &[f32; 3]| [scale * p[0], scale * p[1], scale * p[2], 0.5, 0.5, 0.5];
        let vertices: Vec<[f32; 6]> = mesh.positions().iter().map(vertex).collect();
        let mut rows = vec![Vec::new(); vertices.len()];
        // A closed surface has each edge in both directions.
        for &[a, b, c] in mesh.triangles() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                rows[from as usize].push(to);
            }
        }
        let mut neighbours = vec![rows.len() as u32 + 1];
        neighbours.extend(rows.iter().scan(neighbours[0], |end, row| {
            *end += row.len() as u32;
            Some(*end)
        }));
        neighbours.extend(rows.into_iter().flatten());
        let (count, storage) = (vertices.len() as u32, Usage::STORAGE_BUFFER);
        let bytes: &[u8] = bytemuck::cast_slice(&vertices);
        let gradients = BufferInfo::device_mem(bytes.len() as u64, storage);
        Ok(Self {
            count,
            shape: PassMesh::new(count, mesh.triangles().as_flattened()).with_look(MeshLook::VertexColors),
            vertices: engine.upload(storage, bytes)?,
            gradients: Arc::new(Buffer::create(&engine.device, gradients)?),
            neighbours: engine.upload(storage, bytemuck::cast_slice(&neighbours))?,
        })
    }

    pub fn buffers(&self) -> MeshBuffers {
        let (vertices, gradients) = (whole(&self.vertices), whole(&self.gradients));
        let at = |offset| Layout { stride: 24, offset };
        MeshBuffers {
            colors: Some((vertices, at(12))),
            gradients: GeometryGradients {
                positions: Some((gradients, at(0))),
                colors: Some((gradients, at(12))),
                transforms: None,
            },
            ..MeshBuffers::new(vertices, at(0))
        }
    }
}
