//! Vulkan compute without rendering: devices, buffers, kernels, command buffers. The only folder with `unsafe`.
//!
//! It comes in two halves:
//!
//! - What an embedding host needs works on a [`Device`] alone, which may be the host's: [`Pipeline`],
//!   [`DescriptorPool`] and [`DescriptorSet`], [`Recorder`], [`TimestampPool`]. None of it submits, waits, or allocates
//!   device memory.
//! - [`Context`] owns a device of its own, and with it comes what a host does for itself: [`Buffer`] and
//!   [`SharedBuffer`], [`CommandBuffer`] with submission and waiting, a pipeline cache on disk, validation.
//!
//! Objects keep alive what they need: a [`BufferPart`] its buffer, a [`DescriptorSet`] its buffers and pool, a
//! [`CommandBuffer`] all that it recorded, and all of them the device. So they may be dropped in any order. A host's raw
//! handles enter through the `unsafe` constructors of [`HostAdapter`], [`HostDevice`], [`HostCommands`], [`BufferRef`] and
//! [`ImageRef`] alone, which say what the host must keep alive; all that takes these is safe.

mod adapter;
mod buffer;
mod buffer_desc;
mod buffer_part;
mod cache;
mod command;
mod context;
mod descriptors;
mod device;
#[cfg(all(feature = "external", unix))]
mod external;
mod host;
mod host_memory;
mod instance;
mod kernel;
mod pipeline;
mod recorder;
mod result;
mod shared_buffer;
mod timestamps;
mod validation;

pub use adapter::{DeviceInfo, DeviceKind, Limits, Subgroups};
pub use buffer::Buffer;
pub use buffer_desc::{BufferDesc, Location, TexelFormat};
pub use buffer_part::BufferPart;
pub use cache::PipelineCache;
pub use command::CommandBuffer;
pub use context::{CacheFolder, Context, ContextOptions};
pub use descriptors::{DescriptorPool, DescriptorSet};
pub use device::Device;
#[cfg(all(feature = "external", unix))]
pub use external::{External, ExternalBuffer, ExternalSemaphore, ExternalSupport};
pub use host::{HostAdapter, HostCommands, HostDevice, Loader};
pub use host_memory::{BufferRef, ImageFormat, ImageRef, TextureRef};
pub use kernel::{Binding, BindingKind, Kernel, Member, SpecValue, Specialization, Struct, constants, kernels};
pub use pipeline::Pipeline;
pub use recorder::Recorder;
pub use shared_buffer::SharedBuffer;
pub use timestamps::TimestampPool;
pub use validation::ValidationLog;

/// Raw Vulkan handles and flags, of the ash version that this crate is built on.
pub use ash::vk;
