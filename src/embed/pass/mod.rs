//! A pass: everything that a host binds once and records every frame.

pub mod buffers;
pub mod builder;
mod gradients;
pub mod image_store;
pub mod memory;
#[cfg(feature = "renderer")]
mod own;
pub mod rebind;
mod scene;

use crate::constants as c;
use crate::embed::host::mesh::{GeometryGradients, MeshBuffers, MeshLook, TexelSource};
use crate::embed::host::misfit;
use crate::embed::host::targets::{Floats, Overlap};
use crate::embed::place::counts::{CountStep, Counts};
use crate::embed::place::texels::TexelStep;
use crate::embed::place::{By, GradientStep, Step};
use crate::error::{Error, Result};
use crate::frame::bindings::{FrameBindings, GradientBindings, validated_parts};
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::GradientPlan;
use crate::frame::pack::{MeshTables, light_texels};
use crate::frame::passes::{BackwardStage, ForwardStage};
use crate::frame::rasterizer::Rasterizer;
use crate::vulkan::{BufferPart, BufferRef, HostCommands, Recorder, TimestampPool, vk};
use buffers::PassBuffer;
use builder::{PassPlan, PassStatus};
use memory::{Copy, PassMemory};
use std::sync::atomic::{AtomicU8, Ordering};

/// A plan bound to a host's buffers. Two frames in flight take two of them, with memory of their own; the meshes' buffers may
/// be shared.
///
/// Keep it, and the buffers, until every command buffer that it was recorded into has been executed for the last time or
/// thrown away; then drop it, before the device.
pub struct Pass {
    pub(crate) rasterizer: Rasterizer,
    pub(crate) plan: PassPlan,
    pub(crate) frame: FrameBindings,
    pub(crate) gradients: Option<GradientBindings>,
    pub(crate) buffers: Vec<(BufferId, BufferPart)>,
    /// The buffers that the frame's inputs come from and its outputs go to, and those of its gradients; `None` where host and
    /// device share all of them.
    staging: Option<Staging>,
    gradient_staging: Option<Staging>,
    /// The device buffer, for render graphs.
    device: Option<BufferRef>,
    meshes: Vec<MeshBuffers>,
    /// The tables of its scene, as they are to lie on the device; `None` for a host's meshes.
    pub(crate) scene: Option<MeshTables>,
    /// Tables of draws, then everything that the setup places.
    draws: Vec<(u64, BufferPart)>,
    setup: Vec<Step>,
    texels: Vec<TexelStep>,
    vertices: Vec<Step>,
    back: Vec<Back>,
    counts: Option<CountStep>,
    /// How far it was recorded: [`NOTHING`], [`SETUP`] or [`FORWARD`].
    recorded: AtomicU8,
}

/// The mapped buffers that are copied from and to.
#[derive(Clone)]
pub(crate) struct Staging {
    pub upload: BufferPart,
    pub readback: BufferPart,
}

/// A buffer, and the stages and accesses of its use.
type BufferUse = (BufferRef, vk::PipelineStageFlags, vk::AccessFlags);

/// A step of gradients, and whether other meshes write into the same array.
struct Back {
    step: GradientStep,
    shared: bool,
}

const NOTHING: u8 = 0;
const SETUP: u8 = 1;
const FORWARD: u8 = 2;

impl Rasterizer {
    /// Binds a plan to memory and to the meshes' buffers, one for each mesh of the plan, in their order; none for a scene's.
    /// Compiles what was not compiled yet ([`prepare_pass`](Self::prepare_pass)).
    ///
    /// # Errors
    /// [`Error::Host`] for memory or a mesh's buffer that is too small, misaligned or made for other uses, and for meshes
    /// without what their look or the gradients need; otherwise as [`prepare_pass`](Self::prepare_pass).
    pub fn bind_pass(&self, plan: PassPlan, memory: PassMemory<'_>, meshes: &[MeshBuffers]) -> Result<Pass> {
        let placed = plan.tables.placed.len();
        if meshes.len() != placed {
            let what = format!("buffers of {} meshes for a pass of {placed}", meshes.len());
            return Err(Error::Host { what, fix: "give one MeshBuffers for each mesh of the plan".into() });
        }
        let buffers = plan.layouts.bind(&self.device, &memory)?;
        let scene = plan.scene().map(|scene| MeshTables::new(scene, plan.tables.adjacency));
        let part = |at| BufferPart::of_host(&self.device, at);
        let staging = Staging { upload: part(&memory.upload), readback: part(&memory.readback) };
        let mut pass = self.bind_buffers(plan, buffers, scene)?;
        (pass.staging, pass.gradient_staging) = (Some(staging.clone()), Some(staging));
        pass.device = Some(memory.device);
        pass.meshes = meshes.to_vec();
        for (number, buffers) in meshes.iter().enumerate() {
            pass.bind_mesh(number, buffers, &memory.device).map_err(|error| of_mesh(number, error))?;
        }
        let workspace = [memory.upload, memory.device, memory.readback].into_iter();
        let workspace: Vec<Floats> =
            workspace.chain(memory.own.iter().map(|(_, at)| *at)).map(|at| Floats::whole(&at)).collect();
        pass.share_targets(&workspace, meshes)?;
        Ok(pass)
    }

    /// Binds a plan to its buffers. `scene` has the tables of its scene, if it is one of a scene.
    pub(crate) fn bind_buffers(
        &self,
        plan: PassPlan,
        buffers: Vec<(BufferId, BufferPart)>,
        scene: Option<MeshTables>,
    ) -> Result<Pass> {
        let of_frame = |(id, _): &&(BufferId, BufferPart)| plan.frame.buffer(*id).is_some();
        let (own, added): (Vec<_>, Vec<_>) = buffers.iter().partition(of_frame);
        let parts = |required, given: Vec<&(BufferId, BufferPart)>| validated_parts(&self.device, required, &given);
        let frame = self.bind_parts(&plan.frame, parts(plan.frame.buffers(), own)?)?;
        let gradients = match &plan.gradients {
            Some(plan) => Some(self.bind_gradients(plan, &added, &frame)?),
            // Refuses buffers that are given besides the frame's.
            None => parts(&[], added).map(|_| None)?,
        };
        Ok(Pass {
            rasterizer: self.clone(),
            plan,
            frame,
            gradients,
            buffers,
            staging: None,
            gradient_staging: None,
            device: None,
            meshes: Vec::new(),
            scene,
            draws: Vec::new(),
            setup: Vec::new(),
            texels: Vec::new(),
            vertices: Vec::new(),
            back: Vec::new(),
            counts: None,
            recorded: AtomicU8::new(NOTHING),
        })
    }

    /// Binds the buffers that gradients need beyond those of their frame.
    pub(crate) fn bind_gradients(
        &self,
        plan: &GradientPlan,
        buffers: &[&(BufferId, BufferPart)],
        frame: &FrameBindings,
    ) -> Result<GradientBindings> {
        self.bind_backward_parts(plan, &validated_parts(&self.device, plan.buffers(), buffers)?, frame)
    }

    /// Compiles a pass's kernels unless that was done, in parallel on threads that end with the call. It takes some hundred
    /// milliseconds, which a loading screen can hide.
    ///
    /// # Errors
    /// [`Error::Vulkan`], [`Error::Limit`], [`Error::OutOfMemory`].
    pub fn prepare_pass(&self, plan: &PassPlan) -> Result<()> {
        self.forward_pipelines(&plan.frame)?;
        plan.gradients.as_ref().map_or(Ok(()), |gradients| self.backward_pipelines(gradients).map(drop))
    }
}

impl Pass {
    fn bind_mesh(&mut self, number: usize, buffers: &MeshBuffers, device: &BufferRef) -> Result<()> {
        let Self { rasterizer, plan, frame, gradients, .. } = &*self;
        let (at, offset, size) = plan.layouts.draws[number];
        let draws = BufferPart::of_host(&rasterizer.device, &device.part(offset, size)?);
        let placed = &plan.tables.placed[number];
        let bound = rasterizer.bind_mesh(placed, buffers, &draws, frame, gradients.as_ref())?;
        self.draws.push((at, draws));
        self.setup.extend(bound.setup);
        self.texels.extend(bound.texels);
        self.vertices.extend(bound.vertices);
        self.back.extend(bound.back.into_iter().map(|step| Back { step, shared: false }));
        Ok(())
    }

    /// Finds the arrays into which several meshes write their gradients. Refuses an array that also holds another kind
    /// of gradient, the pass's own memory, or data that a mesh is read from.
    fn share_targets(&mut self, workspace: &[Floats], meshes: &[MeshBuffers]) -> Result<()> {
        let mut sources = Vec::new();
        for (placed, mesh) in self.plan.tables.placed.iter().zip(meshes) {
            sources.extend(mesh.sources(&placed.geometry));
        }
        let fail = |by: By, what: &str| {
            Err(Error::Host {
                what: format!("the gradients by {by:?} lie {what}").to_lowercase(),
                fix: "give gradients an array of their own; only the same gradient of several meshes may share one"
                    .into(),
            })
        };
        let overlaps = |floats: &[Floats], target: &Floats| floats.iter().any(|f| f.overlap(target) != Overlap::None);
        for i in 0..self.back.len() {
            let GradientStep { by, target, .. } = &self.back[i].step;
            if overlaps(workspace, target) {
                return fail(*by, "in the pass's own memory");
            }
            if overlaps(&sources, target) {
                return fail(*by, "on what a mesh is read from");
            }
            let mut shared = false;
            for (_, other) in self.back.iter().enumerate().filter(|(j, _)| *j != i) {
                match target.overlap(&other.step.target) {
                    Overlap::None => {}
                    Overlap::Elements if *by == other.step.by => shared = true,
                    _ => return fail(*by, &format!("among those by {:?}", other.step.by)),
                }
            }
            self.back[i].shared = shared;
        }
        Ok(())
    }

    /// The plan that it was bound for.
    pub fn plan(&self) -> &PassPlan {
        &self.plan
    }

    /// One of its buffers, as it was bound: the images and upstream gradients for the host's own kernels. `None` where the
    /// plan has no such buffer.
    pub fn buffer(&self, buffer: PassBuffer) -> Option<BufferRef> {
        self.find(buffer.id())
    }

    fn find(&self, id: BufferId) -> Option<BufferRef> {
        self.part(id).ok().map(BufferPart::reference)
    }

    /// The part of `texels` that a mesh's texture is: four floats a texel, row 0 at the top. A host that gives no
    /// [`TexelSource`](crate::embed::TexelSource) writes it with a kernel of its own. Its offset is a multiple of 16, which need not be one of
    /// minStorageBufferOffsetAlignment: bind the whole [`buffer`](Self::buffer) then, and give the kernel the offset.
    pub fn texels(&self, mesh: usize) -> Option<BufferRef> {
        let placed = self.plan.tables.placed.get(mesh)?;
        let MeshLook::Texture { size: (width, height), .. } = placed.look else { return None };
        let at = self.find(BufferId::Texels)?;
        at.part(16 * u64::from(placed.texel), 16 * u64::from(width) * u64::from(height)).ok()
    }

    /// The part of `vertex_normals` that a mesh planned [`with_normals`](crate::embed::PassMesh::with_normals) has: three floats, of unit
    /// length, for each of its vertices as they are placed. A kernel of the host's writes it, behind the setup. Its offset is a
    /// multiple of 4; see [`texels`](Self::texels).
    pub fn normals(&self, mesh: usize) -> Option<BufferRef> {
        let geometry = &self.plan.tables.placed.get(mesh)?.geometry;
        let at = self.find(BufferId::VertexNormals)?;
        at.part(12 * u64::from(geometry.first_vertex), 12 * u64::from(geometry.vertices())).ok()
    }

    /// The stages of a frame and of its gradients, in the order in which they run: what lies between the timestamps of
    /// [`HostCommands::with_timestamps`].
    pub fn stages() -> [Vec<&'static str>; 2] {
        [ForwardStage::ALL.map(ForwardStage::name).into(), BackwardStage::ALL.map(BackwardStage::name).into()]
    }

    /// How the setup, a frame and its gradients use the host's buffers, for a host's render graph: each buffer with its stages
    /// and accesses. Compute shaders of the setup read the textures that are images.
    pub fn uses(&self) -> [Vec<BufferUse>; 3] {
        use vk::{AccessFlags as A, PipelineStageFlags as S};
        let (Some(Staging { upload, readback }), Some(device)) = (&self.staging, self.device) else {
            return Default::default();
        };
        let read = |at: &BufferRef| (*at, S::COMPUTE_SHADER, A::SHADER_READ);
        let write = |at: &BufferRef| (*at, S::COMPUTE_SHADER, A::SHADER_READ | A::SHADER_WRITE);
        let kernels = A::SHADER_READ | A::SHADER_WRITE | A::INDIRECT_COMMAND_READ;
        let work = (
            device,
            S::COMPUTE_SHADER | S::DRAW_INDIRECT | S::TRANSFER,
            kernels | A::TRANSFER_READ | A::TRANSFER_WRITE,
        );
        let own = self.buffers.iter().map(|(_, at)| at.reference()).filter(|at| at.raw() != device.raw());
        let own = own.map(|at| (at, work.1, work.2));
        let own: Vec<BufferUse> = own.chain([work]).collect();
        let uploaded = (upload.reference(), S::TRANSFER, A::TRANSFER_READ);
        let read_back = (readback.reference(), S::TRANSFER, A::TRANSFER_WRITE);
        let mut uses = [
            [&own[..], &[uploaded]].concat(),
            [&own[..], &[uploaded, read_back]].concat(),
            [&own[..], &[read_back]].concat(),
        ];
        let [setup, forward, backward] = &mut uses;
        for mesh in &self.meshes {
            setup.extend(mesh.indices.iter().map(|(at, _)| read(at)));
            setup.extend(mesh.uvs.iter().map(|(at, _)| read(at)));
            match &mesh.texels {
                Some(TexelSource::Floats(at)) => setup.push((*at, S::TRANSFER, A::TRANSFER_READ)),
                Some(TexelSource::Bytes { at, .. }) => setup.push(read(at)),
                Some(TexelSource::Image(_)) | None => {}
            }
            let vertices = || [Some(&mesh.positions), mesh.transforms.as_ref()].into_iter().flatten();
            forward.extend(vertices().chain(&mesh.colors).map(|(at, _)| read(at)));
            let GeometryGradients { positions, colors, transforms } = &mesh.gradients;
            backward.extend(vertices().map(|(at, _)| read(at)));
            backward.extend([positions, colors, transforms].into_iter().flatten().map(|(at, _)| write(at)));
        }
        forward.extend(self.counts.iter().map(|counts| read(counts.source())));
        uses
    }

    /// Binds the counts of a pass planned with [`PassBuilder::device_counts`](crate::embed::PassBuilder::device_counts), which every frame
    /// recorded from now on reads. Commands that were recorded with other counts must have been executed.
    ///
    /// # Errors
    /// [`Error::Host`] for a pass planned otherwise, or counts that lie outside their buffer; otherwise as
    /// [`Rasterizer::prepare_pass`].
    pub fn bind_counts(&mut self, counts: &Counts) -> Result<()> {
        if !self.plan.frame.shape.device_counts {
            return misfit("the pass was planned with counts known".into(), "plan it with PassBuilder::device_counts");
        }
        self.counts = Some(CountStep::new(&self.rasterizer, &self.plan.frame, &self.frame, counts)?);
        Ok(())
    }

    /// Writes everything that the CPU gives into the mapped bytes of the upload buffer: tables, cameras and lights. To be
    /// followed by [`record_setup`](Self::record_setup).
    ///
    /// # Errors
    /// [`Error::Host`] for fewer bytes than the upload buffer has.
    pub fn write_inputs(&self, upload: &mut [u8]) -> Result<()> {
        self.write_frame(upload)?;
        let PassPlan { layouts, tables, frame, .. } = &self.plan;
        let shapes = frame.view_shapes();
        let of_meshes = tables.segments.iter().map(|segment| &segment.bytes[..]);
        for (copy, bytes) in layouts.setup.iter().zip(std::iter::once(bytemuck::cast_slice(&shapes)).chain(of_meshes)) {
            put(upload, copy.mapped, bytes)?;
        }
        self.put_scene(upload, |_| true)?;
        for (placed, (at, ..)) in tables.placed.iter().zip(&layouts.draws) {
            put(upload, *at, bytemuck::cast_slice(&placed.geometry.table()))?;
        }
        Ok(())
    }

    /// Writes the part of it that changes from frame to frame: cameras and lights. No frame that reads them may be in flight.
    ///
    /// # Errors
    /// As [`write_inputs`](Self::write_inputs).
    pub fn write_frame(&self, upload: &mut [u8]) -> Result<()> {
        let PassPlan { layouts, frame, .. } = &self.plan;
        let (cameras, lights) = (self.plan.camera_inputs(), light_texels(&frame.shape.lights));
        for copy in &layouts.frame {
            let of_lights = copy.id == BufferId::Lights;
            let bytes = if of_lights { bytemuck::cast_slice(&lights) } else { bytemuck::cast_slice(&cameras) };
            put(upload, copy.mapped, bytes)?;
        }
        Ok(())
    }

    /// Records the work that is done once, and again after [`write_inputs`](Self::write_inputs) or a change of indices,
    /// UVs or textures on the device: the copies of the tables, and the placing of indices, UVs and texels. Begins and
    /// ends with barriers, as every call here.
    ///
    /// # Errors
    /// [`Error::Limit`] for more workgroups than the device allows. The commands recorded before it do no harm.
    pub fn record_setup(&self, commands: &mut HostCommands) -> Result<()> {
        let mut recorder = Recorder::on_host(&self.rasterizer.device, commands);
        recorder.begin_label("setup");
        recorder.barrier();
        self.copy_in(&mut recorder, &self.staging, &self.plan.layouts.setup)?;
        // If a frame is recorded but never executed, its gradients find no tiles, rather than a number left in memory.
        let counts = self.part(BufferId::TileCounts)?;
        recorder.fill(counts, 0, counts.range() / 4 * 4, 0)?;
        if let Some(Staging { upload, .. }) = &self.staging {
            for (at, draws) in &self.draws {
                recorder.copy(upload, *at, draws, 0, draws.range())?;
            }
        }
        recorder.barrier();
        for step in &self.setup {
            step.record(&mut recorder)?;
        }
        for step in &self.texels {
            step.record(&mut recorder)?;
        }
        recorder.barrier();
        recorder.end_label();
        self.recorded.fetch_max(SETUP, Ordering::Relaxed);
        Ok(())
    }

    /// Records a frame: the copies of cameras and lights, the placing of vertices, the images, and the copies into the readback
    /// buffer. Allocates, maps, submits and waits for nothing.
    ///
    /// # Errors
    /// [`Error::Host`] where no setup was recorded before, or no counts are bound that the plan needs; otherwise as
    /// [`record_setup`](Self::record_setup).
    pub fn record_forward(&self, commands: &mut HostCommands) -> Result<()> {
        self.needs(SETUP, "record_setup")?;
        if self.plan.frame.shape.device_counts && self.counts.is_none() {
            return misfit("the pass has no counts".into(), "bind them with Pass::bind_counts");
        }
        self.record_forward_with(&mut Recorder::on_host(&self.rasterizer.device, commands), None)?;
        self.recorded.fetch_max(FORWARD, Ordering::Relaxed);
        Ok(())
    }

    /// Records a frame, whose setup and counts are there.
    pub(crate) fn record_forward_with(&self, recorder: &mut Recorder<'_>, times: Option<&TimestampPool>) -> Result<()> {
        let layouts = &self.plan.layouts;
        recorder.begin_label("pass");
        recorder.barrier();
        self.copy_in(recorder, &self.staging, &layouts.frame)?;
        for step in &self.vertices {
            step.record(recorder)?;
        }
        if let Some(counts) = &self.counts {
            counts.record(recorder)?;
            recorder.barrier();
        }
        self.rasterizer.forward(recorder, &self.plan.frame, &self.frame, times)?;
        self.copy_out(recorder, &self.staging, &layouts.forward)?;
        recorder.end_label();
        Ok(())
    }

    /// Gradients need a frame that was recorded with the present numbers, so a new one must be recorded first.
    pub(crate) fn forget_frame(&mut self) {
        let recorded = self.recorded.get_mut();
        *recorded = (*recorded).min(SETUP);
    }

    /// Fails if the commands would read memory that nothing wrote: on the device their loops might not end.
    fn needs(&self, recorded: u8, call: &str) -> Result<()> {
        if self.recorded.load(Ordering::Relaxed) >= recorded {
            return Ok(());
        }
        let what = format!("{call} was not recorded since the pass was bound or changed");
        Err(Error::Host { what, fix: format!("record it first: {call}(commands)") })
    }

    /// Records the gradients of the frame recorded last, from the upstream gradients that the host's kernels wrote, into the
    /// meshes' own buffers and the readback buffer.
    ///
    /// # Errors
    /// [`Error::Backward`] for a pass without gradients; [`Error::Host`] where no frame was recorded since the pass was bound or
    /// changed; otherwise as [`record_setup`](Self::record_setup).
    pub fn record_backward(&self, commands: &mut HostCommands) -> Result<()> {
        self.gradient_plan()?;
        self.needs(FORWARD, "record_forward")?;
        self.record_backward_with(&mut Recorder::on_host(&self.rasterizer.device, commands), None)
    }

    /// Records the gradients of a frame that was recorded.
    pub(crate) fn record_backward_with(
        &self,
        recorder: &mut Recorder<'_>,
        times: Option<&TimestampPool>,
    ) -> Result<()> {
        let (plan, layout) = (self.gradient_plan()?, &self.plan.layouts.gradients);
        let Some(bindings) = &self.gradients else { return Ok(()) };
        self.copy_in(recorder, &self.gradient_staging, &layout.upstream)?;
        self.rasterizer.backward(recorder, plan, bindings, times)?;
        self.record_back(recorder)?;
        self.copy_out(recorder, &self.gradient_staging, &layout.outputs)
    }

    /// Records the writing of gradients into the meshes' arrays. An array that several meshes share is cleared first;
    /// then each mesh adds to it, in their order.
    fn record_back(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        for back in self.back.iter().filter(|back| back.shared) {
            back.step.step.record_use(recorder, c::TARGET_CLEAR)?;
            recorder.barrier();
        }
        for Back { step, shared } in &self.back {
            step.step.record_use(recorder, if *shared { c::TARGET_ADD } else { c::TARGET_WRITE })?;
            if *shared {
                recorder.barrier();
            }
        }
        if !self.back.is_empty() {
            recorder.barrier();
        }
        Ok(())
    }

    /// Copies inputs of the frame or of its gradients from where the host wrote them, unless it wrote them where they belong.
    fn copy_in<'a>(
        &self,
        recorder: &mut Recorder<'_>,
        staging: &Option<Staging>,
        copies: impl IntoIterator<Item = &'a Copy>,
    ) -> Result<()> {
        let Some(Staging { upload, .. }) = staging else { return Ok(()) };
        for copy in copies {
            recorder.copy(upload, copy.mapped, self.part(copy.id)?, copy.at, copy.size)?;
        }
        Ok(())
    }

    fn copy_out(&self, recorder: &mut Recorder<'_>, staging: &Option<Staging>, copies: &[Copy]) -> Result<()> {
        let Some(Staging { readback, .. }) = staging else { return Ok(()) };
        for copy in copies {
            recorder.copy(self.part(copy.id)?, copy.at, readback, copy.mapped, copy.size)?;
        }
        if !copies.is_empty() {
            recorder.barrier();
        }
        Ok(())
    }

    fn part(&self, id: BufferId) -> Result<&BufferPart> {
        self.buffers.iter().find(|(own, _)| *own == id).map(|(_, part)| part).ok_or_else(|| Error::Host {
            what: format!("there is no buffer `{id}`"),
            fix: "plan and bind the pass anew".into(),
        })
    }

    /// The status of the frame recorded last, from the readback buffer's bytes, once the frame is done.
    ///
    /// # Errors
    /// As [`PassPlan::status`].
    pub fn status(&self, readback: &[u8]) -> Result<PassStatus> {
        self.plan.status(readback)
    }
}

/// An error of binding, with the mesh that it is about.
fn of_mesh(number: usize, error: Error) -> Error {
    match error {
        Error::Host { what, fix } => Error::Host { what: format!("mesh {number} of the pass: {what}"), fix },
        other => other,
    }
}

fn put(upload: &mut [u8], at: u64, bytes: &[u8]) -> Result<()> {
    let (length, start) = (upload.len(), at as usize);
    match upload.get_mut(start..start + bytes.len()) {
        Some(target) => {
            target.copy_from_slice(bytes);
            Ok(())
        }
        None => Err(Error::Host {
            what: format!("an upload buffer of {length} bytes, of which {} are written", start + bytes.len()),
            fix: "give the mapped bytes of the whole upload buffer".into(),
        }),
    }
}

impl std::fmt::Debug for Pass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pass").field("buffers", &self.buffers).finish_non_exhaustive()
    }
}
