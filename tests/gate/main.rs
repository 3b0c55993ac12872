//! The checks of the gate beside the quick tier: the list of public items, rules of the sources, and that the validation
//! layers see faults at all.
#![allow(unsafe_code, clippy::undocumented_unsafe_blocks, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../examples/engine/mod.rs"]
mod engine;
mod public_items;
#[path = "../host/shim/mod.rs"]
mod shim;
mod sources;
mod validation;
