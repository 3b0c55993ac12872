//! What lies under the public API: plans, the layouts that Rust and the kernels share, and the Vulkan folder by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod depth_span;
mod layouts;
mod plan;
mod properties;
mod selftest;
mod soundness;
mod vulkan;
mod vulkan_misuse;
