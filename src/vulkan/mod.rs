//! Vulkan compute without rendering: devices, buffers, kernels, command buffers. It is the only folder with `unsafe`.
//!
//! It comes in two halves:
//!
//! - What an embedding host needs works on a [`Device`] alone, which may be the host's: [`Pipeline`],
//!   [`DescriptorPool`] and [`DescriptorSet`], [`Recorder`], [`TimestampPool`]. None of it submits, waits, or allocates
//!   device memory. A host's raw handles enter through the `unsafe` constructors of [`HostAdapter`], [`HostDevice`],
//!   [`HostCommands`], [`BufferRef`] and [`ImageRef`], which say what the host must keep alive.
//! - The folder `own`, behind the feature `renderer`, opens a device of its own, the `Context`, and does what a host does
//!   for itself: `Buffer` owns memory, `CommandBuffer` submits and waits, a file keeps the pipeline cache,
//!   the validation layer writes into a log.
//!
//! # Why every safe call is sound
//! 1. **Lifetimes.** Objects keep what they need by reference counts: a [`BufferPart`] its buffer, a [`DescriptorSet`] its
//!    buffers, layout and pool, a `CommandBuffer` all that it recorded, and all of them the device. So they may be dropped in
//!    any order. A command buffer waits before it is dropped, recorded again or submitted again; where waiting fails and the
//!    device is not lost, it leaks what the device may still use.
//! 2. **One device.** Whatever meets in a call is checked to be of one device: parts, sets, pipelines, caches and timestamps
//!    by the device's handle, command buffers by their context. A host's buffers get the device that they are bound with.
//! 3. **Ranges, usages, limits.** Every offset, size, alignment, usage bit, texel type, workgroup count and push-constant size
//!    is validated against the buffer, the kernel's reflection and the device's limits before Vulkan sees it.
//! 4. **Mapped memory.** A slice of a mapping and a pending command buffer that uses the buffer exclude each other
//!    (`own/access.rs`): who comes second receives an error. Host writers need `&mut` of the buffer. So memory behind a
//!    reference never changes.
//! 5. **Threads.** Recording, submitting and waiting need `&mut` of the command buffer, which has a pool of its own; the
//!    queue, the allocator and each descriptor pool are behind locks.
//! 6. **Kernels.** SPIR-V comes from this crate's build, and is given to a driver without
//!    what its specialization constants switch off (`specialized`). A device of ours checks the
//!    bounds of buffers, so that wrong contents give a wrong image and touch no other memory; on a host's device,
//!    [`HostCommands::new`] demands that inputs are within the documented ranges. Workgroup counts that a kernel writes for
//!    indirect dispatch cannot be validated, so `Recorder::dispatch_indirect` is private to the crate.

mod adapter;
mod buffer_desc;
mod buffer_part;
mod cache;
mod descriptors;
mod device;
mod devices_lock;
mod host;
mod host_memory;
mod keep;
mod kernel;
#[cfg(feature = "renderer")]
mod own;
mod pipeline;
mod recorder;
mod result;
mod specialized;
#[cfg(all(test, feature = "renderer"))]
mod tests;
mod timestamps;

pub use adapter::{DeviceInfo, DeviceKind, Limits};
pub use buffer_desc::{BufferDesc, Location, TexelFormat};
pub use buffer_part::BufferPart;
pub use cache::PipelineCache;
pub use descriptors::{DescriptorPool, DescriptorSet};
pub use device::Device;
pub use devices_lock::changing_devices;
pub use host::{HostAdapter, HostCommands, HostDevice};
pub use host_memory::{BufferRef, ImageFormat, ImageRef, TextureRef};
pub use kernel::{BindingKind, Kernel, SpecValue, constants, kernels};
#[cfg(feature = "renderer")]
pub use own::{Buffer, CacheFolder, CommandBuffer, Context, ContextOptions, Loader, Mapped, MappedMut};
pub use pipeline::Pipeline;
pub use recorder::Recorder;
pub use timestamps::TimestampPool;

/// Raw Vulkan handles and flags, of the ash version that this crate is built on.
pub use ash::vk;
