//! Some hundred scenes drawn to hurt, and the least scenes of what they have found.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../../../../tests/common/mod.rs"]
mod common;
mod drawn;
mod found;
