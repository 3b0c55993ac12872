//! Recording a host's geometry into a frame's arrays, and its gradients back into the host's.

use super::Rasterizer;
use super::bindings::{FrameBindings, GradientBindings};
use super::geometry::{Geometry, IndexFormat, Layout, linear_groups, rows_of};
use super::targets::Floats;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::gradients::GradientRequest;
use crate::vulkan::{BufferPart, BufferRef, DescriptorPool, HostCommands, Kernel, Recorder, TexelFormat, kernels, vk};

/// Where a host's geometry lies. Every buffer but `draws` has the usage STORAGE_BUFFER, and begins at a multiple of
/// minStorageBufferOffsetAlignment.
#[derive(Clone, Copy, Debug)]
pub struct GeometryBuffers {
    /// [`Geometry::table`], of usage UNIFORM_TEXEL_BUFFER, at a multiple of minTexelBufferOffsetAlignment.
    pub draws: BufferRef,
    /// Vertices: x, y, z as floats.
    pub positions: (BufferRef, Layout),
    /// r, g, b as floats for each vertex, in the same vertices' order; `None` where the frame's `colors` are filled
    /// otherwise.
    pub colors: Option<(BufferRef, Layout)>,
    /// Indices; `None` where the frame's are filled otherwise.
    pub indices: Option<(BufferRef, IndexFormat)>,
    /// One for each instance: three rows of four floats that take (x, y, z, 1) to the world, as VkTransformMatrixKHR;
    /// `None` where vertices are in the world already.
    pub transforms: Option<(BufferRef, Layout)>,
}

/// Where a host wants the gradients of its geometry, in layouts of its own; what is `None` is not computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GeometryGradients {
    /// dL/dx, dL/dy, dL/dz of each vertex that a draw reads, summed over its instances in their order.
    pub positions: Option<(BufferRef, Layout)>,
    /// dL/dr, dL/dg, dL/db of each, likewise.
    pub colors: Option<(BufferRef, Layout)>,
    /// dL by each number of each transform.
    pub transforms: Option<(BufferRef, Layout)>,
}

/// A host's geometry bound to a frame. To be kept as [`FrameBindings`].
pub struct GeometryBindings {
    geometry: Geometry,
    buffers: GeometryBuffers,
    draws: BufferPart,
    pub(super) vertices: Vec<Step>,
    pub(super) indices: Option<Step>,
}

/// The gradients of a host's geometry bound to a backward pass. To be kept as [`GradientBindings`].
pub struct GeometryGradientBindings {
    pub(super) steps: Vec<GradientStep>,
}

/// A stage that writes gradients into a host's array.
pub(super) struct GradientStep {
    pub step: Step,
    pub by: By,
    pub target: Floats,
}

/// What a gradient is by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum By {
    Positions,
    Colors,
    Transforms,
}

/// The numbers of `glsl/common/geometry_push.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct Push {
    pub count: u32,
    pub draws: u32,
    pub first: u32,
    pub base: u32,
    pub stride: u32,
    pub offset: u32,
    pub transform_stride: u32,
    pub transform_offset: u32,
    pub select: u32,
    pub target_use: u32,
}

/// A stage with its numbers.
pub(super) struct Step {
    pub stage: Stage,
    pub push: Push,
    pub groups: [u32; 3],
}

impl Step {
    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&self.push), self.groups)
    }

    /// The same with one of the TARGET_ uses.
    pub fn record_use(&self, recorder: &mut Recorder<'_>, target_use: u32) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&Push { target_use, ..self.push }), self.groups)
    }
}

impl GeometryBindings {
    /// The table of draws, and what it was made of.
    pub(super) fn table(&self) -> (&BufferPart, &Geometry) {
        (&self.draws, &self.geometry)
    }

    /// The numbers that every stage has.
    pub(super) fn push(&self, count: u32) -> Push {
        Push { count, draws: self.geometry.draws().len() as u32, first: self.geometry.first_vertex, ..Push::default() }
    }
}

impl Rasterizer {
    /// [`GeometryBindings::push`] with a vertex array's layout, and with the transforms' where there are such.
    fn vertex_push(&self, made: &GeometryBindings, count: u32, (stride, offset): (u32, u32)) -> Result<Push> {
        let (transform_stride, transform_offset) = match &made.buffers.transforms {
            Some(transforms) => self.layout_words("transforms", transforms, made.geometry.instances(), 12)?,
            None => (0, 0),
        };
        Ok(Push { stride, offset, transform_stride, transform_offset, ..made.push(count) })
    }

    /// Binds a host's vertices, indices and transforms, and the frame's arrays that they go into.
    ///
    /// # Errors
    /// [`Error::Host`] where draws reach beyond a buffer, a layout is no multiple of four, or the frame has fewer vertices or
    /// triangles; [`Error::Vulkan`] for a misaligned offset or a missing usage; [`Error::Limit`].
    pub fn bind_geometry(
        &self,
        geometry: &Geometry,
        buffers: &GeometryBuffers,
        frame: &FrameBindings,
    ) -> Result<GeometryBindings> {
        let table = 32 * geometry.draws().len() as u64;
        if table > buffers.draws.range() {
            let what = format!("draws has {} bytes, its table {table}", buffers.draws.range());
            return misfit(what, "bind a larger part");
        }
        let table = buffers.draws.part(0, table)?;
        // Of no draws nothing is recorded.
        let draws = if geometry.draws().is_empty() {
            BufferPart::of_host(&self.device, &table)
        } else {
            BufferPart::texels_of_host(&self.device, &table, TexelFormat::Uint4, "draws")?
        };
        let geometry = geometry.clone();
        let mut made = GeometryBindings { geometry, buffers: *buffers, draws, vertices: Vec::new(), indices: None };
        let first = made.geometry.first_vertex;
        if made.geometry.vertices() > 0 {
            let positions = self.place(&made, &buffers.positions, (BufferId::Positions, first), frame)?;
            made.vertices.push(positions);
            if let Some(colors) = &buffers.colors {
                let colors = self.place(&made, colors, (BufferId::Colors, first), frame)?;
                made.vertices.push(colors);
            }
        }
        if let (Some((at, format)), true) = (&buffers.indices, made.geometry.triangles() > 0) {
            let target = (BufferId::Indices, made.geometry.first_triangle);
            made.indices = Some(self.place_indices(&made, (at, *format), target, frame)?);
        }
        Ok(made)
    }

    /// The stage that fills `positions` or `colors` from an element on.
    pub(super) fn place(
        &self,
        made: &GeometryBindings,
        source: &(BufferRef, Layout),
        (id, first): (BufferId, u32),
        frame: &FrameBindings,
    ) -> Result<Step> {
        let geometry = &made.geometry;
        let count = geometry.vertices();
        let words = self.layout_words(id.name(), source, geometry.source_vertices().1, 3)?;
        let push = Push { first, ..self.vertex_push(made, count, words)? };
        let target = frame.array(id)?;
        validate_target(id, target, 12 * (u64::from(first) + u64::from(count)))?;
        let moved = made.buffers.transforms.as_ref().filter(|_| id == BufferId::Positions);
        let source = BufferPart::of_host(&self.device, &source.0);
        let transforms = moved.map_or_else(|| source.clone(), |(at, _)| BufferPart::of_host(&self.device, at));
        let buffers = [("draws", &made.draws), ("Vertices", &source), ("Transforms", &transforms), ("Target", target)];
        let modes = [("TRANSFORMED", u32::from(moved.is_some()))];
        Ok(Step { stage: self.stage(&kernels::PLACE, &modes, &buffers)?, push, groups: linear_groups(count) })
    }

    /// The stage that fills `indices` or `uv_indices` from a triangle on.
    pub(super) fn place_indices(
        &self,
        made: &GeometryBindings,
        (at, format): (&BufferRef, IndexFormat),
        (id, first): (BufferId, u32),
        frame: &FrameBindings,
    ) -> Result<Step> {
        let geometry = &made.geometry;
        let bytes = geometry.source_indices() * u64::from(format.bits() / 8);
        // Whole words are read.
        self.validate_storage("indices", at, bytes.next_multiple_of(4))?;
        let target = frame.array(id)?;
        let triangles = geometry.triangles();
        validate_target(id, target, 12 * (u64::from(first) + u64::from(triangles)))?;
        let (base, select) = (geometry.mesh_vertex, format.bits());
        let push = Push { first, base, select, ..made.push(3 * triangles) };
        let buffers = [("draws", &made.draws), ("Indices", &BufferPart::of_host(&self.device, at)), ("Target", target)];
        let stage = self.stage(&kernels::PLACE_INDICES, &[], &buffers)?;
        Ok(Step { stage, push, groups: linear_groups(3 * triangles) })
    }

    /// Binds the arrays that the gradients of a host's geometry go into. They are written, not added: where several bindings share
    /// an array, only [`Pass`](super::Pass) adds.
    ///
    /// # Errors
    /// As [`bind_geometry`](Self::bind_geometry); [`Error::Host`] for transforms' gradients of geometry without any, and for
    /// gradients that the pass was not planned for.
    pub fn bind_geometry_gradients(
        &self,
        geometry: &GeometryBindings,
        gradients: &GeometryGradients,
        backward: &GradientBindings,
    ) -> Result<GeometryGradientBindings> {
        validate_wanted(gradients, backward.wanted)?;
        let mut steps = Vec::new();
        if *gradients == GeometryGradients::default() {
            return Ok(GeometryGradientBindings { steps });
        }
        let placed = u64::from(geometry.geometry.first_vertex) + u64::from(geometry.geometry.vertices());
        validate_target(BufferId::VertexGradients, &backward.vertex_gradients, 32 * placed)?;
        if geometry.geometry.vertices() > 0 {
            for (by, target) in [(By::Positions, &gradients.positions), (By::Colors, &gradients.colors)] {
                if let Some(target) = target {
                    steps.push(self.place_vertex_grad(geometry, target, by, backward)?);
                }
            }
        }
        match (&gradients.transforms, &geometry.buffers.transforms) {
            (None, _) => {}
            (Some(_), None) => {
                return misfit("there are no transforms to differentiate by".into(), "bind the geometry with some");
            }
            (Some(target), Some(_)) if geometry.geometry.instances() > 0 => {
                steps.push(self.place_transform_grad(geometry, target, backward)?);
            }
            _ => {}
        }
        Ok(GeometryGradientBindings { steps })
    }

    fn place_vertex_grad(
        &self,
        made: &GeometryBindings,
        target: &(BufferRef, Layout),
        by: By,
        backward: &GradientBindings,
    ) -> Result<GradientStep> {
        let (first, end) = made.geometry.source_vertices();
        let words = self.layout_words("the gradients", target, end, 3)?;
        let floats = Floats::new(target, first, end - first, 3);
        let push =
            Push { base: first, select: u32::from(by == By::Colors), ..self.vertex_push(made, end - first, words)? };
        let moved = made.buffers.transforms.as_ref().filter(|_| by == By::Positions);
        let target = BufferPart::of_host(&self.device, &target.0);
        let transforms = BufferPart::of_host(&self.device, moved.map_or(&made.buffers.positions.0, |(at, _)| at));
        let buffers = [
            ("draws", &made.draws),
            ("vertex_gradients", &backward.vertex_gradients),
            ("Transforms", &transforms),
            ("Target", &target),
        ];
        let modes = [("TRANSFORMED", u32::from(moved.is_some()))];
        let stage = self.stage(&kernels::PLACE_VERTEX_GRAD, &modes, &buffers)?;
        Ok(GradientStep { step: Step { stage, push, groups: linear_groups(end - first) }, by, target: floats })
    }

    fn place_transform_grad(
        &self,
        made: &GeometryBindings,
        target: &(BufferRef, Layout),
        backward: &GradientBindings,
    ) -> Result<GradientStep> {
        let instances = made.geometry.instances();
        let end = made.geometry.source_vertices().1;
        let (stride, offset) = self.layout_words("positions", &made.buffers.positions, end, 3)?;
        let (transform_stride, transform_offset) =
            self.layout_words("the transforms' gradients", target, instances, 12)?;
        let push = Push { stride, offset, transform_stride, transform_offset, ..made.push(instances) };
        let floats = Floats::new(target, 0, instances, 12);
        let target = BufferPart::of_host(&self.device, &target.0);
        let buffers = [
            ("draws", &made.draws),
            ("vertex_gradients", &backward.vertex_gradients),
            ("Vertices", &BufferPart::of_host(&self.device, &made.buffers.positions.0)),
            ("Target", &target),
        ];
        let stage = self.stage(&kernels::PLACE_TRANSFORM_GRAD, &[], &buffers)?;
        Ok(GradientStep { step: Step { stage, push, groups: rows_of(instances) }, by: By::Transforms, target: floats })
    }

    /// The words of a layout whose last of `count` elements of `words` words each lies inside a buffer.
    pub(super) fn layout_words(
        &self,
        name: &str,
        (at, layout): &(BufferRef, Layout),
        count: u32,
        words: u64,
    ) -> Result<(u32, u32)> {
        let Layout { stride, offset } = *layout;
        if stride % 4 != 0 || offset % 4 != 0 || u64::from(stride) < 4 * words {
            let what = format!("{name} of {stride} bytes each, read at {offset}");
            return misfit(what, "use multiples of four, and a stride of at least what is read");
        }
        let last = u64::from(count.saturating_sub(1)) * u64::from(stride) + u64::from(offset) + 4 * words;
        self.validate_storage(name, at, if count == 0 { 0 } else { last })?;
        Ok((stride / 4, offset / 4))
    }

    /// A host's buffer can be bound as storage, and has so many bytes.
    pub(super) fn validate_storage(&self, name: &str, at: &BufferRef, needed: u64) -> Result<()> {
        validate_made(name, at, vk::BufferUsageFlags::STORAGE_BUFFER)?;
        let alignment = self.device.limits().storage_offset_alignment;
        if !at.offset().is_multiple_of(alignment) {
            let what = format!("{name} begins at byte {}, no multiple of {alignment}", at.offset());
            return misfit(what, "give a part that begins at one, and the rest as Layout::offset");
        }
        // Kernels count words with 32 bits.
        if needed > at.range() || needed > 4 * u64::from(u32::MAX) {
            return misfit(format!("{name} has {} bytes, the draws need {needed}", at.range()), "bind a larger part");
        }
        Ok(())
    }

    /// A kernel bound to buffers by the names of its bindings.
    pub(super) fn stage(
        &self,
        kernel: &'static Kernel,
        modes: &[(&'static str, u32)],
        buffers: &[(&str, &BufferPart)],
    ) -> Result<Stage> {
        let [pipeline] = self.pipelines([Request { kernel, modes, lanes: self.lanes }])?;
        let set = DescriptorPool::new(&self.device, &[kernel])?.bind(&pipeline, buffers)?;
        Ok(Stage::new(pipeline, set))
    }

    /// Records the placing of vertices (and colours): before [`record_forward`](Self::record_forward), in any frame in which
    /// vertices or transforms changed. Begins and ends with barriers as that does.
    ///
    /// # Errors
    /// [`Error::Limit`] for more workgroups than the device allows.
    pub fn record_vertices(&self, commands: &mut HostCommands, bindings: &GeometryBindings) -> Result<()> {
        self.record_steps(commands, "softras vertices", &bindings.vertices)
    }

    /// The same of indices, in any frame in which they changed. The frame's `adjacency` depends on them
    /// ([`Geometry::adjacency`]).
    ///
    /// # Errors
    /// As [`record_vertices`](Self::record_vertices).
    pub fn record_indices(&self, commands: &mut HostCommands, bindings: &GeometryBindings) -> Result<()> {
        self.record_steps(commands, "softras indices", bindings.indices.as_slice())
    }

    /// Records the way of the gradients back into the host's layouts: behind
    /// [`record_backward`](Self::record_backward). Begins and ends with barriers as that does.
    ///
    /// # Errors
    /// As [`record_vertices`](Self::record_vertices).
    pub fn record_geometry_gradients(
        &self,
        commands: &mut HostCommands,
        bindings: &GeometryGradientBindings,
    ) -> Result<()> {
        self.record_steps(commands, "softras geometry gradients", bindings.steps.iter().map(|gradient| &gradient.step))
    }

    fn record_steps<'a>(
        &self,
        commands: &mut HostCommands,
        label: &str,
        steps: impl IntoIterator<Item = &'a Step>,
    ) -> Result<()> {
        let mut recorder = Recorder::on_host(&self.device, commands);
        recorder.begin_label(label);
        recorder.barrier();
        for step in steps {
            step.record(&mut recorder)?;
        }
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }
}

/// Nothing is asked for that the backward pass does not compute.
fn validate_wanted(gradients: &GeometryGradients, wanted: GradientRequest) -> Result<()> {
    let by_position = gradients.positions.is_some() || gradients.transforms.is_some();
    for (asked, planned, name) in
        [(by_position, wanted.positions, "positions"), (gradients.colors.is_some(), wanted.colors, "colors")]
    {
        if asked && !planned {
            let what = format!("the backward pass does not differentiate by {name}");
            return misfit(what, &format!("plan it with GradientRequest::{name} in Differentiate::wanted"));
        }
    }
    Ok(())
}

fn misfit<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

/// A host's buffer is one, and was made for a use.
pub(super) fn validate_made(name: &str, at: &BufferRef, usage: vk::BufferUsageFlags) -> Result<()> {
    if at.raw() == vk::Buffer::null() {
        return misfit(format!("{name}: the buffer is null"), "give a buffer with memory bound to it");
    }
    if !at.usage().contains(usage) {
        return misfit(format!("{name}: the buffer was made for {:?}", at.usage()), &format!("add {usage:?}"));
    }
    Ok(())
}

/// A frame's array has room for what is placed.
fn validate_target(id: BufferId, target: &BufferPart, needed: u64) -> Result<()> {
    if needed > target.range() {
        let what = format!("the frame's `{id}` has {} bytes, the draws fill {needed}", target.range());
        return misfit(what, "plan the frame with a shape of as many vertices and triangles");
    }
    Ok(())
}

impl std::fmt::Debug for GeometryBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GeometryBindings").field("geometry", &self.geometry).finish_non_exhaustive()
    }
}

impl std::fmt::Debug for GeometryGradientBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GeometryGradientBindings").field("stages", &self.steps.len()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::Push;
    use crate::vulkan::kernels;
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernels_have_them() {
        let mirror = [
            ("count", offset_of!(Push, count)),
            ("draws", offset_of!(Push, draws)),
            ("first", offset_of!(Push, first)),
            ("base", offset_of!(Push, base)),
            ("stride", offset_of!(Push, stride)),
            ("offset", offset_of!(Push, offset)),
            ("transform_stride", offset_of!(Push, transform_stride)),
            ("transform_offset", offset_of!(Push, transform_offset)),
            ("select", offset_of!(Push, select)),
            ("target_use", offset_of!(Push, target_use)),
        ];
        let linear = [&kernels::PLACE, &kernels::PLACE_INDICES, &kernels::PLACE_VERTEX_GRAD];
        for kernel in linear.into_iter().chain([&kernels::PLACE_TRANSFORM_GRAD]) {
            let found: Vec<_> = kernel.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
            assert_eq!(found, mirror, "{}", kernel.name);
        }
        // PLACE_TRANSFORM_GRAD runs one workgroup for each instance, so its size is its own.
        assert!(linear.iter().all(|kernel| kernel.local_size == [crate::constants::LINEAR_GROUP, 1, 1]));
    }
}
