//! A frame from the counts of a scene to the commands that render it.
//!
//! The parts, in the order in which a frame goes through them:
//!
//! 1. [`shape`] has the counts and kinds of the meshes, views and lights: all that a plan depends on, without data.
//! 2. [`plan`] computes from a shape and the settings how many bytes every buffer needs, how many workgroups every stage
//!    runs, and the push and specialization constants. [`frame_plan`] checks them against a device's limits. Neither needs a
//!    device.
//! 3. [`buffers`] is the one table of buffers: the id, element format, usage and size of each. Buffers of any owner are
//!    found by these ids.
//! 4. [`pack`] lays out a scene, its cameras and its lights as the bytes that the kernels read, and finds which tables
//!    differ from those of the last frame, so that only these are uploaded.
//! 5. [`pipelines`] compiles the kernels for the specialization constants of a plan and keeps them for later frames.
//! 6. [`bindings`] binds the buffers to the kernels, and [`passes`] records the commands of a forward frame and of its gradients.
//!    [`rasterizer`] does both with the pipelines of one device.
//! 7. [`status`] tells from a frame's own words whether it is complete, and what the next one needs. [`decode`] turns the
//!    buffers of a backward pass into gradients.
//!
//! A pass of [`crate::embed`] drives these parts, with buffers and command buffers of a host or, for [`crate::Renderer`], of softras' own.

pub mod bindings;
pub mod buffers;
pub mod decode;
pub mod frame_plan;
pub mod pack;
pub mod passes;
pub mod pipelines;
pub mod plan;
pub mod rasterizer;
pub mod shape;
pub mod status;
