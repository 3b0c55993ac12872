//! The official renderer's equations in f64 and small scenes for them.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]
// The random generator belongs to the other helpers as well.
#![allow(clippy::duplicate_mod)]

pub mod equations;
#[path = "../../crates/softras-cli/src/stress/random.rs"]
mod random;
pub mod scenes;
