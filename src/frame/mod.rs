//! A frame from sizes to commands: the table of buffers, the plan, the scene's bytes, and the passes, read top to bottom.

pub mod buffers;
pub mod pack;
pub mod passes;
pub mod pipelines;
pub mod plan;
