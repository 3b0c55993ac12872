//! One mesh of a pass bound to the host's buffers: where its vertices, indices, UVs and texels come from.

use super::Rasterizer;
use super::bindings::FrameBindings;
use super::geometry::{Layout, linear_groups};
use super::mesh::{MeshBuffers, MeshLook, TexelSource};
use super::place::{GeometryBindings, GeometryBuffers, Push, Step, validate_made};
use super::tables::Placed;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::vulkan::{BufferPart, BufferRef, DescriptorPool, Recorder, TextureRef, kernels, vk};

/// A mesh's steps: what is placed every frame, and what once.
pub(super) struct BoundMesh {
    pub geometry: GeometryBindings,
    pub setup: Vec<Step>,
    pub texels: Vec<TexelStep>,
}

/// How a texture's texels come into `texels`.
pub(super) enum TexelStep {
    /// By a kernel.
    Place { stage: Stage, push: [u32; 4], groups: [u32; 3] },
    /// As they are.
    Copy { from: BufferPart, to: BufferPart, at: u64, size: u64 },
}

impl TexelStep {
    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        match self {
            Self::Place { stage, push, groups } => stage.record(recorder, bytemuck::bytes_of(push), *groups),
            Self::Copy { from, to, at, size } => recorder.copy(from, 0, to, *at, *size),
        }
    }
}

fn misfit<T>(what: &str, fix: &str) -> Result<T> {
    Err(Error::Host { what: what.into(), fix: fix.into() })
}

impl Rasterizer {
    /// Binds what a mesh is placed from. `draws` is its table on the device.
    pub(super) fn bind_mesh(
        &self,
        placed: &Placed,
        buffers: &MeshBuffers,
        draws: BufferRef,
        frame: &FrameBindings,
    ) -> Result<BoundMesh> {
        let instances = placed.geometry.instances();
        if buffers.transforms.is_none() && instances > placed.geometry.draws().len() as u32 {
            let fix = "give MeshBuffers::transforms, one for each instance";
            return misfit(&format!("{instances} instances and no transforms"), fix);
        }
        let places = GeometryBuffers {
            draws,
            positions: buffers.positions,
            colors: None,
            indices: buffers.indices,
            transforms: buffers.transforms,
        };
        let mut bound = self.bind_geometry(&placed.geometry, &places, frame)?;
        let mut setup: Vec<Step> = bound.indices.take().into_iter().collect();
        let mut texels = Vec::new();
        let any = placed.geometry.vertices() > 0;
        match (placed.look, &buffers.colors) {
            (MeshLook::VertexColors, None) => {
                return misfit("vertex colours and no buffer of them", "give MeshBuffers::colors");
            }
            (MeshLook::VertexColors, Some(colors)) if any => {
                let colors = self.place(&bound, colors, (BufferId::Colors, placed.color), frame)?;
                bound.vertices.push(colors);
            }
            _ => {}
        }
        if let MeshLook::Texture { size, v_down, .. } = placed.look {
            let Some(uvs) = &buffers.uvs else {
                return misfit("a texture and no coordinates", "give MeshBuffers::uvs");
            };
            if any {
                setup.push(self.place_uvs(&bound, uvs, placed.uv, v_down, frame)?);
            }
            if let Some((at, format)) = buffers.indices.filter(|_| placed.geometry.triangles() > 0) {
                setup.push(self.place_indices(
                    &bound,
                    (&at, format),
                    (BufferId::UvIndices, placed.uv_triangle),
                    frame,
                )?);
            }
            if let Some(source) = &buffers.texels {
                texels.push(self.place_texels(source, size, placed.texel, frame)?);
            }
        }
        Ok(BoundMesh { geometry: bound, setup, texels })
    }

    fn place_uvs(
        &self,
        made: &GeometryBindings,
        source: &(BufferRef, Layout),
        first: u32,
        v_down: bool,
        frame: &FrameBindings,
    ) -> Result<Step> {
        let (draws, geometry) = made.table();
        let count = geometry.vertices();
        let (stride, offset) = self.layout_words("UVs", source, geometry.source_vertices().1, 2)?;
        let push = Push { first, stride, offset, select: u32::from(v_down), ..made.push(count) };
        let (source, target) = (BufferPart::of_host(&self.device, &source.0), frame.array(BufferId::Uvs)?);
        let buffers = [("draws", draws), ("Vertices", &source), ("Target", target)];
        Ok(Step { stage: self.stage(&kernels::PLACE_UVS, &[], &buffers)?, push, groups: linear_groups(count) })
    }

    fn place_texels(
        &self,
        source: &TexelSource,
        (width, height): (u32, u32),
        first: u32,
        frame: &FrameBindings,
    ) -> Result<TexelStep> {
        let count = u64::from(width) * u64::from(height);
        let groups = linear_groups(width * height);
        let target = frame.array(BufferId::Texels)?;
        match *source {
            TexelSource::Image(texture) => {
                if texture.size() != (width, height) {
                    let what =
                        format!("an image of {:?} texels for a texture of {:?}", texture.size(), (width, height));
                    return misfit(&what, "plan it with the image's size");
                }
                let stage = self.texture_stage(&texture, target)?;
                Ok(TexelStep::Place { stage, push: [width, height, first, 0], groups })
            }
            TexelSource::Bytes { at, srgb } => {
                self.validate_storage("texels", &at, 4 * count)?;
                let buffers = [("Source", &BufferPart::of_host(&self.device, &at)), ("Target", target)];
                let stage = self.stage(&kernels::PLACE_TEXEL_WORDS, &[], &buffers)?;
                Ok(TexelStep::Place { stage, push: [width, height, first, u32::from(srgb)], groups })
            }
            TexelSource::Floats(at) => {
                validate_made("texels", &at, vk::BufferUsageFlags::TRANSFER_SRC)?;
                if 16 * count > at.range() || !at.offset().is_multiple_of(4) {
                    let what = format!("{} bytes of texels at {} for {count} texels", at.range(), at.offset());
                    return misfit(&what, "give 16 bytes a texel, beginning at a multiple of four");
                }
                let (from, to) = (BufferPart::of_host(&self.device, &at), target.clone());
                Ok(TexelStep::Copy { from, to, at: 16 * u64::from(first), size: 16 * count })
            }
        }
    }

    fn texture_stage(&self, texture: &TextureRef, target: &BufferPart) -> Result<Stage> {
        let kernel = &kernels::PLACE_TEXELS;
        let [pipeline] = self.pipelines([Request { kernel, modes: &[], lanes: self.lanes }])?;
        let pool = DescriptorPool::new(&self.device, &[kernel])?;
        let set = pool.bind_with_texture(&pipeline, &[("Target", target)], ("source", texture))?;
        Ok(Stage::new(pipeline, set))
    }
}

#[cfg(test)]
mod tests {
    use super::kernels;
    use crate::vulkan::BindingKind;

    #[test]
    fn the_kernels_are_bound_as_they_read() {
        let names = |kernel: &crate::vulkan::Kernel| kernel.push_members.iter().map(|m| m.name).collect::<Vec<_>>();
        for kernel in [&kernels::PLACE_TEXELS, &kernels::PLACE_TEXEL_WORDS] {
            assert_eq!(names(kernel), ["width", "height", "first", "srgb"], "{}", kernel.name);
            assert_eq!((kernel.push_constant_bytes, kernel.local_size), (16, [crate::constants::LINEAR_GROUP, 1, 1]));
        }
        let kind = kernels::PLACE_TEXELS.binding("source").map(|binding| binding.kind);
        assert_eq!(kind, Some(BindingKind::SampledImage));
    }
}
