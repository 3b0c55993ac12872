//! The quick tier: every behaviour once, at the lowest level where it exists.
//!
//! Tests take their renderers from a pool that lives as long as the process (`common::renderer`), so that each kernel is
//! compiled once. The validation layers are off unless `SOFTRAS_VALIDATION=1`; run one thread then (`--test-threads=1`), since
//! the layers may crash when one thread opens or drops a device while another one renders.
// Some tests play the host and pass raw Vulkan handles.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// The example contains the engine, and so does the tests' host.
#![allow(clippy::duplicate_mod)]

#[path = "../common/mod.rs"]
mod common;
mod embed;
mod gradient;
mod heap;
#[path = "../host/mod.rs"]
mod host;
mod modes;
mod record;
mod render;
mod robustness;
