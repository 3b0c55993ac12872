//! One mesh of a pass bound to the host's buffers: its geometry goes into the frame's arrays, and its gradients come back.

pub mod counts;
pub mod tables;
pub mod texels;

use crate::embed::host::geometry::{IndexFormat, Layout, linear_groups, rows_of};
use crate::embed::host::mesh::{GeometryGradients, MeshBuffers, MeshLook};
use crate::embed::host::targets::Floats;
use crate::embed::host::{misfit, validate_made};
use crate::error::Result;
use crate::frame::bindings::{FrameBindings, GradientBindings};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::frame::rasterizer::Rasterizer;
use crate::vulkan::{BufferPart, BufferRef, DescriptorPool, Kernel, Recorder, TexelFormat, kernels, vk};
use tables::Placed;
use texels::TexelStep;

/// A mesh's steps: what is placed once and every frame, and where its gradients go.
pub(crate) struct BoundMesh {
    pub setup: Vec<Step>,
    pub texels: Vec<TexelStep>,
    pub vertices: Vec<Step>,
    pub back: Vec<GradientStep>,
}

/// A stage that writes gradients into a host's array.
pub(crate) struct GradientStep {
    pub step: Step,
    pub by: By,
    pub target: Floats,
}

/// The input that a gradient is by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    Positions,
    Colors,
    Transforms,
}

/// The numbers of `glsl/common/geometry_push.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct PlacePush {
    count: u32,
    draws: u32,
    first: u32,
    base: u32,
    stride: u32,
    offset: u32,
    transform_stride: u32,
    transform_offset: u32,
    select: u32,
    target_use: u32,
}

/// A stage with its numbers.
pub(crate) struct Step {
    stage: Stage,
    push: PlacePush,
    groups: [u32; 3],
}

impl Step {
    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&self.push), self.groups)
    }

    /// Records the step with one of the TARGET_ uses.
    pub fn record_use(&self, recorder: &mut Recorder<'_>, target_use: u32) -> Result<()> {
        self.stage.record(recorder, bytemuck::bytes_of(&PlacePush { target_use, ..self.push }), self.groups)
    }
}

/// A mesh while its steps are bound.
struct Binder<'a> {
    rasterizer: &'a Rasterizer,
    placed: &'a Placed,
    buffers: &'a MeshBuffers,
    /// [`Geometry::table`](crate::embed::host::geometry::Geometry::table) on the device.
    draws: BufferPart,
    frame: &'a FrameBindings,
}

impl Rasterizer {
    /// Binds what a mesh is placed from, and where its gradients go. `draws` is its table on the device.
    pub(crate) fn bind_mesh(
        &self,
        placed: &Placed,
        buffers: &MeshBuffers,
        draws: &BufferPart,
        frame: &FrameBindings,
        gradients: Option<&GradientBindings>,
    ) -> Result<BoundMesh> {
        let geometry = &placed.geometry;
        let most = geometry.draws().iter().map(|draw| draw.instances).max().unwrap_or(0);
        if buffers.transforms.is_none() && most > 1 {
            let fix = "give MeshBuffers::transforms, one for each instance";
            return misfit(format!("a draw of {most} instances and no transforms"), fix);
        }
        // Without draws nothing is recorded.
        let draws = if geometry.draws().is_empty() {
            draws.clone()
        } else {
            draws.with_texels(&self.device, TexelFormat::Uint4, "draws")?
        };
        let binder = Binder { rasterizer: self, placed, buffers, draws, frame };
        let mut bound = BoundMesh { setup: Vec::new(), texels: Vec::new(), vertices: Vec::new(), back: Vec::new() };
        binder.bind_sources(&mut bound)?;
        match gradients {
            Some(gradients) => bound.back = binder.gradients(&buffers.gradients, gradients)?,
            None if buffers.gradients == GeometryGradients::default() => {}
            None => {
                let what = "gradients are wanted, and the pass computes none".into();
                return misfit(what, "plan it with PassBuilder::gradients");
            }
        }
        Ok(bound)
    }

    /// The stride and offset of a layout in words, if `count` elements of `words` words each lie inside the buffer.
    fn layout_words(
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

    /// Fails unless a host's buffer can be bound as storage and has this many bytes.
    pub(crate) fn validate_storage(&self, name: &str, at: &BufferRef, needed: u64) -> Result<()> {
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
    pub(crate) fn stage(
        &self,
        kernel: &'static Kernel,
        modes: &[(&'static str, u32)],
        buffers: &[(&str, &BufferPart)],
    ) -> Result<Stage> {
        let [pipeline] = self.pipelines([Request { kernel, modes, lanes: self.lanes }])?;
        let set = DescriptorPool::new(&self.device, &[kernel])?.bind(&pipeline, buffers)?;
        Ok(Stage::new(pipeline, set))
    }
}

impl Binder<'_> {
    fn part(&self, at: &BufferRef) -> BufferPart {
        BufferPart::of_host(&self.rasterizer.device, at)
    }

    /// The numbers that every stage has.
    fn push(&self, count: u32) -> PlacePush {
        let geometry = &self.placed.geometry;
        PlacePush { count, draws: geometry.draws().len() as u32, first: geometry.first_vertex, ..PlacePush::default() }
    }

    /// The numbers of a stage with a vertex array: also the array's layout, and that of the transforms where there are such.
    fn vertex_push(&self, count: u32, (stride, offset): (u32, u32)) -> Result<PlacePush> {
        let (transform_stride, transform_offset) = match &self.buffers.transforms {
            Some(transforms) => {
                self.rasterizer.layout_words("transforms", transforms, self.placed.geometry.instances(), 12)?
            }
            None => (0, 0),
        };
        Ok(PlacePush { stride, offset, transform_stride, transform_offset, ..self.push(count) })
    }

    /// Binds everything that is read of the mesh.
    fn bind_sources(&self, bound: &mut BoundMesh) -> Result<()> {
        let Self { rasterizer, placed, buffers, frame, .. } = self;
        let (vertices, triangles) = (placed.geometry.vertices() > 0, placed.geometry.triangles() > 0);
        if vertices {
            let first = placed.geometry.first_vertex;
            bound.vertices.push(self.place(&buffers.positions, (BufferId::Positions, first))?);
        }
        let indices = buffers.indices.as_ref().filter(|_| triangles);
        if let Some(indices) = indices {
            bound.setup.push(self.place_indices(indices, (BufferId::Indices, placed.geometry.first_triangle))?);
        }
        match (placed.look, &buffers.colors) {
            (MeshLook::VertexColors, None) => {
                return misfit("vertex colours and no buffer of them".into(), "give MeshBuffers::colors");
            }
            (MeshLook::VertexColors, Some(colors)) if vertices => {
                bound.vertices.push(self.place(colors, (BufferId::Colors, placed.color))?);
            }
            _ => {}
        }
        if let MeshLook::Texture { size, v_down, .. } = placed.look {
            let Some(uvs) = &buffers.uvs else {
                return misfit("a texture and no coordinates".into(), "give MeshBuffers::uvs");
            };
            if vertices {
                bound.setup.push(self.place_uvs(uvs, v_down)?);
            }
            if let Some(indices) = indices {
                bound.setup.push(self.place_indices(indices, (BufferId::UvIndices, placed.uv_triangle))?);
            }
            if let Some(source) = &buffers.texels {
                bound.texels.push(TexelStep::new(rasterizer, source, size, placed.texel, frame)?);
            }
        }
        Ok(())
    }

    /// The stage that fills `positions` or `colors` from an element on.
    fn place(&self, source: &(BufferRef, Layout), (id, first): (BufferId, u32)) -> Result<Step> {
        let geometry = &self.placed.geometry;
        let count = geometry.vertices();
        let words = self.rasterizer.layout_words(id.name(), source, geometry.source_vertices().1, 3)?;
        let push = PlacePush { first, ..self.vertex_push(count, words)? };
        let moved = self.buffers.transforms.as_ref().filter(|_| id == BufferId::Positions);
        let source = self.part(&source.0);
        let transforms = moved.map_or_else(|| source.clone(), |(at, _)| self.part(at));
        let target = self.frame.array(id)?;
        let buffers = [("draws", &self.draws), ("Vertices", &source), ("Transforms", &transforms), ("Target", target)];
        let modes = [("TRANSFORMED", u32::from(moved.is_some()))];
        Ok(Step {
            stage: self.rasterizer.stage(&kernels::PLACE, &modes, &buffers)?,
            push,
            groups: linear_groups(count),
        })
    }

    /// The stage that fills `indices` or `uv_indices` from a triangle on.
    fn place_indices(&self, (at, format): &(BufferRef, IndexFormat), (id, first): (BufferId, u32)) -> Result<Step> {
        let geometry = &self.placed.geometry;
        let bytes = geometry.source_indices() * u64::from(format.bits() / 8);
        // Whole words are read.
        self.rasterizer.validate_storage("indices", at, bytes.next_multiple_of(4))?;
        let corners = 3 * geometry.triangles();
        let push = PlacePush { first, base: geometry.mesh_vertex, select: format.bits(), ..self.push(corners) };
        let buffers = [("draws", &self.draws), ("Indices", &self.part(at)), ("Target", self.frame.array(id)?)];
        let stage = self.rasterizer.stage(&kernels::PLACE_INDICES, &[], &buffers)?;
        Ok(Step { stage, push, groups: linear_groups(corners) })
    }

    fn place_uvs(&self, source: &(BufferRef, Layout), v_down: bool) -> Result<Step> {
        let geometry = &self.placed.geometry;
        let count = geometry.vertices();
        let (stride, offset) = self.rasterizer.layout_words("UVs", source, geometry.source_vertices().1, 2)?;
        let push = PlacePush { first: self.placed.uv, stride, offset, select: u32::from(v_down), ..self.push(count) };
        let target = self.frame.array(BufferId::Uvs)?;
        let buffers = [("draws", &self.draws), ("Vertices", &self.part(&source.0)), ("Target", target)];
        let stage = self.rasterizer.stage(&kernels::PLACE_UVS, &[], &buffers)?;
        Ok(Step { stage, push, groups: linear_groups(count) })
    }

    /// Binds the arrays that the gradients go into. Each is written, not added to; [`Pass`](crate::embed::Pass) sums what meshes share.
    fn gradients(&self, wanted: &GeometryGradients, backward: &GradientBindings) -> Result<Vec<GradientStep>> {
        let planned = backward.wanted;
        let by_position = wanted.positions.is_some() || wanted.transforms.is_some();
        for (asked, planned, name) in
            [(by_position, planned.positions, "positions"), (wanted.colors.is_some(), planned.colors, "colors")]
        {
            if asked && !planned {
                let what = format!("the backward pass does not differentiate by {name}");
                return misfit(what, &format!("plan it with GradientRequest::{name}"));
            }
        }
        let geometry = &self.placed.geometry;
        let mut steps = Vec::new();
        if geometry.vertices() > 0 {
            for (by, target) in [(By::Positions, &wanted.positions), (By::Colors, &wanted.colors)] {
                if let Some(target) = target {
                    steps.push(self.place_vertex_grad(target, by, backward)?);
                }
            }
        }
        if let Some(target) = &wanted.transforms {
            if self.buffers.transforms.is_none() {
                let fix = "give MeshBuffers::transforms";
                return misfit("there are no transforms to differentiate by".into(), fix);
            }
            if geometry.instances() > 0 {
                steps.push(self.place_transform_grad(target, backward)?);
            }
        }
        Ok(steps)
    }

    fn place_vertex_grad(
        &self,
        target: &(BufferRef, Layout),
        by: By,
        backward: &GradientBindings,
    ) -> Result<GradientStep> {
        let (first, end) = self.placed.geometry.source_vertices();
        let words = self.rasterizer.layout_words("the gradients", target, end, 3)?;
        let floats = Floats::new(target, first, end - first, 3);
        let push =
            PlacePush { base: first, select: u32::from(by == By::Colors), ..self.vertex_push(end - first, words)? };
        let moved = self.buffers.transforms.as_ref().filter(|_| by == By::Positions);
        let target = self.part(&target.0);
        let transforms = self.part(moved.map_or(&self.buffers.positions.0, |(at, _)| at));
        let buffers = [
            ("draws", &self.draws),
            ("vertex_gradients", &backward.vertex_gradients),
            ("Transforms", &transforms),
            ("Target", &target),
        ];
        let modes = [("TRANSFORMED", u32::from(moved.is_some()))];
        let stage = self.rasterizer.stage(&kernels::PLACE_VERTEX_GRAD, &modes, &buffers)?;
        Ok(GradientStep { step: Step { stage, push, groups: linear_groups(end - first) }, by, target: floats })
    }

    fn place_transform_grad(&self, target: &(BufferRef, Layout), backward: &GradientBindings) -> Result<GradientStep> {
        let geometry = &self.placed.geometry;
        let (instances, end) = (geometry.instances(), geometry.source_vertices().1);
        let (stride, offset) = self.rasterizer.layout_words("positions", &self.buffers.positions, end, 3)?;
        let (transform_stride, transform_offset) =
            self.rasterizer.layout_words("the transforms' gradients", target, instances, 12)?;
        let push = PlacePush { stride, offset, transform_stride, transform_offset, ..self.push(instances) };
        let floats = Floats::new(target, 0, instances, 12);
        let buffers = [
            ("draws", &self.draws),
            ("vertex_gradients", &backward.vertex_gradients),
            ("Vertices", &self.part(&self.buffers.positions.0)),
            ("Target", &self.part(&target.0)),
        ];
        let stage = self.rasterizer.stage(&kernels::PLACE_TRANSFORM_GRAD, &[], &buffers)?;
        Ok(GradientStep { step: Step { stage, push, groups: rows_of(instances) }, by: By::Transforms, target: floats })
    }
}

#[cfg(test)]
mod tests {
    use super::PlacePush;
    use crate::vulkan::kernels;
    use std::mem::offset_of;

    #[test]
    fn the_push_constants_lie_as_the_kernels_have_them() {
        let mirror = [
            ("count", offset_of!(PlacePush, count)),
            ("draws", offset_of!(PlacePush, draws)),
            ("first", offset_of!(PlacePush, first)),
            ("base", offset_of!(PlacePush, base)),
            ("stride", offset_of!(PlacePush, stride)),
            ("offset", offset_of!(PlacePush, offset)),
            ("transform_stride", offset_of!(PlacePush, transform_stride)),
            ("transform_offset", offset_of!(PlacePush, transform_offset)),
            ("select", offset_of!(PlacePush, select)),
            ("target_use", offset_of!(PlacePush, target_use)),
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
