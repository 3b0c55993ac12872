//! The full tier of the library: `cargo test --test full`, hours together with the other packages' (CONTRIBUTING.md).
#![cfg(target_os = "linux")]
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(clippy::duplicate_mod)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../host/mod.rs"]
mod host;
mod leak;
