//! What this project's own tests, benchmarks and command reach of the inside. **Not part of the public interface**: semantic
//! versioning does not cover it, and any release may change or remove any of it.

pub use crate::frame::{buffers, pack, passes, pipelines, plan};

#[cfg(feature = "renderer")]
pub use crate::renderer::parts::in_parts;

/// Raw Vulkan: devices, memory, kernels, command buffers.
pub mod vulkan {
    pub use crate::vulkan::*;
}

pub use crate::vulkan::constants;

/// Parts of the fits that the tests take apart.
#[cfg(feature = "fit")]
pub mod fit {
    pub use crate::fit::image_loss::{add_blurred_gradient, add_pooled_gradient, blur_factor, blurred, pooled};
    pub use crate::fit::pose::{flow_by_vertex, flow_gradient, rotations};
    pub use crate::fit::regularizer::laplacian_coordinates;
    pub use crate::fit::remesh::evened;
    pub use crate::fit::smoothing::Smoothing;
    pub use crate::fit::soft_target::{CLOSED, signed_distance};
    pub use crate::fit::topology::{Flap, Topology};
    pub use crate::fit::voxel::{MAX_RESOLUTION, Voxels, cube_around, is_closed, overlap};

    use crate::error::Result;
    use crate::fit::Regularizer;

    /// A regularizer's value; `weight` times its gradient is added to `gradient`, one vector for each vertex.
    ///
    /// # Errors
    /// [`crate::Error::Fit`] when positions or gradient are not one for each of the topology's vertices.
    pub fn regularize(
        regularizer: Regularizer,
        topology: &Topology,
        positions: &[glam::DVec3],
        weight: f64,
        gradient: &mut [glam::DVec3],
    ) -> Result<f64> {
        regularizer.add(topology, positions, weight, gradient)
    }
}

/// Parts of the f64 reference: counts of pairs, other truncations, finite differences.
#[cfg(feature = "reference")]
pub mod reference {
    pub use crate::reference::count::{Pairs, pairs};
    pub use crate::reference::variants::{render_at, render_untruncated};
}

/// Validation without rendering.
pub mod validate {
    use crate::error::Result;
    use crate::gradients::ImageGradient;
    use crate::scene::{Lights, Outputs, Settings};

    /// Checks every setting's range.
    ///
    /// # Errors
    /// [`crate::Error::Settings`] for the first field that is out of range.
    pub fn settings(settings: &Settings) -> Result<()> {
        settings.validate()
    }

    /// Checks every light.
    ///
    /// # Errors
    /// [`crate::Error::Light`] for the first field that is out of range.
    pub fn lights(lights: &Lights) -> Result<()> {
        lights.validate()
    }

    /// Checks upstream gradients against the images of a frame.
    ///
    /// # Errors
    /// [`crate::Error::Backward`] for an image that was not rendered, has another shape or is not finite.
    pub fn image_gradient(
        gradient: &ImageGradient,
        rendered: Outputs,
        batch: usize,
        height: usize,
        width: usize,
    ) -> Result<()> {
        gradient.validate(rendered, batch, height, width)
    }
}

/// The one door for files that are read, and the one writer.
#[cfg(feature = "obj")]
pub mod files {
    pub use crate::files::input::{open, read, refuse_empty, room_for};
    pub use crate::files::output::{check_writable, write_file, write_files};
    pub use crate::files::picture::Picture;
}

/// The built-in meshes by name.
pub mod shapes {
    pub use crate::shapes::named::{NAMES, by_name, finer};
}
