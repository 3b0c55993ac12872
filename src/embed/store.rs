//! A frame's images into a host's, by a kernel that stores texels.

use super::Rasterizer;
use super::bindings::FrameBindings;
use super::plan::FramePlan;
use crate::error::{Error, Result};
use crate::frame::buffers::BufferId;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::vulkan::{DescriptorPool, HostCommands, ImageFormat, ImageRef, Kernel, Recorder, kernels};

/// One of a frame's images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameImage {
    /// Linear r, g, b, and the silhouette as a; with `srgb`, r, g, b clamped and encoded as sRGB does, for an image that is
    /// viewed as such. Into four channels.
    Color {
        /// Encode.
        srgb: bool,
    },
    /// The silhouette. Into one channel.
    Silhouette,
    /// Σ w z in world units. Into one channel.
    Depth,
    /// Σ w n in world space, and 0. Into four channels of floats; of bytes, what is below 0 is lost.
    Normal,
}

/// A frame's image bound to a host's. To be kept as [`FrameBindings`].
pub struct ImageBindings {
    stage: Stage,
    push: Push,
}

/// The push constants of `glsl/common/store.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    width: u32,
    height: u32,
    first: u32,
    component: u32,
    srgb: u32,
}

/// Pixels of a workgroup along each axis.
const GROUP: u32 = 8;

fn misfit<T>(what: String, fix: &str) -> Result<T> {
    Err(Error::Host { what, fix: fix.into() })
}

fn kernel_of(format: ImageFormat) -> &'static Kernel {
    match format {
        ImageFormat::Rgba32Float => &kernels::STORE_RGBA32F,
        ImageFormat::Rgba16Float => &kernels::STORE_RGBA16F,
        ImageFormat::Rgba8Unorm => &kernels::STORE_RGBA8,
        ImageFormat::R32Float => &kernels::STORE_R32F,
    }
}

impl FrameImage {
    /// The buffer that it lies in, and its component there.
    fn place(self, plan: &FramePlan) -> (BufferId, u32) {
        match self {
            Self::Color { .. } => (BufferId::Color, 0),
            // With colour the silhouette is its fourth component.
            Self::Silhouette if plan.buffer(BufferId::Color).is_some() => (BufferId::Color, 3),
            Self::Silhouette => (BufferId::Silhouette, 0),
            Self::Depth => (BufferId::Depths, 0),
            Self::Normal => (BufferId::Normals, 0),
        }
    }

    fn channels(self) -> u32 {
        if matches!(self, Self::Color { .. } | Self::Normal) { 4 } else { 1 }
    }
}

impl Rasterizer {
    /// Binds one view of an image of a frame to a host's storage image of its size. It serves frames of this plan's size.
    ///
    /// # Errors
    /// [`Error::Host`] for a plan that the frame was not bound for, an image that the frame does not have, a view that there is not, another size, or a format with
    /// another number of channels; otherwise as [`prepare`](Self::prepare).
    pub fn bind_image(
        &self,
        plan: &FramePlan,
        frame: &FrameBindings,
        image: FrameImage,
        view: u32,
        target: &ImageRef,
    ) -> Result<ImageBindings> {
        frame.fits(plan)?;
        let (id, component) = image.place(plan);
        let (width, height) = plan.image_size();
        if plan.buffer(id).is_none() || (image == FrameImage::Silhouette && !plan.has_silhouette()) {
            return misfit(format!("the frame has no image {image:?}"), "ask for it in Settings::outputs");
        }
        if view >= plan.views() {
            return misfit(format!("the frame has no view {view}"), "count views from 0");
        }
        if target.size() != (width, height) {
            let what = format!("an image of {:?} texels for {:?} pixels", target.size(), (width, height));
            return misfit(what, "give one of the frame's size");
        }
        if target.format().channels() != image.channels() {
            let what = format!("{image:?} has {} channels, {:?} others", image.channels(), target.format());
            return misfit(what, "give a format of as many");
        }
        let kernel = kernel_of(target.format());
        let [pipeline] = self.pipelines([Request { kernel, modes: &[], lanes: self.lanes }])?;
        let pool = DescriptorPool::new(&self.device, &[kernel])?;
        let buffers = [("image_texels", frame.array(id)?)];
        let stage = Stage::new(pipeline.clone(), pool.bind_with_image(&pipeline, &buffers, ("target", target))?);
        let srgb = u32::from(image == FrameImage::Color { srgb: true });
        Ok(ImageBindings { stage, push: Push { width, height, first: view * width * height, component, srgb } })
    }

    /// Records the storing of an image: behind [`record_forward`](Self::record_forward). Begins and ends with barriers as that
    /// does; the image is in the layout GENERAL before and after.
    ///
    /// # Errors
    /// [`Error::Limit`] for more workgroups than the device allows.
    pub fn record_image(&self, commands: &mut HostCommands, bindings: &ImageBindings) -> Result<()> {
        let Push { width, height, .. } = bindings.push;
        let mut recorder = Recorder::on_host(&self.device, commands);
        recorder.begin_label("softras image");
        recorder.barrier();
        let groups = [width.div_ceil(GROUP), height.div_ceil(GROUP), 1];
        bindings.stage.record(&mut recorder, bytemuck::bytes_of(&bindings.push), groups)?;
        recorder.barrier();
        recorder.end_label();
        Ok(())
    }
}

impl std::fmt::Debug for ImageBindings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ImageBindings").field("push", &self.push).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn the_kernels_are_what_is_said_of_them() {
        use crate::vulkan::BindingKind;
        let mirror = [
            ("width", offset_of!(Push, width)),
            ("height", offset_of!(Push, height)),
            ("first", offset_of!(Push, first)),
            ("component", offset_of!(Push, component)),
            ("srgb", offset_of!(Push, srgb)),
        ];
        use ImageFormat::{R32Float, Rgba8Unorm, Rgba16Float, Rgba32Float};
        for format in [Rgba32Float, Rgba16Float, Rgba8Unorm, R32Float] {
            let kernel = kernel_of(format);
            let found: Vec<_> = kernel.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
            assert_eq!(found, mirror, "{}", kernel.name);
            assert_eq!(kernel.local_size, [GROUP, GROUP, 1]);
            assert_eq!(kernel.binding("target").map(|b| b.kind), Some(BindingKind::StorageImage(format)));
        }
    }
}
