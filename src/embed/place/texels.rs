//! How a texture's texels come into the frame's `texels`.

use crate::embed::host::geometry::linear_groups;
use crate::embed::host::mesh::TexelSource;
use crate::embed::host::{misfit, validate_made};
use crate::error::Result;
use crate::frame::bindings::FrameBindings;
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::frame::rasterizer::Rasterizer;
use crate::vulkan::{BufferPart, DescriptorPool, Recorder, TextureRef, kernels, vk};

/// A step that fills a texture's part of `texels`.
pub(crate) enum TexelStep {
    /// A kernel writes it.
    Place { stage: Stage, push: [u32; 4], groups: [u32; 3] },
    /// The texels are copied as they are.
    Copy { from: BufferPart, to: BufferPart, at: u64, size: u64 },
}

impl TexelStep {
    /// Binds a source of `width` × `height` texels, which begin at the texel `first` of the frame.
    pub fn new(
        rasterizer: &Rasterizer,
        source: &TexelSource,
        (width, height): (u32, u32),
        first: u32,
        frame: &FrameBindings,
    ) -> Result<Self> {
        let device = &rasterizer.device;
        let count = u64::from(width) * u64::from(height);
        let groups = linear_groups(width * height);
        let target = frame.array(BufferId::Texels)?;
        match *source {
            TexelSource::Image(texture) => {
                if texture.size() != (width, height) {
                    let what =
                        format!("an image of {:?} texels for a texture of {:?}", texture.size(), (width, height));
                    return misfit(what, "plan it with the image's size");
                }
                let stage = texture_stage(rasterizer, &texture, target)?;
                Ok(Self::Place { stage, push: [width, height, first, 0], groups })
            }
            TexelSource::Bytes { at, srgb } => {
                rasterizer.validate_storage("texels", &at, 4 * count)?;
                let buffers = [("Source", &BufferPart::of_host(device, &at)), ("Target", target)];
                let stage = rasterizer.stage(&kernels::PLACE_TEXEL_WORDS, &[], &buffers)?;
                Ok(Self::Place { stage, push: [width, height, first, u32::from(srgb)], groups })
            }
            TexelSource::Floats(at) => {
                validate_made("texels", &at, vk::BufferUsageFlags::TRANSFER_SRC)?;
                if 16 * count > at.range() || !at.offset().is_multiple_of(4) {
                    let what = format!("{} bytes of texels at {} for {count} texels", at.range(), at.offset());
                    return misfit(what, "give 16 bytes a texel, beginning at a multiple of four");
                }
                let (from, to) = (BufferPart::of_host(device, &at), target.clone());
                Ok(Self::Copy { from, to, at: 16 * u64::from(first), size: 16 * count })
            }
        }
    }

    pub fn record(&self, recorder: &mut Recorder<'_>) -> Result<()> {
        match self {
            Self::Place { stage, push, groups } => stage.record(recorder, bytemuck::bytes_of(push), *groups),
            Self::Copy { from, to, at, size } => recorder.copy(from, 0, to, *at, *size),
        }
    }
}

fn texture_stage(rasterizer: &Rasterizer, texture: &TextureRef, target: &BufferPart) -> Result<Stage> {
    let kernel = &kernels::PLACE_TEXELS;
    let [pipeline] = rasterizer.pipelines([Request { kernel, modes: &[], lanes: rasterizer.lanes }])?;
    let pool = DescriptorPool::new(&rasterizer.device, &[kernel])?;
    let set = pool.bind_with_texture(&pipeline, &[("Target", target)], ("source", texture))?;
    Ok(Stage::new(pipeline, set))
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
