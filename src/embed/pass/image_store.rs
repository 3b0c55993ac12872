//! Stores a frame's images into a host's images, by a kernel that writes texels.

use crate::constants as c;
use crate::embed::host::camera::DepthMap;
use crate::embed::host::misfit;
use crate::embed::pass::Pass;
use crate::embed::pass::builder::PassPlan;
use crate::error::Result;
use crate::frame::buffers::BufferId;
use crate::frame::frame_plan::FramePlan;
use crate::frame::passes::Stage;
use crate::frame::pipelines::Request;
use crate::vulkan::{DescriptorPool, HostCommands, ImageFormat, ImageRef, Kernel, Recorder, kernels};
use std::sync::Arc;

/// One of a frame's images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameImage {
    /// Linear r, g, b, and the silhouette as a; with `srgb`, r, g, b clamped and encoded as sRGB does, for an image that is
    /// viewed as such. Into four channels.
    Color {
        /// Encode.
        srgb: bool,
    },
    /// The triangles' colour without the background's, to be blended over a host's own image, and the silhouette as a. Into
    /// four channels.
    Foreground {
        /// Multiply r, g, b by the silhouette, for a blend of ONE and ONE_MINUS_SRC_ALPHA; else they are straight, for
        /// SRC_ALPHA and ONE_MINUS_SRC_ALPHA.
        premultiplied: bool,
        /// Encode as sRGB does, after that.
        srgb: bool,
    },
    /// The silhouette. Into one channel.
    Silhouette,
    /// Σ w z in world units. Into one channel.
    Depth,
    /// The values of a host's depth buffer: the mean view depth of the triangles by the host's own projection, in a pass that
    /// was planned with [`camera_matrices`](crate::embed::PassBuilder::camera_matrices). Into one channel.
    DepthBuffer {
        /// Pixels of a smaller silhouette get the value farthest away, as if nothing were drawn.
        least_silhouette: f32,
    },
    /// Σ w n in world space, and 0. Into four channels of floats; channels of bytes lose what is below 0.
    Normal,
}

/// A frame's image bound to a host's image. Keep it as long as the [`Pass`].
pub struct ImageBindings {
    stage: Stage,
    push: StorePush,
    view: u32,
    /// `FrameBindings::identity` of the frame.
    frame: Arc<()>,
}

impl StorePush {
    fn with_depth(self, depth: &DepthMap) -> Self {
        Self {
            flags: self.flags & !c::STORE_PERSPECTIVE | if depth.perspective { c::STORE_PERSPECTIVE } else { 0 },
            depth_constant: depth.constant as f32,
            depth_factor: depth.factor as f32,
            depth_clear: depth.clear as f32,
            ..self
        }
    }
}

/// The push constants of `glsl/store.comp`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct StorePush {
    width: u32,
    height: u32,
    first: u32,
    component: u32,
    alpha_component: u32,
    flags: u32,
    depth_constant: f32,
    depth_factor: f32,
    depth_clear: f32,
    least_alpha: f32,
    background: [f32; 3],
}

/// Pixels of a workgroup along each axis.
const GROUP: u32 = 8;

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
            Self::Color { .. } | Self::Foreground { .. } => (BufferId::Color, 0),
            // With colour the silhouette is its fourth component.
            Self::Silhouette if plan.buffer(BufferId::Color).is_some() => (BufferId::Color, 3),
            Self::Silhouette => (BufferId::Silhouette, 0),
            Self::Depth | Self::DepthBuffer { .. } => (BufferId::Depths, 0),
            Self::Normal => (BufferId::Normals, 0),
        }
    }

    fn channels(self) -> u32 {
        if matches!(self, Self::Color { .. } | Self::Foreground { .. } | Self::Normal) { 4 } else { 1 }
    }

    /// The STORE_ bits, of a frame that blends its images with the background by the silhouette or does not.
    fn flags(self, composite: bool) -> u32 {
        let bit = |on: bool, bit: u32| if on { bit } else { 0 };
        match self {
            Self::Color { srgb } => bit(srgb, c::STORE_SRGB),
            Self::Foreground { premultiplied, srgb } => {
                let alpha = if premultiplied { c::STORE_PREMULTIPLIED } else { c::STORE_STRAIGHT };
                alpha | bit(srgb, c::STORE_SRGB) | bit(composite, c::STORE_COMPOSITE)
            }
            Self::DepthBuffer { .. } => c::STORE_DEPTH | bit(composite, c::STORE_COMPOSITE),
            _ => 0,
        }
    }

    /// Whether the stored texels depend on the silhouette.
    fn needs_silhouette(self) -> bool {
        matches!(self, Self::Foreground { .. } | Self::Silhouette | Self::DepthBuffer { .. })
    }
}

impl Pass {
    /// Binds one view of an image to a host's storage image of the pass's size.
    ///
    /// # Errors
    /// [`Error::Host`](crate::Error::Host) for an image or a view that the pass does not have, another size, or a
    /// format with another number of channels; otherwise as
    /// [`Rasterizer::prepare_pass`](crate::embed::Rasterizer::prepare_pass).
    pub fn bind_image(&self, image: FrameImage, view: u32, target: &ImageRef) -> Result<ImageBindings> {
        let Self { rasterizer, plan: PassPlan { frame: plan, .. }, frame, .. } = self;
        let (id, component) = image.place(plan);
        let (width, height) = plan.image_size();
        if plan.buffer(id).is_none() || (image.needs_silhouette() && !plan.has_silhouette()) {
            return misfit(format!("the pass has no image {image:?}"), "ask for it in Settings::outputs");
        }
        if view >= plan.views() {
            return misfit(format!("the pass has no view {view}"), "count views from 0");
        }
        if target.size() != (width, height) {
            let what = format!("an image of {:?} texels for {:?} pixels", target.size(), (width, height));
            return misfit(what, "give one of the pass's size");
        }
        if target.format().channels() != image.channels() {
            let what = format!("{image:?} has {} channels, {:?} others", image.channels(), target.format());
            return misfit(what, "give a format of as many");
        }
        let kernel = kernel_of(target.format());
        let [pipeline] = rasterizer.pipelines([Request { kernel, modes: &[], lanes: rasterizer.lanes }])?;
        let pool = DescriptorPool::new(&rasterizer.device, &[kernel])?;
        let (alpha, alpha_component) = match plan.has_silhouette() {
            true => FrameImage::Silhouette.place(plan),
            false => (id, 0),
        };
        let buffers = [("image_texels", frame.array(id)?), ("alpha_texels", frame.array(alpha)?)];
        let stage = Stage::new(pipeline.clone(), pool.bind_with_image(&pipeline, &buffers, ("target", target))?);
        let modes = &plan.forward.modes;
        let hard_depth = id == BufferId::Depths && modes.color_mode == c::COLOR_HARD;
        let flags = image.flags(modes.composite != 0 && !hard_depth);
        let least_alpha = if let FrameImage::DepthBuffer { least_silhouette } = image { least_silhouette } else { 0.0 };
        let first = view * width * height;
        let push =
            StorePush { width, height, first, component, alpha_component, flags, least_alpha, ..StorePush::default() };
        Ok(ImageBindings { stage, push, view, frame: frame.identity.clone() })
    }

    /// Records the storing of an image, behind [`record_forward`](Self::record_forward). Begins and ends with barriers as that
    /// does; the image is in the layout GENERAL before and after. A depth buffer's values are those of the view's matrices, and
    /// what is blended is blended with the background colour of the settings, as both are now.
    ///
    /// # Errors
    /// [`Error::Limit`](crate::Error::Limit) for more workgroups than the device allows; [`Error::Host`](crate::Error::Host) for an
    /// image that another pass bound, or this one before it was bound anew, and for a depth buffer of a camera without matrices.
    pub fn record_store(&self, commands: &mut HostCommands, image: &ImageBindings) -> Result<()> {
        if !Arc::ptr_eq(&image.frame, &self.frame.identity) {
            let what = "an image is stored that another pass bound, or this one before it was bound anew".into();
            return misfit(what, "bind it with Pass::bind_image");
        }
        let camera = self.plan.cameras.get(image.view as usize).and_then(|camera| camera.host);
        let push = match camera {
            Some(camera) => image.push.with_depth(&camera.depth()),
            None if image.push.flags & c::STORE_DEPTH != 0 => {
                let what = "a depth buffer is stored without the host's projection".into();
                return misfit(what, "give the pass matrices for cameras");
            }
            None => image.push,
        };
        let push = StorePush { background: self.plan.frame.background(), ..push };
        let mut recorder = Recorder::on_host(&self.rasterizer.device, commands);
        recorder.begin_label("image");
        recorder.barrier();
        let groups = [push.width.div_ceil(GROUP), push.height.div_ceil(GROUP), 1];
        image.stage.record(&mut recorder, bytemuck::bytes_of(&push), groups)?;
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
            ("width", offset_of!(StorePush, width)),
            ("height", offset_of!(StorePush, height)),
            ("first", offset_of!(StorePush, first)),
            ("component", offset_of!(StorePush, component)),
            ("alpha_component", offset_of!(StorePush, alpha_component)),
            ("flags", offset_of!(StorePush, flags)),
            ("depth_constant", offset_of!(StorePush, depth_constant)),
            ("depth_factor", offset_of!(StorePush, depth_factor)),
            ("depth_clear", offset_of!(StorePush, depth_clear)),
            ("least_alpha", offset_of!(StorePush, least_alpha)),
            ("background_red", offset_of!(StorePush, background)),
            ("background_green", offset_of!(StorePush, background) + 4),
            ("background_blue", offset_of!(StorePush, background) + 8),
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
