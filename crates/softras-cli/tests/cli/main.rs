//! Tests of the `softras` command: arguments, exit codes, files.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod arguments;
mod bench;
mod command;
mod eval;
mod fit;
mod full;
mod gradient;
#[allow(dead_code, reason = "shared with the tests of the library")]
#[path = "../../../../tests/quick/heap.rs"]
mod heap;
mod hostile;
mod hostile_files;
mod killed;
mod memory;
mod mistakes;
#[path = "../../../../tests/common/mutate.rs"]
mod mutate;
mod numpy;
mod official;
#[path = "../../../../tests/official/mod.rs"]
mod official_equations;
mod parts;
mod pose;
mod render;
mod transparency;
mod views;

use command::{fails, softras, succeeds};
