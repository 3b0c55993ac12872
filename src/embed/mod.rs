//! The embedded API: softras on a host's device, in a host's command buffer, with a host's memory.
//!
//! [`Rasterizer`] holds the kernels on a device. A [`Pass`] is all that a host binds once and records every frame:
//! [`PassBuilder`] plans it from counts and settings, [`Rasterizer::bind_pass`] binds it to the host's buffers, and its
//! `record_` calls write commands without allocating.
//!
#![doc = include_str!("guide.md")]

mod host;
mod pass;
mod place;

#[cfg(doc)]
use crate::error::Error;
pub use host::camera::{CameraMatrices, ClipSpace, HostCamera};
pub use host::geometry::{Draw, IndexFormat, Layout};
pub use host::mesh::{GeometryGradients, MeshBuffers, MeshLook, PassMesh, TexelSource};
pub use host::requirements::Requirements;
pub use pass::Pass;
pub use pass::buffers::PassBuffer;
pub use pass::builder::{PassBuilder, PassPlan, PassStatus};
pub use pass::image_store::{FrameImage, ImageBindings};
pub use pass::memory::{MemoryKind, MemoryRequirement, PassMemory};
pub use pass::rebind::Rebound;
pub use place::counts::Counts;

#[cfg(feature = "renderer")]
pub(crate) use pass::Staging;
#[cfg(feature = "renderer")]
pub(crate) use pass::memory::{Arena, Copy, GradientLayout};

pub use crate::frame::pack::InputChanges;
pub use crate::frame::plan::Capacity;
pub use crate::frame::rasterizer::Rasterizer;
pub use crate::vulkan::{
    BufferRef, HostAdapter, HostCommands, HostDevice, ImageFormat, ImageRef, TextureRef, changing_devices,
};
