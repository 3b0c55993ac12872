//! A frame from the counts of a scene to the commands that render it.
//!
//! The parts, in the order in which a frame goes through them:
//!
//! 1. [`plan`] computes from the counts of the meshes, the views and the settings how many bytes every buffer needs, how
//!    many workgroups every stage runs, and the push and specialization constants. It needs no device.
//! 2. [`buffers`] is the one table of buffers: the id, element format, usage and size of each. Buffers of any owner are
//!    found by these ids; where softras owns them itself, they are kept here and grow when a plan needs more.
//! 3. [`pack`] lays out a scene, its cameras and its lights as the bytes that the kernels read, and finds which tables
//!    differ from those of the last frame, so that only these are uploaded.
//! 4. [`pipelines`] compiles the kernels for the specialization constants of a plan and keeps them for later frames.
//! 5. [`passes`] binds the buffers to the stages and records the commands of a forward frame and of its gradients.
//!
//! [`crate::embed`] drives these parts with buffers and command buffers of a host, [`crate::Renderer`] with its own.

pub mod buffers;
pub mod pack;
pub mod passes;
pub mod pipelines;
pub mod plan;
